"""Pictures from frames: JPEG to blue-green-red.

Knows JPEG as cameras send it. Knows no source and no detector.
"""

from __future__ import annotations

import cv2
import numpy as np

from dnb_edge.values import BgrImage, Frame

_FLAGS = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}


def decode_bgr(frame: Frame, *, reduce: int = 1) -> BgrImage | None:
    """The picture of `frame`, shape (height, width, 3); both divided by `reduce` (1, 2, 4 or 8), rounded up.

    None where the JPEG cannot be decoded, is cut off or of another size than the frame says: count it and go on, since
    cameras on long USB cables send such frames now and then. Wrong bits inside a whole JPEG give a wrong picture.
    """
    if reduce not in _FLAGS:
        raise ValueError(f"reduce must be 1, 2, 4 or 8, not {reduce}")
    size = (-(-frame.height_px // reduce), -(-frame.width_px // reduce))
    if frame.bgr is not None:
        if reduce == 1:
            return frame.bgr
        return np.asarray(cv2.resize(frame.bgr, (size[1], size[0]), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    assert frame.jpeg is not None
    if not is_whole_jpeg(frame.jpeg):
        return None
    picture = cv2.imdecode(np.frombuffer(frame.jpeg, dtype=np.uint8), _FLAGS[reduce] | cv2.IMREAD_IGNORE_ORIENTATION)
    if picture is None or picture.shape[:2] != size:
        return None
    return np.asarray(picture, dtype=np.uint8)


def is_whole_jpeg(jpeg: bytes) -> bool:
    """Starts with SOI and ends with EOI, apart from the zeros with which some cameras pad. Some versions of the decoder fill
    a picture that was cut off with grey and say nothing."""
    return jpeg[:2] == b"\xff\xd8" and jpeg.rstrip(b"\0")[-2:] == b"\xff\xd9"
