"""Ending a recording that was cut short, where it stands: whole records stay as they are, the torn end gives way to an index.

Takes a few seconds for an hour of recording and hardly any room. Whatever happens meanwhile, no whole record is touched, so
that it can be done anew. Knows when this is not enough: then `recover` copies.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Metadata

from dnb_edge.errors import WorkError
from dnb_edge.record.durable import sync_directory
from dnb_edge.record.header import RECOVERY_METADATA_NAME, SETUP_NAME
from dnb_edge.record.layout import Layout
from dnb_edge.record.scan import LinearReader, has_chunk_behind

MOST_CUT_BYTES = 8 * 1024 * 1024
"""A torn end longer than this is more than a power cut leaves: the file as it is must be kept then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """What was in the file."""

    counts: dict[str, int]
    """Messages by topic."""
    cut_bytes: int
    """Bytes of the torn end."""


def finish_in_place(path: Path, final: Path) -> Finished | None:
    """End the recording at `path` and call it `final`; None, and nothing done, where it must be copied instead.

    The caller holds its lock. Raises OSError where it cannot be read, WorkError where it cannot be written.
    """
    layout, has_setup = Layout(), False
    reader = LinearReader(
        path, topics=(), whole=lambda offset, opcode, body: layout.whole(offset, opcode, body, reader.checksum)
    )
    for record in reader.records():
        layout.described(record)
        has_setup = has_setup or (isinstance(record, Attachment) and record.name == SETUP_NAME)
    size_bytes = path.stat().st_size
    if reader.bad_parts or not has_setup or not layout.is_right or "" in reader.tally.counts:
        return None
    if size_bytes - reader.good_bytes > MOST_CUT_BYTES:
        return None
    if not reader.complete and has_chunk_behind(path, reader.last_record + 1):
        # The file is damaged inside, not only at its end; the last record's length may be what is wrong.
        return None
    try:
        if not reader.complete:
            origin = {"from": path.name, "bad_parts": "0", "orphans": "0"}
            _end(path, layout, layout.end(reader.tally, Metadata(name=RECOVERY_METADATA_NAME, metadata=origin)))
        path.rename(final)
        sync_directory(final.parent)
    except OSError as error:
        raise WorkError(f"{path}: cannot be finished: {error.strerror}") from error
    return Finished(counts=reader.tally.counts, cut_bytes=0 if reader.complete else size_bytes - reader.good_bytes)


def _end(path: Path, layout: Layout, end: bytes) -> None:
    """Put `end` behind the last whole record. The file keeps its date: by it the oldest recordings are told."""
    before = path.stat()
    descriptor = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    try:
        os.ftruncate(descriptor, layout.data_end)
        os.lseek(descriptor, 0, os.SEEK_END)
        rest = memoryview(end)
        while rest:
            rest = rest[os.write(descriptor, rest) :]
        os.utime(descriptor, ns=(before.st_atime_ns, before.st_mtime_ns))
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
