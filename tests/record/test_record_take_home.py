"""Finished recordings come home on a stick: all that belongs to them, checked, or not at all; real files, real file systems."""

import fcntl
import hashlib
import json
import os
import struct
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from record_samples import HEADER, SCENE, recorder, small_run

from dnb_edge.archive import stick as stick_module
from dnb_edge.archive.label import write_label
from dnb_edge.archive.stick import MANIFEST, PARTIAL, SUMS, NoRoom, Stick, StickFailed, TooLarge
from dnb_edge.archive.stick_names import plain_names
from dnb_edge.archive.take_home import Progress, TakenHome, room_for, take_home
from dnb_edge.errors import InputError
from dnb_edge.record.edits import edits_path
from dnb_edge.record.names import pictures_directory
from dnb_edge.record.reader import read_run
from dnb_edge.record.writer import Recorder, RecordingSettings

HOST = "trackside"
_EXT4_SHUTDOWN = 0x8004587D
"""EXT4_IOC_SHUTDOWN: from then on the file system answers with EIO, as when a stick is pulled."""


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    place = tmp_path / "runs"
    place.mkdir()
    return place


@pytest.fixture
def stick(tmp_path: Path) -> Path:
    place = tmp_path / "stick"
    place.mkdir()
    return place


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """Mounts a real file system of its own, made in a file."""
    place = tmp_path / "disk"
    place.mkdir()

    def mount(kind: str, size_mb: int, *words: str) -> Path:
        if os.geteuid() != 0:
            pytest.skip("mounting a disk needs root")
        image = tmp_path / "disk.img"
        with image.open("wb") as stream:
            stream.truncate(size_mb << 20)
        for command in ([f"mkfs.{kind}", *words, image], ["mount", "-o", "loop", image, place]):
            try:
                done = subprocess.run(command, check=False, capture_output=True, text=True)
            except FileNotFoundError:
                pytest.skip(f"{command[0]} is not installed")
            if done.returncode != 0:
                pytest.skip(f"cannot make and mount {kind} here: {done.stderr.strip()}")
        return place

    yield mount
    subprocess.run(["umount", "-l", place], check=False, capture_output=True)


def home(runs: Path, stick: Path, **changes: object) -> TakenHome:
    return take_home(runs, stick, host=HOST, **changes)  # type: ignore[arg-type]


def lying(stick: Path) -> set[str]:
    """The files on the stick but manifest and checksums, from the box's folder on."""
    folder = stick / "dnb-edge" / HOST
    found = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    return found - {MANIFEST, SUMS}


def going_on(runs: Path, before: Path) -> Path:
    """A finished recording that goes on from `before`."""
    header = replace(HEADER, resumed_from=before.name)
    writer = Recorder(RecordingSettings(directory=runs, lossless=True, image_fps=None), header, SCENE)
    return writer.close()


