"""Which recordings go when room is short: the oldest finished ones, their pictures first, never a pinned or a live one, nor the
last that was finished: a race whose result nobody has fetched yet must not make room for the next.

Knows how the files of a run are called and what may be deleted. Only files with names that this software gives are ever
touched: who renames a recording keeps it. What is decided is decided in `next_removal`, from values alone.
"""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.chain import chain_of, read_head
from dnb_edge.record.durable import PART_SUFFIX, sync_directory
from dnb_edge.record.room import Room, Statvfs, room_of

DAMAGED_SUFFIX = ".damaged"
PIN_SUFFIX = ".pin"
LABEL_SUFFIX = ".label.json"
"""Of the file beside a recording that says what people call it; goes with it."""

MORE_THAN_KEPT = 1.25
"""Room is made as soon as there is less than this many times what is kept free, before anything stops being recorded."""

_RUN = re.compile(r"run-[0-9a-f]{8}-\d{4,}(-recovered(-\d+)?)?")
_STEM = re.compile(rf"({_RUN.pattern})\.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """How much recordings may take."""

    keep_free_bytes: int = 0
    max_total_bytes: int | None = None
    """Of all recordings in the directory together; None for no limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRun:
    """One run with all that lies beside it."""

    name: str
    """Without ending."""
    files: tuple[Path, ...]
    """The recording first, so that its edits never lie there without it having been whole and unjudged in between."""
    pictures: tuple[Path, ...]
    """The ring of pictures, oldest first."""
    size_bytes: int
    """Of all of them."""
    pictures_bytes: int
    changed_ns: int
    """When the recording was last written to; by the system's clock, which on a small board may be late."""
    pinned: bool
    live: bool
    """It is being recorded just now, or a run that is goes on from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Removal:
    """What is deleted, or would be."""

    name: str
    pictures_only: bool
    files: tuple[Path, ...]
    size_bytes: int
    why: str


def stored_runs(directory: Path) -> list[StoredRun]:
    """The runs in `directory`, oldest first. Raises InputError where it cannot be read."""
    try:
        entries = sorted(directory.iterdir())
    except OSError as error:
        raise InputError(f"{directory}: cannot be read: {error.strerror}") from error
    by_name: dict[str, list[Path]] = {}
    for path in entries:
        if (match := _STEM.match(path.name)) is not None:
            by_name.setdefault(match[1], []).append(path)
    runs = [run for name, paths in by_name.items() if (run := _stored(name, paths)) is not None]
    going_on = _earlier_files([run for run in runs if run.live])
    runs = [replace(run, live=run.live or run.name in going_on) for run in runs]
    return sorted(runs, key=lambda run: (run.changed_ns, run.name))


def _earlier_files(live: Sequence[StoredRun]) -> set[str]:
    """Names of the runs that those being recorded go on from: their laps are in the standings."""
    names: set[str] = set()
    for run in live:
        try:
            earlier = chain_of(read_head(run.files[0])).earlier
        except InputError:
            # Just begun: it has no header yet.
            continue
        names.update(match[1] for path in earlier if (match := _STEM.match(path.name)) is not None)
    return names


def next_removal(runs: Sequence[StoredRun], limits: Limits, room: Room) -> Removal | None:
    """What goes first, `runs` being those that are there, oldest first; None where nothing must go, or nothing may."""
    why = _too_much(runs, limits, room)
    if why is None:
        return None
    free = [run for run in runs if not run.pinned and not run.live]
    for run in free:
        if run.pictures:
            return Removal(
                name=run.name, pictures_only=True, files=run.pictures, size_bytes=run.pictures_bytes, why=why
            )
    last_finished = next((run.name for run in reversed(runs) if not run.live), None)
    if not free or free[0].name == last_finished:
        return None
    oldest = free[0]
    return Removal(name=oldest.name, pictures_only=False, files=oldest.files, size_bytes=oldest.size_bytes, why=why)


def plan(runs: Sequence[StoredRun], limits: Limits, room: Room) -> list[Removal]:
    """All that would go, in order, if each removal gave back what it takes."""
    left, removals = list(runs), []
    while (removal := next_removal(left, limits, room)) is not None:
        removals.append(removal)
        left = [rest for run in left if (rest := _without(run, removal)) is not None]
        room = Room(free_bytes=room.free_bytes + removal.size_bytes, total_bytes=room.total_bytes)
    return removals


def remove(removal: Removal) -> None:
    """Delete it. Raises WorkError where the disk refuses."""
    try:
        for path in removal.files:
            path.unlink(missing_ok=True)
        for place in {path.parent for path in removal.files if path.parent.name == f"{removal.name}.pictures"}:
            place.rmdir()
    except OSError as error:
        raise WorkError(f"{error.filename}: cannot be deleted: {error.strerror}") from error


def prune_one(directory: Path, limits: Limits, statvfs: Statvfs = os.statvfs) -> Removal | None:
    """Delete what goes first, if anything must; what that was. Raises InputError or WorkError."""
    removal = next_removal(stored_runs(directory), limits, _room(directory, statvfs))
    if removal is not None:
        remove(removal)
    return removal


def prune(directory: Path, limits: Limits, *, dry_run: bool = False, statvfs: Statvfs = os.statvfs) -> list[Removal]:
    """Delete until the limits are kept or nothing may go any more; with `dry_run` only say it.

    Raises InputError where the directory cannot be read, WorkError where the disk refuses.
    """
    if dry_run:
        return plan(stored_runs(directory), limits, _room(directory, statvfs))
    removals = []
    while (removal := prune_one(directory, limits, statvfs)) is not None:
        removals.append(removal)
    return removals


def still_too_much(directory: Path, limits: Limits, statvfs: Statvfs = os.statvfs) -> str | None:
    """Why there is too much, a few words; None where the limits are kept. Raises InputError."""
    return _too_much(stored_runs(directory), limits, _room(directory, statvfs))


def pin(recording: Path) -> Path:
    """Keep `recording` for ever: a file `NAME.pin` beside it, which is returned. Raises InputError, WorkError."""
    beside = _pin_of(recording)
    try:
        beside.touch()
        sync_directory(beside.parent)
    except OSError as error:
        raise WorkError(f"{beside}: cannot be written: {error.strerror}") from error
    return beside


def unpin(recording: Path) -> Path:
    """Let `recording` go when room is short. Raises InputError, WorkError."""
    beside = _pin_of(recording)
    try:
        beside.unlink(missing_ok=True)
        sync_directory(beside.parent)
    except OSError as error:
        raise WorkError(f"{beside}: cannot be removed: {error.strerror}") from error
    return beside


def has_own_name(recording: Path) -> bool:
    """Whether it has a name that this software gives: what somebody renamed is never deleted by itself."""
    return _STEM.match(recording.name) is not None


def _pin_of(recording: Path) -> Path:
    if not recording.is_file():
        raise InputError(f"{recording}: there is no such recording")
    match = _STEM.match(recording.name)
    if match is None:
        raise InputError(f"{recording}: recordings of this name are never deleted, it needs no pin")
    return recording.with_name(match[1] + PIN_SUFFIX)


def _room(directory: Path, statvfs: Statvfs) -> Room:
    try:
        return room_of(directory, statvfs)
    except OSError as error:
        raise InputError(f"{directory}: cannot be read: {error.strerror}") from error


def _too_much(runs: Sequence[StoredRun], limits: Limits, room: Room) -> str | None:
    wanted = room.kept_free(limits.keep_free_bytes) * MORE_THAN_KEPT
    if room.free_bytes < wanted:
        return f"{room.free_bytes / 1e6:.0f} MB free, {wanted / 1e6:.0f} wanted"
    total = sum(run.size_bytes for run in runs)
    if limits.max_total_bytes is not None and total > limits.max_total_bytes:
        return f"{total / 1e9:.3g} GB of recordings, {limits.max_total_bytes / 1e9:.3g} allowed"
    return None


def _without(run: StoredRun, removal: Removal) -> StoredRun | None:
    if run.name != removal.name:
        return run
    if not removal.pictures_only:
        return None
    gone = set(removal.files)
    return replace(
        run,
        files=tuple(path for path in run.files if path not in gone),
        pictures=(),
        size_bytes=run.size_bytes - run.pictures_bytes,
        pictures_bytes=0,
    )


def _stored(name: str, paths: list[Path]) -> StoredRun | None:
    """The run of these files; None where they are only what lies beside one, such as edits: those are left alone."""
    kept = (".mcap", f".mcap{PART_SUFFIX}", f".mcap{DAMAGED_SUFFIX}")
    recordings = [path for path in paths if path.name.removeprefix(name) in kept and path.is_file()]
    pictures = sorted(
        one
        for place in paths
        if place.name == f"{name}.pictures" and place.is_dir()
        for one in place.iterdir()
        if one.is_file()
    )
    if not recordings:
        return None
    beside = [path for path in paths if path.name in (f"{name}.edits.jsonl", f"{name}{LABEL_SUFFIX}")]
    pictures_bytes = sum(map(_size, pictures))
    return StoredRun(
        name=name,
        files=(*recordings, *beside, *pictures),
        pictures=tuple(pictures),
        size_bytes=sum(map(_size, (*recordings, *beside))) + pictures_bytes,
        pictures_bytes=pictures_bytes,
        changed_ns=max(map(_changed_ns, recordings)),
        pinned=any(path.name == name + PIN_SUFFIX for path in paths),
        live=any(is_locked(path) for path in recordings),
    )


def _size(path: Path) -> int:
    """What it takes; 0 where it has gone meanwhile."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _changed_ns(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def is_locked(path: Path) -> bool:
    """Whether a recorder, or a recovery, has it; True also where that cannot be found out, or it was only just begun."""
    if path.name.endswith(PART_SUFFIX) and _size(path) == 0:
        return True
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
