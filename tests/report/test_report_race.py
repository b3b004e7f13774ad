"""Standings, sectors and incidents on a run's page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from test_report_evidence import incident

from dnb_edge.report.race import race_sections
from dnb_edge.report.run import RunResult
from dnb_edge.values import Lap, SectorTime, Standing, Standings


def lap(number: int, sectors: tuple[float | None, ...], *, valid: bool = True, car: int = 1) -> Lap:
    return Lap(
        number=number,
        start_t_ns=0,
        end_t_ns=10,
        start_s=0.0,
        time_s=10.0,
        sigma_s=0.002,
        valid=valid,
        reasons=() if valid else ("why",),
        similarity_percent=None,
        observed_fraction=1.0,
        car=car,
        sectors=tuple(
            SectorTime(number=k, line=f"sector {k}", time_s=time_s, sigma_s=None if time_s is None else 0.003)
            for k, time_s in enumerate(sectors, start=1)
        ),
    )


@pytest.fixture
def empty(result: Callable[..., RunResult]) -> RunResult:
    """A run in which nothing happened."""
    return replace(result(), laps=(), paths_m=(), stamps_ns=(), scores=(), incidents=(), standings=None, thumbnails={})


def test_nothing_to_show_shows_nothing(empty: RunResult) -> None:
    """A plain practice run has no empty headings."""
    assert race_sections(empty) == ""


def test_sectors_and_the_lap_of_the_best_ones(empty: RunResult) -> None:
    """Every lap's sectors, and what the best of the valid laps would make together; a missing one is no nought."""
    laps = (lap(1, (3.0, 7.0)), lap(2, (2.0, None)), lap(3, (1.0, 1.0), valid=False))
    page = race_sections(replace(empty, laps=laps, paths_m=(empty.track.centreline.points_m,) * 3))
    assert "<td>2.0000 (lap 2)</td>" in page
    assert "<td>7.0000 (lap 1)</td>" in page
    assert "<td>3.0000 \N{PLUS-MINUS SIGN} 0.0030</td>" in page
    assert "<td>\N{EN DASH}</td>" in page
    assert "<td>9.0000 \N{PLUS-MINUS SIGN}" in page


def test_incidents_with_their_picture(empty: RunResult) -> None:
    """The sentence, the moment and the picture; a user's text does not become markup."""
    one = replace(incident(1.0, (3.0, 4.0)), text="<b>out</b>", start_s=4.25)
    page = race_sections(replace(empty, incidents=(one,), thumbnails={(1, 1): b"\xff\xd8jpeg"}))
    assert "&lt;b&gt;out&lt;/b&gt;" in page
    assert "4.25 s after the first frame" in page
    assert 'src="data:image/jpeg;base64,/9hqcGVn"' in page
    assert "<img" not in race_sections(replace(empty, incidents=(one,)))


def test_standings_of_several_cars(empty: RunResult) -> None:
    """Place, name, value and gap; ties are marked and explained; one car alone has no table."""
    rows = tuple(
        Standing(
            place=1,
            tied=True,
            car=car,
            name=f"<{car}>",
            laps=3,
            valid_laps=2,
            value=9.5 + car,
            sigma=0.002,
            best_lap_s=9.5,
            last_lap_s=9.9,
            gap=None,
            interval=None,
        )
        for car in (1, 2)
    )
    standings = Standings(t_ns=1, t_s=0.0, rank_by="best_lap", unit="s", final=True, rows=rows)
    page = race_sections(replace(empty, standings=standings))
    assert "1=" in page
    assert "&lt;2&gt;" in page
    assert "inside their uncertainty" in page
    assert race_sections(replace(empty, standings=replace(standings, rows=rows[:1]))) == ""


def test_cars_with_fewer_laps_are_laps_behind(empty: RunResult) -> None:
    """Where times of different numbers of laps say nothing, the gap is told in laps."""
    row = Standing(
        place=1,
        tied=False,
        car=1,
        name="a",
        laps=3,
        valid_laps=3,
        value=30.0,
        sigma=0.002,
        best_lap_s=9.5,
        last_lap_s=9.9,
        gap=None,
        interval=None,
    )
    rows = (
        row,
        replace(row, place=2, car=2, gap=0.25, interval=0.25, gap_laps=0, interval_laps=0),
        replace(row, place=3, car=3, gap_laps=1, interval_laps=1),
        replace(row, place=4, car=4, gap_laps=3, interval_laps=2),
    )
    standings = Standings(t_ns=1, t_s=0.0, rank_by="total_time", unit="s", final=True, rows=rows)
    page = race_sections(replace(empty, standings=standings))
    assert "<td>0.2500</td><td>0.2500</td>" in page
    assert "<td>+1 lap</td><td>+1 lap</td>" in page
    assert "<td>+3 laps</td><td>+2 laps</td>" in page


def test_each_car_has_its_own_best_sectors(empty: RunResult) -> None:
    """The sectors of two cars are never added up to one lap."""
    laps = (lap(1, (3.0, 7.0)), lap(1, (1.5, 8.5), car=2), lap(2, (4.0, 6.0)))
    page = race_sections(replace(empty, laps=laps, paths_m=(empty.track.centreline.points_m,) * 3))
    assert "car 1, best" in page
    assert "<td>9.0000 \N{PLUS-MINUS SIGN}" in page
    assert "<td>10.0000 \N{PLUS-MINUS SIGN}" in page
    assert "7.5000" not in page
