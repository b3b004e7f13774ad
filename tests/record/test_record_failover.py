"""A disk that fails while a race goes on: no lap is lost, none is called saved before it is, and the recording goes on."""

import errno
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from record_samples import HEADER, SCENE, found, frame, lap, target

from dnb_edge.errors import WorkError
from dnb_edge.record.acks import Acks
from dnb_edge.record.names import pictures_files
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.recover import recover_directory
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import Incident, IncidentKind, Lap


def live_recorder(directory: Path, **changes) -> Recorder:
    return Recorder(RecordingSettings(**({"directory": directory, "sync_period_s": 0.05} | changes)), HEADER, SCENE)


def wait_until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end_s, "nothing happened"
        time.sleep(0.01)


class Broken:
    """Makes every sync of files below `directory` fail, as long as it is switched on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, directory: Path, error: int = errno.EIO) -> None:
        self.on = False
        for name in ("fdatasync", "fsync"):
            monkeypatch.setattr(os, name, self._failing(getattr(os, name), directory, error))

    def _failing(self, real: Callable[[int], None], directory: Path, error: int) -> Callable[[int], None]:
        def sync(descriptor: int) -> None:
            if self.on and Path(f"/proc/self/fd/{descriptor}").readlink().is_relative_to(directory):
                raise OSError(error, os.strerror(error))
            real(descriptor)

        return sync


def laps_in(*directories: Path) -> list[int]:
    for directory in directories:
        recover_directory(directory)
    paths = sorted((path for directory in directories for path in directory.glob("*.mcap")), key=lambda path: path.name)
    alone = [read_run(path) for path in paths]
    return [one.number for run in alone if not run.earlier for one in run.events() if isinstance(one, Lap)] + [
        one.number for run in alone if run.earlier for one in run.events() if isinstance(one, Lap)
    ]


@pytest.mark.parametrize("error", [errno.EIO, errno.EROFS, errno.ENOSPC])
def test_a_failed_disk_is_left_for_another_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int) -> None:
    """The lap whose sync failed is written again on the other disk, and called saved only there; its file says where it goes
    on from, a directory that is not there is passed over and not made, and the warnings name the file that was given up."""
    card, missing, stick = tmp_path / "card", tmp_path / "missing", tmp_path / "stick"
    stick.mkdir()
    broken = Broken(monkeypatch, card, error)
    writer = live_recorder(card, fallback=(missing, stick))
    first = writer.path
    assert writer.wait_saved(writer.add_event(lap(1, 1_000)))
    broken.on = True
    writer.add_detections(found(1, 1_000))
    ticket = writer.add_event(lap(2, 2_000))
    assert writer.wait_saved(ticket, timeout_s=20)
    assert writer.path.parent == stick
    assert [one.number for one in read_run(writer.path, tolerate_damage=True).events() if isinstance(one, Lap)] == [2]
    health = writer.health()
    assert (health.state, health.saved_laps) == ("recording", 2)
    assert health.warnings[0].startswith(f"{first.name} was given up: ")
    assert not missing.exists()
    path = writer.close()
    run = read_run(path)
    name = first.name.removesuffix(".part")
    assert run.warnings[-1] == f"it goes on from {name}, which is not beside it: what came before is left out"
    assert path.name != name, "both may be copied into one directory"
    assert [one.number for one in run.events() if isinstance(one, Lap)] == [2]
    broken.on = False
    (recovery,) = recover_directory(card)
    assert 1 in [one.number for one in read_run(recovery.path).events() if isinstance(one, Lap)]


def test_with_no_disk_at_all_laps_wait_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the only disk fails, nothing is called saved, the state says why and telemetry is counted lost; once it works
    again, every lap of the meantime is saved in a new file, which is read with the old one as one recording."""
    broken = Broken(monkeypatch, tmp_path)
    writer = live_recorder(tmp_path)
    assert writer.wait_saved(writer.add_event(lap(1, 1_000)))
    broken.on = True
    tickets = []
    for number in range(2, 6):
        writer.add_detections(found(number, number * 1_000))
        tickets.append(writer.add_event(lap(number, number * 1_000)))
        assert not writer.wait_saved(tickets[-1])
    wait_until(lambda: writer.health().lost_messages == 4)
    health = writer.health()
    assert (health.state, health.reason, health.saved_laps) == ("failed", "input/output error", 1)
    assert health.warnings[-1] == "recording failed: input/output error"
    assert not any(map(writer.is_saved, tickets))
    broken.on = False
    wait_until(lambda: writer.health().state == "recording")
    assert all(map(writer.is_saved, tickets))
    assert writer.health().saved_laps == 5
    data = writer.add_detections(found(9, 9_000))
    assert writer.wait_saved(data)
    last = writer.close()
    recover_directory(tmp_path)
    run = read_run(last)
    assert len(run.files) == 2
    assert sorted({one.number for one in run.events() if isinstance(one, Lap)}) == [1, 2, 3, 4, 5]
    assert run.lost_messages == 4


