"""DTW and discrete Frechet distance against independent implementations and their own laws."""

from __future__ import annotations

import math
from functools import partial

import dtw
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dnb_edge.cli.bench import dtw_loop_over_arrays, dtw_loop_over_lists
from dnb_edge.score.distance import Headings, Programme, distances, dtw_distance, frechet_distance
from dnb_edge.score.prefix import PrefixTable

POINTS = hnp.arrays(
    np.float64,
    st.tuples(st.integers(1, 12), st.just(2)),
    elements=st.floats(-10, 10, allow_nan=False).map(lambda x: round(x, 3)),
)


@given(POINTS, POINTS)
def test_dtw_equals_dtw_python(path: np.ndarray, reference: np.ndarray) -> None:
    """Our sum is that of dtw-python's symmetric1 on any two short paths."""
    oracle = dtw.dtw(path, reference, step_pattern="symmetric1", distance_only=True).distance
    assert dtw_distance(path, reference) == pytest.approx(oracle, abs=1e-9)


@given(POINTS, POINTS)
def test_the_symmetric_form_equals_dtw_python(path: np.ndarray, reference: np.ndarray) -> None:
    """Our sum is that of dtw-python's symmetric2 on any two short paths, and divided by n + m its normalised distance."""
    oracle = dtw.dtw(path, reference, step_pattern="symmetric2", distance_only=True)
    total = dtw_distance(path, reference, symmetric=True)
    assert total == pytest.approx(oracle.distance, abs=1e-9)
    assert total / (len(path) + len(reference)) == pytest.approx(oracle.normalizedDistance, abs=1e-9)


@given(POINTS, POINTS)
def test_frechet_equals_the_plain_table(path: np.ndarray, reference: np.ndarray) -> None:
    """Our leash is that of Eiter and Mannila's table (1994), filled cell by cell, on any two short paths."""
    assert frechet_distance(path, reference) == pytest.approx(plain_frechet(path, reference), abs=1e-9)


def plain_frechet(path: np.ndarray, reference: np.ndarray) -> float:
    table = np.full((len(path) + 1, len(reference) + 1), np.inf)
    table[0, 0] = 0.0
    for i, j in np.ndindex(len(path), len(reference)):
        way = min(table[i, j], table[i, j + 1], table[i + 1, j])
        table[i + 1, j + 1] = max(math.dist(path[i], reference[j]), way)
    return float(table[-1, -1])


@given(POINTS.filter(lambda p: len(p) > 1), POINTS.filter(lambda p: len(p) > 1))
def test_frechet_is_never_above_geos(path: np.ndarray, reference: np.ndarray) -> None:
    """GEOS (shapely) finds a coupling too, though for about one pair in a hundred not the best one."""
    oracle = shapely.frechet_distance(shapely.LineString(path), shapely.LineString(reference))
    assert frechet_distance(path, reference) <= oracle + 1e-9


def test_frechet_equals_geos_on_random_walks() -> None:
    """On five in six of 300 pairs of random walks GEOS (shapely) finds our leash, on the others a longer one."""
    random = np.random.default_rng(7)
    same = 0
    for _ in range(300):
        path, reference = (np.cumsum(random.normal(size=(random.integers(2, 60), 2)), axis=0) for _ in range(2))
        oracle = shapely.frechet_distance(shapely.LineString(path), shapely.LineString(reference))
        leash = frechet_distance(path, reference)
        assert leash <= oracle + 1e-9
        same += leash == pytest.approx(oracle, abs=1e-9)
    assert same >= 250


