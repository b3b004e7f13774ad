"""The homography and its error, against exact samples and the paper's own figure."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from keypoint_samples import HEIGHT, SCALE, TWIN, WIDTH, exact_pairs, seen

from dnb_edge.errors import InputError
from dnb_edge.view.gate import ErrorLimit, check
from dnb_edge.view.homography import calibration_error, error_by_count, fit_ground_map, fit_homography
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs

KNOWN = {
    4: (1244.73, 11202.58),
    5: (34.96, 314.62),
    6: (32.56, 293.07),
    7: (39.91, 359.16),
    8: (36.73, 330.55),
    9: (26.69, 240.23),
}


def papers_pairs(real_dir):
    folder = real_dir / "drivenetbench"
    return load_npy_pairs(folder / "keypoints_from_camera.npy", folder / "keypoints_from_diagram.npy")


def test_the_papers_figure(real_dir):
    """Error over all nine keypoints of the homography from the first N, all six rows to 0.01 px."""
    rows = error_by_count(papers_pairs(real_dir))
    assert {row.points for row in rows} == set(KNOWN)
    for row in rows:
        mean_px, sum_px = KNOWN[row.points]
        assert row.mean_px == pytest.approx(mean_px, abs=0.01)
        assert row.sum_px == pytest.approx(sum_px, abs=0.01)


def test_the_papers_error_and_leave_one_out(real_dir):
    """In-sample and left-out error differ by more than two: what the paper did not report."""
    error = calibration_error(papers_pairs(real_dir), metres_per_px=0.0015)
    assert error.mean_px == pytest.approx(26.69, abs=0.01)
    assert error.sum_px == pytest.approx(240.23, abs=0.01)
    assert error.max_px == max(error.per_point_px) == pytest.approx(44.93, abs=0.01)
    assert error.leave_one_out_mean_px == pytest.approx(57.96, abs=0.01)
    assert error.mean_m == pytest.approx(error.mean_px * 0.0015)
    assert error.leave_one_out_mean_m == pytest.approx(error.leave_one_out_mean_px * 0.0015)


def test_the_papers_map_agrees_with_its_truth(real_dir):
    """Keypoints clicked at 3840x2160 serve frames of 1280x720 within half a pixel of the truth file's points."""
    truth_file = real_dir / "drivenetbench" / "driven-lap.truth.json"
    frames = json.loads(truth_file.read_text())["frames"]
    ground = fit_ground_map(papers_pairs(real_dir), SCALE, width_px=3840, height_px=2160).scaled_to(1280, 720)
    camera, twin = (np.array([frame[key] for frame in frames]) for key in ("camera", "twin"))
    assert SCALE.to_twin_px(ground.to_track_m(camera)) == pytest.approx(twin, abs=0.5)


def test_exact_pairs_have_no_error():
    """Pairs that one homography explains are explained, in and out of the sample."""
    error = calibration_error(exact_pairs())
    assert error.max_px < 1e-3
    assert error.leave_one_out_mean_px is not None
    assert error.leave_one_out_mean_px < 1e-2
    assert [row.points for row in error_by_count(exact_pairs())] == [4, 5, 6, 7]
    assert error.mean_m is None


def test_four_pairs_have_no_leave_one_out():
    """Three points fix no homography, so nothing is said rather than something made up."""
    assert calibration_error(exact_pairs(4)).leave_one_out_mean_px is None
    assert calibration_error(exact_pairs(5)).leave_one_out_mean_px is not None


@given(st.integers(0, 2**32 - 1))
def test_the_third_coordinate_is_positive_at_every_keypoint(seed):
    """Whatever the noise of clicking, 'in front of the camera' has the same sign everywhere."""
    noise = np.random.default_rng(seed).normal(0, 2, TWIN.shape)
    pairs = KeypointPairs.from_arrays(seen(TWIN) + noise, TWIN, source="noisy")
    matrix = np.array(fit_homography(pairs)).reshape(3, 3)
    assert (np.column_stack((pairs.camera_array(), np.ones(len(pairs)))) @ matrix[2] > 0).all()


def test_swapped_keypoints_are_refused():
    """Pairs in different orders fold the floor through the horizon: the odd ones are named."""
    pairs = KeypointPairs.from_arrays(seen(TWIN)[:4], TWIN[[0, 2, 1, 3]], source="k.npy")
    with pytest.raises(InputError, match=r"k\.npy: no homography fits .* would lie beyond the horizon: check"):
        fit_homography(pairs)


def test_keypoints_outside_the_picture_are_refused():
    """Points clicked on a larger picture than the one named are named, with the key that mends it."""
    with pytest.raises(
        InputError, match=r"sample: camera keypoints .* outside the picture of 640x360 px: .*image_size"
    ):
        fit_ground_map(exact_pairs(), SCALE, width_px=640, height_px=360)
    assert fit_ground_map(exact_pairs(), SCALE, width_px=WIDTH, height_px=HEIGHT).width_px == WIDTH


@pytest.mark.parametrize(
    ("limit", "reason"),
    [
        (ErrorLimit(), None),
        (ErrorLimit(mean_px=30), None),
        (ErrorLimit(mean_px=20), ("not scored: the homography's mean keypoint error is 26.69 twin px, above the limit "
         "of 20 twin px: click the keypoints anew or add more")),
        (ErrorLimit(mean_m=0.05), None),
        (ErrorLimit(mean_px=30, mean_m=0.03), ("not scored: the homography's mean keypoint error is 40.0 mm, above the "
         "limit of 30 mm: click the keypoints anew or add more")),
    ],
)  # fmt: skip
def test_the_gate(real_dir, limit, reason):
    """Above either limit nothing is scored, and the sentence has both numbers; without limits all is."""
    assert check(calibration_error(papers_pairs(real_dir), metres_per_px=0.0015), limit) == reason


def test_the_gate_is_shut_by_an_error_that_is_no_number():
    """An error that cannot be compared does not slip through."""
    error = calibration_error(exact_pairs())
    assert check(error.__class__(**{**as_dict(error), "mean_px": float("nan")}), ErrorLimit(mean_px=5)) is not None


def as_dict(error):
    return {name: getattr(error, name) for name in error.__slots__}


def test_a_limit_in_metres_needs_a_scale():
    """A limit that cannot be checked is an error and not a pass."""
    with pytest.raises(InputError, match="mean_m is set but the twin's scale is not known"):
        check(calibration_error(exact_pairs()), ErrorLimit(mean_m=0.03))
    with pytest.raises(InputError, match="mean_px must be a positive number"):
        ErrorLimit(mean_px=0)
