"""Pictures of floor markers for the command line: one file, or several frames of a source."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from dnb_edge.assembly import make_source
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.cli.calibration_out import input_file
from dnb_edge.cli.photograph import read_photograph
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage
from dnb_edge.view.calibration import InputFile

_SETTLING = 5
"""Frames of a live camera to let pass: its exposure settles."""
_APART = 3
"""Every so many frames of a source one is taken."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pictures:
    """Pictures of one camera that stands still; at least one, all of one size."""

    pictures: tuple[BgrImage, ...]
    camera_id: str | None
    inputs: tuple[InputFile, ...]

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        height, width = self.pictures[0].shape[:2]
        return width, height


def picture_from_file(path: Path) -> Pictures:
    """The picture in a file, as the sensor saw it. Raises `InputError` where it cannot be read."""
    kept = input_file(path)
    return Pictures(pictures=(read_photograph(path),), camera_id=None, inputs=(kept,))


def pictures_from_source(uri: str, *, wanted: int, config: Config | None, console: Console) -> Pictures:
    """Up to `wanted` pictures of a source, a few frames apart. Raises `InputError` where it gives none."""
    taken: list[BgrImage] = []
    with closing(make_source(uri, config)) as source, _progress(console) as progress:
        skipped = _SETTLING if source.info.live else 0
        task = progress.add_task("taking pictures", total=wanted)
        for count, frame in enumerate(source.frames()):
            if count < skipped or (count - skipped) % _APART:
                continue
            picture = decode_bgr(frame)
            if picture is not None:
                taken.append(picture)
                progress.advance(task)
            if len(taken) == wanted:
                break
    if not taken:
        raise InputError(f"{uri}: no picture could be read from it")
    return Pictures(pictures=tuple(taken), camera_id=source.info.camera_id, inputs=())


def _progress(console: Console) -> Progress:
    return Progress(console=console, transient=True, disable=not console.is_terminal)
