"""The lens: camera px to ideal px and back, for both models, inside the picture and far out of it."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.view.lens import Lens, LensModel

WEBCAM = Lens(
    model=LensModel.PINHOLE, fx_px=1000.0, fy_px=1003.0, cx_px=645.0, cy_px=352.0,
    distortion=(-0.25, 0.1, 0.001, -0.0005, -0.02), width_px=1280, height_px=720,
)  # fmt: skip
FISHEYE = Lens(
    model=LensModel.FISHEYE, fx_px=520.0, fy_px=522.0, cx_px=640.0, cy_px=361.0,
    distortion=(0.05, -0.01, 0.002, -0.0005), width_px=1280, height_px=720,
)  # fmt: skip
WIDEST = replace(FISHEYE, fx_px=330.0, fy_px=330.0)
"""Its picture's corners look back over the shoulder: more than 200 degrees from corner to corner."""


def everywhere(lens, count=15):
    u, v = np.meshgrid(np.linspace(0, lens.width_px - 1, count), np.linspace(0, lens.height_px - 1, count))
    return np.column_stack((u.ravel(), v.ravel()))


@st.composite
def lenses(draw):
    """Lenses with coefficients that real ones have, of either model, where they do not fold."""
    number = lambda low, high: draw(st.floats(low, high))  # noqa: E731
    model = draw(st.sampled_from(LensModel))
    if model is LensModel.PINHOLE:
        bent = (number(-0.4, 0.3), number(-0.3, 0.3), number(-2e-3, 2e-3), number(-2e-3, 2e-3), number(-0.1, 0.1))
        focal = number(700.0, 3000.0)
    else:
        bent = (number(-0.1, 0.2), number(-0.05, 0.05), number(-0.02, 0.02), number(-0.005, 0.005))
        focal = number(280.0, 1200.0)
    try:
        return replace(
            WEBCAM, model=model, distortion=bent, fx_px=focal, fy_px=focal * number(0.98, 1.02),
            cx_px=number(560.0, 720.0), cy_px=number(310.0, 410.0),
        )  # fmt: skip
    except InputError:
        reject()


@given(lenses())
def test_camera_px_come_back_from_ideal_px(lens):
    """To ideal px and back is the same pixel, all over the picture, for any lens that was not refused."""
    points = everywhere(lens)
    assert np.abs(lens.to_camera_px(lens.to_ideal_px(points)) - points).max() < 0.05


@given(lenses(), st.floats(0, 2 * math.pi))
def test_the_rim_is_no_edge_and_nothing_folds_back(lens, way):
    """Outwards along any straight line from the centre, camera px go outwards too, without a jump, far beyond the picture."""
    radii = np.linspace(0.0, 60.0, 3000) * lens.fx_px
    ideal = np.outer(radii, (math.cos(way), math.sin(way))) + np.array([lens.cx_px, lens.cy_px])
    seen = np.linalg.norm(lens.to_camera_px(ideal) - (lens.cx_px, lens.cy_px), axis=1)
    steps = np.diff(seen)
    assert steps.min() > 0
    assert steps.max() < 8.0 * radii[1]


@given(lenses(), st.sampled_from([(640, 360), (1920, 1080), (2560, 1440), (320, 180)]))
def test_a_scaled_lens_sees_the_scaled_picture(lens, size):
    """`scaled_to` is the same as scaling pixels, in and out."""
    scaled, by = lens.scaled_to(*size), size[0] / lens.width_px
    points = everywhere(lens, 7)
    ideal = lens.to_ideal_px(points)
    assert np.allclose(scaled.to_ideal_px(points * by), ideal * by, atol=0.05, rtol=1e-6)
    assert np.allclose(scaled.to_camera_px(ideal * by), lens.to_camera_px(ideal) * by, atol=0.01)
    assert (scaled.width_px, scaled.height_px) == size


def test_the_pinhole_is_opencvs():
    """`projectPoints` and `undistortImagePoints` give the same pixels."""
    points = everywhere(WEBCAM)
    ideal = WEBCAM.to_ideal_px(points)
    ahead = np.column_stack(((ideal - (645.0, 352.0)) / (1000.0, 1003.0), np.ones(len(ideal))))
    seen, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), WEBCAM.matrix, np.array(WEBCAM.distortion))
    assert np.abs(seen.reshape(-1, 2) - points).max() < 1e-6
    assert np.abs(WEBCAM.to_camera_px(ideal) - points).max() < 1e-6


