"""A recording that was cut short is ended where it stands: the stock reader finds all that is whole, whatever was cut."""

import io
import os
import shutil
import struct
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, Message, MessageIndex
from record_samples import chunk_spans, small_run

from dnb_edge.errors import WorkError
from dnb_edge.record.reader import read_run
from dnb_edge.record.recover import recover_file
from dnb_edge.record.resync import MOST_WORK_BYTES, next_chunk
from dnb_edge.record.scan import LinearReader


@pytest.fixture(scope="module")
def whole_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_run(tmp_path_factory.mktemp("whole"), frames=24, laps_every=8)


def cut_at(whole_path: Path, place: Path, offset: int) -> Path:
    """A `.part` of the first `offset` bytes."""
    part = place / f"{whole_path.name}.part"
    shutil.copyfile(whole_path, part)
    os.truncate(part, offset)
    return part


def by_index(path: Path) -> list[tuple[str, int, bytes]]:
    """All messages as viewers find them: by the summary's chunk indexes and the message indexes that these point to."""
    content, found = path.read_bytes(), []
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        stock = sorted((channel.topic, one.log_time, one.data) for _, channel, one in reader.iter_messages())
    for chunk in summary.chunk_indexes:
        record = Chunk.read(ReadDataStream(io.BytesIO(content[chunk.chunk_start_offset + 9 :])))
        messages = zstandard.decompress(record.data, record.uncompressed_size)
        for channel_id, offset in chunk.message_index_offsets.items():
            assert content[offset] == Opcode.MESSAGE_INDEX
            index = MessageIndex.read(ReadDataStream(io.BytesIO(content[offset + 9 :])))
            assert index.channel_id == channel_id
            for log_time, at in index.records:
                length = int.from_bytes(messages[at + 1 : at + 9], "little")
                one = Message.read(ReadDataStream(io.BytesIO(messages[at + 9 : at + 9 + length])), length)
                assert (messages[at], one.log_time, one.channel_id) == (Opcode.MESSAGE, log_time, channel_id)
                found.append((summary.channels[channel_id].topic, one.log_time, one.data))
    assert sorted(found) == stock
    return stock


def in_file(path: Path) -> list[tuple[str, int, bytes]]:
    reader = LinearReader(path)
    found = [one for one in reader.records() if isinstance(one, Message)]
    return sorted((reader.tally.topic(one.channel_id) or "", one.log_time, one.data) for one in found)


def in_chunk(whole_path: Path, place: Path, begin: int, end: int) -> list[tuple[str, int, bytes]]:
    """The messages of the chunk between two offsets."""
    found = []
    for offset in (begin, end):
        path = cut_at(whole_path, place, offset)
        found.append(in_file(path))
        path.unlink()
    return [one for one in found[1] if one not in found[0]]


def test_cut_anywhere_it_is_ended_with_an_index(whole_path: Path, tmp_path: Path) -> None:
    """Cut round each chunk's ends, and at every 151st byte of the rest, the finished file holds every whole chunk's messages,
    by linear reading and by the index alike, and its statistics are right."""
    spans = chunk_spans(whole_path)
    everything = whole_path.stat().st_size
    offsets = sorted(
        {*range(spans[0][0], everything, 151), *(end + step for _, end in spans for step in (-1, 0, 1, 40, 200))}
    )
    for offset in offsets:
        part = cut_at(whole_path, tmp_path, offset)
        before = in_file(part)
        done = recover_file(part)
        assert not done.original_kept
        run = read_run(done.path)
        assert run.damage is None
        assert in_file(done.path) == before, offset
        assert by_index(done.path) == before, offset
        with done.path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary.statistics.message_count == len(before) == done.messages
        assert summary.statistics.chunk_count == sum(end <= offset for _, end in spans)
        assert [one.name for one in summary.metadata_indexes][-1] == "dnb-edge/recovery"
        done.path.unlink()


def test_a_whole_part_is_only_renamed(whole_path: Path, tmp_path: Path) -> None:
    """A power cut between the last sync and the rename leaves a whole file, which stays as it is, byte for byte."""
    part = cut_at(whole_path, tmp_path, whole_path.stat().st_size)
    assert recover_file(part).path.read_bytes() == whole_path.read_bytes()


def test_it_keeps_its_date(whole_path: Path, tmp_path: Path) -> None:
    """The oldest recordings are told by their dates: recovery does not make an old one the newest."""
    part = cut_at(whole_path, tmp_path, chunk_spans(whole_path)[-1][0] + 7)
    os.utime(part, ns=(1_000_000_000, 1_000_000_000))
    assert recover_file(part).path.stat().st_mtime_ns == 1_000_000_000


