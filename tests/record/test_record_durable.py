"""What a recording promises of the disk: nothing synced is lost, nothing half-written gets a final name, no wait."""

import errno
import os
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest
from record_samples import HEADER, chunk_spans, found, frame, lap, recorder, small_run, target

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record import names
from dnb_edge.record.durable import DurableFile
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.recover import Leftover, recover_directory, recover_file
from dnb_edge.record.writer import Recorder
from dnb_edge.values import FrameDetections, Lap, Score

SCORE = Score(
    lap=1,
    metric="dtw",
    similarity_percent=95.0,
    dtw_mean_m=0.01,
    frechet_m=0.02,
    clamp_m=None,
    baseline_m=0.5,
    completion_time_s=12.0,
    lateral_mean_m=0.01,
    lateral_max_m=0.03,
    path_length_m=9.9,
    route_length_m=10.0,
)
WRITER = textwrap.dedent(
    """
    import sys, resource, signal
    from pathlib import Path
    sys.path.insert(0, {tests!r})
    from record_samples import found, frame, lap, recorder, target
    if {limit}:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
    writer = recorder(Path({directory!r}), image_fps={image_fps})
    for sequence in range({frames}):
        t_ns = sequence * 33_000_000
        writer.add_frame(frame(sequence, t_ns))
        writer.add_detections(found(sequence, t_ns))
        writer.add_event(target(t_ns))
        if sequence % 10 == 9:
            saved = writer.wait_saved(writer.add_event(lap(sequence // 10 + 1, t_ns)))
            print("saved" if saved else "lost", sequence, flush=True)
    """
)