def test_a_race_begins_without_a_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody watches a box whose card has become read-only: it starts all the same where it may, says that nothing is recorded,
    and records once it can. At a desk it is refused."""
    broken = Broken(monkeypatch, tmp_path, errno.EROFS)
    broken.on = True
    with pytest.raises(WorkError, match="read-only file system"):
        live_recorder(tmp_path)
    writer = live_recorder(tmp_path, start_anyway=True)
    ticket = writer.add_event(lap(1, 1_000))
    assert not writer.wait_saved(ticket)
    assert writer.health().warnings == ("recording failed: read-only file system",)
    broken.on = False
    wait_until(lambda: writer.is_saved(ticket))
    assert laps_in(writer.close().parent) == [1]


def test_a_race_begins_on_the_other_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the first disk cannot be written to at the start, the second is taken at once, with a warning."""
    card, stick = tmp_path / "card", tmp_path / "stick"
    stick.mkdir()
    Broken(monkeypatch, card, errno.EROFS).on = True
    writer = live_recorder(card, fallback=(stick,))
    assert writer.path.parent == stick
    assert writer.health().warnings == (f"{card}: read-only file system",)
    writer.close()


def test_what_is_kept_is_written_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that comes back just before the race ends gets all laps when the recording is closed."""
    broken = Broken(monkeypatch, tmp_path)
    writer = live_recorder(tmp_path)
    broken.on = True
    assert not writer.wait_saved(writer.add_event(lap(1, 1_000)))
    broken.on = False
    writer.close()
    assert laps_in(tmp_path)[-1] == 1


def test_a_race_that_can_be_run_again_ends_its_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With files and the simulator a failed file is the end of the recording, in one line, and no other file is begun."""
    broken = Broken(monkeypatch, tmp_path)
    writer = live_recorder(tmp_path, go_on=False)
    broken.on = True
    assert not writer.wait_saved(writer.add_event(lap(1, 1_000)))
    broken.on = False
    writer.add_detections(found(1, 2_000))
    assert not writer.wait_saved(writer.add_event(lap(2, 3_000)))
    with pytest.raises(WorkError, match="recording failed: input/output error"):
        writer.close()
    assert writer.health().warnings == ("recording failed: input/output error",)
    assert list(tmp_path.iterdir()) == [writer.path]


