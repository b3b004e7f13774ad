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
from dnb_edge.sim.circuit import LANE_HSV, LANE_WIDTH_M, METRES_PER_PX
from dnb_edge.sim.rig import Rig
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
    """Write the twin and the keypoints of `rig` into `directory` (made where it is missing).

    Raises `InputError` where that directory cannot be used, `WorkError` where the disk refuses.
    """
    camera_px, twin_px = rig.keypoint_pairs()
    start_line = rig.start_line_px
    from_px, to_px = (0.0, start_line[0][1]), (1199.0, start_line[0][1])
    files = DemoFiles(
        twin=directory / "twin.png",
        camera_keypoints=directory / "keypoints_camera.npy",
        twin_keypoints=directory / "keypoints_twin.npy",
        keypoints_image_size_px=(rig.camera.width_px, rig.camera.height_px),
        lane_hsv=LANE_HSV,
        lane_width_m=LANE_WIDTH_M,
        metres_per_px=METRES_PER_PX,
        measured_from_px=from_px,
        measured_to_px=to_px,
        measured_length_m=(to_px[0] - from_px[0]) * METRES_PER_PX,
        start_line_px=start_line,
    )
    encoded, png = cv2.imencode(".png", rig.twin)
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
