"""What is still recorded as the disk fills up, and which recordings go: decided from values, with a disk that is made up."""

import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from record_samples import HEADER, SCENE, SOURCE, found, frame, lap, small_run, target

from dnb_edge.errors import InputError
from dnb_edge.record.durable import DurableFile
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.retention import Limits, StoredRun, next_removal, pin, plan, prune, stored_runs, unpin
from dnb_edge.record.room import Level, Room, level_of
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import Lap

MB = 1_000_000
AMPLE = Room(free_bytes=10_000 * MB, total_bytes=32_000 * MB)


def disk(free: Callable[[], int], total: int = 32_000 * MB) -> Callable[[Path], os.statvfs_result]:
    """A statvfs that tells of a disk with `free()` bytes left."""
    return lambda place: os.statvfs_result((1, 1, total, free(), free(), 0, 0, 0, 0, 255))


def stored(
    name: str, *, pinned: bool = False, live: bool = False, pictures: int = 0, size: int = 100 * MB
) -> StoredRun:
    return StoredRun(
        name=name,
        files=(Path(f"{name}.mcap"),),
        pictures=(Path(f"{name}.pictures/000001.mcap"),) if pictures else (),
        size_bytes=size + pictures,
        pictures_bytes=pictures,
        changed_ns=0,
        pinned=pinned,
        live=live,
    )


@pytest.mark.parametrize(
    ("free_mb", "before", "level"),
    [
        (201, Level.ALL, Level.ALL),
        (199, Level.ALL, Level.NO_PICTURES),
        (101, Level.ALL, Level.NO_PICTURES),
        (99, Level.ALL, Level.LAPS_ONLY),
        (0, Level.ALL, Level.LAPS_ONLY),
        (105, Level.LAPS_ONLY, Level.LAPS_ONLY),
        (111, Level.LAPS_ONLY, Level.NO_PICTURES),
        (210, Level.NO_PICTURES, Level.NO_PICTURES),
        (221, Level.NO_PICTURES, Level.ALL),
        (221, Level.LAPS_ONLY, Level.ALL),
    ],
)
def test_pictures_stop_first_then_telemetry(free_mb: int, before: Level, level: Level) -> None:
    """Below what is kept free no pictures, below half of it no telemetry; both come back with a tenth more room than that."""
    assert level_of(Room(free_bytes=free_mb * MB, total_bytes=32_000 * MB), 200 * MB, before) is level


def test_a_small_disk_keeps_a_tenth_free() -> None:
    """On a disk of 500 MB, 200 MB would be too much to ask."""
    small = Room(free_bytes=60 * MB, total_bytes=500 * MB)
    assert level_of(small, 200 * MB, Level.ALL) is Level.ALL
    assert level_of(Room(free_bytes=49 * MB, total_bytes=500 * MB), 200 * MB, Level.ALL) is Level.NO_PICTURES


@pytest.mark.parametrize(
    ("runs", "limits", "free_mb", "gone"),
    [
        ([stored("a"), stored("b")], Limits(keep_free_bytes=200 * MB), 251, []),
        ([stored("a"), stored("b")], Limits(keep_free_bytes=200 * MB), 249, ["a"]),
        ([stored("a"), stored("b"), stored("c")], Limits(keep_free_bytes=200 * MB), 60, ["a", "b"]),
        ([stored("a", pinned=True), stored("b"), stored("c")], Limits(keep_free_bytes=200 * MB), 200, ["b"]),
        ([stored("a", live=True), stored("b"), stored("c")], Limits(keep_free_bytes=200 * MB), 200, ["b"]),
        ([stored("a"), stored("b"), stored("c", live=True)], Limits(keep_free_bytes=200 * MB), 1, ["a"]),
        ([stored("a", pictures=MB)], Limits(keep_free_bytes=200 * MB), 1, ["a pictures"]),
        ([stored("a"), stored("b", pinned=True)], Limits(keep_free_bytes=200 * MB), 1, ["a"]),
        ([stored("a", pinned=True), stored("b", live=True)], Limits(keep_free_bytes=200 * MB), 1, []),
        ([stored("a"), stored("b")], Limits(max_total_bytes=150 * MB), 9000, ["a"]),
        ([stored("a"), stored("b")], Limits(max_total_bytes=200 * MB), 9000, []),
        ([stored("a"), stored("b", pictures=50 * MB)], Limits(max_total_bytes=200 * MB), 9000, ["b pictures"]),
        (
            [stored("a", pictures=1), stored("b", pictures=2), stored("c")],
            Limits(keep_free_bytes=200 * MB),
            200,
            ["a pictures", "b pictures", "a"],
        ),
        ([stored("a", pinned=True, pictures=9 * MB)], Limits(keep_free_bytes=200 * MB), 1, []),
        ([], Limits(keep_free_bytes=200 * MB), 1, []),
    ],
)
def test_the_oldest_go_first_and_pictures_before_them(
    runs: list[StoredRun], limits: Limits, free_mb: int, gone: list[str]
) -> None:
    """What would go, in order, with a made-up disk: never what is pinned, live or the last that was finished, and no more
    than is needed."""
    removals = plan(runs, limits, Room(free_bytes=free_mb * MB, total_bytes=32_000 * MB))
    assert [f"{one.name} pictures" if one.pictures_only else one.name for one in removals] == gone


