"""Linear reading of an MCAP file that may be cut short, torn or hostile: every record that is whole, then what was wrong.

Knows the MCAP container (https://mcap.dev/spec) and nothing of what the messages mean. The stock readers serve whole files
well and read nothing of a truncated one, check no CRC unless asked, and size buffers by what the file claims. Here every
length is checked against the bytes that are there, a chunk is decompressed no further than a cap, and nothing of a chunk
is given out before its CRC is right.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema

from dnb_edge.record.resync import next_chunk

MAGIC = b"\x89MCAP0\r\n"
MAX_RECORD_BYTES = 256 * 1024 * 1024
MAX_CHUNK_BYTES = 64 * 1024 * 1024
"""Decompressed. Our own chunks hold 256 KiB and at most one message more."""
MAX_CHUNK_RECORDS = 100_000
"""In one chunk: 256 KiB hold 8,500 of the shortest messages; a few kilobytes of compressed nothing would hold millions."""
MAX_NOTE_BYTES = 1024 * 1024
"""Of a schema, a channel or metadata: what they hold takes many times its size in memory. Ours have a few kilobytes."""

_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_NO_RECORD = "not a record"

Record = Header | Schema | Channel | Message | Attachment | Metadata

_READERS: dict[int, Callable[[ReadDataStream], Record]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
}

_NOTES = frozenset({Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA})

_PARSE_ERRORS = (McapError, struct.error, ValueError, OverflowError)
"""What the stock parsers raise on garbage; UnicodeDecodeError is a ValueError."""


class Tally:
    """How many messages there were, by topic, from when to when, and which of them are wanted."""

    def __init__(self, topics: Collection[str] | None) -> None:
        """`topics` are those that are wanted; None for all."""
        self._wanted = topics
        self._topics: dict[int, str] = {}
        self._wanted_ids: set[int] = set()
        self._counts: Counter[str] = Counter()
        self._open: dict[int, int] = {}
        self._told_again: Counter[int] = Counter()
        """Messages before the last description of their channel, which a file may repeat."""
        self.first_t_ns: int | None = None
        """Lowest log time of all messages; None where there was none."""
        self.last_t_ns: int | None = None

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic, wanted or not; those of unknown channels under an empty name."""
        counts = self._counts.copy()
        for channel_id, count in self._open.items():
            counts[self._topics.get(channel_id, "")] += count
        return dict(counts)

    @property
    def by_channel(self) -> dict[int, int]:
        """Messages by number of the channel."""
        return dict(Counter(self._open) + self._told_again)

    def channel(self, channel: Channel) -> None:
        """Takes note of a channel, before its messages."""
        # What came under this number before was of the topic that it had then.
        if channel.id in self._open:
            self._told_again[channel.id] += self._open[channel.id]
            self._counts[self._topics.get(channel.id, "")] += self._open.pop(channel.id)
        self._topics[channel.id] = channel.topic
        if self._wanted is not None and channel.topic in self._wanted:
            self._wanted_ids.add(channel.id)
        else:
            self._wanted_ids.discard(channel.id)

    def topic(self, channel_id: int) -> str | None:
        """The topic of a channel; None where nobody said it."""
        return self._topics.get(channel_id)

    def wants(self, channel_id: int, log_time: int) -> bool:
        """Counts one message; whether somebody wants it."""
        self._open[channel_id] = self._open.get(channel_id, 0) + 1
        if self.last_t_ns is None or self.first_t_ns is None:
            self.first_t_ns = self.last_t_ns = log_time
        elif log_time > self.last_t_ns:
            self.last_t_ns = log_time
        elif log_time < self.first_t_ns:
            self.first_t_ns = log_time
        return self._wanted is None or channel_id in self._wanted_ids


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """Where a file stops being right, and how."""

    offset: int
    reason: str
    truncated: bool
    """True where the file just ends too early; False where bytes are wrong."""


class _BadRecord(Exception):
    pass