def contents(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {
        str(path.relative_to(folder)): (path.read_bytes(), path.stat().st_mtime_ns)
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_finished_runs_come_home_with_all_that_belongs_to_them(runs: Path, stick: Path) -> None:
    """Chains, edits, names and pictures, byte for byte; not the run being recorded, nor one cut short; the box is as before."""
    first = small_run(runs)
    second = going_on(runs, first)
    edits_path(second).write_text('{"not": "looked at"}\n')
    write_label(second, "Final, third heat")
    ring = pictures_directory(second)
    ring.mkdir()
    (ring / "0001.mcap").write_bytes(b"pictures")
    (ring / "0002.mcap.part").write_bytes(b"being written")
    cut = small_run(runs)
    cut = cut.rename(cut.with_name(f"{cut.name}.part"))
    cut.write_bytes(cut.read_bytes()[:-300])
    (runs / "notes.mcap").write_bytes(b"not mine")
    live = recorder(runs, image_fps=None)
    before = contents(runs)
    taken = home(runs, stick)
    assert contents(runs) == before
    live.close()
    assert (taken.copied, taken.already, taken.missing, taken.stopped) == ((second.name,), (), (), None)
    whys = {one.run: one.why for one in taken.left}
    assert "being recorded" in whys.pop(f"{live.path.name}.part")
    assert "recover" in whys.pop(cut.name)
    assert "not an MCAP file" in whys.pop("notes.mcap")
    assert not whys
    wanted = {
        first.name,
        second.name,
        edits_path(second).name,
        f"{second.stem}.label.json",
        f"{second.stem}.pictures/0001.mcap",
    }
    assert lying(stick) == wanted
    folder = Path(taken.directory)
    assert all((folder / name).read_bytes() == (runs / name).read_bytes() for name in wanted)
    assert (folder / first.name).stat().st_mtime_ns == first.stat().st_mtime_ns
    assert taken.copied_bytes == sum((runs / name).stat().st_size for name in wanted)
    assert len(list(read_run(folder / first.name).messages())) == len(list(read_run(first).messages()))
    checked = subprocess.run(["sha256sum", "--strict", "-c", SUMS], cwd=folder, capture_output=True, check=False)
    assert checked.returncode == 0, checked


def test_without_pictures_they_stay(runs: Path, stick: Path) -> None:
    """`pictures=False` leaves the ring on the box."""
    run = small_run(runs)
    pictures_directory(run).mkdir()
    (pictures_directory(run) / "0001.mcap").write_bytes(b"pictures")
    home(runs, stick, pictures=False)
    assert lying(stick) == {run.name}


def test_what_is_there_is_passed_over(runs: Path, stick: Path) -> None:
    """A second time nothing is written; what is new comes, and with a lost manifest what lies there is compared and kept."""
    first = small_run(runs)
    home(runs, stick)
    before = contents(stick)
    again = home(runs, stick)
    assert (again.copied, again.already, again.files) == ((), (first.name,), 0)
    assert contents(stick) == before
    second = small_run(runs)
    assert home(runs, stick).copied == (second.name,)
    (stick / "dnb-edge" / HOST / MANIFEST).unlink()
    inodes = {path.name: path.stat().st_ino for path in (stick / "dnb-edge" / HOST).glob("*.mcap")}
    again = home(runs, stick)
    assert (again.already, again.files) == ((second.name, first.name), 0)
    assert len((stick / "dnb-edge" / HOST / MANIFEST).read_text().splitlines()) == 4
    assert {path.name: path.stat().st_ino for path in (stick / "dnb-edge" / HOST).glob("*.mcap")} == inodes


def test_a_manifest_that_was_cut_short_counts_as_far_as_it_goes(runs: Path, stick: Path) -> None:
    """A torn last line is as good as none, and the next one is not spoilt by it."""
    small_run(runs)
    home(runs, stick)
    manifest = stick / "dnb-edge" / HOST / MANIFEST
    manifest.write_bytes(manifest.read_bytes() + b'{"name": "run-')
    small_run(runs)
    assert home(runs, stick).files == 1
    found = [line for line in manifest.read_text().splitlines() if line]
    assert json.loads(found[-1])["sha256"] == hashlib.sha256(sorted(runs.glob("*.mcap"))[-1].read_bytes()).hexdigest()
    assert len(home(runs, stick).already) == 2


def test_nothing_on_the_stick_is_written_over(runs: Path, stick: Path) -> None:
    """Edits that grew come again, what had their name before lies beside them; so with a damaged copy, once it is looked at."""
    run = small_run(runs)
    edits_path(run).write_text("one\n")
    home(runs, stick)
    edits_path(run).write_text("one\ntwo\n")
    assert home(runs, stick).files == 1
    folder = stick / "dnb-edge" / HOST
    assert (folder / edits_path(run).name).read_text() == "one\ntwo\n"
    assert (folder / f"{edits_path(run).name}.older-1").read_text() == "one\n"
    bad = bytearray((folder / run.name).read_bytes())
    bad[100] ^= 1
    (folder / run.name).write_bytes(bad)
    assert home(runs, stick).files == 0
    assert home(runs, stick, check=True).files == 1
    assert (folder / run.name).read_bytes() == run.read_bytes()
    assert (folder / f"{run.name}.older-1").read_bytes() == bad


def test_a_stick_that_gives_back_other_bytes_is_told(runs: Path, stick: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A byte that changes between writing and reading back: that file never gets its name, and the copying stops."""
    small_run(runs)
    spoilt = stick / "dnb-edge" / HOST / PARTIAL
    advise = os.posix_fadvise

    def forget(opened: int, *words: int) -> None:
        if os.fstat(opened).st_ino == spoilt.stat().st_ino:
            with spoilt.open("r+b") as stream:
                stream.write(b"X")
        advise(opened, *words)

    monkeypatch.setattr(stick_module.os, "posix_fadvise", forget)
    taken = home(runs, stick)
    assert taken.stopped is not None
    assert "other bytes" in taken.stopped
    assert (taken.copied, len(taken.missing), taken.full) == ((), 1, False)
    assert lying(stick) == set()


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("kind", ["ext4", "vfat"])
def test_a_full_stick_keeps_whole_files_and_says_what_is_missing(
    runs: Path,
    disk: Callable[..., Path],
    kind: str,
    told: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of runs that do not all fit the latest come, whether the room is known or the disk only says so in the middle."""
    stick = disk(kind, 8)
    names = [small_run(runs).name for _ in range(3)]
    for name in names:
        with (runs / name).open("ab") as stream:
            stream.write(os.urandom(3 << 20))
    if not told:
        monkeypatch.setattr(Stick, "free_bytes", 1 << 40)
    taken = home(runs, stick)
    assert taken.full
    assert ("are free" in (taken.stopped or "")) == told
    whole = lying(stick)
    assert whole == set(taken.copied)
    assert 1 <= len(whole) < 3
    assert {one.run for one in taken.missing} == set(names) - whole
    folder = Path(taken.directory)
    assert all((folder / name).read_bytes() == (runs / name).read_bytes() for name in whole)


@pytest.mark.parametrize("kind", ["ext4", "vfat"])
def test_a_stick_as_they_are_sold(runs: Path, disk: Callable[..., Path], kind: str) -> None:
    """Copied, unmounted, mounted again: all there, nothing to copy."""
    stick = disk(kind, 16)
    write_label(small_run(runs), "Übung 1: früh")
    assert home(runs, stick).files == 2
    image = stick.parent / "disk.img"
    subprocess.run(["umount", stick], check=True)
    subprocess.run(["mount", "-o", "loop", image, stick], check=True)
    assert home(runs, stick).files == 0


def test_a_stick_pulled_in_the_middle_keeps_what_was_whole(runs: Path, disk: Callable[..., Path]) -> None:
    """EIO from the second run on: the first one is there and right when the stick is back, and it goes on with the second."""
    stick = disk("ext4", 32)
    names = [small_run(runs).name for _ in range(2)]
    for name in names:
        with (runs / name).open("ab") as stream:
            stream.write(os.urandom(2 << 20))

    def pull(progress: Progress) -> None:
        if progress.runs_done == 1 and progress.run == names[0]:
            opened = os.open(stick, os.O_RDONLY)
            # Nothing is flushed that was not.
            fcntl.ioctl(opened, _EXT4_SHUTDOWN, struct.pack("I", 2))
            os.close(opened)

    taken = home(runs, stick, tell=pull)
    assert "pulled out" in (taken.stopped or "")
    assert (taken.copied, [one.run for one in taken.missing]) == ((names[1],), [names[0]])
    subprocess.run(["umount", stick], check=True)
    subprocess.run(["mount", "-o", "loop", stick.parent / "disk.img", stick], check=True)
    assert names[1] in lying(stick) <= {names[1], PARTIAL}
    assert (stick / "dnb-edge" / HOST / names[1]).read_bytes() == (runs / names[1]).read_bytes()
    again = home(runs, stick)
    assert (again.copied, again.already) == ((names[0],), (names[1],))
    assert lying(stick) == set(names)


def test_nothing_lands_beneath_a_mount_point(runs: Path, disk: Callable[..., Path]) -> None:
    """Unmounted in the middle, what follows still goes to the stick, not into the box's own folder of that name."""
    stick = disk("ext4", 32)
    names = {small_run(runs).name for _ in range(3)}

    def unmount(progress: Progress) -> None:
        if progress.runs_done == 1:
            subprocess.run(["umount", "-l", stick], check=False, capture_output=True)

    assert home(runs, stick, tell=unmount).stopped is None
    assert list(stick.iterdir()) == []
    subprocess.run(["mount", "-o", "loop", stick.parent / "disk.img", stick], check=True)
    assert lying(stick) == names


def test_a_file_too_large_for_the_file_system_is_told_before_it_is_written(
    tmp_path: Path, disk: Callable[..., Path]
) -> None:
    """As FAT ends at 4 GB, ext2 with blocks of 1 kB ends at 16: known at once, by going there."""
    place = disk("ext2", 16, "-q", "-b", "1024")
    large = tmp_path / "large.mcap"
    with large.open("wb") as stream:
        stream.truncate(17 << 30)
    with Stick(place, HOST) as stick, pytest.raises(TooLarge, match="exFAT"):
        stick.put(large, "large.mcap")
    assert lying(place) == set()


def test_two_at_once_are_refused(runs: Path, stick: Path) -> None:
    """The second one is told, in one line."""
    small_run(runs)
    with Stick(stick, HOST), pytest.raises(InputError, match="another dnb-edge"):
        home(runs, stick)
    assert home(runs, stick).files == 1


@pytest.mark.parametrize("where", ["dnb-edge", f"dnb-edge/{HOST}"])
def test_links_on_the_stick_lead_nowhere(runs: Path, stick: Path, tmp_path: Path, where: str) -> None:
    """A stick whose folder is a link to the box's own files is refused, and nothing is written there."""
    small_run(runs)
    (tmp_path / "own").mkdir()
    (stick / where).parent.mkdir(exist_ok=True)
    (stick / where).symlink_to(tmp_path / "own")
    with pytest.raises(InputError, match="nothing can be written"):
        home(runs, stick)
    assert list((tmp_path / "own").iterdir()) == []


def test_a_run_that_changes_or_goes_meanwhile_is_left_to_the_next_time(
    runs: Path, stick: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is deleted before its turn, and one that is written to during it, are told; the others come all the same."""
    gone, growing, whole = small_run(runs), small_run(runs), small_run(runs)
    pour = Stick._pour

    def and_write(self: Stick, opened: int, source: Path, *rest: object) -> str:
        digest = pour(self, opened, source, *rest)  # type: ignore[arg-type]
        if source == growing:
            growing.write_bytes(growing.read_bytes() + b"more")
            gone.unlink()
        return digest

    monkeypatch.setattr(Stick, "_pour", and_write)
    taken = home(runs, stick)
    assert taken.stopped is None
    assert taken.copied == (whole.name,)
    assert {one.run: one.why.split(": ", 1)[1] for one in taken.missing} == {
        growing.name: "was written to meanwhile",
        gone.name: "cannot be read: No such file or directory",
    }
    assert lying(stick) == {whole.name}


def test_renamed_recordings_get_names_that_fat_takes(runs: Path, stick: Path) -> None:
    """Colons and capitals alone: both come, under names of their own, and a second time nothing does."""
    for name in ("heat 3: final?.mcap", "Best.mcap", "BEST.mcap"):
        small_run(runs).rename(runs / name)
    assert home(runs, stick).files == 3
    found = {name.casefold() for name in lying(stick)}
    assert len(found) == 3
    assert not any(char in name for name in found for char in '"*/:<>?\\| ')
    assert home(runs, stick).files == 0


@given(st.lists(st.text(st.characters(exclude_characters="/\0", codec="utf-8"), min_size=1, max_size=120), max_size=20))
def test_plain_names_are_plain_and_different(names: list[str]) -> None:
    """Whatever recordings are called: ASCII that FAT takes, short, no two alike where capitals do not count, stable."""
    found = plain_names(names)
    assert set(found) == set(names)
    assert len({plain.casefold() for plain in found.values()}) == len(found)
    for plain in found.values():
        assert plain.isascii()
        assert 0 < len(plain) <= 120
        assert not set(plain) & set('"*/:<>?\\| ')
        assert not plain.startswith(".")
        assert not plain.endswith(".")
    assert plain_names(reversed(names)) == found


@given(st.lists(st.integers(0, 10**10), max_size=50))
def test_room_is_never_reckoned_too_small(sizes: list[int]) -> None:
    """Each file takes whole clusters."""
    assert room_for(sizes) >= sum(sizes) + len([size for size in sizes if size % (128 * 1024)])


def test_errors_are_told_apart(stick: Path) -> None:
    """A full stick, a too large file and a stick that fails have their own words."""
    with Stick(stick, HOST) as one:
        kinds = [type(one._fault(OSError(number, "x"), "name")) for number in (28, 122, 27, 5, 19)]
    assert kinds == [NoRoom, NoRoom, TooLarge, StickFailed, StickFailed]
