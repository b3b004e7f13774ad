"""An archive scored by real worker processes: the same bytes whoever does the work, and whoever dies over it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from archive_runs import PATIENCE_S, Cluster, cluster_of, edge, edge_command, make_runs

from dnb_edge.archive import cluster as cluster_room
from dnb_edge.archive.cluster import Crew, crew
from dnb_edge.archive.lot_score import LotJob, ScoredLot, score_lot
from dnb_edge.archive.lots import listed
from dnb_edge.archive.parquet import ResultFiles, runs_path
from dnb_edge.errors import InputError, WorkError

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with five recordings, of which two are damaged."""
    directory = tmp_path_factory.mktemp("archive")
    runs = make_runs(directory, 5)
    runs[1].write_bytes(runs[1].read_bytes()[:5000])
    changed = bytearray(runs[3].read_bytes())
    changed[len(changed) // 2] ^= 255
    runs[3].write_bytes(changed)
    return directory


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler and two workers, which have nothing to do with this process. The last test ends it."""
    with cluster_of(tmp_path_factory.mktemp("cluster"), workers=2) as one:
        yield one


def jobs(archive: Path) -> list[LotJob]:
    return [LotJob(lot=lot) for lot in listed([str(archive)])]


def serial(archive: Path, out: Path) -> Path:
    """The results of a plain loop in this process."""
    with ResultFiles(out, {}) as files:
        for job in jobs(archive):
            for run in score_lot(job).runs:
                files.add(run)
        files.finish()
    return out


def same(one: Path, other: Path) -> bool:
    return all(a.read_bytes() == b.read_bytes() for a, b in ((one, other), (runs_path(one), runs_path(other))))


def test_an_archive_with_damaged_files_is_scored_but_for_those(archive: Path, tmp_path: Path) -> None:
    """Each is told in a line, the rest is in the table, code 1; the files' bytes are those of a plain loop."""
    out = tmp_path / "two.parquet"
    ran = edge("score", archive, "--out", out, "--workers", "2")
    assert ran.code == 1, ran.err
    told = ran.err.splitlines()
    assert told[0].startswith(f"dnb-edge: {archive}/run-1.mcap: the recording is truncated")
    assert told[1].startswith(f"dnb-edge: {archive}/run-3.mcap: the recording is damaged")
    assert told[-1] == "dnb-edge: 2 of 5 recordings could not be scored, see above; the rest was"
    assert "9 laps in 3 recordings" in ran.out
    assert "pilot     3  9 of 9" in ran.out
    assert same(out, serial(archive, tmp_path / "serial.parquet"))


def test_a_sweep_says_what_each_combination_comes_to(archive: Path, cluster: Cluster, tmp_path: Path) -> None:
    """As JSON: one object a combination, one for each recording that failed, and one of all; its picture lies beside."""
    out = tmp_path / "sweep.parquet"
    words = ("--grid", "race.max_lap_s=3.05,9", "--grid", "rules=practice,deepracer")
    ran = edge("score", archive / "*.mcap", "--scheduler", cluster.address, "--json", "--out", out, *words)
    assert ran.code == 1
    assert [(one["values"], one["laps"]) for one in ran.of("combination")] == [
        ({"race.max_lap_s": limit, "rules": rules}, 9) for limit in (3.05, 9) for rules in ("practice", "deepracer")
    ]
    assert [Path(one["recording"]).name for one in ran.of("failed")] == ["run-1.mcap", "run-3.mcap"]
    (whole,) = ran.of("scored")
    assert (whole["recordings"], whole["failed"], whole["laps"]) == (5, 2, 36)
    assert whole["worker_peak_mb"] < 400
    assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")


REFUSED = [
    ("both", ("--workers", "2", "--scheduler", "tcp://127.0.0.1:1"), "--workers is of this machine"),
    ("a key", ("--grid", "race.min_lap=3,4"), "race.min_lap: unknown key, did you mean min_lap_s?"),
    ("no address", ("--scheduler", "here"), "must have the form tcp://HOST:PORT"),
    ("a plot of nothing", ("--plot", "x.png"), "--plot x.png: is for --grid"),
    (
        "a plot of no kind",
        ("--grid", "race.min_lap_s=3,4", "--plot", "x.txt"),
        "--plot x.txt: must be a file that ends in",
    ),
    ("one line a frame", ("--workers", "1", "--json", "--observations"), "--observations: is for single recordings"),
]


@pytest.mark.parametrize(("words", "text"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED])
def test_what_is_asked_wrongly_is_one_line(archive: Path, words: tuple[str, ...], text: str) -> None:
    """Code 2, and no number."""
    ran = edge("score", archive, *words)
    assert (ran.code, ran.out) == (2, "")
    assert text in ran.complaint()


def test_a_scheduler_that_is_not_there_is_one_line_at_once(archive: Path, tmp_path: Path) -> None:
    """Nobody listens; something else listens; nothing is left of the results."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        ran = edge("score", archive, "--scheduler", address, "--out", tmp_path / "out.parquet")
    assert ran.code == 2
    assert f"--scheduler {address}: no Dask scheduler there: Connection refused" in ran.complaint()
    assert list(tmp_path.iterdir()) == []


def test_what_listens_and_is_no_scheduler_is_told(monkeypatch) -> None:
    """Dask's own client would wait for its answer without end."""
    monkeypatch.setattr(cluster_room, "PATIENCE_S", 0.5)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        address = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        with pytest.raises(InputError, match="what listens there is no Dask scheduler"), crew(address):
            pass


def test_without_dask_its_extra_is_named(monkeypatch) -> None:
    """One line."""
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'dnb-edge\[cluster\]'"), crew(None, 1):
        pass


def killed_over(hands: Crew, archive: Path) -> list[ScoredLot]:
    """All results, in order, of an archive named many times; a worker dies by SIGKILL as soon as there is one."""
    results: list[ScoredLot] = []
    for done in hands.in_order(score_lot, jobs(archive) * 6):
        if not results:
            victim = next(iter(hands._client.run(os.getpid).values()))
            os.kill(victim, signal.SIGKILL)
        assert done.error is None, done.error
        assert done.result is not None
        results.append(done.result)
    return results


def test_a_worker_killed_in_the_middle_changes_nothing(archive: Path, cluster: Cluster) -> None:
    """What it had is done again; the results are those of a plain loop, in the order of the recordings. Work over which every
    worker dies is told, and the rest is done."""
    plain = [score_lot(job).runs for job in jobs(archive)] * 6
    with crew(cluster.address) as hands:
        assert [one.runs for one in killed_over(hands, archive)] == plain
        (dead,) = hands.in_order(os._exit, [1])
        assert dead.error == "every worker that took it up died, for want of memory perhaps"
        assert [one.result for one in hands.in_order(abs, [-1, -2, -3])] == [1, 2, 3]


def test_a_scheduler_without_workers_is_told(tmp_path: Path, monkeypatch) -> None:
    """With what to type."""
    monkeypatch.setattr(cluster_room, "PATIENCE_S", 1.5)
    with (
        cluster_of(tmp_path, workers=0) as cluster,
        pytest.raises(InputError, match="it has no workers: start one with `dask worker tcp"),
        crew(cluster.address),
    ):
        pass


def test_ctrl_c_leaves_no_file_and_no_process(archive: Path, tmp_path: Path) -> None:
    """As a terminal sends it, to the command and its workers alike: code 130, nothing of the results, no traceback. While they
    work, none of them listens to other machines."""
    many = [archive / "run-0.mcap"]
    for place in range(300):
        os.link(many[0], tmp_path / f"{place}.mcap")
    out = tmp_path / "out" / "out.parquet"
    out.parent.mkdir()
    with (tmp_path / "err").open("wb") as err:
        process = subprocess.Popen(
            [*edge_command.COMMAND, "score", str(tmp_path), "--out", str(out), "--workers", "1"],
            env=edge_command.environment(),
            stdout=subprocess.PIPE,
            stderr=err,
            start_new_session=True,
        )
    ends = time.monotonic() + PATIENCE_S
    while len(children := children_of(process.pid)) < 2 and time.monotonic() < ends:
        time.sleep(0.05)
    assert len(list(out.parent.iterdir())) == 2
    time.sleep(1.0)
    assert set(listening(process.pid, *children)) == {"0100007F"}
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, said) == (130, b"")
    assert list(out.parent.iterdir()) == []
    assert "Traceback" not in (tmp_path / "err").read_text()
    while any(Path(f"/proc/{child}").exists() for child in children):
        assert time.monotonic() < ends
        time.sleep(0.05)


