"""Which passages count and when: cars that stand, tremble, turn or pass beside the line, seen with noise.

Each row is a drive with what really happened; truth is the first way through that nothing led back from.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import Fix
from dnb_edge.track.line import DirectedLine
from dnb_edge.values import Crossing, Direction, PointM

LINE = DirectedLine(name="start", start_m=(0.0, 0.4), end_m=(0.0, -0.4))
"""Crossed forward by a car that drives to +x."""

F, R = Direction.FORWARD, Direction.REVERSE
Path = Callable[[float], PointM]
FPS = 30


def seen(path: Path, until_s: float, *, sigma_m: float, seed: int, fps: float = FPS) -> list[Fix]:
    """What a camera sees of a car on `path`, with white noise."""
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (round(until_s * fps), 2)) * sigma_m
    fixes = []
    for k, (dx, dy) in enumerate(noise.tolist()):
        x, y = path(k / fps)
        fixes.append(fix(k / fps, (x + dx, y + dy), sigma_m))
    return fixes


def fix(t_s: float, at_m: PointM, sigma_m: float) -> Fix:
    variance = max(sigma_m, 0.002) ** 2
    return Fix(
        t_ns=round(t_s * 1e9), t_s=t_s, target_id=1, observed_m=at_m, covariance_m2=(variance, 0.0, variance),
        track_m=at_m, s_m=0.0, d_m=0.0, outside_m=-0.1, progress_m=0.0,
    )  # fmt: skip


def crossings(fixes: list[Fix], settings: CrossingSettings | None = None, line: DirectedLine = LINE) -> list[Crossing]:
    watch = LineWatch(line, settings or CrossingSettings())
    return [crossing for one in fixes for crossing in watch.feed(one)] + watch.finish()


def along_x(x_m: Callable[[float], float]) -> Path:
    return lambda t_s: (x_m(t_s), 0.05)


def ramp(*legs: tuple[float, float]) -> Path:
    """Straight legs (until_s, speed_mps) from x = -1 m."""

    def x_m(t_s: float) -> float:
        x, since = -1.0, 0.0
        for until_s, speed_mps in legs:
            x += speed_mps * (min(t_s, until_s) - since)
            since = until_s
            if t_s <= until_s:
                break
        return x

    return along_x(x_m)


def leaves(from_m: float, *, arrives: bool = True, stands_s: float = 4.0) -> Path:
    """Comes at 1 m/s, brakes and stands at `from_m` (the line is at 0), leaves at 2 m/s^2 up to 1 m/s."""

    def x_m(t_s: float) -> float:
        stop_s = 2.0
        if t_s < stop_s:
            left_s = stop_s - t_s
            # 2 m/s^2 over the last half second, 1 m/s before it.
            return from_m - (left_s**2 if left_s < 0.5 else 0.25 + (left_s - 0.5)) if arrives else from_m
        go_s = t_s - stop_s - stands_s
        if go_s < 0:
            return from_m
        return from_m + (go_s**2 if go_s < 0.5 else 0.25 + (go_s - 0.5))

    return along_x(x_m)


def trembles(x_m: Callable[[float], float], *, from_s: float = 1.0, until_s: float = 301.0) -> Path:
    """Comes at 1 m/s, trembles on the line as `x_m` says, goes on at 1 m/s."""

    def at(t_s: float) -> float:
        if t_s < from_s:
            return t_s - from_s
        return x_m(t_s - from_s) if t_s < until_s else t_s - until_s

    return along_x(at)


CASES: list[tuple[str, Path, float, list[Direction], float | None, float]] = [
    ("drives through", ramp((9.0, 1.0)), 3.0, [F], 1.0, 0.01),
    ("drives through slowly", ramp((9.0, 0.3)), 6.0, [F], 1 / 0.3, 0.03),
    ("drives through at 3 m/s", ramp((9.0, 3.0)), 1.0, [F], 1 / 3, 0.005),
    ("backwards", lambda t: (1.0 - t, 0.0), 3.0, [R], 1.0, 0.01),
    ("parked on it for five minutes", trembles(lambda t: 0.0), 304.0, [F], None, 0.0),
    ("a sine of 20 mm on it for five minutes", trembles(lambda t: 0.02 * math.sin(6.0 * t)), 304.0, [F], None, 0.0),
    ("a slow sine of 20 mm on it", trembles(lambda t: 0.02 * math.sin(0.7 * t), until_s=61.0), 64.0, [F], None, 0.0),
    ("through, back and through", ramp((1.5, 1.0), (2.5, -1.0), (9.0, 1.0)), 5.0, [F, R, F], None, 0.0),
    ("a reverse over it", ramp((1.5, 1.0), (9.0, -1.0)), 4.0, [F, R], None, 0.0),
    ("a turn before it", ramp((0.9, 1.0), (9.0, -1.0)), 4.0, [], None, 0.0),
    ("40 mm beyond it and back, then through", ramp((1.04, 1.0), (2.04, 0.0), (2.2, -1.0), (9.0, 1.0)), 5.0, [F], 2.32, 0.02),
    ("a U-turn over it", lambda t: (0.3 * math.sin(t - 1.0), 0.3 - 0.3 * math.cos(t - 1.0)), 2.5, [F], 1.0, 0.02),
    ("a U-turn over it and back over it", lambda t: (0.15 * math.sin(t - 1), -0.15 * math.cos(t - 1)), 6.2, [F, R], 1.0, 0.03),
    ("stands 3 mm before it", leaves(-0.003), 8.5, [F], 6.055, 0.05),
    ("stands 3 mm behind it", leaves(0.003), 8.5, [F], 1.945, 0.05),
    ("is first seen 3 mm before it", leaves(-0.003, arrives=False), 8.5, [F], 6.055, 0.05),
    ("at an angle of 30 degrees to it", lambda t: ((t - 1) * 0.5, (t - 1) * 0.866), 1.4, [F], 1.0, 0.02),
    ("beside its end", lambda t: (t - 1.0, 0.5), 3.0, [], None, 0.0),
    ("a curve round its end", lambda t: (0.3 * math.sin(t), 0.8 - 0.3 * math.cos(t)), 7.0, [], None, 0.0),
    ("circles round its end", lambda t: (0.4 * math.sin(t - 1), 0.65 - 0.4 * math.cos(t - 1)), 14.0, [F, F, F], None, 0.0),
]  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("sigma_m", [0.0, 0.002, 0.004])
@pytest.mark.parametrize(
    ("path", "until_s", "expected", "true_s", "within_s"), [c[1:] for c in CASES], ids=[c[0] for c in CASES]
)
def test_what_counts_and_when(
    path: Path,
    until_s: float,
    expected: list[Direction],
    true_s: float | None,
    within_s: float,
    sigma_m: float,
    seed: int,
) -> None:
    """Exactly the crossings that happened, in their directions, and the first of them when it happened: within the row's bound
    or, where noise hides when a standing car left, three of its own sigmas."""
    found = crossings(seen(path, until_s, sigma_m=sigma_m, seed=seed))
    assert [one.direction for one in found] == expected
    if true_s is not None:
        assert found[0].t_s == pytest.approx(true_s, abs=max(within_s, 3 * found[0].sigma_s))


@given(
    seed=st.integers(0, 10_000),
    speed_mps=st.floats(0.5, 3.0),
    sigma_m=st.sampled_from([0.0, 0.002, 0.005]),
    fps=st.sampled_from([15.0, 30.0, 60.0]),
    hysteresis_m=st.floats(0.02, 0.08),
)
@settings(deadline=None, max_examples=60)
def test_no_hysteresis_moves_a_time(
    seed: int, speed_mps: float, sigma_m: float, fps: float, hysteresis_m: float
) -> None:
    """Three laps round a circle, with noise and any hysteresis from 20 to 80 mm: the very same crossings, to the nanosecond."""
    radius_m = 0.6
    line = DirectedLine(name="start", start_m=(0.4, 0.0), end_m=(0.8, 0.0))
    turn = speed_mps / radius_m

    def path(t_s: float) -> PointM:
        return radius_m * math.cos(turn * t_s - 1.0), radius_m * math.sin(turn * t_s - 1.0)

    fixes = seen(path, 3.3 * 2 * math.pi / turn, sigma_m=sigma_m, seed=seed, fps=fps)
    found = crossings(fixes, CrossingSettings(hysteresis_m=hysteresis_m), line)
    assert found == crossings(fixes, CrossingSettings(hysteresis_m=0.05), line)
    assert [one.direction for one in found] == [F] * len(found)
    assert len(found) >= 3


def test_a_parked_car_costs_no_memory() -> None:
    """Half an hour on the line leaves no more behind than a pass: the fixes round it."""
    watch = LineWatch(LINE, CrossingSettings())
    for one in seen(trembles(lambda t: 0.0, until_s=1e9), 1800.0, sigma_m=0.004, seed=1, fps=10):
        assert watch.feed(one) == []
    kept = [watch._candidate, watch._waiting, *watch._due]
    assert len(watch._recent) < 30
    assert all(len(passage.fixes) < 60 for passage in kept if passage is not None)
