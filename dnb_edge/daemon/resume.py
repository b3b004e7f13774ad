"""A run that was cut short and may be gone on with: whether there is one, what it held, and why another is left alone.

Knows the recordings of some directories and what makes two runs the same race. Knows no core: who brings it back to where
it was is `catchup`. A run is gone on with only in the same boot, since the clock that its laps are timed by ends with it.
"""

from __future__ import annotations

import fcntl
import json
import logging
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.records import Message

from dnb_edge import wire
from dnb_edge.errors import InputError
from dnb_edge.record import names
from dnb_edge.record.chain import Head, chain_of, read_head
from dnb_edge.record.channels import DETECTIONS_TOPIC, EVENT_TOPICS
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.header import RunHeader
from dnb_edge.record.scan import LinearReader
from dnb_edge.values import (
    Clock,
    Crossing,
    Event,
    FrameDetections,
    Health,
    Incident,
    Lap,
    RaceState,
    RunSummary,
    Score,
    Standings,
    VehicleReport,
)

log = logging.getLogger(__name__)

RESUME_WITHIN_S = 600.0
"""How long a run may have been dead, seconds: whoever comes back later comes for another race."""

LOOK_S = 20.0
"""So long a run may be looked through, seconds: the service manager waits no minute, and a day of recording is no race."""

SHOWN = (Crossing, Incident, Lap, RaceState, Score, Standings)
"""What a board is made of, besides what comes anew with every frame."""

_SHOWN_TOPICS: dict[str, type[Any]] = {EVENT_TOPICS[kind]: kind for kind in SHOWN}
_HEALTH_TOPIC = EVENT_TOPICS[Health]
_SUMMARY_TOPIC = EVENT_TOPICS[RunSummary]
_VEHICLE_TOPIC = EVENT_TOPICS[VehicleReport]


@dataclass(frozen=True, slots=True, kw_only=True)
class Unfinished:
    """A run that was cut short, as far as it was saved."""

    files: tuple[Path, ...]
    """Its files, in order."""
    first_t_ns: int
    last_t_ns: int
    """Stamps of its first and last saved frame."""
    frames: int
    last_sequence: int
    shown: tuple[Event, ...]
    """What boards show, in the order in which it was told."""
    after_last: int
    """Number of the core's events that were saved behind the last frame's detections: that frame may have more."""

    @property
    def laps(self) -> tuple[Lap, ...]:
        """The laps that were saved."""
        return tuple(event for event in self.shown if isinstance(event, Lap))

    @property
    def name(self) -> str:
        """What its last file is called when it is finished."""
        return self.files[-1].name.removesuffix(PART_SUFFIX)

    @property
    def parts(self) -> tuple[Path, ...]:
        """Its files that nobody has finished."""
        return tuple(path for path in self.files if path.name.endswith(PART_SUFFIX))

    def detections(self) -> Iterator[FrameDetections]:
        """What its core was given, frame by frame. Raises ValueError where one is malformed."""
        for path in self.files:
            # It may have been finished meanwhile, by a recovery that an earlier start has begun.
            there = path if path.exists() else path.with_name(path.name.removesuffix(PART_SUFFIX))
            for record in LinearReader(there, topics=(DETECTIONS_TOPIC,)).records():
                if isinstance(record, Message):
                    yield wire.from_json(FrameDetections, record.data)


def places_there(directory: Path, fallback: Sequence[Path]) -> tuple[Path, ...]:
    """Where runs may lie: those of `directory` and the ones to go on in where its disk fails that are there."""
    found = []
    for place in dict.fromkeys((directory, *fallback)):
        try:
            if place.is_dir():
                found.append(place)
        except OSError as error:
            log.warning("%s: not looked at for earlier runs: %s", place, error.strerror)
    return tuple(found)


