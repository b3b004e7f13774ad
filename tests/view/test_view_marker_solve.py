"""The pose from floor markers at unknown places: exact corners, noisy corners, rendered pictures, and what must be refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from marker_scene import Sheet, camera, draw, lens_of, spread_sheets

from dnb_edge.errors import InputError
from dnb_edge.view.least_squares import minimise
from dnb_edge.view.marker_edges import MarkerFit
from dnb_edge.view.marker_pose import MarkerQuestion, pose_from_pictures
from dnb_edge.view.marker_solution import MeasuredPoint, Optics
from dnb_edge.view.marker_solve import solve_markers
from dnb_edge.view.markers import grey_of

SIZE_M = 0.15
SIGMA_PX = 0.03


def fits(view, sheets, *, rng=None, sigma_px=SIGMA_PX):
    """The sheets' corners as a perfect detector has them, or with noise."""
    found = []
    for sheet in sheets:
        at = view.project(np.column_stack((sheet.corners_m(), np.zeros(4))))
        noise = 0.0 if rng is None else rng.normal(0.0, sigma_px, (4, 2))
        found.append(
            MarkerFit(
                number=sheet.number, camera_px=at + noise, noise_px2=np.eye(8) * sigma_px**2, floor_px=0.0, side_px=50.0
            )
        )
    return found


def optics(view, *, known=True, **changes):
    lens = lens_of(view) if known else None
    return Optics(width_px=view.width_px, height_px=view.height_px, lens=lens, **changes)


def places(solution, sheets):
    """How far the middles' distances are from the truth, metres."""
    there = np.array([[sheet.x_m, sheet.y_m] for sheet in sheets])
    here = solution.places[:, :2]

    def apart(points):
        return np.linalg.norm(points[:, None] - points[None], axis=2)

    return np.abs(apart(here) - apart(there)).max()


@settings(max_examples=15, deadline=None)
@given(
    pitch_deg=st.floats(32.0, 90.0), roll_deg=st.floats(-40.0, 40.0), height_m=st.floats(0.8, 4.0), seed=st.integers(0, 999)
)  # fmt: skip
def test_exact_corners_give_the_exact_pose(pitch_deg, roll_deg, height_m, seed):
    """Whatever the height, pitch, roll and the sheets' places: with the lens known, exact corners give the camera's height and
    pitch and all distances on the floor exactly."""
    view = camera(
        height_m=height_m, pitch_deg=pitch_deg, roll_deg=roll_deg, radial=(-0.08, 0.01), off_centre_px=(9, -6)
    )
    size_m = SIZE_M * height_m / 2.0
    sheets = spread_sheets(view, 4, np.random.default_rng(seed), size_m=size_m, far_m=3.0 * height_m)
    solution = solve_markers(fits(view, sheets), optics(view), size_m=size_m)
    assert solution.height_m == pytest.approx(height_m, rel=1e-4)
    assert solution.pitch_deg == pytest.approx(pitch_deg, abs=0.02)
    assert places(solution, sheets) < 1e-3 * height_m
    assert solution.residual_px.max() < 0.01


@pytest.mark.parametrize("pitch_deg", [40.0, 55.0, 65.0])
def test_exact_corners_tell_an_unknown_lens(pitch_deg):
    """Without a lens file a slanting view tells focal length and bending too, where the optical centre is in the middle."""
    view = camera(height_m=2.15, pitch_deg=pitch_deg, roll_deg=8, radial=(-0.12, 0.0))
    sheets = spread_sheets(view, 8, np.random.default_rng(8))
    solution = solve_markers(fits(view, sheets), optics(view, known=False), size_m=SIZE_M)
    assert solution.height_m == pytest.approx(2.15, rel=0.005)
    assert solution.lens.fx_px == pytest.approx(view.focal_px, rel=0.005)
    assert solution.lens.distortion[0] == pytest.approx(-0.12, abs=0.01)


@pytest.mark.parametrize("known", [True, False], ids=["lens known", "lens unknown"])
def test_the_stated_sigmas_cover_the_truth(known):
    """Over noisy corners, and for unknown lenses off centre and bent at random, height and pitch are within two stated sigmas
    about as often as they should be, and the sigmas are not idle."""
    rng = np.random.default_rng(11)
    heights, pitches = [], []
    for _ in range(20 if known else 16):
        off, bend = ((0.0, 0.0), 0.0) if known else (rng.normal(0, 10, 2), rng.normal(0, 0.08))
        pitch_deg = rng.uniform(40, 65)
        view = camera(height_m=2.0, pitch_deg=pitch_deg, roll_deg=5, radial=(bend, 0.0), off_centre_px=off)
        sheets = spread_sheets(view, 6, rng)
        solution = solve_markers(fits(view, sheets, rng=rng), optics(view, known=known), size_m=SIZE_M)
        heights.append((solution.height_m - 2.0) / solution.height_sigma_m)
        pitches.append((solution.pitch_deg - pitch_deg) / solution.pitch_sigma_deg)
    for errors in (heights, pitches):
        assert 0.85 <= np.mean(np.abs(errors) < 2.0) <= 1.0
        assert np.std(errors) > 0.5


