"""The calibration file: what is saved is what is loaded, and what is wrong with one is said in a line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.cli.calibration_out import save_calibration
from dnb_edge.config.calibration_file import calibration_file, load_calibration, reference_picture
from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.calibration import Calibration, CalibrationMethod, InputFile
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.pose import CameraPose

LENS = Lens(
    model=LensModel.PINHOLE, fx_px=901.25, fy_px=903.5, cx_px=633.1, cy_px=352.9,
    distortion=(-0.21, 0.043, 1e-05, -0.0004, 0.0), width_px=1280, height_px=720,
)  # fmt: skip
PICTURE = InputFile(name="a.png", sha256="f" * 64)
COVARIANCE = tuple(tuple(1e-09 * (i == j) / (1 + i) for j in range(9)) for i in range(9))
CALIBRATION = Calibration(
    ground=GroundMap(
        camera_to_twin=(2.4, 0.6, -741.7, 0.2, 3.47, -300.1, 1e-4, 2.5e-3, 0.4),
        scale=TwinScale(metres_per_px=0.0015, height_px=2540.0),
        width_px=1280, height_px=720, camera_m=(1.4, -0.3, 2.3), lens=LENS,
    ),
    covariance=COVARIANCE,
    error=CalibrationError(
        per_point_px=(1.0, 2.5, 0.25), mean_px=1.25, sum_px=3.75, max_px=2.5, leave_one_out_mean_px=None, mean_m=0.002,
    ),
    method=CalibrationMethod.KEYPOINTS,
    pose=CameraPose(position_m=(1.4, -0.3, 2.3), focal_px=901.25, pitch_deg=58.0),
    camera_id="usb-Überwachung_1080p-0001",
    made_at="2026-11-23T05:00:00+00:00",
    inputs=(InputFile(name="keypoints.yaml", sha256="0" * 64),),
    notes=("keypoint 7 lies 38 px from where the others put it",),
)  # fmt: skip


def stored(path: Path, calibration: Calibration) -> Path:
    path.write_bytes(calibration_file(calibration))
    return path


@pytest.mark.parametrize(
    "changed",
    [
        lambda c: c,
        lambda c: replace(c, ground=replace(c.ground, lens=None, camera_m=None), pose=None, covariance=None, camera_id=None),
        lambda c: replace(c, method=CalibrationMethod.MARKERS, notes=(), inputs=(), reference=PICTURE),
    ],
    ids=["whole", "bare", "markers"],
)  # fmt: skip
def test_what_is_saved_is_what_is_loaded(changed: Callable[[Calibration], Calibration], tmp_path: Path) -> None:
    """Bit for bit, with and without lens, pose, covariance, identity and reference picture."""
    calibration = changed(CALIBRATION)
    assert load_calibration(stored(tmp_path / "c.yaml", calibration)) == calibration


@given(numbers=st.lists(st.floats(-1e9, 1e9, allow_subnormal=True), min_size=8, max_size=8))
def test_any_homography_survives_the_file(numbers: list[float], tmp_path_factory: pytest.TempPathFactory) -> None:
    """Numbers of any size go through YAML unchanged, such as 1e-05, which YAML itself would take for text."""
    a, b, c, d, e, f, g, h = numbers
    matrix = (a, b, c, d, e, f, g, h, 1.0)
    with np.errstate(all="ignore"):
        determinant = np.linalg.det(np.array(matrix).reshape(3, 3))
    if not abs(determinant) >= 1e-6:
        return
    try:
        ground = replace(CALIBRATION.ground, camera_to_twin=matrix)
    except InputError:
        return
    path = stored(tmp_path_factory.mktemp("file") / "c.yaml", replace(CALIBRATION, ground=ground))
    assert load_calibration(path).ground.camera_to_twin == matrix


def test_the_picture_of_the_view_goes_with_it(tmp_path: Path) -> None:
    """Saved beside the file without loss; a picture that was exchanged or left behind is refused by name."""
    picture = np.random.default_rng(1).integers(0, 255, (72, 128, 3), dtype=np.uint8)
    saved = save_calibration(tmp_path / "view.yaml", CALIBRATION, picture)
    path = tmp_path / "view.yaml"
    assert load_calibration(path) == saved
    again = reference_picture(path, saved)
    assert again is not None
    assert np.array_equal(again, picture)
    (tmp_path / "view.reference.png").write_bytes(b"another")
    with pytest.raises(InputError, match=r"view\.reference\.png: not the picture"):
        reference_picture(path, saved)
    (tmp_path / "view.reference.png").unlink()
    with pytest.raises(InputError, match=r"view\.reference\.png: cannot read"):
        reference_picture(path, saved)


@pytest.mark.parametrize(
    ("find", "put", "says"),
    [
        ("format: dnb-edge calibration", "format: something", "not a calibration file"),
        ("version: 1", "version: 9", "version 9, known is 1"),
        ("method: keypoints", "method: guess", "method: "),
        ("width_px: 1280", "width_px: 0", "camera.width_px: "),
        ("homography:", "homografy:", "homography: is missing"),
        ("mean_px: 1.25", "mean_px: small", "error.mean_px: "),
        ("model: pinhole", "model: mirror", "lens.model: "),
        ("distortion: [-0.21, 0.043, 1.0e-05, -0.0004, 0.0]", "distortion: [-0.9, 0.0, 0.0, 0.0]", "folds the picture"),
        ("distortion: [-0.21, 0.043, 1.0e-05, -0.0004, 0.0]", "distortion: [0.1]", "1 distortion coefficients"),
        ("- [1.0e-09, 0.0,", "- [.inf, 0.0,", "covariance"),
        ("method: keypoints", "method: keypoints\ncolour: red", "colour: unknown key"),
        ("method: keypoints", "method: [", "not a calibration file"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line_with_file_and_key(find: str, put: str, says: str, tmp_path: Path) -> None:
    """A file that was edited or damaged is refused whole, with the place that is wrong and what to do."""
    text = calibration_file(CALIBRATION).decode()
    assert find in text
    path = tmp_path / "view.yaml"
    path.write_text(text.replace(find, put, 1))
    with pytest.raises(InputError) as caught:
        load_calibration(path)
    assert str(caught.value).startswith(str(path))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_or_foreign_file_is_named(tmp_path: Path) -> None:
    """No such file, and bytes that are no text."""
    with pytest.raises(InputError, match="cannot read the calibration"):
        load_calibration(tmp_path / "none.yaml")
    (tmp_path / "noise.yaml").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="not a calibration file"):
        load_calibration(tmp_path / "noise.yaml")


def test_another_camera_or_shape_is_refused_with_the_reason() -> None:
    """The same camera at another size of the same mode is converted; another camera or aspect ratio is not."""
    same = CALIBRATION.for_camera(width_px=1920, height_px=1080, camera_id=CALIBRATION.camera_id)
    assert same.point_to_track_m((960.0, 810.0)) == pytest.approx(
        CALIBRATION.ground.point_to_track_m((640.0, 540.0)), abs=1e-9
    )
    assert CALIBRATION.for_camera(width_px=1280, height_px=720, camera_id=None) == CALIBRATION.ground
    with pytest.raises(InputError, match="made with the camera usb-Überwachung_1080p-0001, this one is usb-other"):
        CALIBRATION.for_camera(width_px=1280, height_px=720, camera_id="usb-other")
    with pytest.raises(InputError, match="frames are 640x480, the view was calibrated on pictures of 1280x720"):
        CALIBRATION.for_camera(width_px=640, height_px=480, camera_id=None)


def test_the_sigma_at_a_place_is_that_of_many_maps_drawn_at_random() -> None:
    """First-order propagation agrees with a thousand homographies drawn from the covariance, through the lens, at two sizes."""
    rng = np.random.default_rng(5)
    at = np.array([[300.0, 400.0], [900.0, 650.0]])
    spread = rng.normal(size=(4000, 9)) * np.sqrt(np.diag(np.array(COVARIANCE)))
    u, v = CALIBRATION.ground.to_ideal_px(at).T
    x, y, w = np.einsum(
        "nij,jk->ink",
        (np.array(CALIBRATION.ground.camera_to_twin) + spread).reshape(-1, 3, 3),
        np.vstack((u, v, [1, 1])),
    )
    metres = np.stack((x / w, -y / w), axis=-1) * 0.0015
    drawn = np.sqrt(metres.var(axis=0).sum(axis=-1))
    assert CALIBRATION.sigma_m(at) == pytest.approx(drawn, rel=0.05)
    half = CALIBRATION.scaled_to(640, 360)
    assert half.sigma_m(at / 2) == pytest.approx(CALIBRATION.sigma_m(at), rel=1e-6)
