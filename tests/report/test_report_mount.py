"""The drawing of a mount plan: to scale, whole, the same bytes again."""

import re

import cv2
import numpy as np
import pytest

from dnb_edge.mount.geometry import Optics, TrackArea
from dnb_edge.mount.plan import MountRequest, PlannedCar, Rate, plan_mount
from dnb_edge.mount.suggest import Free, MountLimits
from dnb_edge.report.mount import mount_picture


def plan(*, hfov=66.0, track=(3.0, 2.2), **free):
    return plan_mount(
        MountRequest(
            optics=Optics(hfov_deg=hfov, width_px=1280, height_px=720),
            rate=Rate(fps=30.0, exposure_s=0.002),
            track=TrackArea(width_m=track[0], depth_m=track[1]),
            car=PlannedCar(speed_mps=2.0, length_m=0.25, height_m=0.1),
            free=Free(**free),
            limits=MountLimits(),
        )
    )


PLANS = {
    "suggested": plan(),
    "cut off": plan(height_m=1.6, pitch_deg=35.0, distance_m=-0.4),
    "straight down": plan(hfov=100.0, track=(2.0, 1.5)),
    "horizon": plan(hfov=90.0, track=(1.0, 4.0), height_m=1.0, pitch_deg=20.0),
    "askew": plan(hfov=85.0, height_m=2.2, pitch_deg=44.0, distance_m=0.8, aside_m=-1.7, turn_deg=31.0),
    "tiny part": plan(height_m=2.0, pitch_deg=60.0, distance_m=-1.7),
}


def decoded(png):
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).astype(int)


@pytest.mark.parametrize("found", PLANS.values(), ids=PLANS)
def test_every_kind_of_plan_is_drawn_within_its_sheet(found):
    """Whatever the place: a picture with the view's blue in it, and nothing written over its rim."""
    picture = decoded(mount_picture(found))
    blue, green, red = picture[..., 0], picture[..., 1], picture[..., 2]
    assert np.count_nonzero((blue > 235) & (green > 225) & (red > 210) & (red < 225)) > 1000
    for rim in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
        assert rim.min() == 255


def test_what_is_outside_the_picture_is_hatched_and_said():
    """Red hatching only where a part of the track is cut off."""
    hatched = {name: red_pixels(decoded(mount_picture(PLANS[name]))) for name in ("suggested", "cut off")}
    assert hatched["cut off"] > 1000
    assert hatched["suggested"] == 0


def red_pixels(picture):
    blue, green, red = picture[..., 0], picture[..., 1], picture[..., 2]
    # The dark end of the shading is redder than this only with much more green.
    return np.count_nonzero((red > 180) & (green < 60) & (blue < 50))


def test_side_and_top_view_have_one_scale():
    """The track's depth takes as many pixels in the side view's black bar as in the top view's outline, the outline is as
    wide to deep as the track is, and the camera as high above the bar as it stands above the floor."""
    found = plan(track=(3.0, 2.0))
    picture = decoded(mount_picture(found))
    dark = picture.max(axis=2) < 50
    runs = [longest_run(row) for row in dark]
    bar_row = int(np.argmax(runs[: len(runs) // 2]))
    bar = longest_run(dark[bar_row] & dark[bar_row + 1] & dark[bar_row - 1])
    top = runs[len(runs) // 2 :]
    outline = max(top)
    rows = [i for i, run in enumerate(top) if run >= outline - 1]
    assert bar == pytest.approx(outline, abs=3)
    assert (max(rows) - min(rows)) / outline == pytest.approx(3.0 / 2.0, abs=0.03)
    # Only the camera's square is dark over nine by nine pixels.
    square = np.argwhere(cv2.erode(dark.astype(np.uint8), np.ones((9, 9))))
    up = bar_row - float(square[square[:, 0] < bar_row][:, 0].mean())
    assert up / bar * 2.0 == pytest.approx(found.camera.stand.height_m, abs=0.04)


def longest_run(row):
    """Length of the longest run of dark pixels in a row."""
    edges = np.diff(np.concatenate(([0], row.astype(int), [0])))
    lengths = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    return int(lengths.max()) if len(lengths) else 0


@pytest.mark.parametrize("form", ["png", "svg"])
def test_the_same_plan_gives_the_same_file(form):
    """Neither date nor chance gets into a drawing, and an SVG says its size."""
    found = PLANS["suggested"]
    data = mount_picture(found, picture_format=form)
    assert data == mount_picture(found, picture_format=form)
    if form == "svg":
        assert re.search(rb'<svg [^>]*width="[\d.]+pt"', data)
        assert len(data) < 250_000
