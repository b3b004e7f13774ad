"""The picture that was taken when the view was calibrated, as a source's frames would show it.

Knows where the configuration keeps it. Knows nothing of what it is compared with.
"""

from __future__ import annotations

import cv2
import numpy as np

from dnb_edge.config.calibration_file import load_calibration, reference_picture
from dnb_edge.config.schema import ViewConfig
from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, SourceInfo


def calibrated_picture(view: ViewConfig, info: SourceInfo) -> BgrImage | None:
    """The picture that was taken when the view was calibrated, in the size of the source's frames; None where none was kept."""
    if view.calibration is None:
        return None
    picture = reference_picture(view.calibration, load_calibration(view.calibration))
    return None if picture is None else in_size(picture, info.width_px, info.height_px, name=str(view.calibration))


def in_size(picture: BgrImage, width_px: int, height_px: int, *, name: str) -> BgrImage:
    """The picture in the size of the frames. Raises `InputError` naming it where its aspect ratio is another."""
    height, width = picture.shape[:2]
    if abs(height * width_px / width - height_px) >= 2.0:
        raise InputError(
            f"{name}: its picture is {width}x{height}, frames are {width_px}x{height_px}: use the same camera"
        )
    if (width, height) == (width_px, height_px):
        return picture
    way = cv2.INTER_AREA if width > width_px else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, (width_px, height_px), interpolation=way), dtype=np.uint8)
