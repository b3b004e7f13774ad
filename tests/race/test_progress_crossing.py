"""Progress on routes that cross themselves or come near themselves, and on open ones."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from dnb_edge.race.fix import Fix, Progress
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Observation, PointM, Points

FPS = 30.0


def line(points: Points, *, closed: bool = True, half_m: float = 0.15) -> Centreline:
    n = len(points)
    return Centreline(points_m=points, half_left_m=np.full(n, half_m), half_right_m=np.full(n, half_m), closed=closed)


def eight() -> Centreline:
    """A figure eight; its branches cross at (0, 0), at s = 0 and at half its length."""
    t = np.arange(600) * (2 * math.pi / 600)
    return line(np.column_stack((2.0 * np.sin(t), 1.2 * np.sin(2 * t))))


def hairpin() -> Centreline:
    """Two straights side by side, their lanes touching, and a wide way back."""
    right = np.column_stack((np.arange(0, 3, 0.05), np.zeros(60)))
    bend = np.column_stack(
        [(3.0 + 0.16 * np.sin(a), 0.16 - 0.16 * np.cos(a)) for a in np.linspace(0.1, math.pi - 0.1, 9)]
    ).T
    left = np.column_stack((np.arange(3, 0, -0.05), np.full(60, 0.32)))
    return line(np.vstack((right, bend, left, [[-1.0, 0.32], [-1.5, 0.0], [-1.0, -0.3]])))


def drive(route: Centreline, path: list[PointM], *, fps: float = FPS, start: int = 0) -> list[Fix]:
    progress = Progress(route)
    fixes = []
    for k, point in enumerate(path, start=start):
        seen = Observation(
            t_ns=round(k * 1e9 / fps), t_s=k / fps, camera_px=(0, 0), track_m=point, covariance_m2=(1e-4, 0, 1e-4),
            confidence=1, length_px=9,
        )  # fmt: skip
        fixes.append(progress.fix(seen, target_id=1, track_m=point))
    return fixes


def along(route: Centreline, s_m: np.ndarray, d_m: float = 0.0, noise_m: float = 0.0, seed: int = 0) -> list[PointM]:
    random = np.random.default_rng(seed)
    shift = random.normal(0.0, noise_m, (len(s_m), 2)) if noise_m else np.zeros((len(s_m), 2))
    return [
        (x + dx, y + dy) for (x, y), (dx, dy) in zip((route.point_at(s, d_m) for s in s_m), shift.tolist(), strict=True)
    ]


@pytest.mark.parametrize("d_m", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("noise_m", [0.0, 0.01])
@pytest.mark.parametrize("speed_mps", [0.2, 1.0, 3.0])
def test_s_and_d_go_on_over_a_crossing(d_m: float, noise_m: float, speed_mps: float) -> None:
    """Two laps of the eight, with noise, off the middle: s and d never jump, and the progress is what was driven."""
    route = eight()
    s_m = np.arange(1.0, 1.0 + 2 * route.length_m, speed_mps / FPS)
    fixes = drive(route, along(route, s_m, d_m, noise_m))
    for at_m, fix in zip(s_m, fixes, strict=True):
        assert abs(route.step_m(fix.s_m, at_m)) < 0.02 + 8 * noise_m
        assert fix.d_m == pytest.approx(d_m, abs=0.01 + 6 * noise_m)
    assert fixes[-1].progress_m == pytest.approx(s_m[-1] - 1.0, abs=0.02 + 8 * noise_m)
    assert max(abs(b.progress_m - a.progress_m) for a, b in pairwise(fixes)) < 2 * speed_mps / FPS + 0.05 + 8 * noise_m


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("at", [0.0, 0.5])
@pytest.mark.parametrize("away_m", [-0.04, 0.0, 0.05])
def test_a_car_first_seen_on_the_crossing_is_on_the_branch_that_it_drives_along(
    at: float, away_m: float, backwards: bool
) -> None:
    """Whichever branch was nearest at first: a tenth of a metre on, the heading decides, and progress has not jumped."""
    route = eight()
    sense = -1.0 if backwards else 1.0
    s_m = at * route.length_m + sense * (away_m + np.arange(0.0, 1.0, 0.02))
    fixes = drive(route, along(route, s_m, 0.01))
    assert abs(route.step_m(fixes[-1].s_m, s_m[-1])) < 0.02
    assert fixes[-1].progress_m == pytest.approx(s_m[-1] - s_m[0], abs=0.12)


def test_a_car_that_was_lost_for_long_is_sought_everywhere() -> None:
    """After two seconds on the other lobe, it is there, on the branch that it drives along."""
    route = eight()
    before, after = np.arange(1.0, 1.5, 0.03), route.length_m * 0.5 + np.arange(-0.02, 1.0, 0.03)
    progress = Progress(route)
    for k, point in [*enumerate(along(route, before)), *enumerate(along(route, after, 0.02), start=17 + 60)]:
        seen = Observation(
            t_ns=round(k * 1e9 / FPS), t_s=k / FPS, camera_px=(0, 0), track_m=point, covariance_m2=(1e-4, 0, 1e-4),
            confidence=1, length_px=9,
        )  # fmt: skip
        fix = progress.fix(seen, target_id=1, track_m=point)
    assert abs(route.step_m(fix.s_m, after[-1])) < 0.02


@pytest.mark.parametrize("hidden_s", [0.3, 0.6, 0.9])
def test_a_car_hidden_while_it_crosses_comes_out_on_its_branch(hidden_s: float) -> None:
    """Up to a second unseen at 1.5 m/s, the crossing in the middle of it: s is where the car is."""
    route = eight()
    s_m = np.arange(-1.2, 1.2, 1.5 / FPS) + route.length_m / 2
    path = along(route, s_m, 0.03)
    progress = Progress(route)
    for k, (at_m, point) in enumerate(zip(s_m, path, strict=True)):
        if abs(at_m - route.length_m / 2) < 1.5 * hidden_s / 2:
            continue
        seen = Observation(
            t_ns=round(k * 1e9 / FPS), t_s=k / FPS, camera_px=(0, 0), track_m=point, covariance_m2=(1e-4, 0, 1e-4),
            confidence=1, length_px=9,
        )  # fmt: skip
        fix = progress.fix(seen, target_id=1, track_m=point)
        assert abs(route.step_m(fix.s_m, at_m)) < 0.03


def test_a_car_near_the_neighbouring_lane_stays_on_its_own() -> None:
    """On a straight beside another one, 2 cm over the common edge: it is off its own lane, not half a lap further on."""
    route = hairpin()
    fixes = drive(route, [(x, 0.18) for x in np.arange(0.5, 2.5, 0.05)], fps=10)
    started = drive(route, [(0.2, 0.0), (0.35, 0.1), *((x, 0.18) for x in np.arange(0.5, 2.5, 0.05))], fps=10)
    assert started[-1].s_m == pytest.approx(2.45, abs=0.03)
    assert started[-1].progress_m == pytest.approx(2.25, abs=0.05)
    assert started[-1].outside_m == pytest.approx(0.03, abs=0.01)
    # First seen there, it counts as on the lane that it is nearer to.
    assert fixes[-1].s_m > 3.5


def test_a_car_that_changes_over_to_another_branch_is_found_there() -> None:
    """A lane's width and more away from where it should be, the car is where the route is nearest."""
    route = hairpin()
    across = [
        (1.0, 0.0),
        *((1.0 + 0.02 * k, 0.02 * k) for k in range(1, 17)),
        *((1.3 - 0.02 * k, 0.34) for k in range(10)),
    ]
    fixes = drive(route, across)
    assert abs(fixes[-1].d_m) < 0.05
    assert fixes[-1].s_m > 3.5


def test_progress_on_an_open_route_does_not_wrap() -> None:
    """From one end to the other is its length; carried back to the first end, the progress is none again."""
    x = np.linspace(0, 4, 200)
    route = line(np.column_stack((x, 0.3 * np.sin(x))), closed=False)
    s_m = np.arange(-0.2, route.length_m + 0.2, 0.03)
    fixes = drive(route, along(route, s_m))
    assert fixes[-1].progress_m == pytest.approx(route.length_m, abs=1e-6)
    assert [fixes[0].s_m, fixes[-1].s_m] == pytest.approx([0.0, route.length_m])
    back = drive(route, [*along(route, s_m), route.point_at(0.1)])
    assert back[-1].progress_m == pytest.approx(0.1, abs=0.01)
