"""The instant of a crossing: exact for smooth motion, unmoved by the wait, honest about its uncertainty."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import Fix
from dnb_edge.track.line import DirectedLine
from dnb_edge.values import Crossing, Direction

LINE = DirectedLine(name="start", start_m=(0.0, 0.5), end_m=(0.0, -0.5))
"""Crossed forward by a car that drives to +x."""


def fix(t_s: float, x_m: float, y_m: float = 0.0, sigma_m: float = 0.004) -> Fix:
    return Fix(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        target_id=1,
        observed_m=(x_m, y_m),
        covariance_m2=(sigma_m**2, 0.0, sigma_m**2),
        track_m=(x_m, y_m),
        s_m=0.0,
        d_m=0.0,
        outside_m=-0.1,
        progress_m=0.0,
    )


def feed(fixes: list[Fix], settings: CrossingSettings | None = None) -> list[Crossing]:
    watch = LineWatch(LINE, settings or CrossingSettings())
    return [crossing for one in fixes for crossing in watch.feed(one)] + watch.finish()


@given(
    speed_mps=st.floats(0.8, 6.0),
    true_s=st.floats(0.95, 1.05),
    braking_mps2=st.floats(-1.0, 1.0),
    fps=st.sampled_from([15.0, 29.97, 60.0]),
    hysteresis_m=st.floats(0.005, 0.1),
)
@settings(deadline=None)
def test_smooth_motion_is_timed_exactly_whatever_rate_and_hysteresis(
    speed_mps: float, true_s: float, braking_mps2: float, fps: float, hysteresis_m: float
) -> None:
    """A car with constant acceleration is timed to a microsecond; the hysteresis only delays the news."""

    def x(t: float) -> float:
        return speed_mps * (t - true_s) + braking_mps2 / 2 * (t - true_s) ** 2

    fixes = [fix(k / fps, x(k / fps)) for k in range(int(2 * fps)) if abs(k / fps - true_s) < 0.5]
    (crossing,) = feed(fixes, CrossingSettings(hysteresis_m=hysteresis_m))
    assert crossing.direction is Direction.FORWARD
    assert crossing.t_s == pytest.approx(true_s, abs=1e-6)


def test_the_fit_beats_two_points_and_its_sigma_is_honest() -> None:
    """With 4 mm of noise at 1 m/s and 30 fps the error is below that of two points, and about as large as stated."""
    random = np.random.default_rng(0)
    errors, sigmas = [], []
    for trial in range(400):
        true_s = 1.0 + trial / 400 / 30
        fixes = [fix(k / 30, k / 30 - true_s + random.normal(0, 0.004), random.normal(0, 0.004)) for k in range(15, 46)]
        (crossing,) = feed(fixes)
        errors.append(crossing.t_s - true_s)
        sigmas.append(crossing.sigma_s)
    two_points_s = 0.004 * math.sqrt(2 / 3)
    assert np.std(errors) < 0.85 * two_points_s
    assert 0.8 < np.std(errors) / np.mean(sigmas) < 1.25
    assert abs(np.mean(errors)) < 3 * np.std(errors) / 20


def test_passing_beside_the_line_is_no_crossing() -> None:
    """The line ends: who drives round its end has not crossed it."""
    assert feed([fix(k / 30, k / 30 - 1, 0.7) for k in range(60)]) == []


def test_forward_and_back_are_two_crossings_of_opposite_direction() -> None:
    """Each change of side through the line is one crossing."""
    there_and_back = [fix(k / 30, 0.5 * math.sin(k / 30 * math.pi - math.pi / 2)) for k in range(60)]
    assert [crossing.direction for crossing in feed(there_and_back)] == [Direction.FORWARD, Direction.REVERSE]


def test_jitter_within_the_hysteresis_is_no_crossing() -> None:
    """A car that trembles on the line by less than the hysteresis never crosses it."""
    assert feed([fix(0.0, -0.2), *(fix(k / 30, 0.04 * (-1) ** k) for k in range(1, 300))]) == []


def test_a_crossing_in_a_gap_is_marked_and_widened() -> None:
    """Without observations for half a second round the line the crossing is estimated and its sigma says so: by what the car
    can have done in the gap (8.5 ms at 1 m/s), however smoothly it was seen to drive before and after."""
    fixes = [fix(k / 30, k / 30 - 1) for k in range(60)]
    (seen,) = feed(fixes)
    (crossing,) = feed([one for one in fixes if abs(one.t_s - 1) > 0.25])
    assert crossing.estimated
    assert not seen.estimated
    assert crossing.sigma_s > 0.008 > 4 * seen.sigma_s
    assert abs(crossing.t_s - 1.0) < 0.01


@pytest.mark.parametrize("stop_s", [0.3, 1.0, 3.0, 60.0])
@pytest.mark.parametrize("beyond_m", [0.005, 0.03])
def test_a_car_that_stops_just_beyond_the_line_crossed_it_when_it_did(stop_s: float, beyond_m: float) -> None:
    """However long it stands within the hysteresis before it goes on, the instant is that of the passage."""

    def x_m(t_s: float) -> float:
        return min(t_s - 1.0, beyond_m) if t_s < 1.0 + stop_s else beyond_m + (t_s - 1.0 - stop_s)

    (crossing,) = feed([fix(k / 30, x_m(k / 30)) for k in range(15, round(30 * (3.0 + stop_s)))])
    assert crossing.t_s == pytest.approx(1.0, abs=0.02)
    assert not crossing.estimated


def test_a_car_that_starts_just_before_the_line_crosses_it() -> None:
    """A start from within the hysteresis counts: the first fix says on which side the car stands."""
    (crossing,) = feed([fix(k / 30, -0.03 + max(0.0, k / 30 - 1.0)) for k in range(90)])
    assert crossing.t_s == pytest.approx(1.03, abs=0.01)


def test_the_lines_extension_gives_no_second_crossing_of_an_old_passage() -> None:
    """A tight circuit round one end of the line: each lap is one crossing, forward, and none beside the line."""
    omega = 2 * math.pi / 1.2
    fixes = [
        fix(k / 60, -0.6 * math.cos(omega * k / 60), 0.7 - 0.6 * math.sin(omega * k / 60))
        for k in range(round(60 * 5.5))
    ]
    crossings = feed(fixes)
    assert len(crossings) == 5
    assert {crossing.direction for crossing in crossings} == {Direction.FORWARD}


def test_two_observations_are_enough() -> None:
    """With one observation on each side the instant is the straight line's."""
    (crossing,) = feed([fix(0.0, -0.1), fix(0.1, 0.3)])
    assert crossing.t_s == pytest.approx(0.025, abs=1e-9)


def test_the_stamps_own_sigma_is_added() -> None:
    """A source with poor stamps makes every crossing at least that uncertain."""
    (crossing,) = feed([fix(k / 30, k / 30 - 1) for k in range(60)], CrossingSettings(stamp_sigma_s=0.01))
    assert crossing.sigma_s >= 0.01
