"""A line that is passed while nobody sees the car: counted once, when it was to within its sigma, and only if it was driven."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from race_drive import Where, drive, incidents_of, laps_of, ring, statuses

from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import Fix
from dnb_edge.race.rules import LapRules
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Direction, IncidentKind, PassStatus

Way = Callable[[float], float]
"""Metres along the route, from the line, as a function of time in seconds."""

SPEED_MPS = 1.3


def bends(*, length_m: float = 3.0, radius_m: float = 0.35) -> Track:
    """Two straights and two tight bends; the start line at the top of a bend, where no chord over a long gap passes."""
    straight, bend = np.arange(0, length_m, 0.05), np.linspace(0, math.pi, 24)[:-1]
    points = np.vstack([
        np.column_stack((straight, np.zeros_like(straight))),
        np.column_stack((length_m + radius_m * np.sin(bend), radius_m - radius_m * np.cos(bend))),
        np.column_stack((length_m - straight, np.full_like(straight, 2 * radius_m))),
        np.column_stack((-radius_m * np.sin(bend), radius_m + radius_m * np.cos(bend))),
    ])  # fmt: skip
    points = np.roll(points, -(len(straight) + 11), axis=0)
    half = np.full(len(points), 0.15)
    route = Centreline(points_m=points, half_left_m=half, half_right_m=half)
    start = line_across(route, 0.0, name="start", margin_m=0.05)
    return Track(name="bends", scale=ring().scale, centreline=route, start_line=start)


BENDS, RING = bends(), ring(1.0)


def steady(t_s: float) -> float:
    return SPEED_MPS * t_s - 1.5


def swinging(t_s: float) -> float:
    """Brakes and speeds up by a third all the time, once in about three seconds."""
    return steady(t_s) + 0.33 * SPEED_MPS / 2.1 * (math.cos(2.1 * t_s) - 1.0)


def backwards(t_s: float) -> float:
    return -steady(t_s)


def passes(track: Track, way: Way, until_s: float, sense: float = 1.0) -> list[float]:
    """True instants at which the way passes the line, by bisection."""
    length_m = track.centreline.length_m
    times, step_s = [], 0.01
    for k in range(round(until_s / step_s)):
        a, b = k * step_s, (k + 1) * step_s
        if math.floor(sense * way(a) / length_m) == math.floor(sense * way(b) / length_m):
            continue
        goal = math.floor(sense * way(b) / length_m) * length_m
        for _ in range(40):
            middle = (a + b) / 2
            a, b = (middle, b) if sense * way(middle) < goal else (a, middle)
        times.append(a)
    return times


def seen_but(track: Track, way: Way, hidden: list[tuple[float, float]], d_m: float = 0.0) -> Where:
    def where(t_s: float) -> tuple[float, float] | None:
        return None if any(a < t_s < b for a, b in hidden) else track.centreline.point_at(way(t_s), d_m)

    return where


def starts(told: list[Passed]) -> list[Crossing]:
    return [one for one in told if isinstance(one, Crossing)]


@pytest.mark.parametrize("track", [BENDS, RING], ids=["bends", "ring"])
@pytest.mark.parametrize("way", [steady, swinging, backwards])
@pytest.mark.parametrize("share", [0.15, 0.5, 0.85])
@pytest.mark.parametrize("hidden_s", [0.25, 0.5, 0.8, 1.2, 2.0, 3.0])
def test_a_car_hidden_over_the_line_has_passed_it_once(hidden_s: float, share: float, way: Way, track: Track) -> None:
    """Wherever in the gap the line lies, in a bend or not, forward or backward: as many passes as there were, each within two
    of its sigmas, and the hidden one says that it is estimated."""
    sense = -1.0 if way is backwards else 1.0
    true_s = passes(track, way, 16.0, sense)
    at_s = true_s[1]
    hidden = (at_s - share * hidden_s, at_s + (1 - share) * hidden_s)
    told = drive(track, seen_but(track, way, [hidden], 0.04), seconds=16, noise_m=0.003)
    found = starts(told)
    assert [one.direction for one in found] == [Direction.FORWARD if sense > 0 else Direction.REVERSE] * len(true_s)
    for one, t_s in zip(found, true_s, strict=True):
        assert abs(one.t_s - t_s) < (2.5 * one.sigma_s if one.estimated else 0.006)
    assert [one.estimated for one in found] == [k == 1 for k in range(len(found))]
    if sense > 0:
        assert statuses(told) == ["start", *["lap"] * (len(true_s) - 1)]
        assert len(laps_of(told)) == len(true_s) - 1
        kinds = {one.kind for one in incidents_of(told)}
        assert kinds <= {IncidentKind.LOST}
        assert (IncidentKind.LOST in kinds) == (hidden_s > 1.0)


@pytest.mark.parametrize("hidden_s", [0.5, 0.8, 1.5, 3.0])
def test_the_sigma_of_a_hidden_pass_is_true(hidden_s: float) -> None:
    """Of cars that drive evenly, brake or speed up by up to a third of their speed in a second: 95 % within the interval."""
    random, within, sigmas, at_s = np.random.default_rng(5), [], [], 5.5
    for _ in range(60):
        pace, turn, phase = random.uniform(0.8, 2.4), random.uniform(0, 2 * math.pi), random.uniform(0.1, 0.9)

        def way(t_s: float, pace: float = pace, turn: float = turn) -> float:
            swing = 0.33 * SPEED_MPS / pace * (math.sin(pace * (t_s - at_s) + turn) - math.sin(turn))
            return SPEED_MPS * (t_s - at_s) + swing

        hidden = (at_s - phase * hidden_s, at_s + (1 - phase) * hidden_s)
        told = drive(BENDS, seen_but(BENDS, way, [hidden], random.uniform(-0.1, 0.1)), seconds=9, noise_m=0.003)
        (one,) = starts(told)
        within.append(abs(one.t_s - at_s) < 1.96 * one.sigma_s)
        sigmas.append(one.sigma_s)
    assert np.mean(within) > 0.9
    assert np.median(sigmas) < hidden_s / math.sqrt(12) + 1e-9


def put_down(from_m: float, to_m: float, away_s: float, *, at_s: float = 3.0) -> Where:
    """A car that is taken away at `from_m` along the bends' route, and put down at `to_m` after so long."""

    def where(t_s: float) -> tuple[float, float] | None:
        if t_s < at_s:
            return BENDS.centreline.point_at(from_m + SPEED_MPS * (t_s - at_s))
        since_s = t_s - at_s - away_s
        return None if since_s < 0 else BENDS.centreline.point_at(to_m + SPEED_MPS * since_s)

    return where


