"""Finding floor markers in a picture, and placing them by their edges."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from marker_scene import Look, Sheet, camera, draw, lens_of, spread_sheets

from dnb_edge.errors import InputError
from dnb_edge.view.marker_patch import marker_patch
from dnb_edge.view.markers import MarkersSeen, advice, averaged, find_markers, grey_of, marker_cells

FAMILY = "4X4_50"


def corners_px(view, sheet):
    return view.project(np.column_stack((sheet.corners_m(), np.zeros(4))))


def off_px(view, sheets, seen):
    """(n, 4, 2) of where corners are seen less where they are."""
    return np.array([marker.camera_px - corners_px(view, sheets[marker.number]) for marker in seen.markers])


@pytest.mark.parametrize("tone", [False, True], ids=["linear", "tone curve"])
@pytest.mark.parametrize(("pitch_deg", "seed"), [(90.0, 1), (60.0, 2), (40.0, 3)])
def test_corners_are_placed_to_hundredths_of_a_pixel(pitch_deg, seed, tone):
    """Through a bent lens, blurred, noisy, with a camera's tone curve or without: every sheet is found, its corners are right
    within 0.03 px on average, its size is not off, and the covariance is no smaller than the errors."""
    rng = np.random.default_rng(seed)
    view = camera(height_m=2.15, pitch_deg=pitch_deg, roll_deg=5, radial=(-0.1, 0.02), off_centre_px=(8, -5))
    sheets = spread_sheets(view, 6, rng)
    seen = find_markers(grey_of(draw(view, sheets, rng, Look(tone=tone))), family=FAMILY, lens=lens_of(view))
    assert [marker.number for marker in seen.markers] == list(range(6))
    off = off_px(view, sheets, seen)
    assert np.abs(off).mean() < 0.03
    areas = [cv2.contourArea(marker.camera_px.astype(np.float32)) for marker in seen.markers]
    truth = [cv2.contourArea(corners_px(view, sheet).astype(np.float32)) for sheet in sheets]
    assert np.sqrt(areas) / np.sqrt(truth) == pytest.approx(1.0, abs=0.002)
    chi = [o.ravel() @ np.linalg.inv(m.covariance_px2) @ o.ravel() for o, m in zip(off, seen.markers, strict=True)]
    assert sum(chi) / (8 * len(chi)) < 1.5


def test_the_rim_alone_would_mistake_a_tone_curve_for_size():
    """A camera's tone curve shrinks dark squares; OpenCV's own corners of the same picture are off by far more than ours."""
    rng = np.random.default_rng(4)
    view = camera(height_m=2.15, pitch_deg=90.0)
    sheets = spread_sheets(view, 4, rng)
    grey = grey_of(draw(view, sheets, rng, Look(blur_px=1.0)))
    ours = find_markers(grey, family=FAMILY, lens=None)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    refined = detector.getDetectorParameters()
    refined.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector.setDetectorParameters(refined)
    squares, numbers, _ = detector.detectMarkers(grey)
    theirs = [
        np.abs(square[0] - corners_px(view, sheets[number])).mean()
        for square, number in zip(squares, numbers.ravel(), strict=True)
    ]
    assert np.abs(off_px(view, sheets, ours)).mean() < 0.2 * np.mean(theirs)


def test_a_white_floor_and_sheets_that_touch_the_sheets_rim():
    """Narrow paper on a dark floor: the paper's own rim is a square too and must not hide the marker."""
    rng = np.random.default_rng(1001)
    view = camera(height_m=1.52, pitch_deg=68.7, hfov_deg=60.0)
    sheets = spread_sheets(view, 5, rng)
    seen = find_markers(grey_of(draw(view, sheets, rng, Look(tone=False))), family=FAMILY, lens=None)
    assert [marker.number for marker in seen.markers] == list(range(5))


def scene(sheets, *, height_m=2.0, look=None, **changes):
    view = camera(height_m=height_m, pitch_deg=90.0, **changes)
    return grey_of(draw(view, sheets, np.random.default_rng(3), look))


def row(count, **changes):
    return [Sheet(number=k, x_m=0.5 * k - 0.5, y_m=0.0, turned_rad=0.3 * k, **changes) for k in range(count)]


def test_small_markers_are_told_with_their_size():
    """Markers that can be read but not placed are told, and the advice says how large they are and must be."""
    grey = scene(row(3, size_m=0.15), height_m=6.0, size_px=(960, 540), look=Look(blur_px=0.3, noise=0.5))
    seen = find_markers(grey, family=FAMILY)
    small = find_markers(cv2.resize(grey, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA), family=FAMILY)
    assert seen.markers
    assert not small.markers
    assert all(side < 15.0 for _, side in small.too_small)
    assert small.too_small
    assert "px large in the picture and must be 15" in advice(small, grey, family=FAMILY)