def find_unfinished(
    places: Sequence[Path],
    header: RunHeader,
    *,
    now_ns: int,
    within_s: float,
    look_s: float = LOOK_S,
) -> Unfinished | None:
    """The latest run in the directories `places`, if the one that begins now, with `header`, is to go on with it; else None.

    Its files may lie in several of them. `now_ns` is CLOCK_MONOTONIC. Says in the log why a run that was cut short is not
    gone on with.
    """
    path = _latest(places)
    if path is None:
        _say_other_boot(places)
        return None
    try:
        head = read_head(path)
        chain = chain_of(head, places)
        reason = _other_race(head.header, header)
        found = _read((*chain.earlier, path), until_s=time.monotonic() + look_s)
        if reason is None and chain.missing is not None:
            reason = f"{chain.missing}, from which it went on, is not there"
    except _Ended:
        return None
    except InputError as error:
        log.warning("not resumed: %s", error)
        return None
    if reason is None:
        reason = _too_far(found, now_ns=now_ns, within_s=within_s)
    if reason is not None:
        log.warning("%s was cut short and is not resumed: %s", path.name.removesuffix(PART_SUFFIX), reason)
        return None
    return found


def recover_aside(parts: Sequence[Path], wait: Callable[[], None]) -> None:
    """Finishes the files of a run that was cut short, in a process of its own with little priority: it takes seconds an hour.

    It begins once `wait` has returned. Where it does not come about the next start does it; till then they stay as they are.
    """
    words = ["nice", "-n", "19", sys.executable, "-m", "dnb_edge", "runs", "recover", *map(str, parts)]

    def recover() -> None:
        wait()
        try:
            done = subprocess.run(words, check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL)  # noqa: S603
        except OSError as error:
            log.warning("%s: left as it is until the next start: %s", parts[-1], error.strerror)
            return
        for line in (done.stdout + done.stderr).splitlines():
            log.info("%s", line)

    if parts:
        threading.Thread(target=recover, name="recover", daemon=True).start()


class _Ended(Exception):
    """The run has come to its own end."""


def _latest(places: Sequence[Path]) -> Path | None:
    """The file of this boot that was written last and holds a header; None where there is none, or one of them is in use."""
    heads = [head for place in places if (head := _latest_in(place)) is not None]
    if not heads or any(_in_use(head.path) for head in heads):
        return None
    gone_on = {head.previous for head in heads}
    last = [head for head in heads if head.path.name.removesuffix(PART_SUFFIX) not in gone_on] or heads
    return max(last, key=lambda head: _written_ns(head.path)).path