class LinearReader:
    """Reads one file front to back, once. After `records` has ended, the other attributes say how it went."""

    def __init__(
        self,
        path: Path,
        *,
        skip_bad_parts: bool = False,
        topics: Collection[str] | None = None,
        whole: Callable[[int, int, bytes], None] | None = None,
    ) -> None:
        """Nothing is opened yet. `skip_bad_parts` goes on after a chunk whose content is wrong, and with the next
        whole chunk behind what is no record. With `topics`, messages of
        others are checked and counted like all, but not given out, which takes a tenth of the time. `whole` is told of each
        record as it stands in the file, once that has been checked: offset, opcode, body; `checksum` is of all before it.
        """
        self.path = path
        self._whole = whole
        self._skip_bad_parts = skip_bad_parts
        self._data_ended = False
        self.tally = Tally(topics)
        """The messages so far."""
        self.is_mcap = False
        self.complete = False
        """True where the file ends as it should: data end, footer, magic."""
        self.damage: Damage | None = None
        """The first thing wrong; None where nothing is, that is where `complete`."""
        self.bad_parts = 0
        self.good_bytes = 0
        """Length of the prefix of whole records."""
        self.last_record = 0
        """Offset of the last of them."""
        self.checksum = zlib.crc32(MAGIC)
        """CRC-32 of that prefix."""

    def records(self) -> Iterator[Record]:
        """Headers, schemas, channels, messages, attachments and metadata in the file's order. Raises OSError."""
        with self.path.open("rb") as stream:
            size = self.path.stat().st_size
            self.is_mcap = stream.read(len(MAGIC)) == MAGIC
            if not self.is_mcap:
                self._damaged(0, "no MCAP file", truncated=False)
                return
            self.good_bytes = len(MAGIC)
            ended, before = False, len(MAGIC)
            while not ended:
                offset = stream.tell()
                head = stream.read(9)
                fault = _fault_of(head, size - offset)
                if fault is not None:
                    # The length of the record before may be wrong: whole chunks may lie in what it spans.
                    found = self._found_behind(stream, before, size)
                    self._damaged(offset, fault, truncated=not found and fault != _NO_RECORD)
                    if not found:
                        return
                    self.bad_parts += 1
                    before = stream.tell()
                    continue
                before = offset
                opcode, length = _HEAD.unpack(head)
                body = stream.read(length)
                try:
                    yield from self._unfold(opcode, body)
                    if self._whole is not None:
                        self._whole(offset, opcode, body)
                    # A changed opcode or length can hide a whole record from the checks within records.
                    if opcode == Opcode.DATA_END and _stored_checksum(body) not in (0, self.checksum):
                        raise _BadRecord("the checksum over all data is wrong")
                except _BadRecord as error:
                    self._damaged(offset, str(error), truncated=False)
                    # A wrong checksum over all data says nothing new behind a part that is already known to be bad.
                    self.bad_parts += opcode != Opcode.DATA_END or self.bad_parts == 0
                    if opcode not in (Opcode.CHUNK, Opcode.DATA_END) and self._found_behind(stream, offset, size):
                        continue
                    if not self._skip_bad_parts or opcode not in (Opcode.CHUNK, Opcode.DATA_END):
                        return
                ended = opcode == Opcode.FOOTER
                self.checksum = zlib.crc32(body, zlib.crc32(head, self.checksum))
                self.good_bytes, self.last_record = stream.tell(), offset
            self._check_end(stream)

    def _found_behind(self, stream: BinaryIO, offset: int, size: int) -> bool:
        """Puts `stream` at the next whole chunk behind `offset`; False where there is none, or nobody wants it."""
        found = next_chunk(stream, offset + 1, size, _is_whole) if self._skip_bad_parts else None
        if found is not None:
            stream.seek(found)
        return found is not None

    def _unfold(self, opcode: int, body: bytes) -> Iterator[Record]:
        """What one top-level record holds: itself, a chunk's content, or nothing where it is only an index."""
        if opcode == Opcode.CHUNK:
            yield from _chunk_records(_parse_chunk(body), self.tally)
            return
        self._data_ended = self._data_ended or opcode == Opcode.DATA_END
        if opcode == Opcode.FOOTER and not self._data_ended:
            # Another record with a changed opcode: what lies behind it is not to be taken for nothing.
            raise _BadRecord("a footer stands before the end of the data")
        record = _parse(opcode, body)
        if isinstance(record, Attachment):
            _check_attachment(body)
        if isinstance(record, Channel):
            self.tally.channel(record)
        if record is not None and (
            not isinstance(record, Message) or self.tally.wants(record.channel_id, record.log_time)
        ):
            yield record

    def _check_end(self, stream: BinaryIO) -> None:
        offset = stream.tell()
        if stream.read(len(MAGIC)) != MAGIC:
            self._damaged(offset, "ends without its closing mark", truncated=True)
        elif self.damage is None:
            self.complete = True

    def _damaged(self, offset: int, reason: str, *, truncated: bool) -> None:
        if self.damage is None:
            self.damage = Damage(offset=offset, reason=reason, truncated=truncated)


def has_chunk_behind(path: Path, offset: int) -> bool:
    """Whether a whole chunk begins anywhere at or behind `offset`. Raises OSError."""
    with path.open("rb") as stream:
        return next_chunk(stream, offset, path.stat().st_size, _is_whole) is not None


def chunk_records(body: bytes, tally: Tally) -> tuple[Record, ...]:
    """What one chunk holds, by its record's body, as `LinearReader` gives it out: of the messages those that `tally` wants.

    For those who know by an index which chunk they want. Raises ValueError where anything in it is wrong.
    """
    try:
        return tuple(_chunk_records(_parse_chunk(body), tally))
    except _BadRecord as error:
        raise ValueError(str(error)) from error


def _is_whole(body: bytes) -> bool:
    """Whether a chunk's body is what was written."""
    try:
        chunk = _parse_chunk(body)
        return bool(chunk.uncompressed_crc == zlib.crc32(_decompress(chunk)))
    except _BadRecord:
        return False


