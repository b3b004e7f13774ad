"""The calibration file: one YAML document with everything that ties one camera in one place to one twin.

Knows YAML and the file's form and version; what the numbers mean is `view.calibration`'s knowledge. Numbers are written by
their shortest round-trip text, so that what is loaded equals what was saved, bit for bit.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Literal

import cv2
import numpy as np
import yaml
from pydantic import Field

from dnb_edge import wire
from dnb_edge.config.document import CameraPart, LensPart, Part, check_format, read_mapping, validated
from dnb_edge.config.sections import Number
from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import BgrImage
from dnb_edge.view.calibration import Calibration, CalibrationMethod, InputFile
from dnb_edge.view.ground import GroundMap, Matrix3
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.lens import Lens
from dnb_edge.view.pose import CameraPose

FILE_FORMAT = "dnb-edge calibration"
FILE_VERSION = 1

_WHAT = "calibration file"
_ANEW = "make one with `dnb-edge calibrate keypoints --out` or `calibrate markers --out`"
_HEAD = """\
# Made by `dnb-edge calibrate`; name it in a configuration as view.calibration. `homography` takes the camera's pixels, freed of
# the lens's distortion where there is a lens, to the twin's pixels. Do not change numbers by hand: calibrate again.
"""

Row3 = tuple[Number, Number, Number]


class _Twin(Part):
    metres_per_px: Number
    height_px: Number


class _Pose(Part):
    position_m: Row3
    focal_px: Number
    pitch_deg: Number


class _Error(Part):
    mean_px: Number
    sum_px: Number
    max_px: Number
    leave_one_out_mean_px: Number | None = None
    per_point_px: tuple[Number, ...]
    mean_m: Number | None = None
    sum_m: Number | None = None
    max_m: Number | None = None
    leave_one_out_mean_m: Number | None = None


class _Input(Part):
    name: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class _File(Part):
    format: Literal["dnb-edge calibration"]
    version: Literal[1]
    made_at: str
    method: Literal["keypoints", "markers", "refined"]
    notes: tuple[str, ...] = ()
    camera: CameraPart
    error: _Error
    pose: _Pose | None
    twin: _Twin
    lens: LensPart | None
    homography: tuple[Row3, Row3, Row3]
    covariance: tuple[tuple[Number, ...], ...] | None
    reference: _Input | None = None
    inputs: tuple[_Input, ...] = ()


def calibration_file(calibration: Calibration) -> bytes:
    """The calibration file's bytes."""
    ground, lens = calibration.ground, calibration.ground.lens
    h = ground.camera_to_twin
    document = {
        "format": FILE_FORMAT,
        "version": FILE_VERSION,
        "made_at": calibration.made_at,
        "method": calibration.method.value,
        "notes": list(calibration.notes),
        "camera": {"id": calibration.camera_id, "width_px": ground.width_px, "height_px": ground.height_px},
        "error": wire.to_dict(calibration.error),
        "pose": None if calibration.pose is None else wire.to_dict(calibration.pose),
        "twin": wire.to_dict(ground.scale),
        "lens": None if lens is None else {key: value for key, value in lens.to_dict().items() if key not in _SIZE},
        "homography": [list(h[0:3]), list(h[3:6]), list(h[6:9])],
        "covariance": None if calibration.covariance is None else [list(row) for row in calibration.covariance],
        "reference": None if calibration.reference is None else wire.to_dict(calibration.reference),
        "inputs": [wire.to_dict(one) for one in calibration.inputs],
    }
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=128, allow_unicode=True)
    return (_HEAD + text).encode()


_SIZE = ("width_px", "height_px")


def load_calibration(path: Path) -> Calibration:
    """The calibration in the file `path`. Raises `InputError` naming the file, and the key at fault."""
    data = read_mapping(path, what=_WHAT, remedy=_ANEW)
    check_format(data, path, what=_WHAT, file_format=FILE_FORMAT, version=FILE_VERSION, remedy=_ANEW)
    file = validated(_File, data, path, remedy=_ANEW)
    size = {"width_px": file.camera.width_px, "height_px": file.camera.height_px}
    try:
        lens = None if file.lens is None else Lens.from_dict(file.lens.model_dump() | size)
        ground = GroundMap(
            camera_to_twin=_flat(file.homography),
            scale=TwinScale(**file.twin.model_dump()),
            camera_m=None if file.pose is None else file.pose.position_m,
            lens=lens,
            width_px=file.camera.width_px,
            height_px=file.camera.height_px,
        )
        return Calibration(
            ground=ground,
            covariance=file.covariance,
            error=CalibrationError(**file.error.model_dump()),
            method=CalibrationMethod(file.method),
            pose=None if file.pose is None else CameraPose(**file.pose.model_dump()),
            camera_id=file.camera.id,
            made_at=file.made_at,
            inputs=tuple(InputFile(**one.model_dump()) for one in file.inputs),
            reference=None if file.reference is None else InputFile(**file.reference.model_dump()),
            notes=file.notes,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def reference_picture(path: Path, calibration: Calibration) -> BgrImage | None:
    """The picture of the view as it was calibrated, from beside the calibration file `path`; None where it has none.

    Raises `InputError` where the picture is missing, damaged or not the one that was saved.
    """
    if calibration.reference is None:
        return None
    beside = path.parent / calibration.reference.name
    try:
        data = beside.read_bytes()
    except OSError as error:
        raise InputError(
            f"{beside}: cannot read the picture of the calibration {path.name} ({error.strerror}): keep both files together"
        ) from error
    if hashlib.sha256(data).hexdigest() != calibration.reference.sha256:
        raise InputError(f"{beside}: not the picture with which {path.name} was saved: calibrate again")
    picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise InputError(f"{beside}: not a picture that OpenCV can read: calibrate again")
    return np.asarray(picture, dtype=np.uint8)


def _flat(rows: tuple[Row3, Row3, Row3]) -> Matrix3:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a, b, c, d, e, f, g, h, i
