"""A race whose process is killed, and that goes on when it is started again: real processes, a camera that does not wait."""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from edge_command import PATIENCE_S, Ran, Running, edge

LIVE = (sys.executable, str(Path(__file__).with_name("live_edge.py")))
UNTIL_READY_NS = 3_000_000_000


@pytest.fixture
def race(config: Path, tmp_path: Path) -> Callable[..., Running]:
    """Starts the appliance on one and the same camera each time."""
    source = f"live:{time.monotonic_ns() + UNTIL_READY_NS}"
    words = ("run", "--config", config, "--source", source, "--record", tmp_path / "runs", "--json")

    def start(name: str, *more: object) -> Running:
        return Running(*words, *more, err=tmp_path / f"{name}.err", command=LIVE)

    return start


def kill(running: Running, runs: Path) -> Ran:
    """SIGKILL once all that was told is saved."""
    (part,) = runs.glob("*.part")
    size_bytes = part.stat().st_size
    deadline_s = time.monotonic() + PATIENCE_S
    while part.stat().st_size == size_bytes:
        assert time.monotonic() < deadline_s, "nothing is saved any more"
        time.sleep(0.05)
    running.process.kill()
    return running.ended(PATIENCE_S)


def raced(ran: Ran) -> list[str]:
    """The lines that a recording gives again."""
    return [line for line in ran.out.splitlines() if json.loads(line)["event"] not in ("health", "run")]


def test_a_killed_race_goes_on_with_identical_standings(race: Callable[..., Running], tmp_path: Path) -> None:
    """Killed in its second lap: laps told before stay, the lap in which it was killed is marked, the next ones are whole, and
    one file gives all of it again."""
    runs = tmp_path / "runs"
    with race("first", "--laps", 3) as running:
        running.read_until("lap")
        killed = kill(running, runs)
    with race("second", "--laps", 3) as running:
        ran = running.ended(PATIENCE_S)
    assert ran.code == 0, ran.err
    assert "run-" in ran.err
    assert "which was cut short: 1 laps so far" in ran.err
    laps = [*killed.of("lap"), *ran.of("lap")]
    assert [lap["number"] for lap in laps] == [1, 2, 3]
    assert [bool(lap["suspect"]) for lap in laps] == [False, True, False]
    assert laps[1]["suspect"][0].startswith("camera gap: no frames came for ")
    assert any("going on with run-" in note for health in ran.of("health") for note in health["notes"])
    end = ran.events[-1]
    assert end["laps"] == 3
    again = edge("score", end["recording"], "--json")
    before = raced(again)[: -len(raced(ran))]
    assert raced(again) == before + raced(ran)
    assert before == raced(killed)[: len(before)]
    assert [json.loads(line)["number"] for line in before if json.loads(line)["event"] == "lap"] == [1]
    assert again.events[-1]["frames"] == end["frames"]
    assert again.events[-1]["detected_frames"] == end["detected_frames"]
    # What was killed is finished by a process of its own, which need not be done yet; nothing depends on it.
    listed = [json.loads(line) for line in edge("runs", "list", runs, "--json").out.splitlines()]
    assert [("part of " in (run["note"] or ""), run["laps"]) for run in listed] == [(True, 1), (False, 3)]
    (row,) = [json.loads(line) for line in edge("table", runs, "--json").out.splitlines()]
    assert (row["runs"], row["laps"]) == (1, 3)


def test_a_race_that_was_stopped_or_is_not_wanted_back_begins_anew(
    race: Callable[..., Running], tmp_path: Path
) -> None:
    """With --no-resume laps begin at 1 again; and nothing goes on with a race that ended by itself."""
    runs = tmp_path / "runs"
    with race("first") as running:
        running.read_until("crossing")
        kill(running, runs)
    with race("second", "--no-resume", "--laps", 1) as running:
        second = running.ended(PATIENCE_S)
    assert second.code == 0, second.err
    assert "recovered " in second.err
    assert [(lap["number"], lap["suspect"]) for lap in second.of("lap")] == [(1, [])]
    with race("third") as running:
        running.read_until("health")
        running.process.terminate()
        third = running.ended(PATIENCE_S)
    assert "going on" not in third.err
