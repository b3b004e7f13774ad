"""Paths of blobs: what belongs together, what moves as a car does, and how a path is smoothed."""

import numpy as np
import pytest

from dnb_edge.train.teach_drive import Blob
from dnb_edge.train.teach_paths import Linker, Seen, moves_like_a_car, smoothed

FPS = 30.0


def _seen(number, centre, side=20.0, fps=FPS):
    u, v = centre
    box = (u - side / 2, v - side / 2, u + side / 2, v + side / 2)
    return Seen(number=number, t_s=number / fps, blob=Blob(box_px=box, area_px=side * side * 0.7))


def _path(points, side=20.0, fps=FPS):
    sides = np.broadcast_to(np.asarray(side, float), len(points))
    return [_seen(n, point, float(one), fps) for n, (point, one) in enumerate(zip(points, sides, strict=True))]


def _arc(count=60, step=4.0):
    return [(100 + step * n, 200 + 30 * np.sin(n / 15)) for n in range(count)]


def _noise(seed, count, spread):
    return np.random.default_rng(seed).normal(0, spread, (count, 2))


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        (_path(_arc()), True),
        (_path(_arc(), side=np.linspace(18, 30, 60)), True),
        (_path(_arc(8, 20.0), fps=5.0), True),
        (_path(_arc(4, 20.0), fps=5.0), False),
        (_path(_arc(10)), False),
        (_path([(100.0, 100.0)] * 60), False),
        (_path([(100 + 8 * np.sin(n), 100.0) for n in range(60)]), False),
        (_path(np.array(_arc()) + _noise(1, 60, 15.0)), False),
        (_path(_arc(), side=[20 if n % 2 else 55 for n in range(60)]), False),
    ],
    ids=["drives", "comes-nearer", "few-pictures", "too-few", "too-short", "stands", "swings", "jumps", "flickers"],
)
def test_what_moves_as_a_car_does(path, expected):
    """A car goes somewhere, smoothly, and keeps its size; what stands, swings, jumps or flickers is no car."""
    assert moves_like_a_car(path) is expected


def test_two_cars_that_pass_each_other_stay_two_paths():
    """Two blobs that drive towards each other on lanes 30 px apart give two unbroken paths."""
    linker = Linker()
    for n in range(60):
        linker.take(n / FPS, [_seen(n, (100 + 4 * n, 100.0)), _seen(n, (340 - 4 * n, 130.0))])
    paths = linker.paths()
    assert [len(path) for path in paths] == [60, 60]
    assert all(len({round(one.blob.centre_px[1]) for one in path}) == 1 for path in paths)


@pytest.mark.parametrize(("gap", "count"), [(6, 1), (25, 2)])
def test_a_short_gap_is_bridged_and_a_long_one_ends_the_path(gap, count):
    """Unseen for 0.2 s it is the same path; for 0.8 s another."""
    linker = Linker()
    for n in range(90):
        linker.take(n / FPS, [] if 30 <= n < 30 + gap else [_seen(n, (100 + 3 * n, 100.0))])
    assert len([path for path in linker.paths() if len(path) > 5]) == count


def test_something_of_another_size_does_not_go_on_with_a_path():
    """A blob ten times as large where the car is expected begins a path of its own."""
    linker = Linker()
    for n in range(20):
        linker.take(n / FPS, [_seen(n, (100 + 3 * n, 100.0), 20.0 if n < 10 else 80.0)])
    assert [len(path) for path in linker.paths()] == [10, 10]


def test_smoothing_keeps_a_curve_and_drops_an_outlier():
    """Points on a parabola with noise of 1 px and one point 40 px off: everywhere within 1 px of the truth, with its speed."""
    times = np.arange(60) / FPS
    truth = np.column_stack([100 + 120 * times, 200 - 60 * times**2])
    points = truth + _noise(3, 60, 1.0)
    points[30] += (0.0, -40.0)
    smooth = smoothed(times, points)
    assert smooth.supported.all()
    inner = slice(6, -6)
    assert np.abs(smooth.points - truth)[inner].max() < 1.6
    assert np.hypot(*(smooth.points[30] - truth[30])) < 1.6
    assert smooth.speeds[inner, 0] == pytest.approx(np.full(48, 120.0), abs=15.0)


def test_smoothing_says_where_it_cannot_tell():
    """Asked at times with fewer than four values near, it says that it is not supported."""
    times = np.array([0.0, 0.033, 0.066, 0.1, 0.133, 3.0])
    smooth = smoothed(times, np.zeros((6, 2)), np.array([0.05, 3.0, 9.0]))
    assert smooth.supported.tolist() == [True, False, False]
