"""Which part of a download is wanted, what it is called, and its bytes piece by piece.

Knows HTTP's range and name headers (RFC 9110, RFC 6266) and files; knows no request and nothing of what files hold.
"""

from __future__ import annotations

import os
import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

from dnb_edge.record.durable import PART_SUFFIX

PIECE_BYTES = 256 * 1024
_RANGE = re.compile(r"bytes\s*=\s*(\d{0,18})\s*-\s*(\d{0,18})", re.IGNORECASE)
_SAFE = re.compile(r"[^A-Za-z0-9._ +-]")
_FIRST_ZIP_YEAR, _LAST_ZIP_YEAR = 1980, 2107


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """The first `size_bytes` of a file."""

    path: Path
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One file of a zip."""

    name: str
    parts: tuple[Part, ...]
    modified_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Bytes from `start` up to, but without, `stop`."""

    start: int
    stop: int


class Unsatisfiable(Exception):
    """Nothing of what is wanted is there."""


def wanted_span(text: str | None, size_bytes: int) -> Span | None:
    """What a Range header asks of `size_bytes`; None for all of it: without a header, with one that is malformed or in other
    units, or with several ranges. Raises `Unsatisfiable` where it asks only for what is not there.
    """
    match = None if text is None else _RANGE.fullmatch(text.strip())
    if match is None or match[1] == match[2] == "":
        return None
    if match[1] == "":
        length = int(match[2])
        if length == 0 or size_bytes == 0:
            raise Unsatisfiable
        return Span(start=max(0, size_bytes - length), stop=size_bytes)
    start = int(match[1])
    stop = size_bytes if match[2] == "" else min(size_bytes, int(match[2]) + 1)
    if match[2] != "" and int(match[2]) < start:
        return None
    if start >= size_bytes:
        raise Unsatisfiable
    return Span(start=start, stop=stop)


def still_same(if_range: str | None, *, tag: str, modified: str | None) -> bool:
    """Whether what a client has parts of is what there is now, by its If-Range header; True where it does not ask."""
    if if_range is None:
        return True
    given = if_range.strip()
    return given == tag or (modified is not None and given == modified)


def known_already(if_none_match: str | None, tag: str) -> bool:
    """Whether a client has it already, by its If-None-Match header."""
    if if_none_match is None:
        return False
    given = [one.strip().removeprefix("W/") for one in if_none_match.split(",")]
    return "*" in given or tag in given


def disposition(name: str) -> str:
    """A Content-Disposition that saves under `name`, whatever letters it has (RFC 6266)."""
    plain = _SAFE.sub("_", name).strip(" .") or "download"
    simple = f'attachment; filename="{plain}"'
    return simple if plain == name else f"{simple}; filename*=UTF-8''{quote(name, safe='')}"


def pieces(parts: Sequence[Part], span: Span) -> Iterator[bytes]:
    """The bytes of `span` of the parts one after the other. All files are open from the first piece on, so that one that is
    renamed or deleted meanwhile is whole all the same; one that was finished just before has its final name.

    Raises OSError; a file that has become shorter is one.
    """
    with ExitStack() as stack:
        opened = [(_opened(stack, part.path), part) for part in parts]
        at = 0
        for descriptor, part in opened:
            first, last = max(span.start - at, 0), min(span.stop - at, part.size_bytes)
            while first < last:
                piece = os.pread(descriptor, min(PIECE_BYTES, last - first), first)
                if not piece:
                    raise OSError(f"{part.path.name} has become shorter meanwhile")
                # What was sent is not wanted again: the race's own files stay in memory instead.
                os.posix_fadvise(descriptor, first, len(piece), os.POSIX_FADV_DONTNEED)
                first += len(piece)
                yield piece
            at += part.size_bytes


def zipped(members: Sequence[Member]) -> Iterator[bytes]:
    """A zip of `members` piece by piece, stored as they are: recordings are packed already. Raises OSError."""
    out = _Out()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:  # type: ignore[call-overload]
        for member in members:
            info = zipfile.ZipInfo(member.name, _zip_time(member.modified_ns))
            info.external_attr = 0o644 << 16
            size_bytes = sum(part.size_bytes for part in member.parts)
            with archive.open(info, "w", force_zip64=True) as entry:
                for piece in pieces(member.parts, Span(start=0, stop=size_bytes)):
                    entry.write(piece)
                    yield out.taken()
    yield out.taken()


class _Out:
    """Where the zip is written to: what was written since it was last taken."""

    def __init__(self) -> None:
        self._written: list[bytes] = []

    def write(self, data: bytes) -> int:
        """Keeps it."""
        self._written.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing."""

    def taken(self) -> bytes:
        """All since the last time."""
        written, self._written = self._written, []
        return b"".join(written)


def _opened(stack: ExitStack, path: Path) -> int:
    flags = os.O_RDONLY | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags)
    except FileNotFoundError:
        if not path.name.endswith(PART_SUFFIX):
            raise
        descriptor = os.open(path.with_name(path.name.removesuffix(PART_SUFFIX)), flags)
    stack.callback(os.close, descriptor)
    return descriptor


def _zip_time(modified_ns: int) -> tuple[int, int, int, int, int, int]:
    when = datetime.fromtimestamp(modified_ns / 1e9, tz=UTC)
    if when.year < _FIRST_ZIP_YEAR:
        # A box without a clock of its own.
        return (_FIRST_ZIP_YEAR, 1, 1, 0, 0, 0)
    if when.year > _LAST_ZIP_YEAR:
        return (_LAST_ZIP_YEAR, 12, 31, 23, 59, 58)
    return (when.year, when.month, when.day, when.hour, when.minute, when.second)
