"""A judge's edits beside a recording: `RUN.edits.jsonl`, which only ever grows.

One JSON object a line. The first names the recording, each other is one edit. Every line's `sha256` is over the line before it
and its own text, so that a line which was changed, left out or moved is noticed. (Whoever writes all hashes anew is not: it
is no signature.) Knows the file; knows nothing of what edits do to laps.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnb_edge import wire
from dnb_edge.errors import InputError, WorkError
from dnb_edge.race.edit import Edit
from dnb_edge.record.durable import PART_SUFFIX, sync_directory
from dnb_edge.record.header import RunHeader

FILE_FORMAT = "dnb-edge edits"
FILE_VERSION = 1

_SEAL = "sha256"
_REMEDY = "bring back a copy of the file, or leave the edits out with --no-edits"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunIdentity:
    """What tells one recording from another, and stays when its file is renamed or recovered."""

    name: str
    source: str
    first_t_ns: int | None
    wall_offset_ns: int | None

    @classmethod
    def of(cls, header: RunHeader, first_t_ns: int | None) -> RunIdentity:
        """The identity of the recording with this header, whose first message is stamped `first_t_ns`."""
        return cls(
            name=header.name,
            source=header.source.uri,
            first_t_ns=first_t_ns,
            wall_offset_ns=header.wall_offset_ns,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class EditLog:
    """All that a file of edits holds."""

    path: Path
    edits: tuple[Edit, ...] = ()
    warnings: tuple[str, ...] = ()
    seal: str | None = None
    """The last whole line's hash; None where there is no file yet."""
    whole_bytes: int = 0
    """Length of the file up to the end of its last whole line."""

    @property
    def next_number(self) -> int:
        """The number of the edit that comes next."""
        return len(self.edits) + 1


def edits_path(recording: Path) -> Path:
    """Where the edits of `recording` lie, whether it is finished or not: what was decided before outlives a recovery."""
    return recording.with_name(f"{recording.name.removesuffix(PART_SUFFIX).removesuffix('.mcap')}.edits.jsonl")


def read_edits(recording: Path, identity: RunIdentity) -> EditLog:
    """The edits beside `recording`; none where there is no file.

    What comes after the last line feed was never saved in full and is left out with a warning. Raises `InputError` naming the
    file and the line where anything else is wrong, or where the file belongs to another recording.
    """
    path = edits_path(recording)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return EditLog(path=path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    return _parsed(path, data, identity)


@contextmanager
def locked(recording: Path) -> Iterator[None]:
    """Keeps every other judge from the edits of `recording` meanwhile. Raises `WorkError` where the folder cannot be locked."""
    descriptor = None
    try:
        descriptor = os.open(recording.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError as error:
        if descriptor is not None:
            os.close(descriptor)
        raise WorkError(f"{recording.parent}: cannot be locked: {error.strerror}") from error
    try:
        yield
    finally:
        os.close(descriptor)


def append_edit(log: EditLog, edit: Edit, identity: RunIdentity) -> EditLog:
    """Adds `edit` to the file that `log` was read from, and brings it to the disk; returns the file as it is then.

    Call it within `locked`, with a log that was read there. Raises `WorkError` where the disk fails; the file then is as
    before, or ends in a torn line that the next reader leaves out.
    """
    if edit.number != log.next_number:
        raise ValueError(f"edit {edit.number} cannot follow {log.next_number - 1} edits")
    lines, seal = b"", log.seal
    if seal is None:
        head = {"format": FILE_FORMAT, "version": FILE_VERSION, "recording": wire.to_dict(identity)}
        line, seal = _sealed("", head)
        lines += line
    line, seal = _sealed(seal, wire.to_dict(edit))
    lines += line
    try:
        _write(log.path, lines, log.whole_bytes)
    except OSError as error:
        raise WorkError(f"{log.path}: the edit was not saved: {error.strerror}") from error
    return EditLog(path=log.path, edits=(*log.edits, edit), seal=seal, whole_bytes=log.whole_bytes + len(lines))


def _write(path: Path, lines: bytes, whole_bytes: int) -> None:
    """Puts `lines` behind the first `whole_bytes`; what a power cut left behind those was never said to be saved."""
    new = not path.exists()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o664)
    try:
        os.ftruncate(descriptor, whole_bytes)
        os.lseek(descriptor, 0, os.SEEK_END)
        rest = memoryview(lines)
        while rest:
            rest = rest[os.write(descriptor, rest) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    if new:
        sync_directory(path.parent)


def _sealed(before: str, content: dict[str, Any]) -> tuple[bytes, str]:
    """(the line with its line feed, its hash)."""
    seal = _seal(before, content)
    return json.dumps(content | {_SEAL: seal}, allow_nan=False).encode() + b"\n", seal


def _seal(before: str, content: dict[str, Any]) -> str:
    return hashlib.sha256(f"{before}\n{json.dumps(content, allow_nan=False)}".encode()).hexdigest()


def _parsed(path: Path, data: bytes, identity: RunIdentity) -> EditLog:
    *lines, torn = data.split(b"\n")
    warnings = []
    if torn:
        warnings.append(f"{path.name}: its last line was cut short, by a power cut perhaps, and is left out")
    if not lines:
        return EditLog(path=path, warnings=tuple(warnings))
    seal, head = _unsealed(path, 1, lines[0], "")
    _check_head(path, head, identity)
    edits: list[Edit] = []
    for number, line in enumerate(lines[1:], start=2):
        seal, content = _unsealed(path, number, line, seal)
        edits.append(_edit(path, number, content, edits))
    return EditLog(
        path=path,
        edits=tuple(edits),
        warnings=tuple(warnings),
        seal=seal,
        whole_bytes=len(data) - len(torn),
    )


def _unsealed(path: Path, number: int, line: bytes, before: str) -> tuple[str, dict[str, Any]]:
    """(the line's hash, its content). Raises `InputError` where the line is not as it was written, or not at its place."""
    try:
        content = json.loads(line, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}, line {number}: no JSON: {_REMEDY}") from error
    if not isinstance(content, dict) or not isinstance(content.get(_SEAL), str):
        raise InputError(f"{path}, line {number}: not a line of a file of edits: {_REMEDY}")
    seal = content.pop(_SEAL)
    if seal != _seal(before, content):
        where = "it was changed" if number == 1 else "it, or the line before it, was changed or taken out"
        raise InputError(f"{path}, line {number}: {where} after it was written (its sha256 does not fit): {_REMEDY}")
    return seal, content


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number")


def _check_head(path: Path, head: dict[str, Any], identity: RunIdentity) -> None:
    if head.get("format") != FILE_FORMAT:
        raise InputError(f"{path}, line 1: not a file of edits: {_REMEDY}")
    if head.get("version") != FILE_VERSION:
        raise InputError(
            f"{path}, line 1: a file of version {head.get('version')!r}, known is {FILE_VERSION}: update dnb-edge"
        )
    if head.get("recording") != wire.to_dict(identity):
        raise InputError(f"{path}: these are the edits of another recording: put them beside theirs")


def _edit(path: Path, number: int, content: dict[str, Any], before: Sequence[Edit]) -> Edit:
    try:
        edit = wire.from_dict(Edit, content)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}, line {number}: {error}: {_REMEDY}") from error
    if edit.number != len(before) + 1:
        raise InputError(
            f"{path}, line {number}: edit {edit.number!r} stands where {len(before) + 1} should: {_REMEDY}"
        )
    return edit
