"""One run of the appliance, from a checked configuration to the finished recording.

Opens what the run needs in the right order and closes it in the reverse one, whatever happens in between.
"""

from __future__ import annotations

import contextlib
import logging
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from dnb_edge.assembly import make_header, make_scene, make_source
from dnb_edge.capture.settings import changed_controls
from dnb_edge.capture.source import FrameSource
from dnb_edge.config.schema import Config
from dnb_edge.core import Core, CoreSetup
from dnb_edge.daemon.alone import alone, lock_directory
from dnb_edge.daemon.cameras import feed_of, further_sources
from dnb_edge.daemon.catchup import ResumedCore
from dnb_edge.daemon.live_run import LiveRun
from dnb_edge.daemon.log_aside import log_aside
from dnb_edge.daemon.loop import Race, Stop
from dnb_edge.daemon.machine import MachineWatch
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.recording import recording_settings
from dnb_edge.daemon.resume import RESUME_WITHIN_S, Unfinished, find_unfinished, places_there, recover_aside
from dnb_edge.daemon.rooms import Rooms, keeper, rooms_of
from dnb_edge.daemon.several import Feed
from dnb_edge.daemon.sinks import BoardSink, RecordSink, Sink
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.uri import open_display
from dnb_edge.errors import WorkError
from dnb_edge.record.header import RunHeader
from dnb_edge.record.recover import Recovery, recover_directory
from dnb_edge.record.writer import Recorder
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
    last_good: Path | None = None
    """Where a copy of the last configuration that raced is kept, for when the current one is damaged; None for nowhere."""
    config_fault: str | None = None
    """Why the configuration is that copy already; None where it is the user's own."""
    resume_within_s: float = RESUME_WITHIN_S
    """A run that was cut short no longer ago is gone on with, seconds; 0 for never."""


def run_appliance(
    config: Config,
    options: RunOptions,
    *,
    listeners: Sequence[Sink] = (),
    displays: Sequence[Display] = (),
    notifier: ServiceNotifier | None = None,
    live: LiveRun | None = None,
    source: FrameSource | None = None,
    stop: Stop | None = None,
) -> RunSummary:
    """Runs one race and returns its summary once the recording is finished and synced.

    `source`: an open one instead of that which `options` name, such as a closed loop; it is closed here. `stop` ends the run
    once it is set, instead of SIGINT and SIGTERM.

    `listeners` hear the summary as their last event; `live` tells other processes on the box of the race, and may end it before
    it begins: then nothing is written, and nobody hears anything. Raises `InputError`
    before anything is written where the input is wrong, `WorkError` at the end where the recording failed.
    """
    notifier = ServiceNotifier() if notifier is None else notifier
    notifier.status("starting")
    with ExitStack() as stack:
        stop = stop if live is None else live.stop
        if stop is None:
            stop = stack.enter_context(stop_signals())
        source = make_source(options.source_uri, config) if source is None else source
        stack.callback(source.close)
        if source.info.live:
            stack.enter_context(alone(lock_directory(_directory(config, options))))
            stack.enter_context(log_aside())
        further = further_sources(config, source.info)
        for other in further:
            stack.callback(other.close)
        infos = [source.info, *(other.info for other in further)]
        rooms = rooms_of(config, infos, last_good=options.last_good, config_fault=options.config_fault)
        if live is not None and stop.is_set():
            # It took its time: nobody wants a recording without a frame.
            return RunSummary(frames=0, detected_frames=0, laps=0, recording=None)
        shown = [*displays]
        if options.display_uri is not None:
            display = open_display(options.display_uri)
            stack.callback(display.close)
            shown.append(display)
        party = _Party(displays=shown, listeners=listeners, notifier=notifier, live=live)
        feed = feed_of([source, *further], config)
        return _raced(_prepared(rooms, options, infos, feed, party, stop), party)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Party:
    """Whoever follows the run."""

    displays: Sequence[Display]
    listeners: Sequence[Sink]
    notifier: ServiceNotifier
    live: LiveRun | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Prepared:
    """A run of which all is open and nothing has begun."""

    race: Race
    feed: Feed
    machine: MachineWatch | None
    core: Core | ResumedCore
    earlier: Unfinished | None
    """What it goes on with."""
    recorder: Recorder | None
    board: BoardSink
    watching: Sequence[Sink]
    """All that hear of events, but for the recording."""