@pytest.mark.parametrize(
    ("from_m", "to_m", "away_s", "expected"),
    [
        (-0.3, 1.2, 0.3, []),
        (-1.0, 1.0, 0.5, []),
        (1.0, -0.3, 0.3, ["forward", "forward"]),
        (-0.4, 0.25, 0.5, ["forward"]),
        (-0.4, -0.4, 5.0, ["forward"]),
        (-2.0, 2.0, 0.25, []),
        (0.6, 0.7, 2.0, ["forward"]),
    ],
)
def test_what_was_carried_over_the_line_did_not_drive_over_it(
    from_m: float, to_m: float, away_s: float, expected: list[str]
) -> None:
    """Where the straight way leads past the line, only a step that the car can have driven is a passage."""
    told = drive(BENDS, put_down(from_m, to_m, away_s), seconds=6 + away_s, noise_m=0.002)
    assert [str(one.direction) for one in starts(told)] == expected


@pytest.mark.parametrize("fps", [3.0, 4.0])
def test_few_frames_a_second_are_gaps_and_count_right(fps: float) -> None:
    """Every step is longer than a gap: parked on the line for a minute with jitter is one crossing, and laps are laps."""
    halt_s = 1.5 / SPEED_MPS

    def where(t_s: float) -> tuple[float, float] | None:
        return BENDS.centreline.point_at(steady(min(t_s, halt_s) if t_s < 60 else t_s - 60 + halt_s))

    told = drive(BENDS, where, seconds=60 + 14, fps=fps, noise_m=0.01)
    assert statuses(told) == [PassStatus.START, PassStatus.LAP, PassStatus.LAP]


