"""Photographs for the command line, as the camera's sensor saw them, like frames."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage


def read_photograph(path: Path) -> BgrImage:
    """The picture (h, w, 3) in a file. A note in it on how to turn it (EXIF) is passed over: frames have none, and a map made
    on turned pictures would be another. Raises `InputError` where it cannot be read.
    """
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot read the picture ({error.strerror or error}): check the path") from error
    picture = cv2.imdecode(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION) if len(data) else None
    if picture is None:
        raise InputError(f"{path}: not a picture that OpenCV can read: give a JPEG or PNG")
    return np.asarray(picture, dtype=np.uint8)
