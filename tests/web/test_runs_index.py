"""The index: the same as the readers say, right while a file grows, chains as one run, ids that stay."""

import threading
from pathlib import Path

import pytest
from runs_made import Car, header_of, record, recorder, said, setup

from dnb_edge.archive.glance import Walked, chunks_of, glance, walk
from dnb_edge.archive.index import RunIndex
from dnb_edge.archive.stored import FileState, run_id, session_id
from dnb_edge.record.reader import read_run
from dnb_edge.record.recover import recover_file
from dnb_edge.values import FrameDetections, Lap

ONE, TWO, THREE = (f"run-0000000a-000{k}.mcap" for k in (1, 2, 3))


def test_glance_walk_and_reader_agree(tmp_path: Path) -> None:
    """What the index at the end says, what hopping over the records finds and what reading all gives are the same."""
    path = record(tmp_path, 2.0, 2.2)
    quick, (_, walked), run = glance(path), walk(path), read_run(path)
    assert quick is not None
    assert {topic: count for topic, count in quick.counts.items() if count} == run.counts
    assert (quick.first_t_ns, quick.last_t_ns) == (run.first_t_ns, run.last_t_ns)
    found = walked.contents()
    assert (found.counts, found.first_t_ns, found.last_t_ns) == (run.counts, run.first_t_ns, run.last_t_ns)
    places = chunks_of(path)
    assert places is not None
    assert [place.offset for place in places] == [place.offset for place in walked.chunks]


def test_a_walk_goes_on_where_it_was_wherever_it_was_cut(tmp_path: Path) -> None:
    """A file that is looked at after each kilobyte ends up the same as one that is looked at once, and never shrinks."""
    whole = record(tmp_path, 2.0, 2.2).read_bytes()
    path = tmp_path / "growing"
    going_on, before = Walked(), 0
    for size in (*range(0, len(whole), 1499), len(whole)):
        path.write_bytes(whole[:size])
        going_on, now = walk(path, going_on)
        count = sum(now.contents().counts.values())
        assert count >= before
        before = count
    assert now.contents() == walk(path)[1].contents()


def test_a_torn_end_is_left_out(tmp_path: Path) -> None:
    """Zeros or nonsense behind the last whole record, as a power cut leaves them, hide nothing before them."""
    whole = record(tmp_path, 2.0, finish=False).read_bytes()
    path = tmp_path / "torn"
    path.write_bytes(whole)
    contents = walk(path)[1].contents()
    for torn in (b"\0" * 5000, b"\x06" + (10**6).to_bytes(8, "little"), b"\xff" * 40, b"\x06"):
        path.write_bytes(whole + torn)
        assert walk(path)[1].contents() == contents


def test_laps_while_it_is_recorded(tmp_path: Path) -> None:
    """Each look knows every lap that was saved by then, in order, and the end changes neither id nor laps."""
    made = setup()
    writer = recorder(tmp_path, header_of(made), sync_period_s=0.05)
    index, saved = RunIndex(tmp_path), 0
    for one in said(Car([2.5] * 5), made):
        if isinstance(one, FrameDetections):
            writer.add_detections(one)
        elif isinstance(one, Lap):
            assert writer.wait_saved(writer.add_event(one))
            saved += 1
            (run,) = index.runs()
            assert run.state is FileState.RECORDING
            assert [lap.number for lap in index.laps(run)] == list(range(1, saved + 1))
        else:
            writer.add_event(one)
    before = run.id
    writer.close()
    (run,) = index.runs()
    assert (run.state, run.id, saved) == (FileState.FINISHED, before, 5)
    assert index.laps(run) == RunIndex(tmp_path).laps(RunIndex(tmp_path).runs()[0]) != ()


def test_ids_stay_over_restart_and_recovery(tmp_path: Path) -> None:
    """What was cut short keeps its id when it is recovered; an id tells no name, and each run and session has its own."""
    path = record(tmp_path, 2.0, finish=False)
    (cut,) = RunIndex(tmp_path).runs()
    assert cut.state is FileState.CUT
    recovered = recover_file(path).path
    (whole,) = RunIndex(tmp_path).runs()
    assert (whole.state, whole.id, whole.laps) == (FileState.FINISHED, cut.id, cut.laps)
    assert recovered.stem not in whole.id
    assert len({run_id("a"), run_id("b"), session_id("a"), session_id("b")}) == 4


