"""Ways in which a run ends before its source does: signals, a full disk, a reader that goes away."""

import json
import os
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from edge_command import COMMAND, PATIENCE_S, Race, Running, edge, environment
from mcap.reader import make_reader

from dnb_edge.record.reader import read_run

STOP_WITHIN_S = 5.0
"""What the service promises its manager."""


@pytest.mark.parametrize(
    ("number", "source", "after"),
    [
        (signal.SIGINT, "sim:?laps=30&pace=1", "crossing"),
        (signal.SIGTERM, "sim:?laps=30", "lap"),
    ],
    ids=["SIGINT in the first lap, in real time", "SIGTERM in the second lap, as fast as can be"],
)
def test_a_signal_finishes_the_recording(
    config: Path, tmp_path: Path, number: signal.Signals, source: str, after: str
) -> None:
    """Mid-lap, both signals end the run within 5 s with code 0; its recording is whole for others and scores the same."""
    words = ("run", "--config", config, "--source", source, "--record", tmp_path / "runs", "--json")
    with Running(*words, err=tmp_path / "err") as running:
        running.read_until(after)
        running.process.send_signal(number)
        ran = running.ended(STOP_WITHIN_S)
    assert (ran.code, ran.err) == (0, "")
    end = ran.events[-1]
    assert end["event"] == "run"
    (recording,) = (tmp_path / "runs").iterdir()
    assert Path(end["recording"]) == recording
    assert recording.suffix == ".mcap"
    with recording.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        counts = Counter(channel.topic for _, channel, _ in reader.iter_messages())
        assert reader.get_summary() is not None
    assert max(counts.values()) >= end["frames"]
    again = edge("score", recording, "--json")
    assert again.code == 0
    assert again.out.splitlines() == [line for line in ran.out.splitlines() if json.loads(line)["event"] != "health"]
    assert end["laps"] == len(ran.of("lap"))
    assert len(ran.of("crossing")) == end["laps"] + 1


def test_what_a_killed_run_had_saved_comes_back_with_the_next_run(config: Path, tmp_path: Path) -> None:
    """After SIGKILL the next run says that it recovered the laps that were saved; they are those that were shown."""
    words = ("run", "--config", config, "--source", "sim:?laps=30", "--record", tmp_path / "runs", "--json")
    with Running(*words, err=tmp_path / "err") as running:
        running.read_until("lap")
        # The lap was handed to the disk before it was shown; give the disk its time, as a power cut may not.
        wait_until_saved(tmp_path / "runs")
        running.process.kill()
        shown = running.ended(STOP_WITHIN_S).of("lap")
    (part,) = (tmp_path / "runs").glob("*.part")
    again = edge(*words[:-3], "--record", tmp_path / "runs", "--json", "--laps", 1)
    recovered = part.with_suffix("")
    assert again.code == 0
    assert again.complaint().startswith(f"dnb-edge: recovered {recovered} from an earlier run: ")
    assert not part.exists()
    kept = edge("score", recovered, "--json").of("lap")
    assert kept
    # On a slow machine more laps than the first may have been driven before the kill; none may differ.
    both = min(len(kept), len(shown))
    assert kept[:both] == shown[:both]


def wait_until_saved(directory: Path) -> None:
    """Until the recording in `directory` holds a lap on the disk."""
    (part,) = directory.glob("*.part")
    deadline_s = time.monotonic() + PATIENCE_S
    while not read_run(part, tolerate_damage=True).counts.get("/lap"):
        assert time.monotonic() < deadline_s
        time.sleep(0.05)


def test_a_signal_before_the_first_lap_ends_the_demo_too(tmp_path: Path) -> None:
    """The demo that is interrupted at once says so by its counts, writes no report of nothing, and ends well."""
    with Running("demo", "--json", "--out", tmp_path / "demo", err=tmp_path / "err") as running:
        running.read_until("crossing")
        running.process.send_signal(signal.SIGINT)
        ran = running.ended(STOP_WITHIN_S)
    assert ran.code == 0
    assert "Traceback" not in ran.err
    assert ran.events[-1]["laps"] == 0
    assert len(list((tmp_path / "demo").glob("*.mcap"))) == 1
    assert not list((tmp_path / "demo").glob("*.html"))


