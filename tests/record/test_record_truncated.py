"""A recording that is cut short, torn or hostile: what is whole is read, what is not is told, nothing is believed."""

import os
import struct
import tracemalloc
import zlib
from pathlib import Path

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.writer import Writer
from record_samples import chunk_spans, found, recorder, small_run

from dnb_edge.errors import InputError
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.scan import MAGIC, LinearReader, Message


@pytest.fixture(scope="module")
def whole_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_run(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def whole(whole_path: Path) -> bytes:
    return whole_path.read_bytes()


@pytest.fixture(scope="module")
def chunk_ends(whole_path: Path, whole: bytes) -> list[tuple[int, int]]:
    """(end offset, messages up to there) of each chunk, by the stock reader's index: the oracle."""
    with whole_path.open("rb") as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    ends, count = [], 0
    for index in sorted(indexes, key=lambda one: one.chunk_start_offset):
        count += sum(
            struct.unpack_from("<I", whole, offset + 11)[0] // 16 for offset in index.message_index_offsets.values()
        )
        ends.append((index.chunk_start_offset + index.chunk_length, count))
    assert len(ends) >= 3
    return ends


def messages_in(path: Path) -> list[tuple[int, int, bytes]]:
    return [
        (one.channel_id, one.log_time, one.data) for one in LinearReader(path).records() if isinstance(one, Message)
    ]


def test_every_truncation_keeps_every_complete_chunk(tmp_path: Path, whole: bytes, chunk_ends) -> None:
    """Cut at any byte, the messages read are exactly those of the chunks that are whole, and the cut is told."""
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole)
    everything = messages_in(path)
    assert len(everything) == chunk_ends[-1][1]
    offsets = {*range(0, len(whole), 37), *(end + step for end, _ in chunk_ends for step in (-1, 0, 1))}
    for offset in sorted(offsets):
        path.write_bytes(whole[:offset])
        reader = LinearReader(path)
        got = [(r.channel_id, r.log_time, r.data) for r in reader.records() if isinstance(r, Message)]
        expected = max((count for end, count in chunk_ends if end <= offset), default=0)
        assert got == everything[:expected], offset
        assert not reader.complete
        assert reader.damage is not None


def test_every_single_truncation_of_a_small_file(tmp_path: Path) -> None:
    """The same at every byte of a small recording, header and summary included, from its end to its start."""
    path = small_run(tmp_path, frames=6, laps_every=2)
    everything, spans = messages_in(path), chunk_spans(path)
    ends = [end for _, end in spans]
    counts = []
    for end in ends:
        copy = tmp_path / "chunks.bin"
        copy.write_bytes(path.read_bytes()[:end])
        counts.append(len(messages_in(copy)))
    assert counts == sorted({*counts})
    assert counts[-1] == len(everything) > 20
    for offset in range(path.stat().st_size - 1, -1, -1):
        os.truncate(path, offset)
        reader = LinearReader(path)
        got = [(r.channel_id, r.log_time, r.data) for r in reader.records() if isinstance(r, Message)]
        assert (
            got
            == everything[: max((count for end, count in zip(ends, counts, strict=True) if end <= offset), default=0)]
        )
        assert not reader.complete


@pytest.mark.parametrize("share", [0.05, 0.5, 0.97])
def test_truncated_recording_is_refused_with_the_command_that_helps(tmp_path: Path, whole: bytes, share: float) -> None:
    """read_run of a truncated file raises one line that says so and names `dnb-edge runs recover FILE`."""
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(InputError) as caught:
        read_run(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: the recording is truncated")
    assert text.endswith(f"run `dnb-edge runs recover {path}`")
    assert "\n" not in text
    with pytest.raises(InputError, match="truncated"):
        list(iter_frames(path))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200, deadline=None)
@given(offset=st.integers(0, 1_000_000), change=st.integers(1, 255))
def test_a_wrong_byte_is_never_believed(tmp_path: Path, whole_path: Path, offset: int, change: int) -> None:
    """With any one byte changed, a recording is either refused or gives exactly the original messages."""
    content = bytearray(whole_path.read_bytes())
    content[offset % len(content)] ^= change
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    try:
        read_run(path)
    except InputError:
        return
    assert messages_in(path) == messages_in(whole_path)


def test_a_chunk_that_changed_its_kind_is_missed(tmp_path: Path, whole: bytes, chunk_ends) -> None:
    """A chunk whose opcode became an unknown one, to be skipped by the standard, is missed by the checksum over all data."""
    content = bytearray(whole)
    position = chunk_ends[0][0]
    assert content[position] == 0x07, "message index behind the first chunk"
    content[position] = 0x47
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match="checksum over all data"):
        read_run(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100, deadline=None)
@given(start=st.integers(0, 200), torn=st.integers(1, 8), fill=st.sampled_from([b"\0", b"\xff", b"\x01"]))
def test_torn_sectors_are_never_believed(tmp_path: Path, whole_path: Path, start: int, torn: int, fill: bytes) -> None:
    """Whole sectors of zeros or old bytes, as a power cut leaves them, give no message that was not written."""
    content = whole_path.read_bytes()
    first = (start * 64) % len(content)
    path = tmp_path / "a.mcap"
    path.write_bytes((content[:first] + fill * (64 * torn) + content[first + 64 * torn :])[: len(content)])
    reader = LinearReader(path, skip_bad_parts=True)
    got = {(r.channel_id, r.log_time, r.data) for r in reader.records() if isinstance(r, Message)}
    assert got <= set(messages_in(whole_path))


