"""Which files are one recording: a run that was cut short and went on in another file, or one that was split on purpose.

Knows how a file names the one before it: the member `resumed_from` of its header, or the metadata record
`dnb-edge/continues`. Reads no more than the head of each file; knows nothing of detections and events.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema

from dnb_edge.errors import InputError
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.header import CONTINUES_METADATA_NAME, SETUP_NAME, RunHeader, header_from_json
from dnb_edge.record.scan import LinearReader

MOST_NAME_BYTES = 200
"""Of a file's name; file systems end at 255."""
_PREVIOUS = "previous"


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """What a file says before its first message."""

    path: Path
    header: RunHeader
    previous: str | None
    """Name of the file that it goes on from, as that is called when it is finished; None where it is a recording's first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """A file with those that it goes on from."""

    earlier: tuple[Path, ...]
    """Oldest first; one that was never finished under its `.part` name."""
    missing: str | None
    """Name of the file that should come first and is not there; None where nothing is missing."""


def read_head(path: Path) -> Head:
    """What the recording at `path` says before its first message, finished or not. Raises InputError where that is nothing."""
    header: RunHeader | None = None
    previous: str | None = None
    reader = LinearReader(path, topics=())
    try:
        for record in reader.records():
            match record:
                case Attachment(name=name, data=data) if name == SETUP_NAME and header is None:
                    header = header_from_json(data)
                case Metadata(name=name, metadata=metadata) if name == CONTINUES_METADATA_NAME:
                    previous = metadata.get(_PREVIOUS)
                case Schema() | Channel() | Message():
                    # They stand in chunks, which come after all that is of interest here.
                    break
                case _:
                    pass
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    if not reader.is_mcap:
        raise InputError(f"{path}: not an MCAP file")
    if header is None:
        raise InputError(f"{path}: not a recording of dnb-edge: it has no {SETUP_NAME}")
    return Head(path=path, header=header, previous=previous if previous is not None else header.resumed_from)


def chain_of(head: Head, places: Sequence[Path] = ()) -> Chain:
    """The files that a recording goes on from, which lie beside it, or else in one of the directories `places`."""
    earlier: list[Path] = []
    name, seen = head.previous, {head.path}
    while name is not None:
        path = _found((head.path.parent, *places), name)
        if path is None or path in seen:
            return Chain(earlier=tuple(reversed(earlier)), missing=name)
        try:
            before = read_head(path)
        except InputError:
            return Chain(earlier=tuple(reversed(earlier)), missing=name)
        earlier.append(path)
        seen.add(path)
        name = before.previous
    return Chain(earlier=tuple(reversed(earlier)), missing=None)


def continued(paths: Iterable[Path]) -> dict[Path, Path]:
    """Which of these recordings are read with which other one of them, the last in a chain, since that goes on from them.

    Of one that cannot be read its reader says why.
    """
    known = sorted(paths)
    found: dict[Path, Path] = {}
    for path in known:
        try:
            chain = chain_of(read_head(path))
        except InputError:
            continue
        found |= {before: path for before in chain.earlier if before in known}
    return found


def _found(places: Iterable[Path], name: str) -> Path | None:
    """The file called `name` in the first place that has it, finished or not; None where none has, or it leads elsewhere."""
    if not name or Path(name).name != name or "\0" in name or len(name.encode(errors="replace")) > MOST_NAME_BYTES:
        return None
    paths = (place / one for place in places for one in (name, name + PART_SUFFIX))
    return next((path for path in paths if path.is_file()), None)