def _prepared(
    rooms: Rooms, options: RunOptions, infos: Sequence[SourceInfo], feed: Feed, party: _Party, stop: Stop
) -> _Prepared:
    """Begins the recording, goes on with a run that was cut short, and tells everybody what there is."""
    live, info = party.live, infos[0]
    directory = _directory(rooms.config, options)
    header = make_header(rooms.config, rooms.assembly, info, infos[1:])
    earlier = None if directory is None else _earlier(directory, header, rooms, options.resume_within_s)
    recorder = None if directory is None else _start_recorder(directory, header, rooms, earlier)
    core = _core(rooms.assembly.setup, earlier)
    board = BoardSink(
        party.displays,
        party.notifier,
        rooms.assembly.setup.laps.laps,
        first_t_ns=None if earlier is None else earlier.first_t_ns,
        notices=None if live is None else live.notices,
    )
    shows: list[Sink] = [board, *_elsewhere(live, rooms, info, recorder)]
    _tell_again(earlier, shows)
    watching: list[Sink] = [*shows, *party.listeners]
    # The recording comes first, so that what is shown has already been handed to the disk.
    recording: list[Sink] = [] if recorder is None else [RecordSink(recorder)]
    machine = MachineWatch(lambda: None if recorder is None else recorder.path.parent) if info.live else None
    race = Race(
        info=info,
        feed=feed,
        eyes=rooms.eyes,
        core=core,
        meter=_meter(rooms, info, earlier),
        laps=0 if earlier is None else len(earlier.laps),
        sinks=[*recording, *watching],
        displays=party.displays,
        notifier=party.notifier,
        recorder=recorder,
        stop=stop,
        machine=None if machine is None else lambda: machine.state,
        on_ready=keeper(rooms, options.last_good),
        vehicles=None if live is None else live.vehicles,
    )
    return _Prepared(
        race=race,
        feed=feed,
        machine=machine,
        core=core,
        earlier=earlier,
        recorder=recorder,
        board=board,
        watching=watching,
    )


def _raced(run: _Prepared, party: _Party) -> RunSummary:
    """Races to the end, and finishes the recording. Raises `WorkError` where that failed."""
    with run.feed, run.machine if run.machine is not None else contextlib.nullcontext():
        try:
            summary = run.race.run()
            if run.earlier is not None and isinstance(run.core, ResumedCore):
                summary = replace(
                    summary,
                    frames=summary.frames + run.earlier.frames,
                    detected_frames=summary.detected_frames + run.core.detected_frames,
                )
            if run.recorder is not None:
                run.recorder.add_event(summary)
        finally:
            # Before the camera is closed: a driver that hangs costs no recording.
            _say_end(party.live, party.notifier, run.board)
            path, failure = _finish(run.recorder)
    summary = replace(summary, recording=path)
    for sink in run.watching:
        sink.event(summary)
    if failure is not None:
        raise failure
    return summary


def _directory(config: Config, options: RunOptions) -> Path | None:
    """Where recordings go."""
    return options.record_directory if options.record_directory is not None else config.record.directory


def _earlier(directory: Path, header: RunHeader, rooms: Rooms, within_s: float) -> Unfinished | None:
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


def _start_recorder(directory: Path, header: RunHeader, rooms: Rooms, earlier: Unfinished | None) -> Recorder:
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


def _elsewhere(live: LiveRun | None, rooms: Rooms, info: SourceInfo, recorder: Recorder | None) -> tuple[Sink, ...]:
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


def _meter(rooms: Rooms, info: SourceInfo, earlier: Unfinished | None) -> Meter:
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