def fix(t_s: float, at_m: tuple[float, float], sigma_m: float = 0.003) -> Fix:
    return Fix(
        t_ns=round(t_s * 1e9), t_s=t_s, target_id=1, observed_m=at_m, covariance_m2=(sigma_m**2, 0.0, sigma_m**2),
        track_m=at_m, s_m=0.0, d_m=0.0, outside_m=-0.1, progress_m=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("away_m", [(0.5, 0.1), (-1.5, 0.3), (0.0, 0.6), (-0.6, 0.0)])
@pytest.mark.parametrize("before_s", [0.1, 0.15, 0.25])
def test_a_car_put_down_just_before_the_line_is_timed_by_what_it_drove_then(
    before_s: float, away_m: tuple[float, float]
) -> None:
    """Where it was in the hand or before that is in no fit: 40 lifts, no bias, truth within the interval."""
    line = DirectedLine(name="start", start_m=(0.0, 0.4), end_m=(0.0, -0.4))
    random, errors, within = np.random.default_rng(3), [], []
    for _ in range(40):
        true_s = 1.0 + random.uniform() / 30
        watch, found = LineWatch(line, CrossingSettings()), []
        for k in range(48):
            u = k / 30 - true_s
            lifted = u < -before_s
            x, y = (-1.0 + away_m[0] + 0.7 * u, away_m[1]) if lifted else (u, 0.0)
            found += watch.feed(fix(k / 30, (x + random.normal(0, 0.003), y + random.normal(0, 0.003))))
        (one,) = [one for one in found + watch.finish() if one.direction is Direction.FORWARD]
        errors.append(one.t_s - true_s)
        within.append(abs(errors[-1]) < 1.96 * one.sigma_s)
    assert abs(np.mean(errors)) < 0.0015
    assert np.mean(within) >= 0.9


def test_a_single_false_find_near_the_line_is_left_out() -> None:
    """A fix 0.6 m out of the way, on the line's side where it does not change the passage, does not move the instant."""
    line = DirectedLine(name="start", start_m=(0.0, 0.4), end_m=(0.0, -0.4))
    told: list[Crossing] = []
    for out in (False, True):
        watch, found = LineWatch(line, CrossingSettings()), []
        for k in range(60):
            x = k / 30 - 1.0
            found += watch.feed(
                fix(k / 30, (x, 0.6) if out and k == 25 else (x - (0.6 if out and k == 22 else 0), 0.0))
            )
        (one,) = found + watch.finish()
        told.append(one)
    assert told[1].t_s == pytest.approx(told[0].t_s, abs=1e-4)
    assert told[1].sigma_s < 1.15 * told[0].sigma_s, "only it is left out, not all that was before it"


def test_a_race_without_a_gap_is_the_same_with_and_without_the_route() -> None:
    """While the car is seen, its way along the route decides nothing."""
    plain = CarRace.begin(BENDS, CrossingSettings(), LapRules())
    bare = tuple(LineWatch(line, CrossingSettings()) for line in BENDS.lines)
    where = seen_but(BENDS, swinging, [])
    with_route = drive(BENDS, where, seconds=16, noise_m=0.004, race=plain)
    without = drive(
        BENDS, where, seconds=16, noise_m=0.004,
        race=CarRace(progress=plain.progress.__class__(BENDS.centreline), lines=bare,
                     laps=CarRace.begin(BENDS, CrossingSettings(), LapRules()).laps),
    )  # fmt: skip
    assert starts(with_route) == starts(without)
