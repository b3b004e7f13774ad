"""Places worth a close look: blobs of what moved, and the order in which finds and blobs get one."""

import numpy as np
import pytest

from dnb_edge.detect.acquire import Candidate, apart, close_looks, moved_blobs
from dnb_edge.detect.background import Disc
from dnb_edge.values import Detection


def _cells(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """90 rows and 160 columns of cells, in which the boxes (column, row, columns, rows) have moved."""
    cells = np.zeros((90, 160), np.uint8)
    for column, row, columns, rows in boxes:
        cells[row : row + rows, column : column + columns] = 90
    return cells


def _found(u: float, v: float = 0.0) -> Detection:
    return Detection(camera_px=(u, v), sigma_px=1.0, length_px=20.0, confidence=0.5)


def test_a_moved_blob_is_told_in_frame_px():
    """With a background at half size a cell is 8 frame px: the blob's middle and longest side follow."""
    (blob,) = moved_blobs(_cells((40, 20, 6, 4)), scale=0.5)
    assert blob.camera_px == pytest.approx((42.5 * 8 + 3.5, 21.5 * 8 + 3.5))
    assert blob.length_px == pytest.approx(48.0)


@pytest.mark.parametrize("box", [(10, 10, 1, 1), (10, 10, 40, 6), (10, 10, 3, 60)])
def test_only_blobs_of_a_cars_size_count(box):
    """A single cell is noise, and what is longer than a fifth of the picture's width is a person or a shadow."""
    assert moved_blobs(_cells(box), scale=0.5) == []


def test_the_most_moved_comes_first_and_ties_go_by_place():
    """Blobs come by area, those of one area from left to right."""
    blobs = moved_blobs(_cells((100, 10, 4, 4), (10, 50, 4, 4), (50, 50, 6, 6)), scale=1.0)
    assert [round(blob.camera_px[0] / 4) for blob in blobs] == [53, 12, 102]


def test_what_lies_in_a_frozen_disc_is_left_out():
    """The followed car moves too; it gets no close look beside its window."""
    cells = _cells((40, 20, 6, 4), (100, 60, 6, 4))
    frozen = [Disc(centre_px=(42.5 * 8, 21.5 * 8), radius_px=40.0)]
    (blob,) = moved_blobs(cells, scale=0.5, frozen=frozen)
    assert blob.camera_px[0] > 700


def test_two_finds_then_two_blobs_then_the_rest():
    """Clutter that is found again and again leaves room for what moves; a blob at a find is the find."""
    finds = [_found(100.0), _found(200.0), _found(300.0)]
    blobs = [Candidate(camera_px=(at, 0.0), length_px=20.0) for at in (105.0, 400.0, 500.0, 600.0)]
    assert [place.camera_px[0] for place in close_looks(finds, blobs, 4)] == [100.0, 200.0, 400.0, 500.0]
    assert [place.camera_px[0] for place in close_looks(finds, [], 4)] == [100.0, 200.0, 300.0]
    assert [place.camera_px[0] for place in close_looks([], blobs, 2)] == [105.0, 400.0]
    assert not apart((115.0, 0.0), finds[0])