def test_one_number_twice_is_refused():
    """A number that lies on the floor twice could be either: it is named."""
    sheets = row(2)
    with pytest.raises(InputError, match="marker 1 is seen more than once"):
        find_markers(scene([*sheets, replace(sheets[1], x_m=0.9, y_m=0.3)]), family=FAMILY)


def test_numbers_that_are_not_asked_for_are_left_out():
    """A marker that does not belong to the floor, on a car's roof say, is not taken for one."""
    seen = find_markers(scene(row(3)), family=FAMILY, numbers=(0, 2, 7))
    assert [marker.number for marker in seen.markers] == [0, 2]


def test_another_family_is_named():
    """Sheets of another family are no markers of this one; the advice names the family that is there."""
    view = camera(height_m=2.0, pitch_deg=90.0)
    grey = grey_of(draw(view, row(3), np.random.default_rng(3), family="5X5_50"))
    seen = find_markers(grey, family=FAMILY)
    assert not seen.markers
    assert "5X5" in advice(seen, grey, family=FAMILY)


def test_glare_is_told():
    """A sheet whose black is washed out by a reflection is not placed but told."""
    sheets = row(2)
    view = camera(height_m=2.0, pitch_deg=90.0)
    picture = draw(view, sheets, np.random.default_rng(3))
    u, v = corners_px(view, sheets[1]).mean(axis=0)
    glare = np.zeros(picture.shape, np.float32)
    cv2.circle(glare, (round(u + 18), round(v + 10)), 16, (240.0,) * 3, -1)
    washed = np.clip(picture + cv2.GaussianBlur(glare, (0, 0), 4), 0, 255).astype(np.uint8)
    seen = find_markers(grey_of(washed), family=FAMILY)
    assert [marker.number for marker in seen.markers] == [0]


def test_frames_are_averaged_and_a_hidden_marker_is_told():
    """Several pictures of one view give less noise; a marker that somebody stands before now and then is told, one that is
    mostly hidden is left out; a shaking camera is told."""
    view = camera(height_m=2.0, pitch_deg=90.0)
    rng = np.random.default_rng(6)
    sheets = row(3)
    frames = []
    for k in range(4):
        seen = find_markers(grey_of(draw(view, sheets, rng)), family=FAMILY)
        hidden = {1} if k == 0 else {2} if k < 3 else set()
        frames.append(replace(seen, markers=tuple(m for m in seen.markers if m.number not in hidden)))
    fits, notes = averaged([*frames, *[replace(f, markers=f.markers[:2]) for f in frames[1:3]]])
    assert [fit.number for fit in fits] == [0, 1]
    assert fits[0].noise_px2.trace() < 0.5 * frames[0].markers[0].noise_px2.trace()
    assert len(notes) == 2
    assert "marker 1 is placed in 5 of 6 pictures: does somebody stand in the view?" in notes
    moved = [replace(m, camera_px=m.camera_px + 1.5) for m in frames[3].markers]
    _, notes = averaged([frames[3], replace(frames[3], markers=tuple(moved))])
    assert any("shook" in note for note in notes)


def test_no_markers_at_all():
    """An empty picture has none, and the advice tells what to lay."""
    empty = np.full((400, 600), 128, np.uint8)
    assert find_markers(empty, family=FAMILY) == MarkersSeen(markers=(), too_small=(), unclear=(), unread=0)
    assert "calibrate markers --print" in advice(find_markers(empty, family=FAMILY), empty, family=FAMILY)


def test_unknown_families_and_numbers_are_refused():
    """A family that OpenCV has not, and a number beyond the family's last, are told."""
    with pytest.raises(InputError, match="unknown family of markers 4X5"):
        find_markers(np.zeros((50, 50), np.uint8), family="4X5")
    with pytest.raises(InputError, match="0 to 49, not 50"):
        marker_cells(FAMILY, 50)


def test_a_patch_looks_like_the_code():
    """The drawn patch is the code where the corners are: dark border, light paper, cells as printed."""
    corners = np.array([[30.0, 40.0], [90.0, 44.0], [84.0, 102.0], [28.0, 98.0]])
    cells = marker_cells(FAMILY, 5)
    patch, first = marker_patch(cells, corners, 0.5)
    matrix = cv2.getPerspectiveTransform(
        np.array([[0, 0], [6, 0], [6, 6], [0, 6]], np.float32), (corners - first).astype(np.float32)
    )
    middles = np.array([[[k + 0.5, j + 0.5]] for j in range(6) for k in range(6)])
    at = cv2.perspectiveTransform(middles, matrix)[:, 0]
    levels = np.array([patch[round(v), round(u)] for u, v in at]).reshape(6, 6)
    assert np.array_equal(levels > 100, cells)
