"""Sector lines in their order, and lines that are wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from race_drive import SCALE, at, drive, incidents_of, laps_of, ring

from dnb_edge.errors import InputError
from dnb_edge.race.rules import LapRules
from dnb_edge.race.sectors import SectorPlan, Sectors, check_lines
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Direction, IncidentKind, PassStatus

W = 1.3
ROUND = 2 * math.pi
LAP_S = ROUND / W
TRACK = ring(sectors=4)
PLAN = SectorPlan(lines=("a", "b", "c"), along_m=(2.0, 4.0, 6.0))


def crossing(t_s: float, line: str = "start", sigma_s: float = 0.003) -> Crossing:
    return Crossing(
        t_ns=round(t_s * 1e9), t_s=t_s, line=line, direction=Direction.FORWARD, sigma_s=sigma_s, track_m=(0.0, 0.0),
        target_id=1, estimated=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("passed", "reasons", "times", "missed"),
    [
        (["a2", "b4", "c6"], [None, None, None], [2, 2, 2, 2], []),
        (["a2", "c6"], [None, None], [2, None, None, 2], ["b"]),
        (["c6"], [None], [None, None, None, 2], ["a", "b"]),
        ([], [], [None, None, None, None], ["a", "b", "c"]),
        (["a2", "a3", "b4", "c6"], [None, "a was crossed in this lap already", None, None], [2, 2, 2, 2], []),
        (["a2", "c6", "b7"], [None, None, "b after c"], [2, None, None, 2], ["b"]),
        (["a2", "c3", "b4", "c6"], [None, "c before b", None, None], [2, 2, 2, 2], []),
    ],
    ids=["in order", "one missed", "two missed", "all missed", "one twice", "one late", "one early"],
)
def test_sectors_end_at_their_lines_in_their_turn(
    passed: list[str], reasons: list[str | None], times: list[float | None], missed: list[str]
) -> None:
    """At 1 m/s, so that a crossing's second tells how far was driven: too little for a line further on is out of turn."""
    sectors = Sectors(PLAN, crossing(0.0), 0.7)
    found = [sectors.crossed(crossing(float(one[1]), one[0]), float(one[1])) for one in passed]
    assert found == reasons
    told = sectors.times(crossing(8.0))
    assert [one.number for one in told] == [1, 2, 3, 4]
    assert [one.line for one in told] == ["a", "b", "c", "start"]
    assert [one.time_s for one in told] == [None if time_s is None else pytest.approx(time_s) for time_s in times]
    assert [one.sigma_s for one in told] == [
        None if time_s is None else pytest.approx(0.003 * 2**0.5) for time_s in times
    ]
    assert [*sectors.missed, *sectors.due] == missed


def test_the_sectors_of_a_lap_add_up_to_it() -> None:
    """Four quarters of a ring, each a quarter of the lap; their crossings say so."""
    told = drive(TRACK, lambda t: at(-0.6 + W * t), seconds=11, noise_m=0.002)
    first, second = laps_of(told)
    for driven in (first, second):
        times = [one.time_s for one in driven.lap.sectors]
        assert sum(one for one in times if one is not None) == pytest.approx(driven.lap.time_s)
        assert times == pytest.approx([LAP_S / 4] * 4, abs=0.02)
    crossings = [one for one in told if isinstance(one, Crossing)]
    assert [str(one.status) for one in crossings] == ["start", *(["sector"] * 3 + ["lap"]) * 2]
    assert [one.lap for one in crossings] == [1, 1, 1, 1, 1, 2, 2, 2, 2]


def test_a_sector_line_that_was_missed_is_told_at_the_next() -> None:
    """The car goes round the second line's end: two sectors have no time, one incident names the line."""
    wide = lambda t: at(-0.6 + W * t, 1.25 if 2.7 < t < 3.1 else 1.0)  # noqa: E731
    told = drive(TRACK, wide, seconds=11)
    first, second = laps_of(told)
    assert [one.time_s is None for one in first.lap.sectors] == [False, True, True, False]
    (missed,) = [one for one in incidents_of(told) if one.kind is IncidentKind.MISSED_LINE]
    assert (missed.lap, missed.text) == (1, "the line 'sector 2' was not crossed in its turn")
    before = told[told.index(missed) - 1]
    assert isinstance(before, Crossing)
    assert before.line == "sector 3"
    assert second.incidents == ()


@pytest.mark.parametrize(
    ("missing", "told_after"), [((4,), ["start"]), ((1, 3), ["sector 2", "sector 4"]), ((1, 2, 3, 4), ["start"] * 4)]
)
def test_each_missed_line_is_told_once(missing: tuple[int, ...], told_after: list[str]) -> None:
    """At the next line that is crossed, the end of the lap at the latest."""
    passes_s = [(0.6 + k * ROUND / 5) / W for k in missing]
    wide = lambda t: at(-0.6 + W * t, 1.25 if any(abs(t - one) < 0.2 for one in passes_s) else 1.0)  # noqa: E731
    told = drive(ring(sectors=5), wide, seconds=7, rules=LapRules(off_lane_s=1.0))
    incidents = incidents_of(told)
    assert [one.text.split("'")[1] for one in incidents] == [f"sector {k}" for k in missing]
    last = [[one for one in told[: told.index(incident)] if isinstance(one, Crossing)][-1] for incident in incidents]
    assert [one.line for one in last] == told_after
    (driven,) = laps_of(told)
    assert driven.incidents == tuple(incidents)


