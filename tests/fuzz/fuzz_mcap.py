"""Damage to recordings that gets past their checksums: records are taken apart, changed and put together with right CRCs.

Knows the MCAP container (https://mcap.dev/spec) as far as records, chunks and attachments; written apart from the package, so
that both would have to be wrong alike.
"""

import json
import random
import struct
import zlib
from typing import TypeAlias

import fuzz_bytes
import fuzz_tree
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, METADATA, DATA_END = 1, 2, 3, 4, 5, 6, 9, 12, 15

TEXTS = (
    b"[" * 100_000, b'{"a":' * 50_000, b"1" * 5000, b"", b"null", b"\xff\xfe{}", b'"\\ud800"', b"[]", b"1e999", b"-",
)  # fmt: skip
"""JSON and what is nearly JSON, with which parsers have their trouble."""

Records: TypeAlias = list[tuple[int, bytes]]


def records_of(data: bytes) -> Records:
    """(opcode, body) of each record one behind the other, as far as they are whole."""
    found, at = [], 0
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((opcode, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def joined(records: Records) -> bytes:
    """The records, one behind the other."""
    return b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records)


def mutated(rng: random.Random, whole: bytes) -> bytes:
    """The recording `whole` after some damage of a random kind."""
    kind = rng.random()
    if kind < 0.2:
        return fuzz_bytes.mutated(rng, whole)
    if kind < 0.24:
        return whole[: rng.randint(0, len(whole))]
    records = records_of(whole[len(MAGIC) :])
    for _ in range(rng.randint(1, 3)):
        _damage(rng, records)
    if kind < 0.3:
        records.insert(rng.randint(0, len(records)), bomb(rng))
    return rebuilt(records)


def rebuilt(records: Records) -> bytes:
    """A file of these records; the checksum over all data is right where there is one."""
    out = bytearray(MAGIC)
    for opcode, body in records:
        if opcode == DATA_END and len(body) == 4:
            body = struct.pack("<I", zlib.crc32(out))  # noqa: PLW2901
        out += struct.pack("<BQ", opcode, len(body)) + body
    return bytes(out + MAGIC)


def _damage(rng: random.Random, records: Records) -> None:
    told = [k for k, (opcode, _) in enumerate(records) if opcode in (CHUNK, ATTACHMENT)]
    # Most records of a file are indexes, which nobody who reads it linearly looks at.
    at = rng.choice(told) if told and rng.random() < 0.85 else rng.randrange(len(records))
    opcode, body = records[at]
    kind = rng.random()
    try:
        if opcode == CHUNK and kind < 0.8:
            records[at] = (CHUNK, _chunk(rng, body))
        elif opcode == ATTACHMENT and kind < 0.9:
            records[at] = (ATTACHMENT, _attachment(rng, body))
        else:
            _shuffle(rng, records, at)
    except (struct.error, zstandard.ZstdError, OverflowError, MemoryError):  # it has been damaged before
        records[at] = (opcode, fuzz_bytes.mutated(rng, body))


def _shuffle(rng: random.Random, records: Records, at: int) -> None:
    """A record is changed, lost, doubled, moved, or taken for one of another kind."""
    opcode, body = records[at]
    kind = rng.random()
    if kind < 0.4:
        records[at] = (opcode, fuzz_bytes.mutated(rng, body))
    elif kind < 0.55:
        del records[at]
        if not records:
            records.append((HEADER, b""))
    elif kind < 0.7:
        records.insert(rng.randrange(len(records)), records[at])
    elif kind < 0.85:
        records.insert(rng.randrange(len(records)), records.pop(at))
    else:
        records[at] = (rng.choice((*range(17), 0x80, 0xFF)), body)


def _chunk(rng: random.Random, body: bytes) -> bytes:
    """A chunk with other content, packed and summed up as if it had always been so."""
    start_t, end_t, size, _, name_length = struct.unpack_from("<QQQII", body)
    packed = body[32 + name_length + 8 :]
    name = body[32 : 32 + name_length]
    content = (
        zstandard.ZstdDecompressor().decompress(packed, max_output_size=min(size, 1 << 24))
        if name == b"zstd"
        else packed
    )
    inner = records_of(content)
    for _ in range(rng.randint(1, 3)):
        if not inner:
            break
        at = rng.randrange(len(inner))
        if inner[at][0] == MESSAGE and rng.random() < 0.8:
            inner[at] = (MESSAGE, _message(rng, inner[at][1]))
        else:
            _shuffle(rng, inner, at)
    content = joined(inner)
    if rng.random() < 0.1:
        content = fuzz_bytes.mutated(rng, content)
    return chunk(rng, content, (start_t, end_t))


def chunk(rng: random.Random, content: bytes, times: tuple[int, int] = (0, 0)) -> bytes:
    """The body of a chunk of `content`; one in ten tells a lie of its size, its sum or its compression."""
    name = rng.choice((b"zstd", b""))
    packed = zstandard.ZstdCompressor(level=1).compress(content) if name else content
    size, crc = len(content), zlib.crc32(content)
    lie = rng.random()
    if lie < 0.04:
        size = rng.choice((0, size + 1, size * 2, 2**26, 2**32, 2**63))
    elif lie < 0.06:
        crc = rng.choice((0, crc ^ 1))
    elif lie < 0.08:
        name = rng.choice((b"lz4", b"zstd", b"", b"\xff\xfe", b"ZSTD"))
    elif lie < 0.1:
        packed = fuzz_bytes.mutated(rng, packed)
    head = struct.pack("<QQQII", *times, size, crc, len(name)) + name
    return head + struct.pack("<Q", len(packed)) + packed


def _message(rng: random.Random, body: bytes) -> bytes:
    head, data = bytearray(body[:22]), body[22:]
    if rng.random() < 0.2:
        head = bytearray(fuzz_bytes.mutated(rng, bytes(head), most=1).ljust(22, b"\0")[:22])
    return bytes(head) + payload(rng, data)


def payload(rng: random.Random, data: bytes) -> bytes:
    """A message's or an attachment's content, as a document where it is one."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return fuzz_bytes.mutated(rng, data)
    kind = rng.random()
    if kind < 0.1:
        return fuzz_bytes.mutated(rng, data)
    if kind < 0.14:
        return rng.choice(TEXTS)
    return fuzz_tree.to_json(fuzz_tree.mutated(rng, tree))


def _attachment(rng: random.Random, body: bytes) -> bytes:
    """Another setup in place of the recording's own, its checksum right."""
    at = 16
    for _ in range(2):
        at += 4 + struct.unpack_from("<I", body, at)[0]
    data = payload(rng, body[at + 8 : -4])
    head = body[:at] if rng.random() < 0.9 else fuzz_bytes.mutated(rng, body[:at])
    whole = head + struct.pack("<Q", len(data)) + data
    return whole + struct.pack("<I", zlib.crc32(whole))


def bomb(rng: random.Random) -> tuple[int, bytes]:
    """A record of a few kilobytes that wants to become very many."""
    kind = rng.randrange(6)
    if kind == 0:  # zeros without end, whatever the chunk says of itself
        size = rng.choice((1 << 20, 60 << 20, 200 << 20))
        told = rng.choice((size, size // 2, 1000))
        packed = _zeros(size)
        return CHUNK, struct.pack("<QQQII", 0, 0, told, 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    if kind == 1:  # a channel with more notes than memory has room for
        count = rng.choice((1000, 100_000, 300_000))
        notes = b"".join(struct.pack("<I4sI", 4, struct.pack("<I", 0x30303030 + k), 0) for k in range(count % 7 + 1))
        notes = _notes(count) if rng.random() < 0.05 else notes
        body = struct.pack("<HHI1sI4sI", 9, 0, 1, b"x", 4, b"json", len(notes)) + notes
        return CHUNK, chunk(rng, joined([(CHANNEL, body)]))
    if kind == 2:  # messages of nothing, a million
        count = rng.choice((1000, 20_000))
        return CHUNK, chunk(rng, joined([(MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0))]) * count)
    if kind == 3:  # records of an unknown kind, of no length
        return CHUNK, chunk(rng, joined([(0x55, b"")]) * rng.choice((1000, 200_000)))
    if kind == 4:  # notes at the top
        notes = _notes(rng.choice((10, 30_000)))
        return METADATA, struct.pack("<I1sI", 1, b"x", len(notes)) + notes
    return SCHEMA, struct.pack("<HI1sI1sI", 1, 1, b"x", 1, b"y", rng.choice(fuzz_bytes.EDGES) % 2**32)


def _zeros(size: int, cache: dict[int, bytes] = {}) -> bytes:  # noqa: B006
    """`size` zeros, packed; made once."""
    if size not in cache:
        packer = zstandard.ZstdCompressor(level=1).compressobj()
        cache[size] = b"".join(packer.compress(bytes(1 << 20)) for _ in range(size >> 20)) + packer.flush()
    return cache[size]


def _notes(count: int) -> bytes:
    return b"".join(struct.pack("<I8sI", 8, b"%08d" % k, 0) for k in range(count))