def listening(*pids: int) -> list[str]:
    """The addresses, as the kernel writes them, at which these processes listen."""
    opened = {link.readlink().name for pid in pids for link in Path(f"/proc/{pid}/fd").iterdir() if link.is_symlink()}
    rows = [line.split() for family in ("tcp", "tcp6") for line in Path(f"/proc/net/{family}").read_text().splitlines()]
    return [row[1].partition(":")[0] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in opened]


def children_of(pid: int) -> list[int]:
    """The processes that a process has started."""
    threads = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for thread in threads for child in thread.read_text().split()]


def test_the_work_waits_for_whoever_takes_the_results(cluster: Cluster) -> None:
    """Only so many recordings are given out ahead: thousands of results never pile up."""
    given = []

    def one_after_the_other():
        for place in range(200):
            given.append(place)
            yield -place

    with crew(cluster.address) as hands:
        results = hands.in_order(abs, one_after_the_other())
        next(results)
        assert len(given) <= 2 * cluster_room.LEAST_AHEAD
        assert [json.loads(str(one.result)) for one in results] == list(range(1, 200))


def test_a_scheduler_elsewhere_gives_the_same_and_its_end_is_told(
    archive: Path, cluster: Cluster, tmp_path: Path
) -> None:
    """With another process's workers the bytes are the same; where the scheduler dies, the work ends with its reason."""
    ran = edge("score", archive, "--scheduler", cluster.address, "--out", tmp_path / "there.parquet")
    assert ran.code == 1
    assert same(tmp_path / "there.parquet", serial(archive, tmp_path / "serial.parquet"))

    def orphaned() -> None:
        with crew(cluster.address) as hands:
            for _ in hands.in_order(score_lot, jobs(archive) * 100):
                cluster.scheduler.kill()

    with pytest.raises(WorkError, match="the scheduler is gone"):
        orphaned()