def test_a_chain_is_one_run(tmp_path: Path) -> None:
    """Files that go on from one another are one run with all their laps, whose id is the first one's from the first on."""
    record(tmp_path, 2.0, 2.1, name=ONE)
    index = RunIndex(tmp_path)
    (alone,) = index.runs()
    record(tmp_path, 2.2, name=TWO, resumed_from=ONE)
    record(tmp_path, 2.3, name=THREE, resumed_from=TWO, finish=False)
    (run,) = index.runs()
    assert [file.path.name for file in run.files] == [ONE, TWO, f"{THREE}.part"]
    assert (run.id, run.laps, run.missing) == (alone.id, len(index.laps(run)), None)
    assert run.laps == sum(read_run(file.path, tolerate_damage=True).counts["/lap"] for file in run.files[:1]) + 1 + 1
    (tmp_path / ONE).unlink()
    (rest,) = index.runs()
    assert (rest.id, rest.missing) == (alone.id, ONE)
    assert rest.notes == (f"goes on from {ONE}, which is not here",)


@pytest.mark.parametrize(
    "links", [{ONE: ONE}, {ONE: TWO, TWO: ONE}, {TWO: ONE, THREE: ONE}, {ONE: "../x"}, {ONE: THREE}]
)
def test_odd_chains_lose_no_file(tmp_path: Path, links: dict[str, str]) -> None:
    """Rings, forks and files that are not there: each file is in one run, and each run has its own id."""
    for name in (ONE, TWO, THREE):
        record(tmp_path, 2.0, name=name, resumed_from=links.get(name))
    runs = RunIndex(tmp_path).runs()
    assert sorted(file.path.name for run in runs for file in run.files) == [ONE, TWO, THREE]
    assert len({run.id for run in runs}) == len(runs)


def test_a_file_that_is_another_one_now(tmp_path: Path) -> None:
    """A recording that was replaced under its name is read anew, its laps too."""
    record(tmp_path, 2.0, 2.2, name=ONE, entry="alpha")
    index = RunIndex(tmp_path)
    (run,) = index.runs()
    assert (run.entry, len(index.laps(run))) == ("alpha", run.laps)
    (tmp_path / ONE).unlink()
    record(tmp_path, 2.4, name=ONE, entry="beta")
    (run,) = index.runs()
    assert run.entry == "beta"
    assert [lap.number for lap in index.laps(run)] == [
        lap.number for lap in read_run(tmp_path / ONE).events() if isinstance(lap, Lap)
    ]
    (tmp_path / ONE).unlink()
    assert index.runs() == ()


def test_another_unfinished_file_in_the_same_place(tmp_path: Path) -> None:
    """Where a name and even an inode are used again before anybody looked, nothing of the file before is shown."""
    path = record(tmp_path / "here", 2.5, 2.6, name=ONE, entry="alpha", finish=False)
    index = RunIndex(path.parent)
    assert len(index.laps(index.runs()[0])) == 2
    other = record(tmp_path / "there", 2.4, 2.7, 2.8, name=ONE, entry="beta", finish=False)
    path.write_bytes(other.read_bytes())
    (run,) = index.runs()
    assert run.entry == "beta"
    assert index.laps(run) == RunIndex(other.parent).laps(RunIndex(other.parent).runs()[0])


def test_what_a_recovery_left_beside_the_whole_file_hides_it_not(tmp_path: Path) -> None:
    """A power cut between the recovery's last two steps: the whole file is the run, and is read once."""
    whole = record(tmp_path, 3.0, 3.0)
    part = whole.with_name(f"{whole.name}.part")
    part.write_bytes(whole.read_bytes()[:-300])
    index = RunIndex(tmp_path)
    (run,) = index.runs()
    assert (run.last.path, run.state) == (whole, FileState.FINISHED)
    (again,) = index.runs()
    assert again.last is run.last
    whole.unlink()
    assert [run.last.path for run in index.runs()] == [part]


def test_many_ask_at_once(tmp_path: Path) -> None:
    """Looks from several threads while files come and go give whole answers."""
    index, faults = RunIndex(tmp_path), []
    stop = threading.Event()

    def look() -> None:
        while not stop.is_set():
            try:
                for run in index.runs():
                    index.laps(run)
            except Exception as error:  # noqa: BLE001 whatever it is fails the test
                faults.append(error)

    threads = [threading.Thread(target=look) for _ in range(4)]
    for thread in threads:
        thread.start()
    for number in range(3):
        record(tmp_path, 2.0, name=f"run-0000000a-{number:04d}.mcap")
    stop.set()
    for thread in threads:
        thread.join()
    assert faults == []
    assert len(index.runs()) == 3
