"""One run of the appliance, from a checked configuration to the finished recording.

Opens what the run needs in the right order and closes it in the reverse one, whatever happens in between.
"""

from __future__ import annotations

import contextlib
import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from dnb_edge.assembly import Assembly, assemble, make_detector, make_header, make_scene, make_source
from dnb_edge.capture.settings import changed_controls
from dnb_edge.config.schema import Config
from dnb_edge.core import Core, CoreSetup
from dnb_edge.daemon.alone import alone, lock_directory
from dnb_edge.daemon.camera import SameCamera
from dnb_edge.daemon.catchup import ResumedCore
from dnb_edge.daemon.drift import make_watch
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.last_good import LastGood
from dnb_edge.daemon.live_run import LiveRun
from dnb_edge.daemon.log_aside import log_aside
from dnb_edge.daemon.loop import Race, Stop
from dnb_edge.daemon.machine import MachineWatch
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.recording import recording_settings
from dnb_edge.daemon.resume import RESUME_WITHIN_S, Unfinished, find_unfinished, places_there, recover_aside
from dnb_edge.daemon.sinks import BoardSink, RecordSink, Sink
from dnb_edge.detect.protocol import Detector
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.uri import open_display
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.header import RunHeader
from dnb_edge.record.recover import Recovery, recover_directory
from dnb_edge.record.writer import Recorder
from dnb_edge.values import RunSummary, SourceInfo
from dnb_edge.view.drift import DriftWatch

log = logging.getLogger(__name__)

FINISH_S = 4.0
"""Longest wait for the disk at the end; the service manager allows a little more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """What the command line adds to the configuration."""

    source_uri: str
    record_directory: Path | None = None
    display_uri: str | None = None
    last_good: Path | None = None
    """Where a copy of the last configuration that raced is kept, for when the current one is damaged; None for nowhere."""
    config_fault: str | None = None
    """Why the configuration is that copy already; None where it is the user's own."""
    resume_within_s: float = RESUME_WITHIN_S
    """A run that was cut short no longer ago is gone on with, seconds; 0 for never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rooms:
    """What a configuration means for the opened source."""

    config: Config
    assembly: Assembly
    detector: Detector
    drift: DriftWatch
    config_fault: str | None
    """Why `config` is the last good one; None where it is the user's own."""


def run_appliance(
    config: Config,
    options: RunOptions,
    *,
    listeners: Sequence[Sink] = (),
    displays: Sequence[Display] = (),
    notifier: ServiceNotifier | None = None,
    live: LiveRun | None = None,
) -> RunSummary:
    """Runs one race and returns its summary once the recording is finished and synced.

    `listeners` hear the summary as their last event; `live` tells other processes on the box of the race, and may end it before
    it begins: then nothing is written, and nobody hears anything. Raises `InputError`
    before anything is written where the input is wrong, `WorkError` at the end where the recording failed.
    """
    notifier = ServiceNotifier() if notifier is None else notifier
    notifier.status("starting")
    with ExitStack() as stack:
        stop: Stop = live.stop if live is not None else stack.enter_context(stop_signals())
        source = make_source(options.source_uri, config)
        stack.callback(source.close)
        if source.info.live:
            stack.enter_context(alone(lock_directory(_directory(config, options))))
            stack.enter_context(log_aside())
        rooms = _rooms(config, options, source.info)
        if live is not None and stop.is_set():
            # It took its time: nobody wants a recording without a frame.
            return RunSummary(frames=0, detected_frames=0, laps=0, recording=None)
        shown = [*displays]
        if options.display_uri is not None:
            display = open_display(options.display_uri)
            stack.callback(display.close)
            shown.append(display)
        directory = _directory(rooms.config, options)
        header = make_header(rooms.config, rooms.assembly, source.info)
        earlier = None if directory is None else _earlier(directory, header, rooms, options.resume_within_s)
        recorder = None if directory is None else _start_recorder(directory, header, rooms, earlier)
        core = _core(rooms.assembly.setup, earlier)
        feed = FrameFeed(source, SameCamera(source.info, lambda uri: make_source(uri, config)))
        board = BoardSink(
            shown,
            notifier,
            rooms.assembly.setup.laps.laps,
            first_t_ns=None if earlier is None else earlier.first_t_ns,
            notices=None if live is None else live.notices,
        )
        shows: list[Sink] = [board, *_elsewhere(live, rooms, source.info, recorder)]
        _tell_again(earlier, shows)
        watching: list[Sink] = [*shows, *listeners]
        # The recording comes first, so that what is shown has already been handed to the disk.
        recording: list[Sink] = [] if recorder is None else [RecordSink(recorder)]
        machine = MachineWatch(lambda: None if recorder is None else recorder.path.parent)
        race = Race(
            info=source.info,
            feed=feed,
            detector=rooms.detector,
            core=core,
            meter=_meter(rooms, source.info, earlier),
            laps=0 if earlier is None else len(earlier.laps),
            sinks=[*recording, *watching],
            displays=shown,
            notifier=notifier,
            recorder=recorder,
            stop=stop,
            drift=rooms.drift,
            machine=(lambda: machine.state) if source.info.live else None,
            on_ready=_keeper(rooms, options),
        )
        with feed, machine if source.info.live else contextlib.nullcontext():
            try:
                summary = race.run()
                if earlier is not None and isinstance(core, ResumedCore):
                    summary = replace(
                        summary,
                        frames=summary.frames + earlier.frames,
                        detected_frames=summary.detected_frames + core.detected_frames,
                    )
                if recorder is not None:
                    recorder.add_event(summary)
            finally:
                # Before the camera is closed: a driver that hangs costs no recording.
                _say_end(live, notifier, board)
                path, failure = _finish(recorder)
        summary = replace(summary, recording=path)
        for sink in watching:
            sink.event(summary)
        if failure is not None:
            raise failure
    return summary


