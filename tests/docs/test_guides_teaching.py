"""The answers of docs/teaching.md: what a pupil gets is what the page says, and the page's arithmetic is right."""

import json
import os
import re
import statistics
import subprocess
import sys
from pathlib import Path

import pytest

from dnb_edge.sim.rig import Rig

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "teaching.md").read_text(encoding="utf-8")
GROUP = re.compile(r"^\| (\d) \| ([\d., ]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) to ([\d.]+) \|$", re.MULTILINE)
GROUPS = {
    int(found[1]): ([float(t) for t in found[2].split(", ")], float(found[3]), float(found[4]))
    for found in GROUP.finditer(PAGE)
}


def test_there_are_eight_groups():
    """The answers of exercise 2 are a row for each of eight groups, of five laps each."""
    assert sorted(GROUPS) == list(range(1, 9))
    assert all(len(times) == 5 for times, _, _ in GROUPS.values())


@pytest.mark.parametrize("group", GROUPS)
def test_means_and_spreads_are_those_of_the_laps(group):
    """Mean and standard deviation of each group's row are those of its five lap times, and exercise 4's table has them too."""
    times, mean_s, sd_s = GROUPS[group]
    assert mean_s == pytest.approx(statistics.mean(times), abs=0.001)
    assert sd_s == pytest.approx(statistics.stdev(times), abs=0.001)
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"group-{group} ")]
    assert f"{mean_s:.3f} [" in row
    assert f"{sd_s:.3f}" in row


@pytest.mark.parametrize("group", [1, 5])
def test_the_simulated_car_drives_these_laps(group):
    """The laps of the answers are, to a few thousandths, those that the simulated car of that seed truly drives."""
    told, _, _ = GROUPS[group]
    truth = [lap.time_s for lap in Rig(seed=group, laps=5).truth.laps]
    assert told == pytest.approx(truth, abs=0.004)


def test_the_homeworks_interval_is_the_tables():
    """Mean, sd and Student's factor of the homework give the interval that exercise 4's table prints for group 1."""
    times, mean_s, _ = GROUPS[1]
    assert "2.776 × sd / √5" in PAGE
    half_s = 2.776 * statistics.stdev(times) / 5**0.5
    (low, high) = re.findall(r"^group-1 .*? " + f"{mean_s:.3f}" + r" \[([\d.]+), ([\d.]+)\]", PAGE, re.MULTILINE)[0]
    assert (float(low), float(high)) == pytest.approx((mean_s - half_s, mean_s + half_s), abs=0.002)


def test_a_pupils_command_gives_the_answers_laps(tmp_path):
    """Exercise 2's command, word for word but for fewer laps, tells the first two laps of group 2's answer."""
    (command,) = re.findall(r"^dnb-edge (run --config class/demo\.yaml .*group-7.*)$", PAGE, re.MULTILINE)
    (prepare,) = re.findall(r"^dnb-edge (demo .*--out class)$", PAGE, re.MULTILINE)
    words = (
        command.replace("laps=5", "laps=2").replace("--laps 5", "--laps 2").replace("7", "2").replace('"', "").split()
    )
    env = os.environ | {"OMP_NUM_THREADS": "1"}
    for run in (prepare.split(), [*words, "--json"]):
        done = subprocess.run(
            [sys.executable, "-m", "dnb_edge", *run], cwd=tmp_path, capture_output=True, text=True, check=True, env=env
        )
    laps = [event for event in map(json.loads, done.stdout.splitlines()) if event["event"] == "lap"]
    assert [lap["time_s"] for lap in laps] == pytest.approx(GROUPS[2][0][:2], abs=0.0015)