def test_a_full_disk_fails_the_recording_and_not_the_race(config: Path, small_disk: Callable[[str], Path]) -> None:
    """The disk fills up in a lap: the race is told to its end, then code 1 and one line; no recording under a final name."""
    disk = small_disk("512k")
    words = ("run", "--config", config, "--source", "sim:?laps=1", "--record", disk, "--json")
    ran = edge(*words, "--set", "record.image_fps=30")
    assert ran.code == 1
    line = ran.complaint()
    assert str(disk) in line
    assert "the disk is full" in line
    assert "dnb-edge runs recover" in line
    assert [path.suffix for path in disk.iterdir()] == [".part"]
    assert len(ran.of("lap")) == 1
    assert ran.of("lap")[0]["valid"]
    assert ran.of("health")[-1]["recording"] == "failed"
    assert ran.events[-1] | {"laps": 1, "recording": None} == ran.events[-1]


def test_a_disk_that_is_full_from_the_start_ends_the_run_at_once(
    config: Path, small_disk: Callable[[str], Path]
) -> None:
    """Nothing is raced that was to be recorded and cannot be: code 1, one line, no recording under a final name."""
    disk = small_disk("4k")
    ran = edge("run", "--config", config, "--source", "sim:?laps=1", "--record", disk, "--json")
    assert (ran.code, ran.out) == (1, "")
    assert "the disk is full" in ran.complaint()
    assert not list(disk.glob("*.mcap"))


@pytest.mark.parametrize(
    "words",
    [
        ("run", "--config", "demo.yaml", "--source", "sim:?laps=1", "--record", "runs", "--json", "--observations"),
        ("config", "schema"),
        ("--help",),
    ],
    ids=" ".join,
)
def test_a_reader_that_goes_away_gets_no_traceback(config: Path, words: tuple[str, ...]) -> None:
    """With stdout closed, as by `| head -0`, a command ends quietly; a recording under way is finished."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "wb") as nobody:
        done = subprocess.run(
            [*COMMAND, *words],
            cwd=config.parent,
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=nobody,
            stderr=subprocess.PIPE,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
    assert (done.returncode, done.stderr) == (1, "")
    runs = config.parent / "runs"
    assert [path.suffix for path in runs.iterdir()] == [".mcap"] if "run" in words else not runs.exists()


@pytest.mark.parametrize(
    "words",
    [
        ("run", "--config", "demo.yaml", "--source", "sim:?laps=1", "--record", "runs", "--json", "--observations"),
        ("config", "schema"),
        ("runs", "list"),
    ],
    ids=" ".join,
)
def test_a_full_disk_behind_stdout_is_one_line(config: Path, words: tuple[str, ...]) -> None:
    """`> results.json` on a full disk: code 1 and one line, no traceback; a recording under way is finished."""
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, *words],
            cwd=config.parent,
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
    assert (done.returncode, done.stderr) == (1, "dnb-edge: stdout: No space left on device\n")
    runs = config.parent / "runs"
    assert [path.suffix for path in runs.iterdir()] == [".mcap"] if "run" in words else not runs.exists()


def test_an_export_that_does_not_fit_leaves_nothing_behind(race: Race, small_disk: Callable[[str], Path]) -> None:
    """Of one table or of three: code 1, one line, and no half of a file that would be in the way of the next try."""
    disk = small_disk("8k")
    filler = disk / "filler"
    filler.write_bytes(bytes(4096))
    several = edge("runs", "export", race.recording, "--what", "all", "-o", disk / "race.csv")
    assert (several.code, several.complaint()) == (
        1,
        f"dnb-edge: {disk / 'race-passes.csv'}: cannot be written: No space left on device",
    )
    filler.write_bytes(bytes(8192))
    one = edge("runs", "export", race.recording, "-o", disk / "race.csv")
    assert (one.code, one.complaint()) == (
        1,
        f"dnb-edge: {disk / 'race.csv'}: cannot be written: No space left on device",
    )
    assert list(disk.iterdir()) == [filler]
