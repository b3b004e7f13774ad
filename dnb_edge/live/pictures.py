"""Camera pictures for people: the camera's own JPEG bytes where there are such, else made here.

Knows frames and JPEG. Knows no socket and no thread.
"""

from __future__ import annotations

import cv2

from dnb_edge.live.messages import MOST_BLOB_BYTES, Picture
from dnb_edge.values import Frame

QUALITY = 85


def picture_of(frame: Frame) -> Picture | None:
    """`frame` as a message; None where no JPEG can be made of it."""
    jpeg = frame.jpeg
    if jpeg is None:
        assert frame.bgr is not None, "a frame has one of the two"
        done, encoded = cv2.imencode(".jpg", frame.bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        if not done:
            return None
        jpeg = encoded.tobytes()
    if len(jpeg) > MOST_BLOB_BYTES:
        return None
    return Picture(t_ns=frame.t_ns, frame=frame.sequence, width_px=frame.width_px, height_px=frame.height_px, jpeg=jpeg)
