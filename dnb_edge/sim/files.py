"""The demo's input files: what a user would have made by hand, written from the rig.

Knows which files and numbers a configuration needs. Knows no configuration format.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.errors import InputError, WorkError
from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import LANE_HSV, METRES_PER_PX, Circuit, draw_twin, start_line_px
from dnb_edge.sim.rig import Rig, border_marks
from dnb_edge.values import PointPx


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoFiles:
    """Paths and numbers for the demo's configuration."""

    twin: Path
    """PNG of the digital twin."""
    camera_keypoints: Path
    """.npy, (n, 2) float64, camera px."""
    twin_keypoints: Path
    """.npy, (n, 2) float64, twin px, in the same order."""
    keypoints_image_size_px: tuple[int, int]
    """(width, height) of the picture that the camera keypoints belong to."""
    lane_hsv: tuple[float, float, float]
    """The lane's colour on the twin: hue in degrees, saturation and value in percent."""
    lane_width_m: float
    metres_per_px: float
    measured_from_px: PointPx
    """One end of a line that was measured on the floor, twin px: the start line's."""
    measured_to_px: PointPx
    measured_length_m: float
    start_line_px: tuple[PointPx, PointPx]
    """(start, end) of the directed start line, twin px; laps cross it forward."""


def demo_files(directory: Path, rig: Rig) -> DemoFiles:
    """Write the twin and the keypoints of `rig` into `directory`, as `course_files` does."""
    return course_files(directory, rig.circuit, rig.camera)


def course_files(directory: Path, circuit: Circuit, camera: PinholeCamera) -> DemoFiles:
    """Write the twin and the keypoints of a circuit under a camera into `directory` (made where it is missing).

    Raises `InputError` where that directory cannot be used, `WorkError` where the disk refuses.
    """
    camera_px, twin_px = border_marks(circuit, camera)
    start_line = start_line_px(circuit)
    from_px, to_px = (0.0, start_line[0][1]), (circuit.twin_size_px[0] - 1.0, start_line[0][1])
    files = DemoFiles(
        twin=directory / "twin.png",
        camera_keypoints=directory / "keypoints_camera.npy",
        twin_keypoints=directory / "keypoints_twin.npy",
        keypoints_image_size_px=(camera.width_px, camera.height_px),
        lane_hsv=LANE_HSV,
        lane_width_m=circuit.lane_width_m,
        metres_per_px=METRES_PER_PX,
        measured_from_px=from_px,
        measured_to_px=to_px,
        measured_length_m=(to_px[0] - from_px[0]) * METRES_PER_PX,
        start_line_px=start_line,
    )
    encoded, png = cv2.imencode(".png", draw_twin(circuit))
    assert encoded
    try:
        directory.mkdir(parents=True, exist_ok=True)
        files.twin.write_bytes(png.tobytes())
        np.save(files.camera_keypoints, camera_px)
        np.save(files.twin_keypoints, twin_px)
    except OSError as error:
        kind = WorkError if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO) else InputError
        raise kind(f"{directory}: cannot write the demo's files there: {error.strerror}") from error
    return files