def test_with_room_enough_nothing_goes() -> None:
    """No limit, no removal."""
    assert next_removal([stored("a")], Limits(), AMPLE) is None


def make_run(directory: Path, number: int, *, age_s: int, edits: bool = False, suffix: str = "") -> Path:
    path = directory / f"run-0badcafe-{number:04d}.mcap{suffix}"
    path.write_bytes(bytes(1000))
    if edits:
        path.with_name(f"run-0badcafe-{number:04d}.edits.jsonl").write_bytes(bytes(10))
    os.utime(path, (1e9 - age_s, 1e9 - age_s))
    return path


def names_in(directory: Path) -> set[str]:
    return {one.name for one in directory.iterdir()}


def test_files_of_a_run_go_together(tmp_path: Path) -> None:
    """The oldest by date goes with its edits and pictures; a younger one with a lower number, one that was renamed, edits
    without a run and what is not ours stay."""
    make_run(tmp_path, 7, age_s=90, edits=True)
    make_run(tmp_path, 3, age_s=10)
    (tmp_path / "run-0badcafe-0007.pictures").mkdir()
    (tmp_path / "run-0badcafe-0007.pictures" / "000001.mcap").write_bytes(bytes(50))
    kept = {"run-0badcafe-0003.mcap", "final heat.mcap", "run-0badcafe-0099.edits.jsonl", "notes.txt"}
    for name in kept - {"run-0badcafe-0003.mcap"}:
        (tmp_path / name).write_bytes(bytes(5000))
    removals = prune(tmp_path, Limits(max_total_bytes=1500))
    assert [(one.name, one.pictures_only) for one in removals] == [
        ("run-0badcafe-0007", True),
        ("run-0badcafe-0007", False),
    ]
    assert names_in(tmp_path) == kept
    assert prune(tmp_path, Limits(max_total_bytes=1500)) == []


def test_a_dry_run_deletes_nothing(tmp_path: Path) -> None:
    """It names the same that would go."""
    for number in (1, 2, 3):
        make_run(tmp_path, number, age_s=100 - number)
    limits = Limits(max_total_bytes=1500)
    told = prune(tmp_path, limits, dry_run=True)
    assert len(names_in(tmp_path)) == 3
    assert prune(tmp_path, limits) == told
    assert names_in(tmp_path) == {"run-0badcafe-0003.mcap"}


def test_a_pin_keeps_a_run_for_ever(tmp_path: Path) -> None:
    """A pinned run stays whatever the limits; unpinned it goes. A name that is never deleted takes no pin."""
    path = make_run(tmp_path, 1, age_s=5)
    make_run(tmp_path, 2, age_s=1)
    beside = pin(path)
    assert beside.name == "run-0badcafe-0001.pin"
    assert prune(tmp_path, Limits(max_total_bytes=1)) == []
    unpin(path)
    assert not beside.exists()
    assert len(prune(tmp_path, Limits(max_total_bytes=1))) == 1
    with pytest.raises(InputError, match="no such recording"):
        pin(path)
    other = tmp_path / "final.mcap"
    other.touch()
    with pytest.raises(InputError, match="needs no pin"):
        pin(other)


def test_the_run_that_is_being_recorded_stays(tmp_path: Path) -> None:
    """A locked `.part` is never deleted, nor one that was only just created; one that nobody writes is an old run like any."""
    live = DurableFile(tmp_path / "run-0badcafe-0001.mcap")
    live.write(bytes(5000))
    (tmp_path / "run-0badcafe-0002.mcap.part").touch()
    make_run(tmp_path, 3, age_s=5, suffix=".part")
    newest = make_run(tmp_path, 4, age_s=0)
    os.utime(newest, (4e9, 4e9))
    assert [one.name for one in prune(tmp_path, Limits(max_total_bytes=1))] == ["run-0badcafe-0003"]
    live.abandon()
    assert [one.name for one in prune(tmp_path, Limits(max_total_bytes=1))] == ["run-0badcafe-0001"]


def live_recorder(directory: Path, statvfs: Callable[[Path], os.statvfs_result] = os.statvfs, **changes) -> Recorder:
    settings = {
        "directory": directory,
        "image_fps": 1000.0,
        "image_ring_bytes": 5 * MB,
        "sync_period_s": 0.05,
    } | changes
    return Recorder(RecordingSettings(**settings), HEADER, SCENE, statvfs=statvfs)


