"""The view of a run from a calibration file: the map as saved, or a refusal that names the file and the reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dnb_edge.assembly import assemble, check_detector, load_pairs, make_header
from dnb_edge.cli.calibration_out import save_calibration
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Clock, SourceInfo
from dnb_edge.view.across_line import across_sigma_m
from dnb_edge.view.calibration import Calibration, CalibrationMethod
from dnb_edge.view.homography import calibration_error, fit_ground_map
from dnb_edge.view.pose import find_pose

INFO = SourceInfo(uri="x:", width_px=1280, height_px=720, nominal_fps=30.0, clock=Clock.MEDIA, live=False)
BARE = ("view.keypoints=null", "view.keypoints_camera=null", "view.keypoints_twin=null", "view.image_size_px=null")


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's configuration and, beside it, a calibration `view.yaml` from the same keypoints."""
    path = write_demo_config(tmp_path_factory.mktemp("demo"), Rig(seed=1, laps=1))
    save_calibration(path.parent / "view.yaml", calibration_of(path))
    return path


def calibration_of(path: Path) -> Calibration:
    config = load_config(path)
    scale, pairs = assemble(config, INFO).setup.track.scale, load_pairs(config.view)
    ground = fit_ground_map(pairs, scale, width_px=1280, height_px=720)
    pose = find_pose(ground)
    return Calibration(
        ground=replace(ground, camera_m=pose.position_m),
        covariance=None,
        error=calibration_error(pairs, metres_per_px=scale.metres_per_px),
        method=CalibrationMethod.KEYPOINTS,
        pose=pose,
        camera_id="usb-Cam_1",
    )


def calibrated(demo: Path, name: str, *more: str) -> Config:
    return load_config(demo, [*BARE, f"view.calibration={demo.parent / name}", *more])


def test_a_calibration_gives_the_run_the_map_that_it_holds(demo: Path) -> None:
    """Bit for bit as from the keypoints, with the camera's place besides; its file's hash goes into the recording."""
    plain, whole = assemble(load_config(demo), INFO), assemble(calibrated(demo, "view.yaml"), INFO)
    assert replace(whole.setup.ground, camera_m=None) == plain.setup.ground
    assert whole.setup.ground.camera_m == pytest.approx((1.5, -0.42, 2.2), abs=0.01)
    assert whole.calibration == plain.calibration
    header = make_header(calibrated(demo, "view.yaml"), whole, INFO)
    assert "view.yaml" in header.setup["sha256"]


def test_its_gate_and_its_sizes_are_those_of_any_view(demo: Path) -> None:
    """The limit of the error holds for it, too; frames of half the size are converted."""
    strict = calibrated(demo, "view.yaml", "view.max_mean_error_m=null", "view.max_mean_error_px=1e-12")
    assert "above the limit" in str(assemble(strict, INFO).setup.not_scored_because)
    half = assemble(calibrated(demo, "view.yaml"), replace(INFO, width_px=640, height_px=360)).setup.ground
    full = assemble(calibrated(demo, "view.yaml"), INFO).setup.ground
    assert half.point_to_track_m((320.0, 180.0)) == pytest.approx(full.point_to_track_m((640.0, 360.0)))


@pytest.mark.parametrize(
    ("info", "says"),
    [
        (replace(INFO, camera_id="usb-Cam_2"), "made with the camera usb-Cam_1, this one is usb-Cam_2"),
        (
            replace(INFO, width_px=640, height_px=480),
            "frames are 640x480, the view was calibrated on pictures of 1280x720",
        ),
    ],
    ids=["another camera", "another shape"],
)
def test_another_camera_is_refused(demo: Path, info: SourceInfo, says: str) -> None:
    """The reason names the calibration's file."""
    with pytest.raises(InputError, match=says) as caught:
        assemble(calibrated(demo, "view.yaml"), info)
    assert "view.yaml" in str(caught.value)


def test_a_map_to_another_twin_is_refused(demo: Path) -> None:
    """A twin of another scale would give other metres, silently."""
    made = calibration_of(demo)
    other = replace(made, ground=replace(made.ground, scale=TwinScale(metres_per_px=0.004, height_px=800.0)))
    save_calibration(demo.parent / "other.yaml", other)
    with pytest.raises(InputError, match=r"other\.yaml: made for a twin 800 px high at 4 mm a px, the track's is"):
        assemble(calibrated(demo, "other.yaml"), INFO)


def test_keypoints_beside_a_calibration_are_refused(demo: Path) -> None:
    """Only one of the two can be meant."""
    with pytest.raises(InputError, match="give calibration or keypoints_camera, not both"):
        load_config(demo, [f"view.calibration={demo.parent / 'view.yaml'}"])


def test_what_needs_keypoints_says_so(demo: Path) -> None:
    """A finished map cannot be fitted again."""
    with pytest.raises(InputError, match="holds a finished map, no keypoints"):
        load_pairs(calibrated(demo, "view.yaml").view)


def test_the_error_of_the_map_is_known_over_the_whole_route(demo: Path) -> None:
    """A calibration with a covariance tells its greatest sigma on the route, frames of any size alike; keypoints tell none."""
    made = calibration_of(demo)
    h = made.ground.camera_to_twin
    loose = tuple(tuple(1e-6 * h[i] ** 2 * (i == j) for j in range(9)) for i in range(9))
    save_calibration(demo.parent / "loose.yaml", replace(made, covariance=loose))
    whole = assemble(calibrated(demo, "loose.yaml"), INFO)
    route = whole.setup.track.centreline.points_m
    seen = whole.setup.ground.to_camera_px(route)
    assert whole.view_sigma_m == pytest.approx(replace(made, covariance=loose).sigma_m(seen).max())
    assert (
        assemble(calibrated(demo, "loose.yaml"), replace(INFO, width_px=640, height_px=360)).view_sigma_m
        == whole.view_sigma_m
    )
    assert assemble(load_config(demo), INFO).view_sigma_m is None


def test_a_box_above_the_floor_asks_for_the_cameras_place(demo: Path) -> None:
    """`detector.point_height_m` makes a run with bare keypoints find where the camera stands; it is for boxes only."""
    raised = load_config(demo, ["detector.point_height_m=0.04"])
    assert assemble(raised, INFO).setup.ground.camera_m == pytest.approx((1.5, -0.42, 2.2), abs=0.01)
    with pytest.raises(InputError, match="point_height_m: only for a model that Ultralytics exported"):
        check_detector(raised.detector)


def test_keypoints_tell_how_far_a_line_may_be_out_of_its_place(demo: Path) -> None:
    """Without a calibration file the map's covariance is that of the keypoints' weighted fit, in the map's own scale and for
    the frames' own size: exact keypoints leave a few millimetres across the start line, at any size of frame."""
    half = replace(INFO, width_px=640, height_px=360)
    sigmas_m = []
    for info in (INFO, half):
        setup = assemble(load_config(demo), info).setup
        assert setup.map_covariance is not None
        sigmas_m.append(across_sigma_m(setup.ground, setup.map_covariance, setup.track.start_line))
    assert 0.0002 < sigmas_m[0] < 0.01
    assert sigmas_m[1] == pytest.approx(sigmas_m[0], rel=1e-6)


def test_a_calibration_without_covariance_tells_nothing_of_the_kind(demo: Path) -> None:
    """None stays none; the row time comes from the configuration, in microseconds."""
    setup = assemble(calibrated(demo, "view.yaml", "capture.row_us=40"), INFO).setup
    assert setup.map_covariance is None
    assert setup.row_s == pytest.approx(40e-6)
