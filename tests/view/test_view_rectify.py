"""The floor seen from straight above."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.sim.camera import mast_camera
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.rectify import finest_metres_per_px, rectified, rectified_size_px, seen_mask, visible_extent_m

SCALE = TwinScale(metres_per_px=0.002, height_px=1000.0)
SIZE = (1280, 720)


def ground_of(camera, lens=None):
    """The exact map of a simulated camera, to a twin of 2 mm a px."""
    to_twin = np.array([[1 / 0.002, 0, 0], [0, -1 / 0.002, 1000.0], [0, 0, 1]])
    h = to_twin @ np.linalg.inv(camera.floor_homography())
    h *= np.sign((h @ [camera.width_px / 2, camera.height_px - 1, 1])[2])
    return GroundMap(
        camera_to_twin=tuple(h.ravel().tolist()),
        scale=SCALE,
        width_px=camera.width_px,
        height_px=camera.height_px,
        lens=lens,
    )


def oblique(**given):
    """A camera on a mast, looking down at 55 degrees."""
    return mast_camera(**{"position_m": (1.5, -0.4, 2.2), "pitch_deg": 55.0, "yaw_deg": 3.0, "size_px": SIZE} | given)


def brown():
    """A lens of the oblique camera's focal length that bends as a cheap webcam's."""
    camera = oblique()
    return Lens(
        model=LensModel.PINHOLE, fx_px=camera.matrix[0, 0], fy_px=camera.matrix[1, 1], cx_px=639.5, cy_px=359.5,
        distortion=(-0.25, 0.07, 0.001, -0.0005, 0.0), width_px=SIZE[0], height_px=SIZE[1],
    )  # fmt: skip


def spotted(ground, places_m, radius_m=0.02):
    """A picture of black discs on a light floor at `places_m` (n, 2), as `ground`'s camera shows them."""
    picture = np.full((ground.height_px, ground.width_px, 3), 230, dtype=np.uint8)
    turns = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    for place in places_m:
        rim = place + radius_m * np.column_stack((np.cos(turns), np.sin(turns)))
        at = np.rint(ground.to_camera_px(rim) * 16).astype(np.int32)
        cv2.fillPoly(picture, [at], (0, 0, 0), cv2.LINE_AA, shift=4)
    return picture


@pytest.mark.parametrize("lens", [None, brown()], ids=["no lens", "a bent lens"])
@pytest.mark.parametrize("metres_per_px", [0.001, 0.002, 0.006])
def test_things_lie_where_they_are_on_the_floor(lens, metres_per_px):
    """Discs on the floor come out within a tenth of a px, or half a millimetre, of their places, whatever the lens."""
    ground = ground_of(oblique(), lens)
    places = np.array([[1.0, 0.8], [1.5, 1.2], [2.0, 0.7], [1.3, 1.6], [0.7, 1.3]])
    extent = (0.2, 0.3, 2.6, 2.1)
    picture = rectified(spotted(ground, places), ground, metres_per_px=metres_per_px, extent_m=extent)
    dark = 230.0 - picture[..., 0].astype(float)
    rows, columns = np.indices(dark.shape)
    for place in places:
        u, v = (place[0] - 0.2) / metres_per_px, dark.shape[0] - (place[1] - 0.3) / metres_per_px
        near = np.hypot(columns - u, rows - v) < 0.03 / metres_per_px
        weights = np.where(dark > 50, dark, 0) * near
        found = np.array([(weights * columns).sum(), (weights * rows).sum()]) / weights.sum()
        assert np.abs(found - (u, v)).max() * metres_per_px < max(0.0005, 0.1 * metres_per_px)


def test_the_rectified_twin_of_a_straight_view_is_the_picture_itself():
    """Where the camera's picture is the twin itself, nothing changes: the px convention is the twin's."""
    picture = np.random.default_rng(1).integers(0, 255, (60, 80, 3)).astype(np.uint8)
    ground = GroundMap(
        camera_to_twin=(1, 0, 0, 0, 1, 0, 0, 0, 1),
        scale=TwinScale(metres_per_px=0.01, height_px=60),
        width_px=80,
        height_px=60,
    )
    assert np.array_equal(rectified(picture, ground, metres_per_px=0.01, extent_m=(0, 0, 0.8, 0.6)), picture)


