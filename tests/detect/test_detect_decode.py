"""The network's maps become peaks: place, length, sigma, heading, order."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.detect.decode import peaks
from dnb_edge.detect.onnx import CentreMaps


def _blank(rows: int = 10, columns: int = 12, channels: int = 9) -> CentreMaps:
    values = np.zeros((channels, rows, columns), np.float32)
    values[0] = -8.0
    return CentreMaps(values=values)


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
    ("heading", "expected"),
    [
        ((0.0, 0.9), math.pi / 2),
        ((-1.0, 0.0), math.pi),
        ((0.2, 0.1), None),
        ((-1.0, 0.0, 0.0, 0.6), math.pi / 2),
        ((-0.7, 0.0, 0.0, -0.6), -math.pi / 2),
        ((0.9, 0.0, -0.1, 0.5), math.pi),
        ((0.0, -1.0, 0.7, -0.7), -math.pi / 4),
        ((0.0, -1.0, -0.7, 0.7), 3 * math.pi / 4),
        ((0.3, 0.3, 1.0, 0.0), None),
    ],
)
def test_a_weak_heading_is_none(heading, expected):
    """The heading is told only where its (double-angle) vector is longer than a half; the single angle gives the sense."""
    maps = _with_peak(_blank(channels=5 + len(heading)), 4, 4, 1.0)
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
    u=st.floats(8, 119),
    v=st.floats(8, 119),
    length=st.floats(14, 70),
    heading=st.floats(-3.1, 3.1),
    doubled=st.booleans(),
)
def test_decoding_the_ideal_maps_gives_the_label_back(u, v, length, heading, doubled):
    """Maps that say where a car is, each cell in its own words, decode to that car: ground point, length and heading."""
    rows, columns = np.mgrid[0:32, 0:32].astype(np.float32)
    values = np.zeros((9 if doubled else 7, 32, 32), np.float32)
    values[1], values[2] = (u + 0.5) / 4 - 0.5 - columns, (v + 0.5) / 4 - 0.5 - rows
    values[0] = 3.0 - 2.0 * (values[1] ** 2 + values[2] ** 2)
    values[3] = math.log(length / 32.0)
    single = [math.cos(heading), math.sin(heading)]
    words = [math.cos(2 * heading), math.sin(2 * heading), *single] if doubled else single
    values[4:-1] = np.array(words, np.float32)[:, None, None]
    (peak,) = peaks(CentreMaps(values=values), least_confidence=0.3, most=5)
    assert (peak.u_px, peak.v_px) == pytest.approx((u, v), abs=0.02)
    assert peak.length_px == pytest.approx(length, rel=1e-4)
    assert peak.heading_rad is not None
    assert math.remainder(peak.heading_rad - heading, math.tau) == pytest.approx(0.0, abs=1e-4)