@pytest.mark.parametrize("claimed", [700_000_000, 1_000])
def test_a_decompression_bomb_is_refused_before_it_takes_memory(tmp_path: Path, claimed: int) -> None:
    """A chunk of a few kB that holds 700 MB is refused, whether it admits its size or not, within 100 MB."""
    packer = zstandard.ZstdCompressor(level=3).compressobj()
    packed = b"".join(packer.compress(bytes(1_000_000)) for _ in range(700)) + packer.flush()
    assert len(packed) < 100_000
    body = RecordBuilder()
    chunk = Chunk(
        compression="zstd",
        data=packed,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=claimed,
    )
    chunk.write(body)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(MAGIC + body.end())
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="damaged"):
            read_run(path)
        assert tracemalloc.get_traced_memory()[1] < 100_000_000
    finally:
        tracemalloc.stop()


def test_a_record_longer_than_the_file_takes_no_memory(tmp_path: Path) -> None:
    """A record that claims 200 MB in a file of 30 bytes is a truncated one, and nothing is allocated for it."""
    path = tmp_path / "long.mcap"
    path.write_bytes(MAGIC + struct.pack("<BQ", 6, 200_000_000) + b"x" * 13)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="truncated"):
            read_run(path)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()


def test_a_record_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    """A sparse file that really has the 2 GB its first record claims is refused without reading them."""
    path = tmp_path / "wide.mcap"
    with path.open("wb") as stream:
        stream.write(MAGIC + struct.pack("<BQ", 6, 2_000_000_000))
        stream.truncate(2_100_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="not a record"):
            read_run(path)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("content", [b"", b"MCAP", b"not an MCAP file at all" * 99])
def test_other_files_are_not_taken_for_recordings(tmp_path: Path, content: bytes) -> None:
    """What is no MCAP file is refused as such, by name."""
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"notes\.txt: not an MCAP file"):
        read_run(path)


def test_a_stranger_s_mcap_is_told_apart_from_a_damaged_one(tmp_path: Path) -> None:
    """A whole MCAP file of other software is refused as not ours, with no talk of recovery."""
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_message(writer.register_channel("/x", "json", 0), 0, b"{}", 0)
        writer.finish()
    with pytest.raises(InputError, match=r"not a recording of dnb-edge: it has no setup\.json") as caught:
        read_run(path)
    assert "recover" not in str(caught.value)


@pytest.mark.parametrize(
    ("setup", "reason"),
    [
        (b'{"format": 2}', "format 2 is not known"),
        (b'{"format": 1, "name": "x"}', "incomplete"),
        (b"[]", "not an object"),
        (b"{", "delimiter|property name"),
    ],
)
def test_a_header_that_cannot_be_read_is_one_line(tmp_path: Path, setup: bytes, reason: str) -> None:
    """A recording by newer software, or with a broken setup.json, is refused with its name and the reason."""
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_attachment(0, 0, "setup.json", "application/json", setup)
        writer.finish()
    with pytest.raises(InputError, match=reason) as caught:
        read_run(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_oracle_agrees_with_the_stock_chunk_parser(tmp_path: Path, whole: bytes) -> None:
    """Our messages of a whole file are those that the stock library unpacks from its chunks, CRCs checked."""
    path = tmp_path / "a.mcap"
    path.write_bytes(whole)
    with path.open("rb") as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        stock = [(message.channel_id, message.log_time, message.data) for _, _, message in messages]
    assert messages_in(path) == stock


def _chunk_of(content: bytes) -> bytes:
    """A file whose one chunk holds `content`, its checksum right."""
    body = RecordBuilder()
    Chunk(
        compression="zstd",
        data=zstandard.ZstdCompressor().compress(content),
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=zlib.crc32(content),
        uncompressed_size=len(content),
    ).write(body)
    return MAGIC + body.end()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (bytes(9 * 1_000_000), "more than the 100000 records that are read"),
        (struct.pack("<BQ", 5, 31) + bytes(31), None),
        (struct.pack("<BQ", 4, 2_000_000) + bytes(2_000_000), "more than the 1048576 that are read"),
    ],
    ids=["a million records of nothing", "an empty message", "a channel of 2 MB"],
)
def test_a_chunk_of_very_many_small_things_is_refused(tmp_path: Path, content: bytes, says: str | None) -> None:
    """What takes a few kilobytes in the file and a second for each chunk, or many times its size in memory, is not unfolded."""
    path = tmp_path / "many.mcap"
    path.write_bytes(_chunk_of(content))
    reader = LinearReader(path)
    found = sum(1 for _ in reader.records())
    assert reader.damage is not None
    if says is None:
        assert (found, reader.damage.truncated) == (1, True)
    else:
        assert says in reader.damage.reason


def test_stamps_that_run_backwards_are_refused(tmp_path: Path) -> None:
    """Detections of two runs in one file are none that a core could be given."""
    writer = recorder(tmp_path, image_fps=None)
    for sequence, t_ns in ((0, 10), (1, 20), (2, 20)):
        writer.add_detections(found(sequence, t_ns))
    run = read_run(writer.close())
    with pytest.raises(InputError, match="frame 2 comes before frame 1 in time"):
        list(run.race_detections())