def test_what_shrinks_is_averaged():
    """A fine chequerboard, seen in px of several of the camera's, turns grey and makes no moiré."""
    u, v = np.meshgrid(np.arange(800), np.arange(600))
    picture = np.repeat((((u + v) % 2) * 255).astype(np.uint8)[..., None], 3, axis=2)
    ground = GroundMap(
        camera_to_twin=(1, 0, 0, 0, 1, 0, 0, 0, 1),
        scale=TwinScale(metres_per_px=0.001, height_px=600),
        width_px=800,
        height_px=600,
    )
    small = rectified(picture, ground, metres_per_px=0.004, extent_m=(0.02, 0.02, 0.78, 0.58))
    assert np.ptp(small.astype(int)) < 30


def test_unseen_floor_is_grey_and_the_mask_tells_it():
    """What the picture does not show has the given grey, beyond the horizon and behind the camera as well."""
    ground = ground_of(oblique(pitch_deg=20.0))
    picture = np.zeros((720, 1280, 3), dtype=np.uint8)
    extent = (-6.0, -3.0, 9.0, 12.0)
    seen = seen_mask(ground, metres_per_px=0.02, extent_m=extent)
    whole = rectified(picture, ground, metres_per_px=0.02, extent_m=extent, unseen=77)
    assert 0.05 < seen.mean() < 0.6
    assert (whole[~seen] == 77).all()
    assert (whole[seen] == 0).all()
    rows, columns = np.nonzero(~seen)
    places = np.column_stack((extent[0] + columns * 0.02, extent[1] + (seen.shape[0] - rows) * 0.02))
    behind = places[places[:, 1] < -1.0]
    assert len(behind) > 1000


@pytest.mark.parametrize("lens", [None, brown()], ids=["no lens", "a bent lens"])
def test_the_visible_floor_holds_what_the_camera_sees(lens):
    """Looking down, all of the picture lies in the rectangle, and each side touches it."""
    ground = ground_of(oblique(), lens)
    x0, y0, x1, y1 = visible_extent_m(ground)
    corners = ground.to_track_m(np.array([[-0.5, -0.5], [1279.5, -0.5], [-0.5, 719.5], [1279.5, 719.5]]))
    assert x0 == pytest.approx(corners[:, 0].min(), abs=0.02)
    assert y1 == pytest.approx(corners[:, 1].max(), abs=0.05)
    assert y0 <= corners[:, 1].min() + 1e-6
    assert x1 == pytest.approx(corners[:, 0].max(), abs=0.02)


def test_the_visible_floor_ends_before_the_horizon():
    """A camera that sees the horizon still has a rectangle of a few metres, and a margin makes it no larger."""
    ground = ground_of(oblique(pitch_deg=15.0))
    x0, y0, x1, y1 = visible_extent_m(ground)
    assert y1 - y0 < 20
    assert x1 - x0 < 30
    inner = visible_extent_m(ground, margin_px=60)
    assert inner[0] >= x0
    assert inner[3] <= 1.1 * y1


def test_the_finest_scale_is_that_of_the_near_floor():
    """The best scale of a picture taken from straight above is that of all of it."""
    camera = mast_camera(position_m=(1.5, 1.0, 2.0), pitch_deg=89.999, size_px=SIZE)
    assert finest_metres_per_px(ground_of(camera)) == pytest.approx(2.0 / camera.matrix[0, 0], rel=0.01)


def test_bad_wishes_are_refused():
    """A picture of another size, an empty rectangle and a scale without reason are each one line."""
    ground = ground_of(oblique())
    picture = np.zeros((720, 1280, 3), dtype=np.uint8)
    with pytest.raises(InputError, match="the picture is 640x480 px, the calibration for 1280x720"):
        rectified(np.zeros((480, 640, 3), dtype=np.uint8), ground, metres_per_px=0.01, extent_m=(0, 0, 1, 1))
    for extent in ((0, 0, 0, 1), (0, 0, 1, float("nan")), (2, 0, 1, 1)):
        with pytest.raises(InputError, match="is empty"):
            rectified(picture, ground, metres_per_px=0.01, extent_m=extent)
    with pytest.raises(InputError, match="positive number of metres per px"):
        rectified_size_px(metres_per_px=0, extent_m=(0, 0, 1, 1))
    with pytest.raises(InputError, match="too many"):
        rectified_size_px(metres_per_px=1e-6, extent_m=(0, 0, 1, 1))
    upwards = replace(ground, camera_to_twin=(1, 0, 0, 0, 1, 0, 0, 0, -1))
    with pytest.raises(InputError, match="no floor"):
        visible_extent_m(upwards)
