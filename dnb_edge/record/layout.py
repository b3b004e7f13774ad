"""Where everything stands in an MCAP file, so that one that was cut short can be ended where it stands.

Knows the container's index records (https://mcap.dev/spec). Takes each whole record from the linear reader and makes of them
the end that the file's writer would have written. Knows nothing of what messages mean.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections import deque
from dataclasses import dataclass, field

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from dnb_edge.record.scan import MAGIC, Record, Tally, message_indexes

CHECKED_CHUNKS = 64
"""Chunks at the end whose message indexes are compared with their messages: a power cut may have torn what came last."""

_RECORD_HEAD_BYTES = 9
_CHUNK_HEAD = struct.Struct("<QQQII")


@dataclass(slots=True)
class _Tail:
    """A chunk near the end, with the message indexes that followed it."""

    body: bytes
    end: int
    checksum: int
    indexes: list[bytes] = field(default_factory=list)

    @property
    def is_right(self) -> bool:
        try:
            found = [MessageIndex.read(ReadDataStream(io.BytesIO(body))) for body in self.indexes]
        except (McapError, struct.error):
            return False
        return {index.channel_id: sorted(index.records) for index in found} == {
            channel_id: sorted(entries) for channel_id, entries in message_indexes(self.body).items()
        }


class Layout:
    """Everything that stands in the file's data section, in order."""

    def __init__(self) -> None:
        self.data_end = 0
        """Where the data section ends, as far as it is whole."""
        self.checksum = zlib.crc32(MAGIC)
        """CRC-32 up to there."""
        self._ended = False
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._tail: deque[_Tail] = deque(maxlen=CHECKED_CHUNKS)

    def described(self, record: Record) -> None:
        """Takes note of a schema or a channel."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record

    def whole(self, offset: int, opcode: int, body: bytes, checksum_before: int) -> None:
        """Takes note of one record that stands at `offset`."""
        self._ended = self._ended or opcode == Opcode.DATA_END
        if self._ended:
            # The summary is made anew.
            return
        length = _RECORD_HEAD_BYTES + len(body)
        checksum = zlib.crc32(body, zlib.crc32(struct.pack("<BQ", opcode, len(body)), checksum_before))
        self.data_end, self.checksum = offset + length, checksum
        if opcode == Opcode.CHUNK:
            self._chunks.append(_chunk_index(offset, body))
            self._tail.append(_Tail(body, self.data_end, checksum))
        elif opcode == Opcode.MESSAGE_INDEX and self._chunks:
            self._chunks[-1].message_index_offsets[int.from_bytes(body[:2], "little")] = offset
            self._chunks[-1].message_index_length += length
            self._tail[-1].indexes.append(body)
        elif opcode == Opcode.ATTACHMENT:
            self._attachments.append(_attachment_index(offset, body))
        elif opcode == Opcode.METADATA:
            name = Metadata.read(ReadDataStream(io.BytesIO(body))).name
            self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))

    @property
    def is_right(self) -> bool:
        """Whether the message indexes near the end fit their chunks; those of the last chunk need not, they are made anew."""
        return all(tail.is_right for tail in list(self._tail)[:-1])

    def end(self, tally: Tally, note: Metadata) -> bytes:
        """What must follow `data_end` to make the file a whole one, with `note` as its last record. May lower `data_end`."""
        data = b""
        if self._tail and not self._tail[-1].is_right:
            data = self._last_indexes(self._tail[-1])
        at = self.data_end + len(data)
        body = _written(note)
        self._metadata.append(MetadataIndex(offset=at, length=len(body), name=note.name))
        data += body
        checksum = zlib.crc32(data, self.checksum)
        data += _written(DataEnd(data_section_crc=checksum))
        return data + self._summary(self.data_end + len(data), tally) + MAGIC

    def _last_indexes(self, tail: _Tail) -> bytes:
        """The last chunk's message indexes, which stand behind it instead of those that were cut short."""
        self.data_end, self.checksum = tail.end, tail.checksum
        chunk, data = self._chunks[-1], b""
        chunk.message_index_offsets.clear()
        for channel_id, entries in message_indexes(tail.body).items():
            chunk.message_index_offsets[channel_id] = tail.end + len(data)
            data += _written(MessageIndex(channel_id=channel_id, records=entries))
        chunk.message_index_length = len(data)
        return data

    def _summary(self, start: int, tally: Tally) -> bytes:
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=tally.by_channel,
            chunk_count=len(self._chunks),
            message_count=sum(tally.by_channel.values()),
            message_end_time=tally.last_t_ns or 0,
            message_start_time=tally.first_t_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        summary, offsets = b"", b""
        groups = (
            (Opcode.SCHEMA, self._schemas.values()),
            (Opcode.CHANNEL, self._channels.values()),
            (Opcode.STATISTICS, (statistics,)),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        for opcode, records in groups:
            group = b"".join(map(_written, records))
            if group:
                offset = SummaryOffset(group_opcode=opcode, group_start=start + len(summary), group_length=len(group))
                offsets += _written(offset)
            summary += group
        offsets_start = start + len(summary)
        summary += offsets
        # The checksum covers the footer as well, up to itself.
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offsets_start)
        footer = Footer(
            summary_start=start, summary_offset_start=offsets_start, summary_crc=zlib.crc32(head, zlib.crc32(summary))
        )
        return summary + _written(footer)


def _chunk_index(offset: int, body: bytes) -> ChunkIndex:
    start, end, uncompressed_size, _, name_length = _CHUNK_HEAD.unpack_from(body)
    name_end = _CHUNK_HEAD.size + name_length
    (compressed_size,) = struct.unpack_from("<Q", body, name_end)
    return ChunkIndex(
        chunk_length=_RECORD_HEAD_BYTES + len(body),
        chunk_start_offset=offset,
        compression=body[_CHUNK_HEAD.size : name_end].decode(),
        compressed_size=compressed_size,
        message_end_time=end,
        message_index_length=0,
        message_index_offsets={},
        message_start_time=start,
        uncompressed_size=uncompressed_size,
    )


def _attachment_index(offset: int, body: bytes) -> AttachmentIndex:
    attachment = Attachment.read(ReadDataStream(io.BytesIO(body)))
    return AttachmentIndex(
        offset=offset,
        length=_RECORD_HEAD_BYTES + len(body),
        log_time=attachment.log_time,
        create_time=attachment.create_time,
        data_size=len(attachment.data),
        name=attachment.name,
        media_type=attachment.media_type,
    )


def _written(
    record: (
        Schema
        | Channel
        | Statistics
        | ChunkIndex
        | AttachmentIndex
        | MetadataIndex
        | MessageIndex
        | SummaryOffset
        | Metadata
        | DataEnd
        | Footer
    ),
) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
