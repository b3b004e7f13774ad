"""Damage to bytes that knows nothing of what they mean: flips, cuts, copies, and numbers at the edges of their range."""

import random
import struct

EDGES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
"""Values at which lengths, counts and offsets go wrong."""


def mutated(rng: random.Random, data: bytes, *, most: int = 4) -> bytes:
    """`data` after one to `most` random damages."""
    out = bytearray(data)
    for _ in range(rng.randint(1, most)):
        rng.choice(_DAMAGES)(rng, out)
    return bytes(out)


def _flip(rng: random.Random, out: bytearray) -> None:
    if out:
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)


def _byte(rng: random.Random, out: bytearray) -> None:
    if out:
        out[rng.randrange(len(out))] = rng.choice((0, 1, 9, 10, 13, 32, 0x7F, 0x80, 0xFE, 0xFF, rng.randrange(256)))


def _cut(rng: random.Random, out: bytearray) -> None:
    del out[rng.randint(0, len(out)) :]


def _remove(rng: random.Random, out: bytearray) -> None:
    start, length = _span(rng, out)
    del out[start : start + length]


def _repeat(rng: random.Random, out: bytearray) -> None:
    start, length = _span(rng, out)
    out[start:start] = out[start : start + length] * rng.randint(1, 3)


def _move(rng: random.Random, out: bytearray) -> None:
    start, length = _span(rng, out)
    block = out[start : start + length]
    to = rng.randint(0, len(out))
    out[to : to + len(block)] = block


def _noise(rng: random.Random, out: bytearray) -> None:
    at = rng.randint(0, len(out))
    out[at:at] = rng.randbytes(rng.randint(1, 64))


def _number(rng: random.Random, out: bytearray) -> None:
    """A length or a count somewhere, little-endian, becomes another."""
    size, form = rng.choice(((2, "<H"), (4, "<I"), (8, "<Q")))
    if len(out) < size:
        return
    at = rng.randint(0, len(out) - size)
    (was,) = struct.unpack_from(form, out, at)
    value = rng.choice((*EDGES, was + 1, was - 1, was * 2)) % 256**size
    struct.pack_into(form, out, at, value)


def _span(rng: random.Random, out: bytearray) -> tuple[int, int]:
    start = rng.randint(0, len(out))
    return start, rng.choice((1, 4, 16, 64, 256, 1024))


_DAMAGES = (_flip, _flip, _byte, _byte, _cut, _remove, _repeat, _move, _noise, _number, _number)
