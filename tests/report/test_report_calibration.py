"""The plot of error against number of keypoints."""

import cv2
import numpy as np
import pytest

from dnb_edge.report.calibration import error_by_count_picture
from dnb_edge.view.homography import CountError


def rows(*means, first=4, count=9):
    return [CountError(points=first + k, mean_px=mean, sum_px=mean * count) for k, mean in enumerate(means)]


STEEP = rows(1244.7, 35.0, 32.6, 39.9, 36.7, 26.7)


@pytest.mark.parametrize("errors", [STEEP, rows(35.0, 32.6, 39.9), rows(0.0), rows(0.0, 0.0), rows(5.0)])
def test_both_curves_are_drawn(errors):
    """Steep, flat, single and vanishing errors each give a picture with blue and red in it."""
    picture = cv2.imdecode(np.frombuffer(error_by_count_picture(errors), np.uint8), cv2.IMREAD_COLOR).astype(int)
    assert picture.shape[1] > 800
    blue, green, red = picture[..., 0], picture[..., 1], picture[..., 2]
    assert np.count_nonzero((blue > 120) & (red < 80) & (green < 120)) > 200
    assert np.count_nonzero((red > 120) & (blue < 80) & (green < 90)) > 200


def test_the_same_errors_give_the_same_file():
    """Neither date nor chance gets into a picture, and the SVG says its numbers as text paths of both curves."""
    for form in ("png", "svg"):
        assert error_by_count_picture(STEEP, picture_format=form) == error_by_count_picture(STEEP, picture_format=form)
    assert error_by_count_picture(STEEP, picture_format="svg").startswith(b"<?xml")
