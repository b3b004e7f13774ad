"""The recorded picture nearest to a moment, found through the files' own indexes: no recording is read through for it.

Knows the files of a recording and the rings of pictures beside them. A file that is still being written has no index, and its
pictures are found when it is finished.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk

from dnb_edge import wire
from dnb_edge.errors import InputError
from dnb_edge.record.chain import chain_of, read_head
from dnb_edge.record.channels import IMAGE_NOTE_TOPIC, IMAGE_TOPIC, ImageNote
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.names import pictures_files
from dnb_edge.record.reader import frame_of
from dnb_edge.values import Frame

NEAR_NS = 500_000_000
"""A picture further from the moment than this shows something else."""

_OPCODE_AND_LENGTH_BYTES = 9
"""In front of each record's body."""


def picture_near(recording: Path, t_ns: int, *, within_ns: int = NEAR_NS) -> Frame | None:
    """The picture nearest to `t_ns`, the source's clock; None where none was kept within `within_ns` of it.

    Raises `InputError` where a file cannot be read.
    """
    own = (*chain_of(read_head(recording)).earlier, recording)
    files = (file for one in own for file in (one, *pictures_files(one)))
    found = [_nearest(file, t_ns, within_ns) for file in files if not file.name.endswith(PART_SUFFIX)]
    frames = [frame for frame in found if frame is not None]
    return min(frames, key=lambda frame: abs(frame.t_ns - t_ns), default=None)


def _nearest(file: Path, t_ns: int, within_ns: int) -> Frame | None:
    """The nearest picture of one file."""
    best: tuple[ImageNote, bytes] | None = None
    notes: dict[int, ImageNote] = {}
    try:
        with file.open("rb") as stream:
            for topic, message in _messages(stream, t_ns - within_ns, t_ns + within_ns):
                if topic == IMAGE_NOTE_TOPIC:
                    notes[message.log_time] = wire.from_json(ImageNote, message.data)
                elif (note := notes.get(message.log_time)) is not None and (
                    best is None or abs(note.t_ns - t_ns) < abs(best[0].t_ns - t_ns)
                ):
                    best = note, message.data
            return None if best is None else frame_of(*best)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from error
    except (McapError, ValueError, TypeError, KeyError, struct.error) as error:
        raise InputError(f"{file}: its pictures cannot be read: {error}") from error


def _messages(stream: BinaryIO, first_ns: int, last_ns: int) -> Iterator[tuple[str, Message]]:
    """Pictures and their notes of that time, in the order of the file; none where it has no index."""
    summary = make_reader(stream).get_summary()
    if summary is None:
        return
    topics = {key: one.topic for key, one in summary.channels.items() if one.topic in (IMAGE_NOTE_TOPIC, IMAGE_TOPIC)}
    for place in sorted(summary.chunk_indexes, key=lambda one: one.chunk_start_offset):
        if place.message_end_time < first_ns or place.message_start_time > last_ns:
            continue
        if topics.keys().isdisjoint(place.message_index_offsets):
            continue
        stream.seek(place.chunk_start_offset + _OPCODE_AND_LENGTH_BYTES)
        for record in breakup_chunk(Chunk.read(ReadDataStream(stream))):
            if isinstance(record, Message) and record.channel_id in topics and first_ns <= record.log_time <= last_ns:
                yield topics[record.channel_id], record