def wait_until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end_s, "nothing happened"
        time.sleep(0.02)


def told(writer: Recorder, words: str) -> Callable[[], bool]:
    return lambda: any(words in warning for warning in writer.health().warnings)


def test_a_disk_that_fills_up_costs_pictures_then_telemetry_and_no_lap(tmp_path: Path) -> None:
    """As room shrinks, each step is told in a warning and recorded laps are acknowledged throughout; all comes back with room,
    and the file says what it lost."""
    free = [1000 * MB]
    writer = live_recorder(tmp_path, disk(lambda: free[0]), keep_free_bytes=200 * MB)

    def second(number: int) -> None:
        writer.add_frame(frame(number, number * 1_000_000_000))
        writer.add_detections(found(number, number * 1_000_000_000))
        writer.add_event(target(number * 1_000_000_000))
        assert writer.wait_saved(writer.add_event(lap(number, number * 1_000_000_000)))

    second(1)
    free[0] = 150 * MB
    wait_until(told(writer, "no pictures are recorded"))
    second(2)
    free[0] = 50 * MB
    wait_until(told(writer, "only laps are recorded"))
    second(3)
    free[0] = 1000 * MB
    wait_until(lambda: not told(writer, "is nearly full")())
    second(4)
    health = writer.health()
    assert (health.state, health.lost_messages, health.dropped_images, health.saved_laps) == ("recording", 2, 2, 4)
    path = writer.close()
    run = read_run(path)
    assert [one.number for one in run.events() if isinstance(one, Lap)] == [1, 2, 3, 4]
    assert [one.sequence for one in run.detections()] == [1, 2, 4]
    assert [one.sequence for one in iter_frames(path)] == [1, 4]
    assert run.lost_messages == 2


def test_the_recorder_makes_room_for_itself(tmp_path: Path) -> None:
    """With less room than is wanted the oldest runs go, one by one, until there is enough; the recording goes on, and tells."""
    for number in (1, 2, 3):
        make_run(tmp_path, number, age_s=100 - number)
    old = lambda: sum(one.name.startswith("run-0badcafe") for one in tmp_path.iterdir())  # noqa: E731
    writer = live_recorder(tmp_path, disk(lambda: (400 - 100 * old()) * MB), keep_free_bytes=200 * MB, prune=True)
    wait_until(lambda: old() == 1)
    wait_until(told(writer, "2 old recordings, or their pictures, deleted to make room, last of run-0badcafe-0002"))
    wait_until(lambda: not told(writer, "is nearly full")())
    path = writer.close()
    assert names_in(tmp_path) == {"run-0badcafe-0003.mcap", path.name}


def test_where_nothing_may_go_it_is_said(tmp_path: Path) -> None:
    """All that is old is pinned: a warning says that nothing more may be deleted."""
    pin(make_run(tmp_path, 1, age_s=100))
    writer = live_recorder(tmp_path, disk(lambda: 100 * MB), keep_free_bytes=200 * MB, prune=True)
    wait_until(told(writer, "nothing more may be deleted: 100 MB free, 250 wanted"))
    writer.close()
    assert len(stored_runs(tmp_path)) == 2


@pytest.fixture
def small_disk(tmp_path: Path):
    """A real file system of 8 MiB."""
    if os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root")
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", place], check=False, capture_output=True, text=True
    )
    if mounted.returncode != 0:
        pytest.skip(f"cannot mount a small disk here: {mounted.stderr.strip()}")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


def test_a_real_disk_that_is_full_of_old_runs_takes_a_new_one(small_disk: Path) -> None:
    """On 8 MiB filled with old recordings to the last 40 kB, a race is recorded whole: the oldest make room for it."""
    source = small_run(small_disk)
    for number in range(1, 70):
        path = small_disk / f"run-0badcafe-{number:04d}.mcap"
        try:
            path.write_bytes(source.read_bytes() + os.urandom(100_000))
        except OSError:
            path.unlink()
            break
        os.utime(path, (1e9 + number, 1e9 + number))
    before = len(names_in(small_disk))
    writer = live_recorder(small_disk, keep_free_bytes=400_000, prune=True, image_ring_bytes=None)
    wait_until(lambda: len(names_in(small_disk)) <= before - 3)
    for sequence in range(200):
        writer.add_detections(found(sequence, sequence * 33_000_000))
    assert writer.wait_saved(writer.add_event(lap(1, 1)))
    path = writer.close()
    assert len(list(read_run(path).detections())) == 200
    assert read_run(path).header.source == SOURCE
    assert not (small_disk / "run-0badcafe-0001.mcap").exists()
