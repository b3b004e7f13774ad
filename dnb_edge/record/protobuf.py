"""One field out of a protobuf message, without a protobuf library: enough to read our own pictures back.

Knows the wire format (https://protobuf.dev/programming-guides/encoding/) as far as bytes fields need it.
"""

from __future__ import annotations

VARINT, FIXED64, LENGTH_DELIMITED, FIXED32 = 0, 1, 2, 5


def bytes_field(message: bytes, number: int) -> bytes:
    """The last length-delimited field `number`; empty where absent, as protobuf has it. Raises ValueError."""
    found, offset = b"", 0
    while offset < len(message):
        tag, offset = _varint(message, offset)
        kind = tag & 7
        if kind == VARINT:
            _, offset = _varint(message, offset)
        elif kind in (FIXED64, FIXED32):
            offset += 8 if kind == FIXED64 else 4
        elif kind == LENGTH_DELIMITED:
            length, offset = _varint(message, offset)
            if offset + length > len(message):
                raise ValueError("a field is longer than its message")
            if tag >> 3 == number:
                found = message[offset : offset + length]
            offset += length
        else:
            raise ValueError(f"unknown wire type {kind}")
    return found


def _varint(message: bytes, offset: int) -> tuple[int, int]:
    """The number at `offset`, and the offset behind it."""
    value = 0
    for index in range(10):
        if offset + index >= len(message):
            break
        byte = message[offset + index]
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value, offset + index + 1
    raise ValueError("a number does not end")
