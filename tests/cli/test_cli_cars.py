"""Several cars in one race, from the demo's pictures through the real detector to standings, table and report."""

import csv
import io
import json
from pathlib import Path

import pytest
import yaml
from edge_command import EdgeOnce, Race, edge

from dnb_edge.sim.car import PAINTS
from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.driver import Drive
from dnb_edge.sim.traffic import drives

CARS, LAPS = 3, 2
NAMES = [paint.name for paint in PAINTS[:CARS]]


@pytest.fixture(scope="module")
def driven() -> tuple[Drive, ...]:
    """What `demo --cars` drives, each car's by its number less one."""
    return drives(demo_circuit(), cars=CARS, laps=LAPS, seed=1)


@pytest.fixture(scope="module")
def cars_race(edge_once: EdgeOnce) -> Race:
    """One race of several cars by `demo`, recorded and reported."""
    directory = edge_once.directory / "cars"
    words = ("--fast", "--json", "--cars", CARS, "--laps", LAPS, "--out", directory)
    ran = edge_once("demo-cars", "demo", *words)
    assert ran.code == 0, ran.err
    (recording,) = directory.glob("*.mcap")
    return Race(ran=ran, directory=directory, recording=recording)


def test_every_car_has_its_own_laps_and_no_others(cars_race: Race, driven: tuple[Drive, ...]) -> None:
    """By colour each car is who it is: its laps are all there, once, valid, and within 20 ms of how that car was driven."""
    laps = cars_race.ran.of("lap")
    assert len(laps) == cars_race.ran.events[-1]["laps"] == CARS * LAPS
    for number, drive in enumerate(driven, start=1):
        own = [lap for lap in laps if lap["car"] == number]
        assert [lap["number"] for lap in own] == list(range(1, LAPS + 1))
        assert [lap["start_s"] for lap in own] == pytest.approx(drive.crossings_s[:LAPS], abs=0.020)
        true = [end - start for start, end in zip(drive.crossings_s, drive.crossings_s[1 : LAPS + 1], strict=False)]
        assert [lap["time_s"] for lap in own] == pytest.approx(true, abs=0.020)
        assert [(lap["valid"], lap["reasons"]) for lap in own] == [(True, [])] * LAPS
        assert [score["lap"] for score in cars_race.ran.of("score") if score["car"] == number] == [1, 2]
    assert cars_race.ran.of("incident") == []
    assert "Traceback" not in cars_race.ran.err


def test_the_standings_name_the_cars_in_their_true_order(cars_race: Race, driven: tuple[Drive, ...]) -> None:
    """The last standings are final and list every car, the one with the fastest true lap first."""
    last = cars_race.ran.of("standings")[-1]
    best = [min(b - a for a, b in zip(one.crossings_s, one.crossings_s[1 : LAPS + 1], strict=False)) for one in driven]
    assert last["final"]
    assert [row["name"] for row in last["rows"]] == [NAMES[car] for car in sorted(range(CARS), key=best.__getitem__)]
    assert [row["laps"] for row in last["rows"]] == [LAPS] * CARS


def test_scoring_the_recording_of_several_cars_again_gives_the_same(cars_race: Race) -> None:
    """`score --json` prints what the live race said again, bit for bit, but for the appliance's own health."""
    again = edge("score", cars_race.recording, "--json")
    assert (again.code, again.err) == (0, "")
    live = [line for line in cars_race.ran.out.splitlines() if json.loads(line)["event"] != "health"]
    assert again.out.splitlines() == live


def test_the_table_has_a_row_for_every_car(cars_race: Race) -> None:
    """One recording, as many entries as cars, each with its own laps' mean."""
    rows = [json.loads(line) for line in edge("table", cars_race.recording, "--json").out.splitlines()]
    (as_csv,) = [edge("table", cars_race.recording, "--format", "csv").out]
    assert len(list(csv.DictReader(io.StringIO(as_csv)))) == CARS
    assert sorted(row["entry"] for row in rows) == sorted(NAMES)
    laps = cars_race.ran.of("lap")
    for row in rows:
        own = [lap["time_s"] for lap in laps if lap["car"] == NAMES.index(row["entry"]) + 1]
        assert row["laps"] == LAPS
        assert row["completion_time_s"] == pytest.approx(sum(own) / LAPS)


def test_report_and_configuration_name_every_car(cars_race: Race) -> None:
    """The report's page lists all cars and all laps; the configuration that the demo leaves has the cars with their colours."""
    (page,) = cars_race.directory.glob("*.html")
    html = page.read_text(encoding="utf-8")
    assert all(name in html for name in NAMES)
    assert all(f"{lap['time_s']:.3f}" in html for lap in cars_race.ran.of("lap"))
    config = yaml.safe_load((cars_race.directory / "demo.yaml").read_text())
    assert config["cars"] == [{"name": paint.name, "colour": paint.hex} for paint in PAINTS[:CARS]]
    checked = edge("config", "check", cars_race.directory / "demo.yaml")
    assert (checked.code, checked.err) == (0, "")


@pytest.mark.parametrize("uri", ["sim:?cars=0", "sim:?cars=9"])
def test_a_race_of_none_or_nine_is_refused(pristine: Path, uri: str) -> None:
    """One line that says how many cars there can be."""
    ran = edge("run", "--config", pristine / "demo.yaml", "--source", uri)
    assert (ran.code, ran.out) == (2, "")
    assert "cars must lie between 1 and 8" in ran.complaint()
