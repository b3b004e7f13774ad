"""How a URI and the camera's section of a configuration become an open source of frames."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from dnb_edge.capture.recording import RecordingSource
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import FrameSource, check_uri, open_source
from dnb_edge.config.devices import CaptureConfig
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.values import SourceInfo

_LOOP = "loop:"


def check_source(wanted: CaptureConfig) -> None:
    """Raises `InputError` where the source's URI is none, as far as that shows without looking for the device or file."""
    if wanted.source is None:
        return
    try:
        if wanted.source.startswith(_LOOP):
            from dnb_edge.assembly.loops import check_loop  # noqa: PLC0415 as below

            check_loop(wanted.source)
        else:
            check_uri(wanted.source)
    except InputError as error:
        raise InputError(f"capture.source: {error}") from error


def make_source(uri: str, config: Config | None) -> FrameSource:
    """The source at `uri`, open; a camera is asked for what the configuration says."""
    return source_of(uri, None if config is None else config.capture)


def source_of(uri: str, asked: CaptureConfig | None) -> FrameSource:
    """As `make_source`, from the camera's section alone."""
    if uri.startswith(_LOOP):
        # Drivers and tasks are a quarter of a second to import, and a camera needs none of them.
        from dnb_edge.assembly.loops import open_loop  # noqa: PLC0415

        return open_loop(uri)
    settings = None
    if asked is not None:
        keys = {choice.name for choice in fields(CaptureSettings)} & set(type(asked).model_fields)
        settings = CaptureSettings(**{key: getattr(asked, key) for key in keys})
    return open_source(uri, settings, open_recording=open_recording)


def open_recording(uri: str, path: Path) -> FrameSource:
    """The pictures of the recording at `path` as a source. Raises `InputError` where it holds none."""
    run = read_run(path)
    first = next(iter(iter_frames(path)), None)
    if first is None:
        raise InputError(f"{path}: this recording holds no pictures: score it with `dnb-edge score {path}`")
    recorded = run.header.source
    info = SourceInfo(
        uri=uri,
        width_px=first.width_px,
        height_px=first.height_px,
        nominal_fps=recorded.nominal_fps,
        clock=recorded.clock,
        live=False,
        camera_id=recorded.camera_id,
    )
    return RecordingSource(uri, info, iter_frames(path))
