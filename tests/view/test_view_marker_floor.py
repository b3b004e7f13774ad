"""From solved markers to a calibration: its own floor or a measured layout, the covariance, contradictions by name."""

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_scene import Sheet, camera, lens_of, spread_sheets
from test_view_marker_solve import SIZE_M, fits, optics

from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.calibration import CalibrationMethod
from dnb_edge.view.marker_floor import (
    MarkerLayout,
    check_layout,
    layout_calibration,
    own_calibration,
    twin_size_m,
)
from dnb_edge.view.marker_overlay import draw_markers
from dnb_edge.view.marker_solution import MeasuredPoint
from dnb_edge.view.marker_solve import solve_markers
from dnb_edge.view.pose import find_pose

SCALE = TwinScale(metres_per_px=0.002, height_px=1500)


def solved(view, sheets, *, known=True, **changes):
    return solve_markers(fits(view, sheets), optics(view, known=known), size_m=SIZE_M, **changes)


def layout_of(sheets, *, factor=1.0, sigma_m=0.003, scale=SCALE):
    """Places as measured on a track whose axes lie elsewhere, turned by 0.4 rad."""
    c, s = math.cos(0.4), math.sin(0.4)
    points = []
    for sheet in sheets:
        x, y = sheet.x_m * factor, sheet.y_m * factor
        at = (c * x - s * y + 2.0, s * x + c * y + 0.5)
        points.append(MeasuredPoint(number=sheet.number, local=(0.0, 0.0), at_m=at, sigma_m=sigma_m))
    return MarkerLayout(points=tuple(points), scale=scale, source="layout.yaml")


def scene(pitch_deg=55.0, count=6, seed=5, **changes):
    view = camera(height_m=2.15, pitch_deg=pitch_deg, roll_deg=4, **changes)
    return view, spread_sheets(view, count, np.random.default_rng(seed))


@pytest.mark.parametrize("pitch_deg", [42.0, 55.0, 75.0, 90.0])
def test_the_markers_make_the_floor(pitch_deg):
    """Without a layout x runs to the right and y upwards in the picture, all markers have positive coordinates inside the twin,
    distances are true, and the stored pose is the camera's."""
    view, sheets = scene(pitch_deg, radial=(-0.1, 0.0))
    solution = solved(view, sheets)
    calibration, (width_m, height_m) = own_calibration(solution, metres_per_px=0.004)
    ground = calibration.ground
    corners = ground.to_track_m(solution.corners_px.reshape(-1, 2))
    assert (corners > 0.2).all()
    assert (corners < np.array([width_m, height_m]) - 0.2).all()
    middle = corners.mean(axis=0)
    here, right, up = ground.to_camera_px(middle + np.array([[0, 0], [0.1, 0], [0, 0.1]]))
    assert right[0] - here[0] > abs(right[1] - here[1])
    assert here[1] - up[1] > abs(up[0] - here[0])
    middles = ground.to_track_m(view.project(np.array([[s.x_m, s.y_m, 0.0] for s in sheets])))
    for k in range(1, len(sheets)):
        told = math.dist((sheets[0].x_m, sheets[0].y_m), (sheets[k].x_m, sheets[k].y_m))
        assert math.dist(middles[0], middles[k]) == pytest.approx(told, abs=1e-3)
    assert calibration.method is CalibrationMethod.MARKERS
    assert calibration.pose.position_m[2] == pytest.approx(2.15, abs=1e-3)
    assert calibration.pose.pitch_deg == pytest.approx(pitch_deg, abs=0.02)
    assert calibration.error.max_m < 1e-4
    assert ground.scale.height_px * 0.004 == pytest.approx(height_m)


def test_the_camera_is_where_the_map_has_it():
    """The pose that `find_pose` reads from the map alone is the one that is stored: map, lens and pose agree."""
    view, sheets = scene()
    calibration, _ = own_calibration(solved(view, sheets), metres_per_px=0.002)
    again = find_pose(calibration.ground)
    assert again.position_m == pytest.approx(calibration.pose.position_m, abs=1e-6)
    assert again.pitch_deg == pytest.approx(calibration.pose.pitch_deg, abs=1e-6)


def test_a_layout_ties_the_map_to_the_track():
    """With measured places the map gives track m of that layout, its camera included; a marker that the layout names and the
    picture lacks is noted."""
    view, sheets = scene()
    layout = layout_of([*sheets, Sheet(number=30, x_m=0.0, y_m=0.0, turned_rad=0.0)])
    check_layout(layout, solved(view, sheets))
    solution = solved(view, sheets, measured=layout.points)
    calibration = layout_calibration(solution, layout)
    seen = calibration.ground.to_track_m(view.project(np.array([[s.x_m, s.y_m, 0.0] for s in sheets])))
    assert seen == pytest.approx(np.array([p.at_m for p in layout.points[:-1]]), abs=1e-3)
    assert calibration.pose.position_m == pytest.approx((2.0, 0.5, 2.15), abs=2e-3)
    assert calibration.ground.scale == SCALE
    assert "marker 30 of the layout not seen" in calibration.notes
    width_m, height_m = twin_size_m(solution, calibration)
    assert height_m == pytest.approx(3.0)
    assert width_m > seen[:, 0].max()


def test_corners_can_be_measured_instead_of_middles():
    """A tape finds a corner more easily than a middle: the layout takes both."""
    view, sheets = scene()
    points = [
        MeasuredPoint(number=s.number, local=(-0.5, 0.5), at_m=tuple(s.corners_m()[0] + (4.0, 1.0)), sigma_m=0.002)
        for s in sheets
    ]
    layout = MarkerLayout(points=tuple(points), scale=None, source="layout.yaml")
    check_layout(layout, solved(view, sheets))
    solution = solved(view, sheets, measured=layout.points)
    assert layout_calibration(solution, layout).pose.position_m == pytest.approx((4.0, 1.0, 2.15), abs=2e-3)


