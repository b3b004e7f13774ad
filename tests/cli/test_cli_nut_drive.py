"""`dnb-edge nut drive`: drives through the real appliance, their truth beside them, a campaign that survives what happens."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from dnb_edge.archive.replayed import replay
from dnb_edge.cli.main import app
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.reader import read_run
from dnb_edge.values import Incident, IncidentKind, Lap

OVAL = "name: oval\nkind: lane-following\nplace: table\nsize_px: [640, 480]\nlaps: 1\n"
"""Short laps."""

BLIND = """
class Dies:
    def __init__(self):
        self.pictures = 0

    def __call__(self, rgb, speed_mps):
        self.pictures += 1
        if self.pictures > 60:
            raise RuntimeError("the network's power is gone")
        return 0.0, 0.2


def straight(rgb, speed_mps):
    return 0.0, 0.5
"""


@pytest.fixture
def oval(tmp_path: Path) -> Path:
    path = tmp_path / "oval.yaml"
    path.write_text(OVAL)
    return path


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module of a user's own: `blind`."""
    (tmp_path / "blind.py").write_text(BLIND)
    monkeypatch.syspath_prepend(str(tmp_path))


def drive(*words: object) -> Result:
    return CliRunner().invoke(app, ["nut", "drive", *map(str, words), "--json"])


def lines(ran: Result) -> list[dict]:
    return [json.loads(line) for line in ran.stdout.splitlines()]


def test_a_drive_is_timed_as_it_was_and_the_same_seed_is_the_same_drive(oval: Path, tmp_path: Path) -> None:
    """Within 8 ms of the simulator's own lap; a second campaign elsewhere has the same laps to the bit, and in the same place
    drives nothing anew. The recording re-scores to the same lap, under the driver's name."""
    common = ("--driver", "mine=pure-pursuit", "--task", oval, "--seeds", "3")
    first, second = (lines(drive(*common, "--record", tmp_path / name)) for name in ("a", "b"))
    (told,) = first[0]["laps"]
    assert abs(told["error_ms"]) <= 8.0
    assert (first[0]["entry"], first[0]["ended"], first[0]["completed"]) == ("mine", "laps", True)
    assert first[0]["laps"] == second[0]["laps"]
    recording = tmp_path / "a" / "oval-mine-seed0003.mcap"
    written = recording.stat()
    assert lines(drive(*common, "--record", tmp_path / "a")) == first
    assert recording.stat() == written, "nothing was driven anew"
    again = replay(recording)
    assert [lap.time_s for lap in again.events if isinstance(lap, Lap)] == [told["time_s"]]
    assert (again.header.driver.name, again.header.session) == ("mine", "oval")
    assert first[-1]["event"] == "ranking"
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["oval-mine-seed0003.drive.json", recording.name]


@pytest.mark.usefixtures("outside")
def test_a_car_that_runs_into_a_thing_is_told_of(tmp_path: Path) -> None:
    """A blind driver, a box on the straight behind the start line: the appliance tells the hit that the simulator knows
    of, and the rules end the drive there."""
    task = tmp_path / "box.yaml"
    task.write_text(
        "name: box\nkind: obstacles\nlaps: 1\nobstacles: [{at_m: [2.3, 0.3], radius_m: 0.15}]\n"
        "penalties: {collision: {dnf: true}}\n"
    )
    ran = drive("--driver", "python:blind:straight", "--task", task, "--seeds", "1", "--record", tmp_path / "runs")
    (result, ranking) = lines(ran)
    assert (result["ended"], result["completed"], result["laps"]) == ("race", False, [])
    assert (result["collisions"], result["true_collisions"], result["score"]) == (1, 1, 0.0)
    (recording,) = (tmp_path / "runs").glob("*.mcap")
    hits = [one for one in replay(recording).events if isinstance(one, Incident) and one.kind is IncidentKind.COLLISION]
    assert len(hits) == 1
    assert ranking["rows"][0]["collisions"] == 1
    assert ran.exit_code == 0, "a bad driver is a result"


@pytest.mark.usefixtures("outside")
def test_a_driver_that_fails_is_told_and_the_others_go_on(oval: Path, tmp_path: Path) -> None:
    """Its recording is whole up to there, the other one's drive is complete, and the exit code says that something failed."""
    ran = drive(
        "--driver", "bad=python:blind:Dies", "--driver", "pure-pursuit", "--task", oval, "--seeds", "1",
        "--record", tmp_path / "r",
    )  # fmt: skip
    assert isinstance(ran.exception, WorkError)
    assert "1 of 2 drives failed, the first bad, seed 1" in str(ran.exception)
    bad, good, ranking = lines(ran)
    assert bad["ended"] == "failed"
    assert "the network's power is gone" in bad["failure"]
    assert good["completed"]
    assert [row["entry"] for row in ranking["rows"]] == ["pure-pursuit", "bad"]
    read_run(tmp_path / "r" / "oval-bad-seed0001.mcap")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--driver", "chauffeur"), "chauffeur: no driver"),
        (("--driver", "pure-pursuit", "--task", "parking"), "no task is called 'parking'"),
        (("--driver", "pure-pursuit", "--seeds", "one"), "--seeds one: write 1-30"),
        (
            ("--driver", "pure-pursuit", "--driver", "x=lane-follower", "--driver", "x=pure-pursuit"),
            "another driver is called",
        ),
        (("--driver", "pure-pursuit", "--set", "race.lap=2"), "race.lap: unknown key"),
    ],
)
def test_what_is_wrong_is_told_before_anything_is_driven(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    """In one line, and nothing is left behind."""
    ran = drive(*words, "--record", tmp_path / "runs")
    assert isinstance(ran.exception, InputError)
    assert told in str(ran.exception)
    assert "\n" not in str(ran.exception)
    assert ran.stdout == ""
    assert not list(tmp_path.glob("runs/*"))


def test_ctrl_c_leaves_whole_drives_and_nothing_else(oval: Path, tmp_path: Path) -> None:
    """Two processes at work, interrupted once the first drive is done: every recording that is there is whole and has its
    result, nothing half is left, and the same command goes on."""
    runs = tmp_path / "runs"
    words = ["nut", "drive", "--driver", "pure-pursuit", "--task", str(oval), "--record", str(runs)]
    command = [sys.executable, "-m", "dnb_edge", *words, "--seeds", "1-40", "--jobs", "2"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while process.poll() is None and not list(runs.glob("*.drive.json")):
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "the same command goes on" in err
    names = {path.name for path in runs.iterdir()}
    whole = {name.removesuffix(".mcap") for name in names if name.endswith(".mcap")}
    assert names == {name + ending for name in whole for ending in (".mcap", ".drive.json")}
    assert 1 <= len(whole) < 40
    for name in whole:
        read_run(runs / f"{name}.mcap")
    done = min(whole)[-4:]
    assert lines(drive(*words[2:], "--seeds", str(int(done))))[0]["completed"]
