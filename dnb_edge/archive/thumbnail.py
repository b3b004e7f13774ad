"""A small picture of a run for lists: its track with the path of one lap. Drawn, never taken from a camera.

Knows tracks and paths; knows no recording and no page. Colours are the pages' own, on a dark ground in either theme.
"""

from __future__ import annotations

import cv2
import numpy as np

from dnb_edge.track.model import Track
from dnb_edge.values import BgrImage, Points

WIDTH_PX = 480
HEIGHT_PX = 270
_MARGIN_PX = 22.0
_SHIFT = 4
_QUALITY = 85

_GROUND = (19, 17, 15)
_LANE = (71, 64, 58)
_MIDDLE = (140, 131, 123)
_LINE = (234, 240, 242)
_PATH = (255, 183, 116)


def track_picture(track: Track | None, path_m: Points | None) -> bytes:
    """JPEG of `track` with the path (n, 2), track m, over it; an empty ground where neither is known."""
    image: BgrImage = np.full((HEIGHT_PX, WIDTH_PX, 3), _GROUND, dtype=np.uint8)
    shown = [
        points for points in ((None if track is None else track.centreline.points_m), path_m) if points is not None
    ]
    shown = [points for points in shown if len(points)]
    if shown:
        _draw(image, track, path_m, np.vstack(shown))
    done, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    assert done, "an 8-bit picture can be encoded"
    return jpeg.tobytes()


def _draw(image: BgrImage, track: Track | None, path_m: Points | None, shown_m: Points) -> None:
    half_m = 0.0
    if track is not None:
        half_m = float(max(np.max(track.centreline.half_left_m), np.max(track.centreline.half_right_m)))
    low, high = shown_m.min(axis=0) - half_m, shown_m.max(axis=0) + half_m
    size_m = np.maximum(high - low, 1e-6)
    scale = float(min((WIDTH_PX - 2 * _MARGIN_PX) / size_m[0], (HEIGHT_PX - 2 * _MARGIN_PX) / size_m[1]))
    middle_m = (low + high) / 2

    def px(points_m: Points) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
        u = WIDTH_PX / 2 + (points_m[:, 0] - middle_m[0]) * scale
        v = HEIGHT_PX / 2 - (points_m[:, 1] - middle_m[1]) * scale
        return np.round(np.column_stack([u, v]) * (1 << _SHIFT)).astype(np.int32)

    if track is not None:
        route, closed = [px(track.centreline.points_m)], track.centreline.closed
        cv2.polylines(image, route, closed, _LANE, max(3, round(2 * half_m * scale)), cv2.LINE_AA, _SHIFT)
        cv2.polylines(image, route, closed, _MIDDLE, 1, cv2.LINE_AA, _SHIFT)
        for line in track.lines:
            cv2.polylines(image, [px(np.array([line.start_m, line.end_m]))], False, _LINE, 2, cv2.LINE_AA, _SHIFT)  # noqa: FBT003 OpenCV takes it so
    if path_m is not None and len(path_m) > 1:
        cv2.polylines(image, [px(path_m)], False, _PATH, 2, cv2.LINE_AA, _SHIFT)  # noqa: FBT003 OpenCV takes it so
