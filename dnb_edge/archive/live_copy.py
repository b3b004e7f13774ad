"""A valid finished copy of a recording that is still being written: its whole records so far, and an end for them.

The file itself is only read. Whoever hands out the copy sends its first `data_bytes` bytes and then `end`: what stands there
already never changes. Knows the container; knows nothing of who wants the copy.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Metadata

from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.record.header import SETUP_NAME
from dnb_edge.record.layout import Layout
from dnb_edge.record.scan import LinearReader, has_chunk_behind

COPY_METADATA_NAME = "dnb-edge/copy"
"""Metadata record in a copy: the file it is `from` and how many `bytes` that had."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CopyEnd:
    """What makes the beginning of a recording a whole one."""

    data_bytes: int
    """How much of the file comes first."""
    end: bytes
    """What comes then: index and footer."""


def copy_end(path: Path, *, growing: bool) -> CopyEnd:
    """The end for a copy of the recording at `path` as it is now; `growing` while somebody writes it.

    Reads all of it once, a record at a time. Raises `TemporaryFault` where it has only just begun, `InputError` where it cannot
    be read or is damaged inside.
    """
    layout, has_setup = Layout(), False
    reader = LinearReader(
        path, topics=(), whole=lambda offset, opcode, body: layout.whole(offset, opcode, body, reader.checksum)
    )
    try:
        for record in reader.records():
            layout.described(record)
            has_setup = has_setup or (isinstance(record, Attachment) and record.name == SETUP_NAME)
        torn = reader.bad_parts > 0 or not layout.is_right or "" in reader.tally.counts
        if not growing and not torn and not reader.complete:
            torn = has_chunk_behind(path, reader.last_record + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if not has_setup:
        raise TemporaryFault(f"{path.name}: has only just begun: try again in a moment")
    if torn:
        raise InputError(f"{path}: the recording is damaged inside: run `dnb-edge runs recover {path}`")
    note = {"from": path.name, "bytes": str(reader.good_bytes)}
    end = layout.end(reader.tally, Metadata(name=COPY_METADATA_NAME, metadata=note))
    return CopyEnd(data_bytes=layout.data_end, end=end)
