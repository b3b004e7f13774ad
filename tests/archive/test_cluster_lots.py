"""Which recordings places mean, here and in other file systems, and how one from elsewhere comes to this machine."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import fsspec
import pytest
from archive_runs import Car, make_runs, record

from dnb_edge.archive import lots as lots_room
from dnb_edge.archive.lot_score import LotJob, score_lot
from dnb_edge.archive.lots import Lot, at_hand, guarded, is_elsewhere, is_pattern, last_of_chains, listed, previous_of
from dnb_edge.errors import InputError


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with three recordings."""
    directory = tmp_path_factory.mktemp("lots") / "runs"
    make_runs(directory, 3)
    return directory


@pytest.fixture
def memory():
    """fsspec's file system in this process, empty."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    yield system
    system.store.clear()


def names(*places: object) -> list[str]:
    return [Path(lot.name).name for lot in listed([str(place) for place in places])]


def test_files_directories_and_patterns_mean_recordings_once(runs: Path) -> None:
    """In the order of the places, those of one place by name, each once however often it is named."""
    three = [f"run-{place}.mcap" for place in range(3)]
    assert names(runs) == three
    assert names(runs / "run-[02].mcap") == ["run-0.mcap", "run-2.mcap"]
    assert names(runs.parent / "**" / "run-1.mcap") == ["run-1.mcap"]
    assert names(runs.parent / "run*") == three
    assert names(runs / "run-2.mcap", runs, runs / "*.mcap") == ["run-2.mcap", "run-0.mcap", "run-1.mcap"]


def test_addresses_mean_recordings_of_other_file_systems(runs: Path, memory, tmp_path: Path) -> None:
    """A directory, a pattern and a file in memory; a zip file: named by their addresses, without anything else there."""
    for path in runs.iterdir():
        memory.pipe(f"/years/{path.name}", path.read_bytes())
    memory.pipe("/years/notes.txt", b"nothing")
    three = [f"memory:///years/run-{place}.mcap" for place in range(3)]
    assert [lot.name for lot in listed(["memory://years"])] == three
    assert [lot.name for lot in listed(["memory://years/run-[12].mcap", three[1]])] == three[1:]
    archive = tmp_path / "years.zip"
    with zipfile.ZipFile(archive, "w") as made:
        made.write(runs / "run-0.mcap", "run-0.mcap")
    assert names(f"zip://*.mcap::file://{archive}") == ["run-0.mcap"]


NOWHERE = [
    ("there is no such recording", "no.mcap"),
    ("no recording (.mcap) has such a name", "no*.mcap"),
    ("no recordings (.mcap) in this directory", "."),
    ("Protocol not known: nothing", "nothing://x/y.mcap"),
    ("no recordings (.mcap) there", "memory://no/where"),
    ("cannot be listed: FileNotFoundError", "zip://*.mcap::file:///no.zip"),
]


@pytest.mark.parametrize(("text", "place"), NOWHERE)
def test_a_place_without_recordings_is_one_line(tmp_path: Path, monkeypatch, memory, text: str, place: str) -> None:
    """It names the place."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as told:
        listed([place])
    assert text in str(told.value)
    assert place in str(told.value)
    assert "\n" not in str(told.value)


def test_what_is_a_pattern_or_an_address() -> None:
    """A file that is called like a pattern is that file."""
    assert is_pattern("runs/*.mcap")
    assert not is_pattern("runs/a.mcap")
    assert is_elsewhere("s3://bucket/a.mcap")
    assert not is_elsewhere("/runs/a.mcap")


def test_a_file_called_like_a_pattern_is_that_file(tmp_path: Path) -> None:
    """And no pattern for others."""
    (tmp_path / "a[1].mcap").touch()
    assert not is_pattern(str(tmp_path / "a[1].mcap"))
    assert names(tmp_path / "a[1].mcap") == ["a[1].mcap"]