def _fault_of(head: bytes, left_bytes: int) -> str | None:
    """What is wrong with a record that begins with `head`, `left_bytes` before the file's end; None where nothing shows."""
    if len(head) < _HEAD.size:
        return "ends without a footer"
    opcode, length = _HEAD.unpack(head)
    if opcode == 0 or length > MAX_RECORD_BYTES:
        return _NO_RECORD
    return "ends in the middle of a record" if _HEAD.size + length > left_bytes else None


def _parse(opcode: int, body: bytes) -> Record | None:
    """The record, or None where its kind only serves those who jump about in the file."""
    if opcode in _NOTES and len(body) > MAX_NOTE_BYTES:
        raise _BadRecord(
            f"a record of kind {opcode} has {len(body)} bytes, more than the {MAX_NOTE_BYTES} that are read"
        )
    try:
        if opcode == Opcode.MESSAGE:
            return _message(body)
        read = _READERS.get(opcode)
        record: Record | None = None if read is None else read(ReadDataStream(io.BytesIO(body)))
    except _PARSE_ERRORS as error:
        raise _BadRecord(f"a record of kind {opcode} cannot be read") from error
    return record


def _message(body: bytes) -> Message:
    channel_id, sequence, log_time, publish_time = struct.unpack_from("<HIQQ", body)
    return Message(
        channel_id=channel_id, sequence=sequence, log_time=log_time, publish_time=publish_time, data=body[22:]
    )


def _check_attachment(body: bytes) -> None:
    if _stored_checksum(body) not in (0, zlib.crc32(body[:-4])):
        raise _BadRecord("an attachment's checksum is wrong")


def _stored_checksum(body: bytes) -> int:
    """The CRC-32 in the last four bytes of `body`; 0 where none was stored."""
    try:
        (stored,) = struct.unpack("<I", body[-4:])
    except struct.error as error:
        raise _BadRecord("a checksum is missing") from error
    return int(stored)


def message_indexes(body: bytes) -> dict[int, list[tuple[int, int]]]:
    """Of a chunk that was read before, by its record's body: log time and offset of each message, by channel."""
    content, indexes, offset = _decompress(_parse_chunk(body)), dict[int, list[tuple[int, int]]](), 0
    while offset < len(content):
        opcode, length = _HEAD.unpack_from(content, offset)
        if opcode == Opcode.MESSAGE:
            channel_id, _, log_time, _ = _MESSAGE_HEAD.unpack_from(content, offset + _HEAD.size)
            indexes.setdefault(channel_id, []).append((log_time, offset))
        offset += _HEAD.size + length
    return indexes


def _parse_chunk(body: bytes) -> Chunk:
    try:
        chunk: Chunk = Chunk.read(ReadDataStream(io.BytesIO(body)))
    except _PARSE_ERRORS as error:
        raise _BadRecord("a chunk cannot be read") from error
    return chunk


def _chunk_records(chunk: Chunk, tally: Tally) -> Iterator[Record]:
    content = _decompress(chunk)
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise _BadRecord("a chunk's checksum is wrong")
    offset, end, count = 0, len(content), 0
    while offset < end:
        count += 1
        if count > MAX_CHUNK_RECORDS:
            raise _BadRecord(f"a chunk has more than the {MAX_CHUNK_RECORDS} records that are read")
        start = offset + _HEAD.size
        if start > end:
            raise _BadRecord("a chunk ends in the middle of a record")
        opcode, length = _HEAD.unpack_from(content, offset)
        offset = start + length
        if offset > end:
            raise _BadRecord("a chunk ends in the middle of a record")
        if opcode == Opcode.MESSAGE and length >= _MESSAGE_HEAD.size:
            channel_id, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(content, start)
            if tally.wants(channel_id, log_time):
                data = content[start + _MESSAGE_HEAD.size : offset]
                yield Message(channel_id, log_time, data, publish_time, sequence)
            continue
        record = _parse(opcode, content[start:offset])
        if isinstance(record, Channel):
            tally.channel(record)
        if record is not None:
            yield record


def _decompress(chunk: Chunk) -> bytes:
    """The chunk's content, exactly as long as it claims. Decompresses no byte beyond that, whatever the data holds."""
    size = chunk.uncompressed_size
    if size > MAX_CHUNK_BYTES:
        raise _BadRecord(f"a chunk claims {size} bytes, more than the {MAX_CHUNK_BYTES} that are read")
    if chunk.compression == "":
        content: bytes = chunk.data
    elif chunk.compression == "zstd":
        # Streaming: the one-shot call sizes its buffer by what the compressed data claims, not by the limit given.
        unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES)
        try:
            with unpacker.stream_reader(chunk.data) as reader:
                content = reader.read(size + 1)
        except zstandard.ZstdError as error:
            raise _BadRecord("a chunk cannot be decompressed") from error
    else:
        raise _BadRecord(f"a chunk is compressed by {chunk.compression}, which is not read here")
    if len(content) != size:
        raise _BadRecord("a chunk is not as long as it claims")
    return content