@given(POINTS, POINTS, st.none() | st.floats(0.1, 5.0), st.booleans(), st.integers(1, 5))
def test_several_programmes_at_once_and_a_growing_path_give_the_same_distances(
    path: np.ndarray, reference: np.ndarray, clamp: float | None, directed: bool, batch: int
) -> None:
    """Asked for together each is what it is alone, to the last bit; fed in batches it is the same to rounding, to every
    beginning of the reference."""
    headings = None
    if directed:
        path_units, reference_units = (np.column_stack([np.cos(p[:, 0]), np.sin(p[:, 0])]) for p in (path, reference))
        headings = Headings(path=path_units, reference=reference_units, cost_m=0.7)
    together = distances(path, reference, clamp, tuple(Programme), headings=headings)
    for programme, distance in zip(Programme, together, strict=True):
        assert (distance,) == distances(path, reference, clamp, (programme,), headings=headings)
        table = PrefixTable(reference, programme, clamp)
        for i in range(0, len(path), batch):
            turned = None if headings is None else 0.7 * (1 - path_units[i : i + batch] @ reference_units.T) / 2
            table.extend(path[i : i + batch], turned)
        assert table.points == len(path)
        ends = table.to(0, len(reference) - 1)
        assert ends[-1] == pytest.approx(distance, abs=1e-9)
        if headings is None:
            for end, part in enumerate(ends):
                assert (part,) == pytest.approx(distances(path, reference[: end + 1], clamp, (programme,)), abs=1e-9)


@pytest.mark.parametrize(("angle", "share"), [(0.0, 0.0), (math.pi / 3, 0.25), (math.pi / 2, 0.5), (math.pi, 1.0)])
def test_direction_costs_by_its_angle(angle: float, share: float) -> None:
    """Along costs nothing, exactly; across half of the price, against all of it; the clamp leaves it alone."""
    path, along = np.zeros((1, 2)), np.array([[1.0, 0.0]])
    turned = along if angle == 0 else np.array([[math.cos(angle), math.sin(angle)]])
    headings = Headings(path=turned, reference=along, cost_m=0.5)
    far = np.array([[3.0, 4.0]])
    assert dtw_distance(path, path, headings=headings) == pytest.approx(0.5 * share, abs=1e-15)
    assert frechet_distance(path, far, headings=headings) == pytest.approx(5.0 + 0.5 * share)
    assert dtw_distance(path, far, 0.2, headings=headings) == pytest.approx(0.2 + 0.5 * share)


@given(POINTS, POINTS, st.none() | st.floats(0.1, 5.0))
def test_the_vectorised_form_equals_the_plain_double_loops(
    path: np.ndarray, reference: np.ndarray, clamp: float | None
) -> None:
    """Anti-diagonals change the order of work, not the result, with and without clamp."""
    bound = math.inf if clamp is None else clamp
    fast = dtw_distance(path, reference, clamp)
    assert fast == pytest.approx(dtw_loop_over_lists(path, reference, bound), abs=1e-9)
    assert fast == pytest.approx(dtw_loop_over_arrays(path, reference, bound), abs=1e-9)


@given(POINTS, POINTS, st.floats(0.1, 5.0))
def test_a_path_has_distance_zero_to_itself_and_both_distances_are_symmetric(
    path: np.ndarray, reference: np.ndarray, clamp: float
) -> None:
    """Both measures are zero on equal paths and do not care which path is called the reference."""
    for distance in (dtw_distance, frechet_distance, partial(dtw_distance, symmetric=True)):
        assert distance(path, path, clamp) == 0.0
        assert distance(path, reference, clamp) == pytest.approx(distance(reference, path, clamp), abs=1e-9)
    assert frechet_distance(path, reference, clamp) <= clamp


def test_two_long_paths_agree_with_the_plain_loop_to_a_billionth() -> None:
    """On 2,000 x 2,000 points the difference to the plain double loop stays below 1e-9."""
    random = np.random.default_rng(3)
    path, reference = np.cumsum(random.normal(size=(2, 2000, 2)), axis=1)
    assert abs(dtw_distance(path, reference, 5.0) - dtw_loop_over_lists(path, reference, 5.0)) < 1e-9


def test_an_empty_path_is_refused() -> None:
    """A path without points has no distance."""
    with pytest.raises(ValueError, match="0 points"):
        dtw_distance(np.empty((0, 2)), np.zeros((3, 2)))
    with pytest.raises(ValueError, match="0 points"):
        PrefixTable(np.zeros((3, 2)), Programme.DTW).to(0, 2)
