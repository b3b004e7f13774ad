"""One run of the appliance, from a checked configuration to the finished recording.

Opens what the run needs in the right order and closes it in the reverse one, whatever happens in between.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from dnb_edge.assembly import Assembly, assemble, make_detector, make_header, make_scene, make_source
from dnb_edge.config.schema import Config
from dnb_edge.core import Core
from dnb_edge.daemon.drift import make_watch
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.loop import Race
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.sinks import BoardSink, RecordSink, Sink
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.uri import open_display
from dnb_edge.errors import WorkError
from dnb_edge.record.recover import Recovery, recover_directory
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import RunSummary, SourceInfo

log = logging.getLogger(__name__)

FINISH_S = 4.0
"""Longest wait for the disk at the end; the service manager allows a little more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """What the command line adds to the configuration."""

    source_uri: str
    record_directory: Path | None = None
    display_uri: str | None = None


def run_appliance(
    config: Config, options: RunOptions, *, listeners: Sequence[Sink] = (), displays: Sequence[Display] = ()
) -> RunSummary:
    """Runs one race and returns its summary once the recording is finished and synced.

    `listeners` hear the summary as their last event. Raises `InputError` before anything is written where the input is
    wrong, `WorkError` at the end where the recording failed.
    """
    notifier = ServiceNotifier()
    notifier.status("starting")
    with ExitStack() as stack:
        stop = stack.enter_context(stop_signals())
        source = make_source(options.source_uri, config)
        stack.callback(source.close)
        assembly = assemble(config, source.info)
        detector = make_detector(config, assembly.setup.ground)
        shown = [*displays]
        if options.display_uri is not None:
            display = open_display(options.display_uri)
            stack.callback(display.close)
            shown.append(display)
        recorder = _start_recorder(config, assembly, source.info, options.record_directory)
        feed = FrameFeed(source, lambda: make_source(options.source_uri, config))
        watching: list[Sink] = [BoardSink(shown, notifier, assembly.setup.laps.laps), *listeners]
        # The recording comes first, so that what is shown has already been handed to the disk.
        recording: list[Sink] = [] if recorder is None else [RecordSink(recorder)]
        race = Race(
            info=source.info,
            feed=feed,
            detector=detector,
            core=Core(assembly.setup),
            meter=_meter(assembly),
            sinks=[*recording, *watching],
            displays=shown,
            notifier=notifier,
            recorder=recorder,
            stop=stop,
            drift=make_watch(config.view, assembly.setup, source.info),
        )
        try:
            with feed:
                summary = race.run()
            if recorder is not None:
                recorder.add_event(summary)
        finally:
            notifier.stopping()
            path, failure = _finish(recorder)
        summary = replace(summary, recording=path)
        for sink in watching:
            sink.event(summary)
        if failure is not None:
            raise failure
    return summary


def _start_recorder(config: Config, assembly: Assembly, info: SourceInfo, directory: Path | None) -> Recorder | None:
    directory = directory if directory is not None else config.record.directory
    if directory is None:
        return None
    _recover(directory)
    settings = RecordingSettings(directory=directory, image_fps=config.record.image_fps or None, lossless=not info.live)
    return Recorder(settings, make_header(config, assembly, info), make_scene(assembly.setup))


def _recover(directory: Path) -> None:
    """Brings back what an earlier run left unfinished when its power went, before a new one is begun beside it."""
    for result in recover_directory(directory) if directory.is_dir() else ():
        if isinstance(result, Recovery):
            log.warning("recovered %s from an earlier run: %d laps", result.path, result.laps)
        else:
            log.warning("not recovered: %s", result.reason)


def _finish(recorder: Recorder | None) -> tuple[str | None, WorkError | None]:
    """Finishes the recording as far as it goes: its path where it is good, and what failed where it is not."""
    if recorder is None:
        return None, None
    try:
        return str(recorder.close(FINISH_S)), None
    except WorkError as error:
        return None, error


def _meter(assembly: Assembly) -> Meter:
    reason = assembly.setup.not_scored_because
    return Meter(
        view_error_mean_px=assembly.calibration.mean_px,
        view_error_mean_m=assembly.calibration.mean_m,
        view_sigma_m=assembly.view_sigma_m,
        standing_warnings=() if reason is None else (reason,),
    )


@contextmanager
def stop_signals() -> Iterator[threading.Event]:
    """An event that SIGINT and SIGTERM set; outside the main thread, where signals cannot be caught, one that nobody sets."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def request(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        stop.set()

    before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