def test_an_error_of_any_kind_is_one_line() -> None:
    """Nobody knows what a file system's library raises."""

    def fail() -> None:
        raise KeyError("no credentials")

    with pytest.raises(InputError, match="it: KeyError: 'no credentials'"):
        guarded(fail, "it")


def test_a_missing_package_is_named(monkeypatch, tmp_path: Path) -> None:
    """Without fsspec no address can be read; the extra is."""
    monkeypatch.setitem(__import__("sys").modules, "fsspec", None)
    with pytest.raises(InputError, match=r"pip install 'dnb-edge\[cluster\]'"):
        listed(["memory://x"])


def test_a_recording_elsewhere_scores_as_here_with_its_edits(runs: Path, memory, monkeypatch) -> None:
    """It is copied in pieces into a directory that is gone afterwards; what lies beside it comes along."""
    monkeypatch.setattr(lots_room, "PIECE_BYTES", 1000)
    memory.pipe("/years/run-1.mcap", (runs / "run-1.mcap").read_bytes())
    memory.pipe("/years/run-1.edits.jsonl", b"nonsense\n")
    (lot,) = listed(["memory://years"])
    with at_hand(lot) as path:
        assert path.read_bytes() == (runs / "run-1.mcap").read_bytes()
        assert sorted(one.name for one in path.parent.iterdir()) == ["run-1.edits.jsonl", "run-1.mcap"]
    assert not path.parent.exists()
    (error,) = score_lot(LotJob(lot=lot)).errors
    assert error.startswith("memory:///years/run-1") or "run-1.edits.jsonl" in error
    there = score_lot(LotJob(lot=lot, edits=False)).runs[0]
    (here,) = score_lot(LotJob(lot=listed([str(runs / "run-1.mcap")])[0])).runs
    assert len(here.laps) == 3
    assert [dict(lap, recording="") for lap in there.laps] == [dict(lap, recording="") for lap in here.laps]
    assert there.trials == here.trials


def chain(directory: Path) -> list[Path]:
    """Three files of which each goes on from the one before it, and one for itself."""
    car = Car((3.0,))
    return [
        record(directory, "a.mcap", car),
        record(directory, "b.mcap", car, resumed_from="a.mcap"),
        record(directory, "c.mcap", car, resumed_from="b.mcap"),
        record(directory, "other.mcap", car),
    ]


def last(lots: tuple[Lot, ...]) -> list[str]:
    previous = {}
    for place, lot in enumerate(lots):
        try:
            previous[place] = previous_of(lot)
        except InputError:
            continue
    return [Path(lot.name).name for lot in last_of_chains(lots, previous)]


def test_of_a_run_of_several_files_only_the_last_is_scored(tmp_path: Path, memory, monkeypatch) -> None:
    """Here and elsewhere; of a file that lies elsewhere only its beginning is read for that."""
    files = chain(tmp_path)
    assert last(listed([str(tmp_path)])) == ["c.mcap", "other.mcap"]
    for path in files:
        memory.pipe(f"/years/{path.name}", path.read_bytes())
    there = listed(["memory://years"])
    monkeypatch.setattr(lots_room, "HEAD_BYTES", (2000, 100_000))
    assert last(there) == ["c.mcap", "other.mcap"]
    with at_hand(there[2]) as path:
        assert sorted(one.name for one in path.parent.iterdir()) == ["a.mcap", "b.mcap", "c.mcap"]


def test_a_file_that_cannot_be_read_stays_to_be_told(tmp_path: Path) -> None:
    """Even where another one goes on from it; files of one name in two directories are not mixed up."""
    files = chain(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    shutil.copy(files[0], tmp_path / "elsewhere" / "b.mcap")
    files[1].write_bytes(b"nothing")
    found = last(listed([str(tmp_path), str(tmp_path / "elsewhere")]))
    assert found == ["a.mcap", "b.mcap", "c.mcap", "other.mcap", "b.mcap"]