def _written_ns(path: Path) -> int:
    """When it was written last, by the disk's date; 0 where it has got another name meanwhile."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _latest_in(place: Path) -> Head | None:
    """Of the file of this boot with the highest number in one directory."""
    pattern = re.compile(rf"run-{re.escape(names.boot_tag())}-(\d+)\.mcap({re.escape(PART_SUFFIX)})?")
    found = [(int(match[1]), path) for path in place.glob("run-*") if (match := pattern.fullmatch(path.name))]
    for _, path in sorted(found, reverse=True):
        try:
            return read_head(path)
        except InputError:
            # It was cut short before its header was saved.
            continue
    return None


def _in_use(path: Path) -> bool:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def _say_other_boot(places: Sequence[Path]) -> None:
    """A run of an earlier boot is recovered and never gone on with: how long the box was off nobody knows."""
    tag = names.boot_tag()
    for path in sorted(path for place in places for path in place.glob(f"run-*{PART_SUFFIX}")):
        if not path.name.startswith(f"run-{tag}-") and not _in_use(path):
            log.warning(
                "%s was cut short by a power cut or a restart of the machine and is not resumed: its clock has ended with it. "
                "A new race begins; the laps of the old one are kept",
                path.name.removesuffix(PART_SUFFIX),
            )


def _other_race(before: RunHeader, now: RunHeader) -> str | None:
    """In what the run that begins is another race than the one before; None where it is the same."""
    if now.source.clock is not Clock.MONOTONIC or not now.source.live:
        return f"{now.source.uri} is no live camera"
    mine, other = json.loads(now.to_json()), json.loads(before.to_json())
    names_of = {
        "source": "source",
        "entry": "entry",
        "session": "session",
        "versions": "software",
        "setup": "configuration",
    }
    for member, word in names_of.items():
        if _same(mine[member]) != _same(other[member]):
            return f"another {word}"
    return None


def _same(value: Any) -> Any:
    """What must be equal: of a source who it is, not how its settings were taken this time."""
    if isinstance(value, dict) and "camera_id" in value:
        return {key: value[key] for key in ("uri", "width_px", "height_px", "clock", "live", "camera_id")}
    return value


def _too_far(found: Unfinished, *, now_ns: int, within_s: float) -> str | None:
    age_s = (now_ns - found.last_t_ns) * 1e-9
    if age_s < 0:
        return "its stamps lie in the future"
    if age_s > within_s:
        return f"its last frame is {age_s:.0f} s old (limit {within_s:.0f} s)"
    return None


class _Tally:
    """What is gathered from one file after the other."""

    def __init__(self) -> None:
        self.frames = 0
        self.first: bytes | None = None
        self.last: bytes | None = None
        self.after_last = 0
        self.shown: list[Event] = []
        self.since_start = 0
        """Frames of the process that wrote the file: what its Health counts."""

    def take(self, topic: str, data: bytes) -> None:
        """Takes one message. Raises `_Ended` at the run's summary, ValueError where one is malformed or frames are missing."""
        if topic == DETECTIONS_TOPIC:
            self.first = self.first or data
            self.last = data
            self.frames += 1
            self.since_start += 1
            self.after_last = 0
        elif topic == _SUMMARY_TOPIC:
            raise _Ended
        elif topic == _HEALTH_TOPIC:
            missing = wire.from_json(Health, data).frames - self.since_start
            if missing > 0:
                raise ValueError(f"{missing} frames of it were not recorded")
        elif topic != _VEHICLE_TOPIC:  # that is not of the core
            self.after_last += 1
            kind = _SHOWN_TOPICS.get(topic)
            if kind is not None:
                self.shown.append(wire.from_json(kind, data))


def _read(files: Sequence[Path], *, until_s: float) -> Unfinished:
    """All that is to be known of the run in `files`. Raises `_Ended` where it has ended by itself.

    Raises InputError where it is damaged inside or lacks frames, so that no core can be brought back exactly to where it was,
    and where it cannot be read until `until_s`, by time.monotonic.
    """
    tally = _Tally()
    topics: Collection[str] = (DETECTIONS_TOPIC, *EVENT_TOPICS.values())
    for path in files:
        head = read_head(path)
        if head.previous is None or head.previous == head.header.resumed_from:
            tally.since_start = 0
        _read_file(path, topics, tally, until_s)
    if tally.first is None or tally.last is None:
        raise InputError(f"{files[-1]}: it was cut short before its first frame was saved")
    first, last = (wire.from_json(FrameDetections, text) for text in (tally.first, tally.last))
    return Unfinished(
        files=tuple(files),
        first_t_ns=first.t_ns,
        last_t_ns=last.t_ns,
        frames=tally.frames,
        last_sequence=last.sequence,
        shown=tuple(tally.shown),
        after_last=tally.after_last,
    )


def _read_file(path: Path, topics: Collection[str], tally: _Tally, until_s: float) -> None:
    reader = LinearReader(path, topics=topics)
    try:
        for record in reader.records():
            if isinstance(record, Message) and (topic := reader.tally.topic(record.channel_id)) is not None:
                tally.take(topic, record.data)
                if topic == _HEALTH_TOPIC and time.monotonic() > until_s:
                    raise ValueError("it is too long to be gone on with")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: {error}") from error
    if reader.damage is not None and not reader.damage.truncated:
        raise InputError(f"{path}: it is damaged inside ({reader.damage.reason})")