def test_a_sector_line_crossed_forward_back_and_forward_counts_at_first() -> None:
    """The others are told with their reasons."""

    def where(t_s: float) -> tuple[float, float]:
        back_s = 2.0
        out = t_s if t_s < back_s else max(back_s - (t_s - back_s), back_s - 0.5, t_s - 2 * 0.5)
        return at(-0.6 + W * out)

    told = drive(TRACK, where, seconds=8)
    found = [(one.line, one.status, one.reason) for one in told if isinstance(one, Crossing)]
    assert found[:4] == [
        ("start", PassStatus.START, None),
        ("sector 1", PassStatus.SECTOR, None),
        ("sector 1", PassStatus.IGNORED, "backwards"),
        ("sector 1", PassStatus.IGNORED, "sector 1 was crossed in this lap already"),
    ]
    (driven,) = laps_of(told)
    assert driven.lap.sectors[0].time_s == pytest.approx(LAP_S / 4, abs=0.01)
    assert driven.lap.sectors[1].time_s == pytest.approx(LAP_S / 4 + 1.0, abs=0.05)


def test_sector_lines_outside_laps_are_told_and_ignored() -> None:
    """A car that is first seen behind the start line."""
    told = drive(TRACK, lambda t: at(0.5 + W * t), seconds=3.5)
    assert [(one.line, one.reason, one.lap) for one in told if isinstance(one, Crossing)] == [
        ("sector 1", "no lap ran", None),
        ("sector 2", "no lap ran", None),
        ("sector 3", "no lap ran", None),
    ]


def test_right_lines_are_right() -> None:
    """Of a ring, with and without sectors and a finish line of its own."""
    check_lines(ring())
    check_lines(TRACK)
    finish = line_across(TRACK.centreline, 5.5, name="finish")
    check_lines(replace(TRACK, finish_line=finish))
    assert SectorPlan.of(TRACK).along_m == pytest.approx([k * ROUND / 4 for k in (1, 2, 3)], abs=1e-3)


A, B, C = TRACK.sector_lines
NOWHERE = DirectedLine(name="x", start_m=(0.2, 0.0), end_m=(0.3, 0.0))
THROUGH = DirectedLine(name="x", start_m=(-1.3, 0.0), end_m=(1.3, 0.0))
BACKWARDS = DirectedLine(name="x", start_m=A.end_m, end_m=A.start_m)


@pytest.mark.parametrize(
    ("track", "message"),
    [
        (replace(TRACK, sector_lines=(A, C, B)), "'sector 2' comes before 'sector 3' along the route: put"),
        (replace(TRACK, sector_lines=(NOWHERE,)), "'x' does not cross the route: draw"),
        (replace(TRACK, sector_lines=(THROUGH,)), "'x' crosses the route 2 times: draw"),
        (replace(TRACK, sector_lines=(BACKWARDS,)), "'x' is crossed backwards by the route: swap"),
        (replace(TRACK, sector_lines=(A, A)), "'sector 1' is there twice: give"),
        (replace(TRACK, start_line=NOWHERE), "'x' does not cross the route: draw"),
        (replace(TRACK, finish_line=replace(THROUGH, name="finish")), "'finish' crosses the route 2 times: draw"),
        (replace(TRACK, finish_line=line_across(TRACK.centreline, 4.0, name="finish")), "'sector 3' lies outside of the lap"),
    ],
    ids=["order", "nowhere", "twice", "backwards", "same name", "start nowhere", "finish twice", "behind the finish"],
)  # fmt: skip
def test_wrong_lines_are_one_clear_line(track: Track, message: str) -> None:
    """Each names the track, the line and what to do."""
    with pytest.raises(InputError, match=r"^track 'ring': the line ") as error:
        check_lines(track)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_finish_before_the_start_is_one_clear_line() -> None:
    """On an open route."""
    x = np.linspace(0.0, 4.0, 100)
    route = Centreline(
        points_m=np.column_stack((x, 0 * x)),
        half_left_m=np.full(100, 0.1),
        half_right_m=np.full(100, 0.1),
        closed=False,
    )
    track = Track(
        name="straight", scale=SCALE, centreline=route, start_line=line_across(route, 3.0, name="start"),
        finish_line=line_across(route, 1.0, name="finish"),
    )  # fmt: skip
    with pytest.raises(
        InputError, match=r"^track 'straight': the finish line lies before the start line: swap the two$"
    ):
        check_lines(track)
