"""Finding the next whole chunk behind a spot of a damaged file that makes no sense.

Knows where a chunk's compression stands in its record (https://mcap.dev/spec) and looks for that. Knows nothing of what a
chunk holds: who asks says whether one is whole.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import BinaryIO

from mcap.opcode import Opcode

_MARK = b"\x04\x00\x00\x00zstd"
"""The compression of all our chunks, with its length before it."""
_START = struct.Struct("<BQQQQI")
"""Of a chunk up to that mark: opcode, length of the record, start, end, size of the content, its CRC-32."""
_HEAD_BYTES = 9
_BLOCK_BYTES = 1024 * 1024

MOST_LENGTH_BYTES = 64 * 1024 * 1024
"""Of a chunk's record; ours hold 256 KiB and at most one message more."""

MOST_WORK_BYTES = 256 * 1024 * 1024
"""So much is read and unpacked in vain before the search is given up: hostile files may be all beginnings of chunks."""


def next_chunk(stream: BinaryIO, start: int, size: int, is_whole: Callable[[bytes], bool]) -> int | None:
    """Offset of the first chunk at or behind `start` whose body `is_whole`, in a file of `size` bytes; None for none.

    Leaves `stream` anywhere. Raises OSError.
    """
    at, work = start + _START.size, 0
    while at < size and work <= MOST_WORK_BYTES:
        stream.seek(at)
        block = stream.read(_BLOCK_BYTES)
        found = block.find(_MARK)
        if found < 0:
            at += max(1, len(block) - len(_MARK) + 1)
            continue
        candidate = at + found - _START.size
        stream.seek(candidate)
        opcode, length, _, _, content_bytes, checksum = _START.unpack(stream.read(_START.size))
        # Without a checksum nobody knows whether these bytes ever were a chunk.
        left = size - candidate - _HEAD_BYTES
        if opcode == Opcode.CHUNK and checksum and length <= min(left, MOST_LENGTH_BYTES):
            work += length + content_bytes
            stream.seek(candidate + _HEAD_BYTES)
            if work <= MOST_WORK_BYTES and is_whole(stream.read(length)):
                return candidate
        at += found + 1
        work += len(block)
    return None