def test_a_full_disk_loses_nothing_of_what_is_whole(
    whole_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where there is no room for the index the `.part` keeps its name and all its messages, and can be recovered later."""
    part = cut_at(whole_path, tmp_path, chunk_spans(whole_path)[-1][1] - 1)
    before = in_file(part)
    real = os.write
    with monkeypatch.context() as full:

        def little(descriptor: int, data: bytes) -> int:
            if os.fstat(descriptor).st_size > part.stat().st_size:
                raise OSError(28, os.strerror(28))
            return real(descriptor, bytes(data)[:100]) if len(data) < 100 else full_disk()

        def full_disk() -> int:
            raise OSError(28, os.strerror(28))

        full.setattr(os, "write", little)
        with pytest.raises(WorkError, match="No space left"):
            recover_file(part)
    assert list(tmp_path.iterdir()) == [part]
    assert in_file(part) == before
    assert in_file(recover_file(part).path) == before


def test_a_torn_index_behind_a_whole_chunk_is_made_anew(whole_path: Path, tmp_path: Path) -> None:
    """Where a power cut left zeros in the message index of a chunk that is not the last, the recording is copied, and the
    copy's index finds every message."""
    start = chunk_spans(whole_path)[0][1]
    part = cut_at(whole_path, tmp_path, chunk_spans(whole_path)[-1][1])
    content = bytearray(part.read_bytes())
    content[start + 9 + 6 : start + 9 + 30] = bytes(24)
    part.write_bytes(content)
    before = in_file(part)
    done = recover_file(part)
    assert by_index(done.path) == before


def test_a_long_torn_end_is_kept(whole_path: Path, tmp_path: Path) -> None:
    """More than a power cut leaves behind the last whole record may be worth something: the damaged file is kept beside."""
    part = cut_at(whole_path, tmp_path, chunk_spans(whole_path)[-1][1])
    with part.open("ab") as stream:
        stream.write(b"\0" * 9_000_000)
    done = recover_file(part)
    assert done.original_kept
    assert {one.name for one in tmp_path.iterdir()} == {whole_path.name, f"{whole_path.name}.damaged"}


@pytest.mark.parametrize(
    ("first", "length", "fill"),
    [(0, 40, b"\0"), (1, 8, b"\xff"), (1, 8, b"\x05"), (1, 2, b"\x07"), (60, 800, b"\0"), (-60, 800, b"\0")],
    ids=["no record", "endless", "too long", "into the next", "zeros inside", "zeros across its beginning"],
)
def test_whole_chunks_behind_a_damaged_spot_are_kept(
    whole_path: Path, tmp_path: Path, first: int, length: int, fill: bytes
) -> None:
    """Damage at or in the middle chunk of a file that was cut short takes the chunks that it lies in and no other one; the
    recovered file says so, and the damaged one stays."""
    spans = chunk_spans(whole_path)
    middle = len(spans) // 2
    everything = in_file(cut_at(whole_path, tmp_path, spans[-1][1]))
    content = bytearray(whole_path.read_bytes()[: spans[-1][1]])
    start = spans[middle][0] + first
    content[start : start + length] = fill * min(length, len(content) - start)
    hit = [index for index, (begin, end) in enumerate(spans) if begin < start + length and start < end]
    lost = [one for index in hit for one in in_chunk(whole_path, tmp_path, *spans[index])]
    part = cut_at(whole_path, tmp_path, 0)
    part.write_bytes(content)
    done = recover_file(part)
    assert 0 < len(hit) < len(spans) - middle
    kept = in_file(done.path)
    assert {one for one in everything if one not in lost} <= set(kept) <= set(everything)
    assert len(set(kept)) == len(kept)
    assert (done.bad_parts > 0, done.original_kept) == (True, True)
    assert {one.name for one in tmp_path.iterdir()} == {whole_path.name, f"{whole_path.name}.damaged"}


def test_beginnings_of_chunks_without_end_are_given_up(whole_path: Path, tmp_path: Path) -> None:
    """A file made of nothing but heads of chunks, each of which claims to be long, takes no time that its size does not."""
    part = cut_at(whole_path, tmp_path, chunk_spans(whole_path)[-1][1])
    head = struct.pack("<BQQQQI", Opcode.CHUNK, 1_000_000, 0, 0, 60_000_000, 1) + b"\x04\0\0\0zstd"
    with part.open("ab") as stream:
        stream.write(b"\0" * 9 + head * 100_000)
    reads = []

    class Counting(io.BytesIO):
        def read(self, size=-1):
            data = super().read(size)
            reads.append(len(data))
            return data

    content = part.read_bytes()
    assert next_chunk(Counting(content), chunk_spans(whole_path)[-1][1], len(content), lambda body: False) is None
    assert sum(reads) < 2 * MOST_WORK_BYTES
