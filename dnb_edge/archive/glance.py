"""A quick look into a recording's file: which topics it has, how many messages, and in which chunks they stand.

Reads the index at the end of a finished file; hops from record to record through one that is still being written, and goes on
next time from where it came to. Unpacks no more chunks than somebody wants messages of. Knows the MCAP container
(https://mcap.dev/spec) and nothing of what messages mean; checks no more than it needs: `record.reader` checks all.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Message, Statistics, SummaryOffset

from dnb_edge.errors import InputError
from dnb_edge.record.scan import MAGIC, MAX_RECORD_BYTES, Tally, chunk_records

_HEAD = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY_BYTES = 16
_FOOTER = struct.Struct("<BQQQI")
_END_BYTES = _FOOTER.size + len(MAGIC)
_MOST_SUMMARY_BYTES = 256 * 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkPlace:
    """Where a chunk stands and what is in it."""

    offset: int
    """Of its record."""
    start_t_ns: int
    end_t_ns: int
    counts: tuple[tuple[int, int], ...]
    """(channel, messages of it); with 0 messages where the index does not say how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """What a file holds, by its index."""

    topics: dict[int, str]
    """By channel."""
    counts: dict[str, int]
    """Messages by topic."""
    first_t_ns: int | None
    """Lowest stamp, the source's clock; None where there is no message."""
    last_t_ns: int | None
    complete: bool
    """False where the file does not end as a finished one does: it is being written, or was cut short."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Walked:
    """How far somebody walked through a file without an end, and what was there."""

    offset: int = len(MAGIC)
    topics: dict[int, str] = field(default_factory=dict)
    chunks: tuple[ChunkPlace, ...] = ()

    def contents(self) -> Contents:
        """What was there."""
        counts: dict[str, int] = {}
        for chunk in self.chunks:
            for channel, count in chunk.counts:
                topic = self.topics.get(channel, "")
                counts[topic] = counts.get(topic, 0) + count
        stamps = [(chunk.start_t_ns, chunk.end_t_ns) for chunk in self.chunks if chunk.counts]
        return Contents(
            topics=self.topics,
            counts=counts,
            first_t_ns=min((start for start, _ in stamps), default=None),
            last_t_ns=max((end for _, end in stamps), default=None),
            complete=False,
        )


def glance(path: Path) -> Contents | None:
    """What the finished file at `path` holds; None where it does not end as one does.

    Raises `InputError` where it cannot be read, or its index is wrong.
    """
    with _opened(path) as stream:
        groups = _groups(stream)
        return None if groups is None else _by_statistics(stream, groups)


def chunks_of(path: Path) -> tuple[ChunkPlace, ...] | None:
    """The chunks of the finished file at `path`, in order; as `glance` otherwise."""
    with _opened(path) as stream:
        groups = _groups(stream)
        return None if groups is None else _by_chunk_indexes(stream, groups)


def walk(path: Path, before: Walked | None = None) -> tuple[Walked, Walked]:
    """(from where to go on next time, all that is there now) of a file without an end.

    `before` is what the last walk through the same file gave to go on from. Raises `InputError` where it cannot be read.
    """
    with _opened(path) as stream:
        return _walk(stream, before if before is not None else Walked())


def messages(
    path: Path, topics: dict[int, str], chunks: Iterable[ChunkPlace], wanted: Collection[str]
) -> Iterator[tuple[ChunkPlace, str, Message]]:
    """The messages of the `wanted` topics in these chunks, with their chunk and topic, in the file's order.

    `topics` are the file's, by channel. Raises `InputError` where the file cannot be read or a chunk is damaged.
    """
    channels = {channel for channel, topic in topics.items() if topic in wanted}
    with _opened(path) as stream:
        for chunk in chunks:
            if not any(channel in channels for channel, _ in chunk.counts):
                continue
            tally = Tally(wanted)
            for channel in channels:
                tally.channel(Channel(id=channel, topic=topics[channel], message_encoding="", metadata={}, schema_id=0))
            for record in chunk_records(_chunk_body(stream, chunk.offset), tally):
                if isinstance(record, Message):
                    yield chunk, tally.topic(record.channel_id) or "", record


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with path.open("rb") as stream:
            yield stream
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such recording") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (McapError, ValueError, struct.error, KeyError) as error:
        raise InputError(f"{path}: damaged inside: run `dnb-edge runs recover {path}`") from error


def _groups(stream: BinaryIO) -> dict[int, tuple[int, int]] | None:
    """(offset, length) of each group of records in the summary, by their kind; None where the file has no end."""
    size = stream.seek(0, io.SEEK_END)
    if size < len(MAGIC) + _END_BYTES:
        return None
    stream.seek(size - _END_BYTES)
    end = stream.read(_END_BYTES)
    opcode, length, start, offsets_start, _ = _FOOTER.unpack(end[: _FOOTER.size])
    if end[_FOOTER.size :] != MAGIC or opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size:
        return None
    last = size - _END_BYTES
    if not 0 < start <= offsets_start <= last:
        # Somebody else's file, without an index.
        return None
    found: dict[int, tuple[int, int]] = {}
    for body in _bodies(stream, offsets_start, last - offsets_start, Opcode.SUMMARY_OFFSET):
        offset = SummaryOffset.read(ReadDataStream(io.BytesIO(body)))
        if not start <= offset.group_start <= offset.group_start + offset.group_length <= last:
            raise ValueError("a group of the summary lies outside of it")
        found[offset.group_opcode] = (offset.group_start, offset.group_length)
    return found


def _by_statistics(stream: BinaryIO, groups: dict[int, tuple[int, int]]) -> Contents:
    topics = _topics(stream, groups)
    body = next(_bodies(stream, *groups[Opcode.STATISTICS], Opcode.STATISTICS), None)
    if body is None:
        raise ValueError("no statistics")
    statistics = Statistics.read(ReadDataStream(io.BytesIO(body)))
    counts: dict[str, int] = {}
    for channel, count in statistics.channel_message_counts.items():
        topic = topics.get(channel, "")
        counts[topic] = counts.get(topic, 0) + count
    any_message = statistics.message_count > 0
    return Contents(
        topics=topics,
        counts=counts,
        first_t_ns=statistics.message_start_time if any_message else None,
        last_t_ns=statistics.message_end_time if any_message else None,
        complete=True,
    )


def _topics(stream: BinaryIO, groups: dict[int, tuple[int, int]]) -> dict[int, str]:
    topics = {}
    for body in _bodies(stream, *groups.get(Opcode.CHANNEL, (0, 0)), Opcode.CHANNEL):
        channel = Channel.read(ReadDataStream(io.BytesIO(body)))
        topics[channel.id] = channel.topic
    return topics


def _by_chunk_indexes(stream: BinaryIO, groups: dict[int, tuple[int, int]]) -> tuple[ChunkPlace, ...]:
    found = []
    for body in _bodies(stream, *groups.get(Opcode.CHUNK_INDEX, (0, 0)), Opcode.CHUNK_INDEX):
        index = ChunkIndex.read(ReadDataStream(io.BytesIO(body)))
        found.append(
            ChunkPlace(
                offset=index.chunk_start_offset,
                start_t_ns=index.message_start_time,
                end_t_ns=index.message_end_time,
                counts=tuple((channel, 0) for channel in index.message_index_offsets),
            )
        )
    return tuple(sorted(found, key=lambda chunk: chunk.offset))


def _bodies(stream: BinaryIO, offset: int, length: int, wanted: int) -> Iterator[bytes]:
    """The bodies of the records of this kind in a part of the file that holds nothing else."""
    if length > _MOST_SUMMARY_BYTES:
        raise ValueError("the summary is longer than any that is read")
    stream.seek(offset)
    part = stream.read(length)
    at = 0
    while at < len(part):
        opcode, size = _HEAD.unpack_from(part, at)
        at += _HEAD.size + size
        if at > len(part):
            raise ValueError("a record of the summary is cut short")
        if opcode == wanted:
            yield part[at - size : at]


def _walk(stream: BinaryIO, before: Walked) -> tuple[Walked, Walked]:
    """Hops over the records. The last chunk is looked at again next time: its message indexes may not all be there yet."""
    size = stream.seek(0, io.SEEK_END)
    offset, chunk_at, counts = before.offset, None, list[tuple[int, int]]()
    topics, chunks = dict(before.topics), list(before.chunks)
    # Where to go on next time: the offset, and how many chunks stand before it.
    going_on = before.offset, len(chunks)

    def walked(at: int) -> tuple[Walked, Walked]:
        return (
            Walked(offset=going_on[0], topics=dict(topics), chunks=tuple(chunks[: going_on[1]])),
            Walked(offset=at, topics=topics, chunks=tuple(chunks)),
        )

    stream.seek(offset)
    while True:
        head = stream.read(_HEAD.size)
        opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, 0)
        whole = opcode != 0 and length <= MAX_RECORD_BYTES and offset + _HEAD.size + length <= size
        if chunk_at is not None and not (whole and opcode == Opcode.MESSAGE_INDEX):
            # Of the last chunk not all message indexes may be there yet.
            counts = counts if whole else []
            if not _learned(stream, chunk_at, counts, topics):
                return walked(chunk_at)
            start_t_ns, end_t_ns = _times(stream, chunk_at)
            chunks.append(ChunkPlace(offset=chunk_at, start_t_ns=start_t_ns, end_t_ns=end_t_ns, counts=tuple(counts)))
            if whole:
                going_on = offset, len(chunks)
            chunk_at, counts = None, []
            stream.seek(offset + _HEAD.size)
        if not whole or opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return walked(offset)
        if opcode == Opcode.CHUNK:
            chunk_at = offset
        elif opcode == Opcode.MESSAGE_INDEX and chunk_at is not None:
            channel, entries_bytes = _INDEX_HEAD.unpack(stream.read(_INDEX_HEAD.size))
            counts.append((channel, entries_bytes // _INDEX_ENTRY_BYTES))
        offset += _HEAD.size + length
        stream.seek(offset)


def _learned(stream: BinaryIO, offset: int, counts: list[tuple[int, int]], topics: dict[int, str]) -> bool:
    """Fills in what nobody said yet about a chunk: its channels' topics, and what is in it where no index followed.

    False where the chunk is not whole: a power cut tore what came last.
    """
    if counts and all(channel in topics for channel, _ in counts):
        return True
    tally = Tally(())
    try:
        records = chunk_records(_chunk_body(stream, offset), tally)
    except ValueError:
        return False
    topics |= {record.id: record.topic for record in records if isinstance(record, Channel)}
    counts[:] = sorted(tally.by_channel.items())
    return True


def _times(stream: BinaryIO, offset: int) -> tuple[int, int]:
    stream.seek(offset + _HEAD.size)
    start_t_ns, end_t_ns = _CHUNK_TIMES.unpack(stream.read(_CHUNK_TIMES.size))
    return start_t_ns, end_t_ns


def _chunk_body(stream: BinaryIO, offset: int) -> bytes:
    stream.seek(offset)
    opcode, length = _HEAD.unpack(stream.read(_HEAD.size))
    if opcode != Opcode.CHUNK or length > MAX_RECORD_BYTES:
        raise ValueError("no chunk stands where one should")
    return stream.read(length)
