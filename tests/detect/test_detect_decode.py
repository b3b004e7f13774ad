"""The network's maps become peaks: place, length, sigma, heading, order."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.detect.decode import peaks
from dnb_edge.detect.onnx import CentreMaps
from dnb_edge.train.batches import GRID, WINDOW_PX, targets_for


def _blank(rows: int = 10, columns: int = 12) -> CentreMaps:
    shape = (rows, columns)
    return CentreMaps(
        heat=np.full(shape, -8.0, np.float32),
        offset=np.zeros((2, *shape), np.float32),
        size=np.zeros(shape, np.float32),
        heading=np.zeros((2, *shape), np.float32),
        spread=np.zeros(shape, np.float32),
    )


def _with_peak(maps: CentreMaps, row: int, column: int, logit: float) -> CentreMaps:
    maps.heat[row, column] = logit
    return maps


@pytest.mark.parametrize(
    ("row", "column", "offset", "expected_px"),
    [
        (0, 0, (0.0, 0.0), (1.5, 1.5)),
        (3, 5, (0.0, 0.0), (21.5, 13.5)),
        (3, 5, (0.5, -0.25), (23.5, 12.5)),
        (9, 11, (-0.5, 0.5), (43.5, 39.5)),
    ],
)
def test_a_cell_and_its_offset_give_the_pixel(row, column, offset, expected_px):
    """A cell covers four px: its centre is at 4 * index + 1.5, and an offset of one cell is four px."""
    maps = _with_peak(_blank(), row, column, 2.0)
    maps.offset[:, row, column] = offset
    (peak,) = peaks(maps, least_confidence=0.3, most=5)
    assert (peak.u_px, peak.v_px) == pytest.approx(expected_px, abs=1e-2)


@pytest.mark.parametrize(
    ("size", "spread", "length_px", "sigma_px"), [(0.0, 0.0, 32.0, 4.0), (math.log(2), math.log(0.5), 64.0, 2.0)]
)
def test_size_and_spread_are_logarithms(size, spread, length_px, sigma_px):
    """Size 0 is 32 px and spread 0 is one cell of 4 px; both grow by their exponential."""
    maps = _with_peak(_blank(), 4, 4, 1.0)
    maps.size[4, 4], maps.spread[4, 4] = size, spread
    (peak,) = peaks(maps, least_confidence=0.3, most=5)
    assert (peak.length_px, peak.sigma_px) == pytest.approx((length_px, sigma_px), rel=1e-5)


@pytest.mark.parametrize(
    ("heading", "expected"), [((0.0, 0.9), math.pi / 2), ((-1.0, 0.0), math.pi), ((0.2, 0.1), None)]
)
def test_a_weak_heading_is_none(heading, expected):
    """The heading is told only where its vector is longer than a half."""
    maps = _with_peak(_blank(), 4, 4, 1.0)
    maps.heading[:, 4, 4] = heading
    (peak,) = peaks(maps, least_confidence=0.3, most=5)
    assert peak.heading_rad == (None if expected is None else pytest.approx(expected))


def test_peaks_come_strongest_first_and_at_most_as_many_as_asked():
    """Order is by confidence, the weakest fall away, and those under the threshold never appear."""
    maps = _blank(20, 20)
    for (row, column), logit in {(2, 2): 0.5, (10, 10): 3.0, (17, 3): 1.5, (5, 16): -3.0}.items():
        maps.heat[row, column] = logit
    found = peaks(maps, least_confidence=0.3, most=2)
    assert [round(peak.confidence, 3) for peak in found] == [0.953, 0.818]


def test_two_cells_that_vote_for_one_point_are_one_peak():
    """Of two maxima with the same ground point only the stronger stays."""
    maps = _blank()
    maps.heat[4, 4], maps.heat[4, 6] = 2.0, 1.0
    maps.offset[0, 4, 4], maps.offset[0, 4, 6] = 1.0, -1.0
    assert len(peaks(maps, least_confidence=0.3, most=5)) == 1


@given(
    u=st.floats(8, WINDOW_PX - 9),
    v=st.floats(8, WINDOW_PX - 9),
    length=st.floats(14, 70),
    heading=st.floats(-3.1, 3.1),
)
def test_decoding_the_targets_gives_the_label_back(u, v, length, heading):
    """What training asks of the network decodes to the label it was made from: ground point, length and heading."""
    label = np.array([[u, v, length, math.cos(heading), math.sin(heading), 1.0]], dtype=np.float32)
    targets = targets_for(label)
    heat = np.log(np.clip(targets[0], 1e-4, 0.95) / (1 - np.clip(targets[0], 1e-4, 0.95)))
    maps = CentreMaps(
        heat=heat, offset=targets[2:4], size=targets[4], heading=targets[5:7], spread=np.zeros((GRID, GRID), np.float32)
    )
    (peak,) = peaks(maps, least_confidence=0.3, most=5)
    assert (peak.u_px, peak.v_px) == pytest.approx((u, v), abs=0.02)
    assert peak.length_px == pytest.approx(length, rel=1e-4)
    assert peak.heading_rad == pytest.approx(heading, abs=1e-4)