def test_a_lens_that_is_not_quite_right_widens_the_sigmas():
    """The lens's own sigmas reach the height: without them a lens wrong by 0.3 % would be believed far too well."""
    view = camera(height_m=2.0, pitch_deg=60.0)
    sheets = spread_sheets(view, 6, np.random.default_rng(5))
    wrong = replace(lens_of(view), fx_px=view.focal_px * 1.003, fy_px=view.focal_px * 1.003)
    believed = Optics(width_px=1280, height_px=720, lens=wrong)
    doubted = replace(believed, lens_sigmas=(0.003, 1.0, 1.0))
    found = fits(view, sheets)
    sure, unsure = (solve_markers(found, eyes, size_m=SIZE_M) for eyes in (believed, doubted))
    assert abs(sure.height_m - 2.0) > 3.0 * sure.height_sigma_m
    assert abs(unsure.height_m - 2.0) < 2.0 * unsure.height_sigma_m
    assert unsure.height_sigma_m < 0.02


def test_straight_down_the_lens_or_the_height_must_be_known():
    """From straight above every focal length fits: the refusal names both ways out, and each of them works."""
    view = camera(height_m=2.5, pitch_deg=88.0)
    sheets = spread_sheets(view, 6, np.random.default_rng(2))
    found = fits(view, sheets)
    with pytest.raises(InputError, match=r"8[0-9] degrees down: without its lens .* --height, or calibrate the lens"):
        solve_markers(found, optics(view, known=False), size_m=SIZE_M)
    by_height = solve_markers(found, optics(view, known=False), size_m=SIZE_M, height_m=2.5)
    assert by_height.height_m == pytest.approx(2.5, abs=3 * by_height.height_sigma_m)
    assert by_height.height_sigma_m < 0.04
    assert solve_markers(found, optics(view), size_m=SIZE_M).pitch_deg == pytest.approx(88.0, abs=0.01)


def test_a_marker_of_another_size_is_set_aside_by_name():
    """One sheet printed smaller is named and left out of six; of four with two odd ones nothing is left to trust."""
    view = camera(height_m=2.0, pitch_deg=60.0)
    sheets = spread_sheets(view, 6, np.random.default_rng(5))
    odd = [replace(s, size_m=0.135) if s.number == 2 else s for s in sheets]
    solution = solve_markers(fits(view, odd), optics(view), size_m=SIZE_M)
    assert solution.aside == (2,)
    assert solution.height_m == pytest.approx(2.0, abs=0.001)
    worse = [replace(s, size_m=0.12 + 0.01 * s.number) for s in sheets[:4]]
    with pytest.raises(InputError, match="one flat floor"):
        solve_markers(fits(view, worse), optics(view), size_m=SIZE_M)


def test_measured_places_take_over_the_scale():
    """Places measured to a millimetre tell the height better than squares that were printed 0.6 % too small."""
    view = camera(height_m=2.0, pitch_deg=60.0)
    sheets = spread_sheets(view, 6, np.random.default_rng(5), size_m=0.1491)
    told = [
        MeasuredPoint(number=s.number, local=(0.0, 0.0), at_m=(s.x_m + 3, s.y_m - 1), sigma_m=0.0005) for s in sheets
    ]
    found = fits(view, sheets, sigma_px=0.1)
    free = solve_markers(found, optics(view), size_m=SIZE_M)
    tied = solve_markers(found, optics(view), size_m=SIZE_M, measured=told)
    assert abs(free.height_m - 2.0) > 0.008
    assert abs(tied.height_m - 2.0) < 0.5 * abs(free.height_m - 2.0)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_markers_are_refused(count):
    """Below three the number is said, and how many to lay."""
    view = camera(height_m=2.0, pitch_deg=60.0)
    sheets = spread_sheets(view, 3, np.random.default_rng(5))[:count]
    with pytest.raises(InputError, match="seen: lay at least 3"):
        solve_markers(fits(view, sheets), optics(view), size_m=SIZE_M)


def pictured(view, sheets, **changes):
    grey = grey_of(draw(view, sheets, np.random.default_rng(1)))
    return pose_from_pictures([grey], optics(view), MarkerQuestion(family="4X4_50", size_m=SIZE_M, **changes))