def test_sheets_printed_at_97_percent_are_named():
    """Every length by the picture is 3 % longer than by the layout: two markers are named with both lengths, the print's scale
    is told and the size to give instead."""
    view = camera(height_m=2.15, pitch_deg=55.0)
    sheets = spread_sheets(view, 6, np.random.default_rng(5), size_m=SIZE_M * 0.97)
    with pytest.raises(InputError, match=r"markers \d and \d are [\d.]+ m apart .* printed at 97% .* 145\.5 by this"):
        check_layout(layout_of(sheets), solved(view, sheets))


def test_one_wrong_place_is_named_and_not_blamed_on_the_print():
    """One marker of six measured 10 cm wrong: it is in the pair that is named, and nothing is said of reprinting as such."""
    view, sheets = scene()
    layout = layout_of(sheets)
    wrong = replace(layout.points[3], at_m=(layout.points[3].at_m[0] + 0.1, layout.points[3].at_m[1]))
    points = (*layout.points[:3], wrong, *layout.points[4:])
    with pytest.raises(InputError, match=r"(markers 3 and \d|markers \d and 3) are .* measure again") as refused:
        check_layout(replace(layout, points=points), solved(view, sheets))
    assert "print again" not in str(refused.value)


def test_a_layout_of_other_markers_is_refused():
    """Where fewer than two of the layout's markers are seen, those that are seen are told."""
    view, sheets = scene(count=4)
    others = [replace(s, number=s.number + 20) for s in sheets[1:]]
    with pytest.raises(
        InputError, match="1 of its markers seen, two are needed: the picture shows markers 0, 1, 2 and 3"
    ):
        check_layout(layout_of([sheets[0], *others]), solved(view, sheets))


@pytest.mark.parametrize("measured", [False, True], ids=["own floor", "layout"])
def test_the_covariance_of_the_map_is_that_of_repeated_trials(measured):
    """The stated sigma of the position at points between the markers is, within a third, the scatter over 60 trials with new
    noise in the corners and, with a layout, in the places."""
    view, sheets = scene(count=5)
    rng = np.random.default_rng(9)
    true = np.array([[s.x_m, s.y_m] for s in sheets])
    at_m = (true[:-1] + true[1:]) / 2.0
    at_px = view.project(np.column_stack((at_m, np.zeros(len(at_m)))))
    middles_px = view.project(np.column_stack((true, np.zeros(len(true)))))
    placed, stated = [], []
    for _ in range(60):
        points = tuple(
            MeasuredPoint(number=s.number, local=(0.0, 0.0), at_m=tuple(xy + rng.normal(0, 0.004, 2)), sigma_m=0.004)
            for s, xy in zip(sheets, true + 2.0, strict=True)
        )
        found = fits(view, sheets, rng=rng, sigma_px=0.2)
        solution = solve_markers(found, optics(view), size_m=SIZE_M, measured=points if measured else ())
        if measured:
            calibration = layout_calibration(solution, MarkerLayout(points=points, scale=SCALE, source=""))
            placed.append(calibration.ground.to_track_m(at_px) - at_m - 2.0)
        else:
            calibration, _ = own_calibration(solution, metres_per_px=0.002)
            # Only the shape counts: laid back onto the true middles.
            here, there = calibration.ground.to_track_m(middles_px), true
            h, t = (p[:, 0] + 1j * p[:, 1] for p in (here, there))
            turned = np.exp(-1j * np.angle(((h - h.mean()) * (t - t.mean()).conj()).sum()))
            seen = calibration.ground.to_track_m(at_px)
            moved = (seen[:, 0] + 1j * seen[:, 1] - h.mean()) * turned + t.mean()
            placed.append(np.column_stack((moved.real, moved.imag)) - at_m)
        stated.append(calibration.sigma_m(at_px))
    scatter = np.sqrt((np.array(placed) ** 2).sum(axis=2).mean(axis=0))
    assert np.median(stated, axis=0) == pytest.approx(scatter, rel=0.34)


def test_an_estimated_lens_is_kept_and_noted():
    """Without a lens file the estimated lens goes into the map, and the note says so."""
    view, sheets = scene(radial=(-0.1, 0.0), count=8)
    solution = solved(view, sheets, known=False)
    calibration, _ = own_calibration(solution, metres_per_px=0.002)
    assert calibration.ground.lens == solution.lens
    assert calibration.ground.lens.distortion[0] == pytest.approx(-0.1, abs=0.02)
    assert any("lens was estimated" in note for note in calibration.notes)
    assert lens_of(view).fx_px == pytest.approx(calibration.pose.focal_px, rel=0.01)


def test_the_overlay_draws_outlines_grid_and_foot():
    """The picture with what was found has blue lines of the floor, red outlines on the markers and, straight above, the point
    below the camera."""
    view, sheets = scene(85.0)
    solution = solved(view, sheets)
    calibration, _ = own_calibration(solution, metres_per_px=0.002)
    empty = np.full((view.height_px, view.width_px, 3), 120, np.uint8)
    corners = dict(zip(solution.numbers, solution.corners_px, strict=True))
    drawn = draw_markers(empty, calibration.ground, corners).astype(int)
    blue = (drawn[..., 0] > 200) & (drawn[..., 2] < 80)
    red = (drawn[..., 2] > 200) & (drawn[..., 0] < 80)
    assert blue.mean() > 0.005
    for marker in solution.corners_px:
        u, v = np.rint((marker[0] + marker[1]) / 2).astype(int)
        assert red[v - 2 : v + 3, u - 2 : u + 3].any()
    assert (empty == 120).all()