def _directory(config: Config, options: RunOptions) -> Path | None:
    """Where recordings go."""
    return options.record_directory if options.record_directory is not None else config.record.directory


def _rooms(config: Config, options: RunOptions, info: SourceInfo) -> _Rooms:
    """Builds the rooms, from the last good configuration where the current one, or a file that it names, is damaged."""
    try:
        return _built(config, info, options.config_fault)
    except InputError as error:
        if options.last_good is None or options.config_fault is not None:
            raise
        try:
            return _built(LastGood(options.last_good).load(), info, str(error))
        except InputError:
            # Of two faults the user can mend the first.
            raise error from None


def _built(config: Config, info: SourceInfo, config_fault: str | None) -> _Rooms:
    assembly = assemble(config, info)
    return _Rooms(
        config=config,
        assembly=assembly,
        detector=make_detector(config, assembly.setup.ground),
        drift=make_watch(config.view, assembly.setup, info),
        config_fault=config_fault,
    )


def _keeper(rooms: _Rooms, options: RunOptions) -> Callable[[], None] | None:
    """What keeps the configuration as the last good one, in its own thread; None where it is that already, or need not be."""
    directory = options.last_good
    if directory is None or rooms.config_fault is not None:
        return None

    def keep() -> None:
        try:
            LastGood(directory).keep(rooms.config)
        except (OSError, InputError) as error:
            log.warning("%s: the configuration cannot be kept as the last good one: %s", directory, error)

    return threading.Thread(target=keep, name="last-good", daemon=True).start


def _earlier(directory: Path, header: RunHeader, rooms: _Rooms, within_s: float) -> Unfinished | None:
    """The run that was cut short and that this one goes on with; None where there is none. All others are recovered first."""
    found = None
    places = places_there(directory, rooms.config.record.fallback)
    if within_s > 0 and header.source.live:
        found = find_unfinished(places, header, now_ns=time.monotonic_ns(), within_s=within_s)
    for place in places:
        _recover(place, leave=() if found is None else found.parts)
    if found is not None:
        log.warning("going on with %s, which was cut short: %d laps so far", found.name, len(found.laps))
    return found


def _core(setup: CoreSetup, earlier: Unfinished | None) -> Core | ResumedCore:
    """A new core, or one that is brought back to where that of the earlier run was."""
    if earlier is None:
        return Core(setup)
    core = ResumedCore(
        setup,
        earlier.detections,
        frames=earlier.frames,
        after_last=earlier.after_last,
        laps=earlier.laps,
        name=earlier.name,
    )
    recover_aside(earlier.parts, core.wait)
    return core


def _start_recorder(directory: Path, header: RunHeader, rooms: _Rooms, earlier: Unfinished | None) -> Recorder:
    settings = recording_settings(rooms.config.record, directory, live=header.source.live)
    header = replace(header, resumed_from=None if earlier is None else earlier.name)
    return Recorder(settings, header, make_scene(rooms.assembly.setup))


def _recover(directory: Path, *, leave: Sequence[Path]) -> None:
    """Brings back what an earlier run left unfinished when its power went, before a new one is begun beside it."""
    for result in recover_directory(directory, leave=leave):
        if isinstance(result, Recovery):
            log.warning("recovered %s from an earlier run: %d laps", result.path, result.laps)
        else:
            log.warning("not recovered: %s", result.reason)


def _elsewhere(live: LiveRun | None, rooms: _Rooms, info: SourceInfo, recorder: Recorder | None) -> tuple[Sink, ...]:
    """Whoever tells other processes of the race, which begins now."""
    if live is None:
        return ()
    live.races(rooms.assembly.setup, info, None if recorder is None else recorder.path)
    return (live.sink,)


def _say_end(live: LiveRun | None, notifier: ServiceNotifier, board: BoardSink) -> None:
    """The race is over; the service too, unless it lives on."""
    if live is None:
        notifier.stopping()
    else:
        live.ends(notifier, board.state)


def _tell_again(earlier: Unfinished | None, sinks: Sequence[Sink]) -> None:
    """What the run that is gone on with had told already."""
    for event in () if earlier is None else earlier.shown:
        for sink in sinks:
            sink.event(event)


def _finish(recorder: Recorder | None) -> tuple[str | None, WorkError | None]:
    """Finishes the recording as far as it goes: its path where it is good, and what failed where it is not."""
    if recorder is None:
        return None, None
    try:
        return str(recorder.close(FINISH_S)), None
    except WorkError as error:
        return None, error


def _meter(rooms: _Rooms, info: SourceInfo, earlier: Unfinished | None) -> Meter:
    assembly = rooms.assembly
    fault, reason = rooms.config_fault, assembly.setup.not_scored_because
    return Meter(
        view_error_mean_px=assembly.calibration.mean_px,
        view_error_mean_m=assembly.calibration.mean_m,
        view_sigma_m=assembly.view_sigma_m,
        first_t_ns=None if earlier is None else earlier.first_t_ns,
        standing_warnings=(
            *(() if fault is None else (f"last good configuration in use: {fault}",)),
            *(() if reason is None else (reason,)),
            *changed_controls(info.controls),
        ),
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
