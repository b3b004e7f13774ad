"""The rig: what its pictures show is what its truth says, and its files are what the other rooms need."""

import cv2
import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.sim.circuit import LANE_HSV, TWIN_SCALE
from dnb_edge.sim.files import demo_files
from dnb_edge.sim.rig import Rig, floor_to_camera_px
from dnb_edge.track.build import TrackSettings, build_track
from dnb_edge.track.twin import LaneColour, load_twin
from dnb_edge.values import StampSource
from dnb_edge.view.homography import calibration_error, fit_ground_map
from dnb_edge.view.keypoints import load_npy_pairs


def difference(rig: Rig, index: int) -> np.ndarray:
    """Where frame `index` differs from the empty room with the same noise."""
    empty = rig._renderer.picture(index, None)
    shown = rig.frame(index).bgr
    return np.abs(shown.astype(int) - empty.astype(int)).max(axis=2)


def test_frames_follow_the_clock(rig):
    """Stamps are the frame number over the rate, rounded to the nanosecond; size and form are as announced."""
    frame = rig.frame(7)
    assert (frame.sequence, frame.t_ns, frame.stamp_source) == (7, round(7e9 / 30), StampSource.SIMULATED)
    assert frame.bgr is not None
    assert frame.bgr.shape == (720, 1280, 3)
    assert rig.truth.crossings_s[-1] < rig.t_ns(rig.frames - 1) * 1e-9
    with pytest.raises(IndexError, match="drive"):
        rig.frame(rig.frames)


@pytest.mark.parametrize("index", [0, 60, 130, 200, 300])
def test_the_car_is_where_the_truth_says(rig, index):
    """The picture differs from the empty room round the ground point, and nowhere else; the car is at least 40 px long."""
    changed = difference(rig, index) > 12
    v, u = np.nonzero(changed)
    at = np.array(rig.frame_truth(index).camera_px)
    centre = np.array([(u.min() + u.max()) / 2, (v.min() + v.max()) / 2])
    extent = max(np.ptp(u), np.ptp(v))
    assert 40 <= extent <= 150
    assert np.linalg.norm(centre - at) < 0.3 * extent
    assert u.min() <= at[0] <= u.max()
    assert v.min() <= at[1] <= v.max()


@pytest.mark.parametrize("index", [60, 130, 200])
def test_the_redrawn_rectangle_has_no_edge(rig, index):
    """The shadow fades out before the rectangle that a frame redraws ends: its border is as in the empty room."""
    changed = difference(rig, index)
    v, u = np.nonzero(changed)
    for edge in (changed[v.min()], changed[v.max()], changed[:, u.min()], changed[:, u.max()]):
        assert edge.max() <= 3


def test_ground_point_is_the_footprints_centre(rig):
    """The truth's camera px is the projection of its track m, and the heading in the picture points along the motion."""
    for index in range(0, rig.frames - 1, 25):
        truth, after = rig.frame_truth(index), rig.frame_truth(index + 1)
        assert np.allclose(floor_to_camera_px(rig.camera, np.array([truth.track_m]))[0], truth.camera_px)
        moved = np.array(after.camera_px) - truth.camera_px
        along = np.array([np.cos(truth.heading_px_rad), -np.sin(truth.heading_px_rad)])
        assert moved @ along > 0.98 * np.linalg.norm(moved)


def test_truth_laps_are_between_crossings(rig):
    """Laps are numbered from 1 and last from one crossing to the next."""
    assert [lap.number for lap in rig.truth.laps] == [1, 2]
    assert [lap.time_s for lap in rig.truth.laps] == list(np.diff(rig.truth.crossings_s))


def test_the_same_seed_gives_the_same_bytes(rig):
    """Frames come out alike whatever was drawn before; another seed gives another room and car."""
    rig.frame(90)
    again = Rig(seed=1, fps=30.0, laps=2)
    assert np.array_equal(rig.frame(40).bgr, again.frame(40).bgr)
    other = Rig(seed=2, fps=30.0, laps=2, size_px=(320, 180))
    small = Rig(seed=1, fps=30.0, laps=2, size_px=(320, 180))
    assert not np.array_equal(other.frame(0).bgr, small.frame(0).bgr)


def test_noise_changes_from_frame_to_frame(rig):
    """The empty floor is not quite the same from picture to picture: a camera's noise is in it."""
    corner = [rig.frame(i).bgr[600:700, 300:500].astype(float) for i in range(6)]
    deviation = np.std(corner, axis=0).mean()
    assert 0.8 < deviation < 4.0


def test_the_demo_files_rebuild_the_track(rig, tmp_path):
    """What the demo writes is enough for the other rooms to find the true centreline, scale, start line and homography."""
    files = demo_files(tmp_path / "demo", rig)
    hue, saturation, value = files.lane_hsv
    colour = LaneColour(hue_deg=hue, saturation_percent=saturation, value_percent=value)
    settings = TrackSettings(
        name="demo", lane_colour=colour, metres_per_px=files.metres_per_px, start_line_px=files.start_line_px
    )
    track = build_track(load_twin(files.twin), settings, source=str(files.twin))
    line = rig.circuit.centreline
    assert track.centreline.length_m == pytest.approx(line.length_m, rel=0.005)
    s = np.linspace(0.0, line.length_m, 200)
    s_found, off = track.centreline.locate(line.at(s + rig.circuit.start_s_m))
    assert np.abs(off).max() < 0.01
    assert np.all(np.diff(s_found[5:-5]) > 0.0)
    pairs = load_npy_pairs(files.camera_keypoints, files.twin_keypoints)
    assert calibration_error(pairs).max_px < 1e-3
    width, height = files.keypoints_image_size_px
    ground = fit_ground_map(pairs, TWIN_SCALE, width_px=width, height_px=height)
    truth = rig.frame_truth(100)
    assert np.allclose(ground.point_to_track_m(truth.camera_px), truth.track_m, atol=1e-5)


def test_the_measured_length_gives_the_scale(rig, tmp_path):
    """The measured line and its length agree with the metres per px."""
    files = demo_files(tmp_path, rig)
    (u0, v0), (u1, v1) = files.measured_from_px, files.measured_to_px
    assert np.hypot(u1 - u0, v1 - v0) * files.metres_per_px == pytest.approx(files.measured_length_m)


def test_the_lane_has_its_colour_on_the_twin(rig):
    """The middle of the lane has the named hue, saturation and value."""
    u, v = TWIN_SCALE.to_twin_px(rig.circuit.centreline.at(np.array([1.0])))[0]
    pixel = rig.twin[round(v), round(u)][None, None].astype(np.float32) / np.float32(255.0)
    hue, saturation, value = cv2.cvtColor(pixel, cv2.COLOR_BGR2HSV)[0, 0]
    assert (hue, 100 * saturation, 100 * value) == pytest.approx(LANE_HSV, abs=1.0)


def test_a_directory_that_cannot_be_is_the_callers_mistake(rig, tmp_path):
    """A folder that cannot be made is named in one line."""
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="taken"):
        demo_files(tmp_path / "taken", rig)


@pytest.mark.parametrize(("arguments", "words"), [({"fps": 0.0}, "fps"), ({"laps": 0}, "laps")])
def test_impossible_rigs_are_refused(arguments, words):
    """A rig without frames or laps is a mistake of the caller."""
    with pytest.raises(ValueError, match=words):
        Rig(**arguments)
    with pytest.raises(ValueError, match="keypoints"):
        Rig(laps=1, size_px=(160, 90)).keypoint_pairs(3)
