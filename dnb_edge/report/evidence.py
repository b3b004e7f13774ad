"""What an incident looked like: the recorded picture nearest to its worst moment, cut out round the car.

Knows incidents and recorded pictures; knows no recording and no page.
"""

from __future__ import annotations

import heapq
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import cv2
import numpy as np

from dnb_edge.values import BgrImage, Frame, Incident, PointPx

NEAR_S = 0.5
"""A picture further from the moment than this shows something else, seconds."""

MOST = 48
"""So many incidents get a picture: those in which the car was farthest off, or which lasted longest."""

SHARE = 0.22
"""Width of the cut-out as a share of the picture's width."""

WIDTH_PX = 320
"""Width of a thumbnail."""

_JPEG_QUALITY = 80
_RING = (0, 140, 255)


def thumbnails(incidents: Sequence[Incident], frames: Iterable[Frame]) -> Mapping[tuple[int, int], bytes]:
    """JPEG thumbnails by (car, number) of the incident, of those of which a picture was kept near their worst moment.

    `frames` are looked through once, in their order; of each incident the nearest picture is decoded, no other. Where there are
    more than `MOST` incidents, the lesser ones get none.
    """
    placed = [one for one in incidents if one.camera_px is not None]
    wanted = sorted(heapq.nlargest(MOST, placed, key=_weight), key=_worst_t_ns)
    nearest: dict[tuple[int, int], tuple[int, Frame]] = {}
    for frame in frames if wanted else ():
        for one in _near(wanted, frame.t_ns):
            away_ns = abs(frame.t_ns - one.worst_t_ns)
            key = (one.car, one.number)
            if key not in nearest or away_ns < nearest[key][0]:
                nearest[key] = (away_ns, frame)
    found = {}
    for one in wanted:
        kept = nearest.get((one.car, one.number))
        image = None if kept is None else _decoded(kept[1])
        if image is not None and one.camera_px is not None:
            found[one.car, one.number] = _cut_out(image, one.camera_px)
    return MappingProxyType(found)


def _weight(incident: Incident) -> tuple[float, float]:
    return incident.greatest_m or 0.0, incident.lasted_s


def _worst_t_ns(incident: Incident) -> int:
    return incident.worst_t_ns


def _near(incidents: Sequence[Incident], t_ns: int) -> Sequence[Incident]:
    """Those whose worst moment is no further from `t_ns` than `NEAR_S`, of incidents in the order of that."""
    away_ns = round(NEAR_S * 1e9)
    first = bisect_left(incidents, t_ns - away_ns, key=_worst_t_ns)
    return incidents[first : bisect_right(incidents, t_ns + away_ns, key=_worst_t_ns)]


def thumbnail(frame: Frame, camera_px: PointPx) -> bytes | None:
    """What is round `camera_px` in `frame`, as JPEG, with a ring round the point; None where the frame cannot be decoded."""
    image = _decoded(frame)
    return None if image is None else _cut_out(image, camera_px)


def _decoded(frame: Frame) -> BgrImage | None:
    """The picture; None where its bytes are none."""
    if frame.bgr is not None:
        return frame.bgr
    decoded = cv2.imdecode(np.frombuffer(frame.jpeg or b"", dtype=np.uint8), cv2.IMREAD_COLOR)
    return None if decoded is None else np.asarray(decoded, dtype=np.uint8)


def _cut_out(image: BgrImage, camera_px: PointPx) -> bytes:
    """The surroundings of `camera_px`, kept inside the picture, with a ring round the point."""
    height_px, width_px = image.shape[:2]
    wide = max(16, min(width_px, round(SHARE * width_px)))
    high = max(12, min(height_px, round(0.75 * wide)))
    left = int(np.clip(round(camera_px[0] - wide / 2), 0, width_px - wide))
    top = int(np.clip(round(camera_px[1] - high / 2), 0, height_px - high))
    scale = WIDTH_PX / wide
    small = cv2.resize(
        image[top : top + high, left : left + wide], (WIDTH_PX, round(high * scale)), interpolation=cv2.INTER_AREA
    )
    middle = (round((camera_px[0] - left + 0.5) * scale - 0.5), round((camera_px[1] - top + 0.5) * scale - 0.5))
    cv2.circle(small, middle, 10, _RING, 2, lineType=cv2.LINE_AA)
    done, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    assert done, "an 8-bit picture can be encoded"
    return jpeg.tobytes()