def start_writer(directory: Path, *, frames: int, limit: int = 0, image_fps: float | None = None, tail: str = ""):
    """A process of its own that records `frames` frames and prints each lap that was acknowledged."""
    code = WRITER.format(
        tests=str(Path(__file__).parent), directory=str(directory), frames=frames, limit=limit, image_fps=image_fps
    )
    return subprocess.Popen(
        [sys.executable, "-c", code + tail], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.fixture
def small_disk(tmp_path: Path):
    """A real file system of 256 KiB."""
    if os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root")
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", place]
    mounted = subprocess.run(mount, check=False, capture_output=True, text=True)
    if mounted.returncode != 0:
        pytest.skip(f"cannot mount a small disk here: {mounted.stderr.strip()}")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


@pytest.mark.parametrize("laps", [1, 4, 17])
def test_kill_9_loses_nothing_that_was_acknowledged(tmp_path: Path, laps: int) -> None:
    """After SIGKILL every lap said to be saved, and all before it, is read back from the `.part`; no final file exists."""
    process = start_writer(tmp_path, frames=100_000)
    last = None
    for _ in range(laps):
        word, last = process.stdout.readline().split()
        assert word == "saved"
    process.kill()
    process.communicate()
    assert not list(tmp_path.glob("*.mcap"))
    (part,) = tmp_path.glob("*.part")

    (recovery,) = recover_directory(tmp_path)
    run = read_run(recovery.path)
    assert recovery.path.name == part.name.removesuffix(".part")
    assert not part.exists()
    assert run.lost_messages == 0
    assert run.header == HEADER
    sequences = [one.sequence for one in run.detections()]
    assert sequences == list(range(len(sequences)))
    assert len(sequences) > int(last)
    assert recovery.laps >= laps
    assert [one.number for one in run.events() if isinstance(one, Lap)] == list(range(1, recovery.laps + 1))


def test_a_process_that_ends_without_closing_leaves_a_part_and_says_nothing(tmp_path: Path) -> None:
    """Leaving the interpreter with the recorder open gives no noise, no final name, and everything synced."""
    out, err = (process := start_writer(tmp_path, frames=30)).communicate()
    assert (process.returncode, err) == (0, "")
    assert out.split() == ["saved", "9", "saved", "19", "saved", "29"]
    assert not list(tmp_path.glob("*.mcap"))
    (recovery,) = recover_directory(tmp_path)
    assert recovery.laps == 3


def test_a_full_disk_fails_the_recording_and_not_the_race(small_disk: Path, tmp_path: Path, capfd) -> None:
    """When the disk is full no call raises, the state says why, close() names file and reason, and what was
    acknowledged can be recovered elsewhere; no final name, no copy left by a recovery without room, no noise."""
    writer = recorder(small_disk, image_fps=1000.0)
    saved = 0
    for sequence in range(2000):
        t_ns = sequence * 33_000_000
        writer.add_frame(frame(sequence, t_ns, jpeg=os.urandom(2000)))
        writer.add_detections(found(sequence, t_ns))
        if sequence % 10 == 9 and writer.wait_saved(writer.add_event(lap(sequence // 10 + 1, t_ns))):
            saved += 1
    health = writer.health()
    assert (health.state, health.reason) == ("failed", "the disk is full")
    assert health.warnings[-1] == "recording failed: the disk is full"
    with pytest.raises(WorkError, match=r"run-\w+-0001\.mcap\.part: recording failed: the disk is full.*runs recover"):
        writer.close()
    assert 3 <= saved < 200
    assert [path.name for path in small_disk.iterdir()] == [health.path.name]

    (leftover,) = recover_directory(small_disk)
    assert isinstance(leftover, Leftover)
    assert [path.name for path in small_disk.iterdir()] == [health.path.name]

    part = tmp_path / health.path.name
    part.write_bytes(health.path.read_bytes())
    recovery = recover_file(part)
    assert recovery.laps >= saved
    assert capfd.readouterr().err == ""


def test_no_room_for_the_header_is_said_at_once(small_disk: Path) -> None:
    """A recorder on a disk that is already full raises WorkError and leaves no final file."""
    with pytest.raises(OSError, match="No space"):
        (small_disk / "big").write_bytes(bytes(300_000))
    with pytest.raises(WorkError, match="the disk is full"):
        recorder(small_disk)
    assert not list(small_disk.glob("*.mcap"))


def test_a_file_size_limit_is_an_error_like_any_other(tmp_path: Path) -> None:
    """Where the kernel lets no file grow further (EFBIG, as 4 GB on a USB stick), the recording goes on in the next one, says
    so, and the files together hold every lap: all were acknowledged."""
    tail = "print(writer.state, writer.health().warnings[0])\n"
    out, err = start_writer(tmp_path, frames=400, limit=40_000, image_fps=1000.0, tail=tail).communicate()
    assert err == ""
    *told, last = out.splitlines()
    assert last.startswith("recording run-")
    assert last.endswith(".mcap.part was given up: file too large")
    assert len(told) == 40
    assert all(line.startswith("saved") for line in told)
    recoveries = recover_directory(tmp_path)
    assert len(recoveries) >= 3
    run = read_run(recoveries[-1].path)
    assert run.files == tuple(one.path for one in recoveries)
    laps = [one.number for one in run.events() if isinstance(one, Lap)]
    assert sorted(set(laps)) == list(range(1, 41))
    # A lap that came whole to a file which then failed stands in both: it was not acknowledged there.
    assert len(laps) < 40 + len(recoveries)


def test_a_failed_sync_is_never_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One EIO of fdatasync ends the file: no second sync, no more bytes, no final name, and the laps are not saved. Nor is
    anything when the next file's header cannot be synced either; such a file is not left behind."""
    writer = recorder(tmp_path)
    calls = []

    def broken(descriptor: int) -> None:
        calls.append(str(Path(f"/proc/self/fd/{descriptor}").readlink()))
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fdatasync", broken)
    monkeypatch.setattr(os, "fsync", broken)
    first = writer.add_event(lap(1, 1_000))
    assert not writer.wait_saved(first)
    assert not writer.wait_saved(writer.add_event(lap(2, 2_000)))
    assert not writer.is_saved(first)
    with pytest.raises(WorkError, match="input/output error"):
        writer.close()
    assert calls.count(calls[0]) == 1
    assert len(calls) >= 2
    assert [str(path) for path in tmp_path.iterdir()] == [calls[0]]


@pytest.mark.parametrize("event", [lap(1, 1_000), SCORE], ids=["lap", "score"])
def test_saved_is_said_only_after_the_disk_has_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, event) -> None:
    """A lap or score is synced at once, unasked; while fdatasync is under way it is not saved; once that returns it is,
    and its bytes were written before."""
    writer = recorder(tmp_path, sync_period_s=3600.0)
    asked, answer, sizes = threading.Event(), threading.Event(), []
    real = os.fdatasync

    def slow(descriptor: int) -> None:
        sizes.append(os.fstat(descriptor).st_size)
        asked.set()
        assert answer.wait(30)
        real(descriptor)

    monkeypatch.setattr(os, "fdatasync", slow)
    before = writer.path.stat().st_size
    ticket = writer.add_event(event)
    assert asked.wait(30)
    assert not writer.is_saved(ticket)
    assert not writer.wait_saved(ticket, timeout_s=0.01)
    assert writer.health().saved_laps == 0
    answer.set()
    assert writer.wait_saved(ticket)
    assert writer.is_saved(ticket)
    assert writer.health().saved_laps == isinstance(event, Lap)
    assert sizes[0] > before
    writer.close()


def test_a_stuck_disk_never_holds_a_live_race(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the disk stuck, pictures give way first, then detections are refused and counted, laps always get in;
    the finished file and its reader say how many messages are missing."""
    writer = recorder(tmp_path, lossless=False, queue_messages=20, queue_pictures=4, image_fps=1000.0)
    asked, answer = threading.Event(), threading.Event()
    real = os.fdatasync

    def stuck(descriptor: int) -> None:
        asked.set()
        assert answer.wait(30)
        real(descriptor)

    monkeypatch.setattr(os, "fdatasync", stuck)
    writer.add_event(lap(1, 0))
    assert asked.wait(30)
    for sequence in range(10):
        writer.add_frame(frame(sequence, sequence * 10_000_000))
    tickets = [writer.add_detections(found(sequence, sequence * 10_000_000)) for sequence in range(25)]
    assert tickets[:20] == list(range(6, 26)), "pictures made room for all detections that fit"
    assert tickets[20:] == [None] * 5
    assert writer.add_event(target(0)) is None
    assert writer.add_event(lap(2, 1_000)) is not None
    health = writer.health()
    assert (health.state, health.lost_messages, health.dropped_images) == ("recording", 6, 10)
    assert health.warnings[0] == "6 messages not recorded: the disk cannot keep up"
    answer.set()
    path = writer.close()
    run = read_run(path)
    assert run.lost_messages == 6
    assert run.warnings == ("6 messages were not recorded, the disk could not keep up",)
    assert [one.number for one in run.events() if isinstance(one, Lap)] == [1, 2]
    assert list(iter_frames(path)) == []


def test_a_lossless_producer_waits_and_loses_nothing(tmp_path: Path) -> None:
    """With a queue of 4, a producer that may wait gets every one of 500 frames of detections and pictures through."""
    writer = recorder(tmp_path, queue_messages=4, queue_pictures=2, image_fps=1000.0)
    for sequence in range(500):
        writer.add_frame(frame(sequence, sequence * 10_000_000))
        assert writer.add_detections(found(sequence, sequence * 10_000_000)) is not None
    path = writer.close()
    assert [one.sequence for one in read_run(path).detections()] == list(range(500))
    assert len(list(iter_frames(path))) == 500


def test_a_value_that_cannot_be_written_fails_the_recording_only(tmp_path: Path) -> None:
    """NaN, which JSON has no word for, makes the recording fail with the reason; adding it raises nothing."""
    writer = recorder(tmp_path)
    broken = found(1, 1)
    object.__setattr__(broken.detections[0], "sigma_px", float("nan"))
    writer.add_detections(broken)
    assert not writer.wait_saved()
    assert writer.state == "failed"
    with pytest.raises(WorkError, match="not JSON compliant"):
        writer.close()
    assert writer.add_event(lap(1, 1)) is None


def test_names_never_collide_and_nothing_is_overwritten(tmp_path: Path) -> None:
    """The counter goes on behind every file of the boot, finished, cut or damaged; two open recorders differ."""
    tag = names.boot_tag()
    for name in (f"run-{tag}-0007.mcap.part", f"run-{tag}-0009.mcap.damaged", f"run-{tag}-0003.mcap", "notes.txt"):
        (tmp_path / name).write_bytes(b"mine")
    first, second = recorder(tmp_path), recorder(tmp_path)
    assert [first.close().name, second.close().name] == [f"run-{tag}-0010.mcap", f"run-{tag}-0011.mcap"]
    assert (tmp_path / f"run-{tag}-0003.mcap").read_bytes() == b"mine"


def test_a_final_name_taken_meanwhile_is_left_alone(tmp_path: Path) -> None:
    """If somebody puts a file under the final name during the run, it stays, and the recording stays as `.part`."""
    writer = recorder(tmp_path)
    final = writer.path.with_suffix("")
    final.write_bytes(b"somebody else's")
    with pytest.raises(WorkError, match="file exists"):
        writer.close()
    assert final.read_bytes() == b"somebody else's"
    recovery = recover_file(writer.path)
    assert recovery.path.name == f"{final.stem}-recovered.mcap"
    assert final.read_bytes() == b"somebody else's"


def test_abandon_keeps_the_part_and_what_was_saved(tmp_path: Path) -> None:
    """An abandoned recording has no final name; what was saved before is recoverable, and calls after it are harmless."""
    writer = recorder(tmp_path)
    assert writer.wait_saved(writer.add_event(lap(1, 1_000)))
    writer.abandon()
    assert writer.add_event(lap(2, 2_000)) is None
    assert not list(tmp_path.glob("*.mcap"))
    assert recover_file(writer.path).laps == 1


@pytest.mark.parametrize("kind", ["file", "missing"])
def test_a_place_that_cannot_be_used(tmp_path: Path, kind: str) -> None:
    """A file where the directory should be is refused by name; a directory that is missing is made."""
    place = tmp_path / "runs" / "today"
    if kind == "missing":
        assert recorder(place).close().parent == place
        return
    place.parent.write_bytes(b"")
    with pytest.raises(InputError, match=r"runs/today: cannot record there"):
        recorder(place)


def test_a_durable_file_that_failed_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a failed sync nothing more is written, synced or renamed, and the writers above hear no exception."""
    file = DurableFile(tmp_path / "a.mcap")
    file.write(b"abc")
    with monkeypatch.context() as broken:
        broken.setattr(os, "fdatasync", lambda descriptor: os.fsync(1_000_000))
        assert not file.sync()
    assert file.failure.errno == errno.EBADF
    assert file.write(b"def") == 3
    assert (file.sync(), file.sync_new(), file.finish()) == (False, False, False)
    assert file.path.read_bytes() == b"abc"
    assert [one.name for one in tmp_path.iterdir()] == ["a.mcap.part"]


def test_a_durable_file_only_grows(tmp_path: Path) -> None:
    """Seeking is refused except to where the file already is, so that a crash can never leave a hole."""
    file = DurableFile(tmp_path / "a.mcap")
    assert file.write(b"abc") == 3
    assert (file.seek(0, os.SEEK_CUR), file.seek(3), file.tell()) == (3, 3, 3)
    with pytest.raises(ValueError, match="front to back"):
        file.seek(0)
    with pytest.raises(FileExistsError):
        DurableFile(tmp_path / "a.mcap")
    assert file.finish()
    assert (tmp_path / "a.mcap").read_bytes() == b"abc"
    assert not file.sync()


def test_recovery_leaves_a_live_recording_alone(tmp_path: Path) -> None:
    """The `.part` of a recorder at work is locked: recovery refuses it, and the recorder finishes as if nothing was."""
    writer: Recorder = recorder(tmp_path)
    (leftover,) = recover_directory(tmp_path)
    assert "is being recorded just now" in leftover.reason
    writer.add_event(lap(1, 1_000))
    assert len(list(read_run(writer.close()).events())) == 1
    assert len(list(tmp_path.iterdir())) == 1


def test_recovery_of_a_truncated_file_keeps_the_original(tmp_path: Path) -> None:
    """A cut file with a final name stays, its copy is called -recovered, equals the whole chunks, and can be scored."""
    path = small_run(tmp_path, image_fps=1000.0)
    whole = path.read_bytes()
    original = list(read_run(path).messages())
    cut = chunk_spans(path)[-1][1] - 1
    path.write_bytes(whole[:cut])
    recovery = recover_file(path)
    assert recovery.path.name == f"{path.stem}-recovered.mcap"
    assert recovery.original_kept
    assert path.read_bytes() == whole[:cut]
    run = read_run(recovery.path)
    assert run.damage is None
    assert run.header == HEADER
    got = list(run.messages())
    assert 0 < len(got) < len(original)
    assert got == original[: len(got)]
    assert run.warnings == (f"recovered from {path.name}, 0 damaged parts left out",)
    assert recover_file(path).path.name == f"{path.stem}-recovered-2.mcap"


def test_a_footer_in_the_middle_costs_no_message(tmp_path: Path) -> None:
    """A record whose opcode became a footer's ends nothing: what lies behind it is kept with the damaged file, and told."""
    path = small_run(tmp_path)
    content = bytearray(path.read_bytes())
    content[chunk_spans(path)[0][1]] = 0x02
    part = path.with_name(path.name + ".part")
    path.unlink()
    part.write_bytes(content)
    recovery = recover_file(part)
    assert (recovery.bad_parts, recovery.original_kept) == (1, True)
    assert read_run(recovery.path).damage is None


def test_recovery_tells_of_a_hole_and_keeps_the_damaged_file(tmp_path: Path) -> None:
    """A `.part` with a damaged chunk in its middle gives everything else, says that something is missing, and is kept."""
    path = small_run(tmp_path)
    content = bytearray(path.read_bytes())
    total = sum(isinstance(one, FrameDetections) for one in read_run(path).messages())
    start, end = chunk_spans(path)[1]
    content[end - 40 : end - 36] = b"\0\0\0\0"
    assert start < end - 40
    part = path.rename(path.with_name(path.name + ".part"))
    part.write_bytes(content)
    (recovery,) = recover_directory(tmp_path)
    assert (recovery.bad_parts, recovery.original_kept) == (1, True)
    assert {one.name for one in tmp_path.iterdir()} == {path.name, f"{path.name}.damaged"}
    run = read_run(recovery.path)
    assert run.lost_messages == 1
    assert run.warnings == (f"recovered from {part.name}, 1 damaged parts left out",)
    assert 0 < len(list(run.detections())) < total


def test_messages_whose_channel_was_lost_are_counted(tmp_path: Path) -> None:
    """Where the damaged chunk is the one that described the channels, what follows means nothing and is counted lost."""
    path = small_run(tmp_path)
    content = bytearray(path.read_bytes())
    _, end = chunk_spans(path)[0]
    content[end - 40 : end - 36] = b"\0\0\0\0"
    path.write_bytes(content)
    recovery = recover_file(path)
    assert (recovery.messages, recovery.bad_parts, recovery.original_kept) == (0, 1, True)
    assert recovery.orphans > 80
    assert read_run(recovery.path).lost_messages == 1 + recovery.orphans


def test_a_copy_that_does_not_read_back_gets_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If the disk returns other bytes than were written, recovery fails, the original stays and no copy is left."""
    path = small_run(tmp_path)
    os.truncate(path, chunk_spans(path)[-1][1])
    real = DurableFile.write

    def forgetful(file: DurableFile, data: bytes) -> int:
        return real(file, bytes(data) if len(data) < 1000 else bytes(data[:-1]) + bytes([data[-1] ^ 1]))

    monkeypatch.setattr(DurableFile, "write", forgetful)
    with pytest.raises(WorkError, match="does not read back as written"):
        recover_file(path)
    assert list(tmp_path.iterdir()) == [path]


def test_a_whole_file_needs_no_recovery_but_a_whole_part_gets_its_name(tmp_path: Path) -> None:
    """Recovering a finished recording is refused; a crash between the last sync and the rename loses nothing."""
    path = small_run(tmp_path)
    original = list(read_run(path).messages())
    with pytest.raises(InputError, match="the recording is whole"):
        recover_file(path)
    path.rename(path.with_name(path.name + ".part"))
    (recovery,) = recover_directory(tmp_path)
    assert (recovery.path, recovery.cut_bytes, recovery.original_kept) == (path, 0, False)
    assert list(read_run(path).messages()) == original
    assert len(list(tmp_path.iterdir())) == 1


def test_a_part_without_a_header_is_reported_and_left(tmp_path: Path) -> None:
    """A `.part` that was cut before its header was saved is told in one line and stays; no copy is left behind."""
    path = small_run(tmp_path)
    part = tmp_path / "run-00000000-0001.mcap.part"
    part.write_bytes(path.read_bytes()[:90])
    empty = tmp_path / "run-00000000-0002.mcap.part"
    empty.write_bytes(b"")
    first, second = recover_directory(tmp_path)
    assert "nothing to recover: it was cut short before its header was saved" in first.reason
    assert "not an MCAP file" in second.reason
    assert {one.name for one in tmp_path.iterdir()} == {path.name, part.name, empty.name}


def test_a_recovery_that_was_itself_cut_is_done_anew(tmp_path: Path) -> None:
    """The half-written copy of an interrupted recovery is thrown away, and the recovery succeeds."""
    path = small_run(tmp_path)
    path.rename(path.with_name(path.name + ".part"))
    path.with_name(path.name + ".recovering").write_bytes(b"half")
    (recovery,) = recover_directory(tmp_path)
    assert len(list(read_run(recovery.path).detections())) == 60
    assert len(list(tmp_path.iterdir())) == 1
