"""DTW and discrete Frechet distance against independent implementations and their own laws."""

from __future__ import annotations

import math

import dtw
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dnb_edge.cli.bench import dtw_loop_over_arrays, dtw_loop_over_lists
from dnb_edge.score.distance import dtw_distance, frechet_distance

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
    for distance in (dtw_distance, frechet_distance):
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
