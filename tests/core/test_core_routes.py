"""Whole races on routes that cross themselves and on routes from point to point."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from circle import SCALE, circle_setup, circle_track, frames

from dnb_edge.core import Core, CoreSetup
from dnb_edge.race.rules import LapRules
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.layout import NamedLine, laid_out
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Event, Lap, PointM, Points, Score

SPEED_MPS = 1.2


def line(points: Points, *, closed: bool) -> Centreline:
    half = np.full(len(points), 0.15)
    return Centreline(points_m=points, half_left_m=half, half_right_m=half, closed=closed)


def eight_track() -> Track:
    """A figure eight whose start line lies on its right lobe and a sector line on its left one."""
    t = np.arange(700) * (2 * math.pi / 700)
    route = line(np.column_stack((2.0 + 1.6 * np.sin(t), 2.0 + 1.0 * np.sin(2 * t))), closed=True)
    start = line_across(route, 0.25 * route.length_m, name="start", margin_m=0.05)
    sector = line_across(route, 0.75 * route.length_m, name="left lobe", margin_m=0.05)
    return laid_out(
        route, name="eight", scale=SCALE, start=start, sectors=[NamedLine(line=sector, name="left lobe")], source="test"
    )


def open_track() -> Track:
    """An S with half a metre before its start line and behind its finish line."""
    x = np.linspace(0.3, 3.7, 500)
    route = line(np.column_stack((x, 2.0 + 0.8 * np.sin(1.6 * x))), closed=False)
    start = line_across(route, 0.5, name="start", margin_m=0.05)
    finish = line_across(route, route.length_m - 0.5, name="finish", margin_m=0.05)
    return laid_out(route, name="open", scale=SCALE, start=start, finish=finish, source="test")


def race(track: Track, position: Callable[[float], PointM | None], *, seconds: float, noise_px: float = 0.0,
         seed: int = 0, **changes: object) -> list[Event]:  # fmt: skip
    core = Core(circle_setup(track=track, **changes))
    events = [e for found in frames(position, seconds=seconds, noise_px=noise_px, seed=seed) for e in core.step(found)]
    return events + core.finish()


def laps_of(events: list[Event]) -> list[Lap]:
    return [event for event in events if isinstance(event, Lap)]


def scores_of(events: list[Event]) -> list[Score]:
    return [event for event in events if isinstance(event, Score)]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("begin", [0.0, 0.1, 0.5, 0.9])
def test_laps_of_a_figure_eight_are_counted_timed_and_scored(begin: float, seed: int) -> None:
    """Wherever the car is first seen, the crossing included: each time round is one valid lap, and its score is a good one."""
    track = eight_track()
    length_m = track.centreline.length_m
    lap_s = length_m / SPEED_MPS
    wander = lambda s_m: 0.05 * math.sin(2 * math.pi * s_m / length_m * 3 + seed)  # noqa: E731
    at = lambda t: (begin - 0.25) * length_m + SPEED_MPS * t  # noqa: E731
    events = race(
        track, lambda t: track.centreline.point_at(at(t), wander(at(t))), seconds=4.3 * lap_s, noise_px=1.0, seed=seed
    )
    laps = laps_of(events)
    assert [lap.number for lap in laps] == list(range(1, len(laps) + 1))
    assert len(laps) in (3, 4)
    assert all(lap.valid for lap in laps), [lap.reasons for lap in laps]
    assert [lap.time_s for lap in laps] == pytest.approx([lap_s] * len(laps), abs=0.02)
    for score in scores_of(events):
        assert score.similarity_percent > 90
        assert score.lateral_max_m < 0.05 + 0.03
        assert score.route_length_m == pytest.approx(length_m, rel=1e-6)
    lines = [event.line for event in events if isinstance(event, Crossing)]
    assert all(a != b for a, b in itertools.pairwise(lines))


def test_half_an_eight_is_no_lap() -> None:
    """A car that goes round one lobe only crosses the start line without having driven the lap."""
    track = eight_track()
    length_m = track.centreline.length_m
    lobe_s = length_m / 2 / SPEED_MPS
    # The right lobe lies round the start line: from a quarter before it to a quarter behind it.
    events = race(
        track, lambda t: track.centreline.point_at(-length_m / 4 + (SPEED_MPS * t) % (length_m / 2)), seconds=4 * lobe_s
    )
    assert sum(isinstance(event, Crossing) for event in events) >= 3
    assert laps_of(events) == []


def attempts(track: Track, *, count: int, away_s: float = 2.0) -> tuple[Callable[[float], PointM | None], float]:
    """A car that drives from end to end `count` times, unseen for `away_s` between; and the time for one attempt."""
    drive_s = track.centreline.length_m / SPEED_MPS

    def position(t_s: float) -> PointM | None:
        k, into_s = divmod(t_s, drive_s + away_s)
        return track.centreline.point_at(SPEED_MPS * into_s, 0.03) if k < count and into_s <= drive_s else None

    return position, drive_s + away_s


@pytest.mark.parametrize("noise_px", [0.0, 1.0])
def test_a_run_from_point_to_point_is_a_lap_from_the_start_line_to_the_finish_line(noise_px: float) -> None:
    """Three times from end to end, carried back unseen: three valid laps, timed and scored between the two lines."""
    track = open_track()
    _, lap_m = track.lap_m()
    position, each_s = attempts(track, count=3)
    events = race(track, position, seconds=3 * each_s, noise_px=noise_px)
    laps, scores = laps_of(events), scores_of(events)
    assert [lap.number for lap in laps] == [1, 2, 3]
    assert all(lap.valid for lap in laps), [lap.reasons for lap in laps]
    assert [lap.time_s for lap in laps] == pytest.approx([lap_m / SPEED_MPS] * 3, abs=0.01)
    assert [score.route_length_m for score in scores] == pytest.approx([lap_m] * 3, rel=1e-3)
    assert all(score.similarity_percent > 90 and score.lateral_mean_m < 0.04 for score in scores)
    names = [event.line for event in events if isinstance(event, Crossing)]
    assert names == ["start", "finish"] * 3
    assert [lap.start_s for lap in laps] == pytest.approx([0.5 / SPEED_MPS + k * each_s for k in range(3)], abs=0.01)


def test_a_run_that_is_given_up_begins_anew_at_the_start_line() -> None:
    """Half way, then back to the first end and all the way: one lap, timed from the second start."""
    track = open_track()
    length_m = track.centreline.length_m
    half_s = length_m / 2 / SPEED_MPS

    def position(t_s: float) -> PointM | None:
        if t_s < half_s:
            return track.centreline.point_at(SPEED_MPS * t_s)
        return track.centreline.point_at(SPEED_MPS * (t_s - half_s - 1.5)) if t_s > half_s + 1.5 else None

    (lap,) = laps_of(race(track, position, seconds=half_s + 1.5 + length_m / SPEED_MPS))
    assert lap.valid, lap.reasons
    assert lap.time_s == pytest.approx((length_m - 1.0) / SPEED_MPS, abs=0.01)


def test_a_car_that_drives_back_in_sight_is_on_an_out_lap_until_it_starts_again() -> None:
    """There, back in reverse over both lines, and there again: two laps."""
    track = open_track()
    length_m = track.centreline.length_m
    there_s = length_m / SPEED_MPS

    def position(t_s: float) -> PointM:
        k, into_s = divmod(t_s, there_s)
        return track.centreline.point_at(SPEED_MPS * (into_s if k % 2 == 0 else there_s - into_s))

    events = race(track, position, seconds=3 * there_s)
    assert [(e.line, str(e.direction)) for e in events if isinstance(e, Crossing)] == [
        ("start", "forward"), ("finish", "forward"), ("finish", "reverse"), ("start", "reverse"),
        ("start", "forward"), ("finish", "forward"),
    ]  # fmt: skip
    assert [lap.valid for lap in laps_of(events)] == [True, True]


def test_the_wanted_number_of_runs_ends_an_open_race() -> None:
    """After two of three attempts the race is finished, and the third is not counted."""
    track = open_track()
    position, each_s = attempts(track, count=3)
    core = Core(circle_setup(track=track, laps=LapRules(laps=2)))
    events = [e for found in frames(position, seconds=3 * each_s) for e in core.step(found)]
    assert core.finished
    assert len(laps_of(events)) == 2


def test_a_closed_route_may_have_a_finish_line_of_its_own() -> None:
    """From the start line to a finish line three quarters round: that is the lap, once in each time round."""
    whole = circle_track()
    finish = line_across(whole.centreline, 0.75 * whole.centreline.length_m, name="finish", margin_m=0.05)
    track = Track(name="c", scale=SCALE, centreline=whole.centreline, start_line=whole.start_line, finish_line=finish)
    assert track.lap_m() == pytest.approx((0.0, 0.75 * whole.centreline.length_m), abs=1e-6)
    events = race(track, lambda t: whole.centreline.point_at(SPEED_MPS * t - 0.4), seconds=17)
    laps = laps_of(events)
    assert len(laps) == 3
    assert [lap.time_s for lap in laps] == pytest.approx([track.lap_m()[1] / SPEED_MPS] * 3, abs=0.01)
    assert all(lap.valid for lap in laps)
    assert scores_of(events)[0].similarity_percent > 99


@pytest.mark.parametrize("track", [eight_track(), open_track()], ids=["eight", "open"])
def test_a_recorded_setup_is_the_setup(track: Track) -> None:
    """Stored as JSON and read again it gives the same events, bit for bit."""
    setup = circle_setup(track=track)
    again = CoreSetup.from_dict(json.loads(json.dumps(setup.to_dict())))
    assert again == setup
    told = []
    for one in (setup, again):
        core = Core(one)
        position = lambda t: track.centreline.point_at(SPEED_MPS * t)  # noqa: E731
        told.append([e for found in frames(position, seconds=9, noise_px=1.0) for e in core.step(found)])
    assert told[0] == told[1]