def test_the_fisheye_is_opencvs():
    """`cv2.fisheye`'s own functions give the same pixels, where they give any."""
    points = everywhere(FISHEYE)
    bent = np.array(FISHEYE.distortion)
    ideal = cv2.fisheye.undistortPoints(
        points.reshape(-1, 1, 2), FISHEYE.matrix, bent, R=np.eye(3), P=FISHEYE.matrix, criteria=(3, 100, 1e-12)
    ).reshape(-1, 2)
    assert np.allclose(FISHEYE.to_ideal_px(points), ideal, rtol=1e-9, atol=1e-6)
    rays = (ideal - (640.0, 361.0)) / (520.0, 522.0)
    seen = cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), FISHEYE.matrix, bent).reshape(-1, 2)
    assert np.abs(FISHEYE.to_camera_px(ideal) - seen).max() < 1e-6


def test_a_fisheye_that_sees_behind_itself():
    """A lens of more than 180 degrees is taken, and every pixel of its picture comes back."""
    points = everywhere(WIDEST)
    ideal = WIDEST.to_ideal_px(points)
    assert np.isfinite(ideal).all()
    assert np.abs(WIDEST.to_camera_px(ideal) - points).max() < 1e-6


def test_a_straight_edge_is_straight_in_ideal_px():
    """Points of a line in space lie on a line in ideal px, and do not in camera px."""
    line = np.column_stack((np.linspace(-0.5, 0.5, 21), np.full(21, 0.3), np.ones(21)))
    for lens, project in ((WEBCAM, cv2.projectPoints), (FISHEYE, cv2.fisheye.projectPoints)):
        ahead = line.reshape(-1, 1, 3)
        seen = project(ahead, np.zeros(3), np.zeros(3), lens.matrix, np.array(lens.distortion))[0].reshape(-1, 2)
        assert np.ptp(seen[:, 1]) > 3.0
        assert np.ptp(lens.to_ideal_px(seen)[:, 1]) < 1e-4


@pytest.mark.parametrize("lens", [WEBCAM, FISHEYE, WIDEST], ids=["pinhole", "fisheye", "widest"])
def test_stored_and_loaded(lens):
    """The stored form gives an equal lens; no point is no point."""
    assert Lens.from_dict(lens.to_dict()) == lens
    assert lens.to_ideal_px(np.empty((0, 2))).shape == lens.to_camera_px(np.empty((0, 2))).shape == (0, 2)
    centre = np.array([[lens.cx_px, lens.cy_px]])
    assert np.allclose(lens.to_ideal_px(centre), centre)
    assert np.allclose(lens.to_camera_px(centre), centre)


@pytest.mark.parametrize(
    ("lens", "changes", "message"),
    [
        (WEBCAM, {"fx_px": 0.0}, "focal lengths must be positive"),
        (WEBCAM, {"cx_px": math.nan}, "all numbers finite"),
        (WEBCAM, {"width_px": 0}, "is not a picture's"),
        (WEBCAM, {"distortion": (0.1,)}, "1 distortion coefficients, a pinhole lens has 4 or 5 or 8"),
        (FISHEYE, {"distortion": (0.1,) * 5}, "a fisheye lens has 4"),
        (WEBCAM, {"distortion": (-1.5, 0.0, 0.0, 0.0)}, "folds the picture over"),
        (FISHEYE, {"distortion": (-0.4, 0.0, 0.0, 0.0)}, "folds the picture over"),
    ],
)
def test_lenses_that_no_camera_has(lens, changes, message):
    """Numbers that mean nothing and distortions that fold the picture are refused in words."""
    with pytest.raises(InputError, match=message):
        replace(lens, **changes)


def test_a_stored_form_that_lacks_something():
    """A missing member is a plain error, not a traceback."""
    stored = WEBCAM.to_dict()
    del stored["fx_px"]
    with pytest.raises(InputError, match="calibrate the lens again"):
        Lens.from_dict(stored)
    with pytest.raises(InputError, match="calibrate the lens again"):
        Lens.from_dict(WEBCAM.to_dict() | {"model": "mirror"})