@pytest.fixture
def mounted(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own that can be made read-only."""
    if os.geteuid() != 0:
        pytest.skip("mounting needs root")
    place = tmp_path / "card"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", place]
    if subprocess.run(mount, check=False, capture_output=True).returncode != 0:
        pytest.skip("cannot mount a file system here")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


def test_a_full_stick_gives_way_to_the_next_disk(mounted: Path, tmp_path: Path) -> None:
    """On a real file system that somebody else has filled, the recording goes on in the next directory, and no lap is lost."""
    stick = tmp_path / "stick"
    stick.mkdir()
    writer = live_recorder(mounted, fallback=(stick,))
    with pytest.raises(OSError, match="No space"):
        (mounted / "big").write_bytes(bytes(9_000_000))
    for number in range(1, 30):
        for sequence in range(40):
            writer.add_detections(found(sequence, number * 1_000_000 + sequence))
        assert writer.wait_saved(writer.add_event(lap(number, number * 1_000_000 + 50)), timeout_s=20)
    assert writer.path.parent == stick
    path = writer.close()
    (mounted / "big").unlink()
    assert set(laps_in(mounted, path.parent)) == set(range(1, 30))


def test_a_long_recording_goes_on_in_another_file(tmp_path: Path) -> None:
    """With a time for each file the next one begins behind a lap; the files, read as one, hold every frame and lap once."""
    writer = live_recorder(tmp_path, rotate_s=0.0001, image_fps=None)
    for number in range(1, 4):
        for sequence in range(number * 10, number * 10 + 10):
            writer.add_detections(found(sequence, sequence * 1_000))
            writer.add_event(target(sequence * 1_000))
        assert writer.wait_saved(writer.add_event(lap(number, (number * 10 + 9) * 1_000)))
    last = writer.close()
    paths = sorted(tmp_path.iterdir())
    assert len(paths) == 4
    run = read_run(last)
    assert run.files == tuple(paths)
    assert [one.sequence for one in run.detections()] == list(range(10, 40))
    assert [one.number for one in run.events() if isinstance(one, Lap)] == [1, 2, 3]
    assert run.lost_messages == 0


def incident(worst_t_ns: int, number: int = 1) -> Incident:
    return Incident(
        number=number,
        kind=IncidentKind.OFF_TRACK,
        car=1,
        target_id=1,
        lap=1,
        start_t_ns=worst_t_ns - 1,
        end_t_ns=worst_t_ns + 2_000_000_000,
        start_s=0.0,
        lasted_s=2.0,
        greatest_m=0.1,
        worst_t_ns=worst_t_ns,
        track_m=(0.0, 0.0),
        camera_px=(3.0, 4.0),
        s_m=1.0,
        text="left the track",
    )


def test_pictures_lie_in_a_ring_and_those_of_incidents_in_the_recording(tmp_path: Path) -> None:
    """Of a long race the newest pictures are kept, within the ring's bytes, and of older ones those that show an incident;
    read back they come in order, each once."""
    ring_bytes = 4_000_000
    writer = live_recorder(tmp_path, image_fps=100.0, image_ring_bytes=ring_bytes, lossless=True)
    for sequence in range(200):
        t_ns = sequence * 100_000_000
        writer.add_frame(frame(sequence, t_ns, jpeg=os.urandom(50_000)))
        writer.add_detections(found(sequence, t_ns))
        if sequence == 30:
            writer.add_event(incident(2_010_000_000))
    path = writer.close()
    ring = pictures_files(path)
    assert sum(one.stat().st_size for one in ring) <= ring_bytes
    assert path.stat().st_size < 300_000
    kept = [one.sequence for one in iter_frames(path)]
    assert kept[0] == 20
    assert kept[1:] == list(range(kept[1], 200))
    assert 60 < len(kept) < 80
    assert read_run(ring[0]).header == HEADER


def test_pictures_of_a_killed_run_are_read_as_far_as_they_go(tmp_path: Path) -> None:
    """The ring's last file, cut short, gives the pictures that are whole."""
    writer = live_recorder(tmp_path, image_fps=100.0, image_ring_bytes=4_000_000, lossless=True)
    for sequence in range(20):
        writer.add_frame(frame(sequence, sequence * 100_000_000, jpeg=os.urandom(50_000)))
    writer.wait_saved()
    writer.abandon()
    (recovery,) = recover_directory(tmp_path)
    assert pictures_files(recovery.path)[-1].name.endswith(".part")
    kept = [one.sequence for one in iter_frames(recovery.path)]
    assert kept == list(range(len(kept)))
    assert len(kept) >= 10


@given(lost=st.sets(st.integers(1, 60)), through=st.integers(0, 60), order=st.randoms(use_true_random=False))
def test_a_lost_ticket_is_never_called_saved(lost: set[int], through: int, order) -> None:
    """Whatever was lost, in whatever order that is told, tickets are saved up to where the disk has come, but for it."""
    acks = Acks()
    told = sorted(lost)
    order.shuffle(told)
    for ticket in told:
        acks.lost(ticket)
    acks.saved(through)
    assert {ticket for ticket in range(1, 61) if acks.is_saved(ticket)} == set(range(1, through + 1)) - lost
    assert not acks.is_saved(None)


def test_too_many_holes_make_it_say_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """With more holes than are kept, the oldest tickets all count as not saved: memory is bounded, and nothing is claimed."""
    monkeypatch.setattr("dnb_edge.record.acks.HOLES_KEPT", 10)
    acks = Acks()
    for ticket in range(2, 60, 2):
        acks.lost(ticket)
    acks.saved(60)
    saved = {ticket for ticket in range(1, 61) if acks.is_saved(ticket)}
    assert saved <= {ticket for ticket in range(1, 61) if ticket % 2 == 1 or ticket == 60}
    assert 59 in saved
