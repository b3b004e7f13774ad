"""Thumbnails of incidents."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dnb_edge.report.evidence import WIDTH_PX, thumbnails
from dnb_edge.values import Frame, Incident, IncidentKind, PointPx, StampSource


def incident(worst_s: float, camera_px: PointPx | None, number: int = 1) -> Incident:
    return Incident(
        number=number,
        kind=IncidentKind.OFF_TRACK,
        car=1,
        target_id=1,
        lap=1,
        start_t_ns=0,
        end_t_ns=1,
        start_s=0.0,
        lasted_s=0.5,
        greatest_m=0.1,
        worst_t_ns=round(worst_s * 1e9),
        track_m=(0.0, 0.0),
        camera_px=camera_px,
        s_m=0.0,
        text="the car left the lane",
    )


def frame(t_s: float, car_px: tuple[int, int], *, broken: bool = False) -> Frame:
    """A grey picture with a bright blue car."""
    image = np.full((360, 640, 3), 90, dtype=np.uint8)
    cv2.circle(image, car_px, 9, (255, 60, 0), -1)
    jpeg = b"no picture" if broken else cv2.imencode(".jpg", image)[1].tobytes()
    return Frame(
        sequence=0,
        t_ns=round(t_s * 1e9),
        stamp_source=StampSource.SIMULATED,
        width_px=640,
        height_px=360,
        jpeg=jpeg,
    )


def blue_px(jpeg: bytes) -> tuple[float, float]:
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape[1] == WIDTH_PX
    v, u = np.nonzero((image[..., 0] > 200) & (image[..., 2] < 90))
    return float(u.mean()), float(v.mean())


@pytest.mark.parametrize("car_px", [(300, 180), (8, 8), (632, 350)])
def test_the_nearest_picture_is_cut_out_round_the_car(car_px: tuple[int, int]) -> None:
    """The picture nearest to the worst moment is shown, with the car in it, at the picture's edges too."""
    frames = [frame(0.8, (100, 300)), frame(1.05, car_px), frame(1.3, (500, 40))]
    found = thumbnails([incident(1.0, (float(car_px[0]), float(car_px[1])))], frames)
    u, v = blue_px(found[1, 1])
    assert 0 <= u < WIDTH_PX
    if car_px == (300, 180):
        assert u == pytest.approx(WIDTH_PX / 2, abs=4)
        assert v == pytest.approx(WIDTH_PX * 0.375, abs=4)


def test_no_picture_near_means_no_thumbnail() -> None:
    """A recording without pictures, one far from the moment, a damaged one, or a car that was not seen has none."""
    seen = incident(1.0, (300.0, 180.0))
    assert not thumbnails([seen], [])
    assert not thumbnails([seen], [frame(3.0, (300, 180))])
    assert not thumbnails([seen], [frame(1.0, (300, 180), broken=True)])
    assert not thumbnails([incident(1.0, None)], [frame(1.0, (300, 180))])