def test_markers_on_a_line_or_in_a_corner_are_refused_with_advice():
    """Four sheets on one line, and four in one corner of the picture, fix the floor badly: each says what to move where."""
    view = camera(height_m=2.5, pitch_deg=60.0)
    line = [Sheet(number=k, x_m=-0.9 + 0.6 * k, y_m=1.4, turned_rad=0.2 * k) for k in range(4)]
    with pytest.raises(InputError, match=r"on one line, 1\.80 m long: lay one or two at least 0\.45 m beside it"):
        pictured(view, line)
    corner = [Sheet(number=k, x_m=0.5 + 0.25 * (k % 2), y_m=1.0 + 0.25 * (k // 2), turned_rad=0.0) for k in range(4)]
    with pytest.raises(InputError, match=r"one part of the picture .* spread them"):
        pictured(view, corner)


def test_a_measured_height_that_contradicts_a_known_lens_is_refused():
    """With the lens known the height is told: a tape that says 6 % more, or sheets printed at 94 %, is named."""
    view = camera(height_m=2.0, pitch_deg=60.0)
    sheets = spread_sheets(view, 4, np.random.default_rng(5))
    with pytest.raises(InputError, match=r"--height 2\.12: by the markers .* [12]\.\d{3} m .* printed at 106%"):
        pictured(view, sheets, height_m=2.12)
    assert pictured(view, sheets, height_m=2.03).solution.height_m == pytest.approx(2.0, abs=0.005)


def test_a_measured_height_that_the_markers_doubt_is_noted():
    """Without a lens the height is believed, but where it is 10 % off and the view tells so by itself, that is said."""
    view = camera(height_m=2.0, pitch_deg=50.0)
    grey = grey_of(draw(view, spread_sheets(view, 6, np.random.default_rng(5)), np.random.default_rng(1)))

    def doubts(height_m):
        question = MarkerQuestion(family="4X4_50", size_m=SIZE_M, height_m=height_m)
        return [
            note for note in pose_from_pictures([grey], optics(view, known=False), question).notes if "--height" in note
        ]

    (note,) = doubts(2.5)
    assert "measure again, from the floor to the lens" in note
    assert doubts(2.01) == []


def test_what_is_not_seen_is_noted():
    """Markers that should lie there and are not seen are named; three only are noted as few."""
    view = camera(height_m=2.0, pitch_deg=60.0)
    sheets = spread_sheets(view, 3, np.random.default_rng(5))
    pose = pictured(view, sheets, numbers=(0, 1, 2, 3))
    assert "marker 3 is not seen" in pose.notes
    assert any("3 markers leave little" in note for note in pose.notes)


@pytest.mark.parametrize(
    ("pitch_deg", "height_m", "seed"), [(38.0, 2.6, 1), (52.0, 1.6, 2), (64.0, 2.9, 3), (77.0, 2.1, 4), (90.0, 3.0, 5)]
)
def test_pose_from_pictures_within_a_centimetre(pitch_deg, height_m, seed):
    """The figure to reach: on drawn pictures, the lens known, height within 1 cm and pitch within 0.3 degrees."""
    rng = np.random.default_rng(seed)
    view = camera(height_m=height_m, pitch_deg=pitch_deg, roll_deg=rng.uniform(-15, 15), radial=(0.05, 0.0))
    sheets = spread_sheets(view, int(rng.integers(4, 7)), rng)
    pose = pictured(view, sheets)
    assert pose.solution.height_m == pytest.approx(height_m, abs=0.01)
    assert pose.solution.pitch_deg == pytest.approx(pitch_deg, abs=0.3)
    assert abs(pose.solution.height_m - height_m) < 3.5 * pose.solution.height_sigma_m


def test_least_squares_finds_a_known_minimum_and_its_covariance():
    """A line through points: the parameters are numpy's, the covariance is the textbook's, a fixed parameter stays."""
    x = np.linspace(0, 4, 9)
    y = 1.5 * x + 2.0 + np.sin(7 * x) * 0.1

    def residuals(p):
        return p[0] * x + p[1] + p[2] - y

    fit = minimise(residuals, np.array([0.0, 0.0, 0.25]), np.array([True, True, False]))
    slope, offset = np.polyfit(x, y, 1)
    assert fit.parameters == pytest.approx([slope, offset - 0.25, 0.25])
    design = np.column_stack((x, np.ones_like(x)))
    assert fit.inverse[:2, :2] == pytest.approx(np.linalg.inv(design.T @ design), rel=1e-4)
    assert fit.freedom == 7


def test_least_squares_gives_up_on_nonsense():
    """Where the residuals are no numbers from the start there is no fit."""
    assert minimise(lambda p: np.full(3, math.nan) * p[0], np.array([1.0]), np.array([True])) is None
