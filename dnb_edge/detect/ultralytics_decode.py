"""From a frame to the input of a network made by Ultralytics, and from its answer to boxes in the frame. Pure.

Knows pixels, tensors and overlaps; nothing of files, settings or cars. Written to agree with Ultralytics' own preparation and
non-maximum suppression (NMS) of version 8.4, so that a model finds here what it finds there. Frame coordinates in this module
are *corner px*: the origin is the corner of the top left pixel, not its centre, so a camera px is a corner px less 0.5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.ultralytics_file import Layout
from dnb_edge.values import BgrImage

FloatArray = NDArray[np.float32]

PAD_LEVEL = 114
"""Grey round the picture, 0..255."""
MOST_CANDIDATES = 30_000
CLASS_APART_PX = 7680.0
"""Boxes of different classes are moved as far apart before NMS, so that they do not overlap."""
_CHUNK = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Letterbox:
    """Where a frame lies in the network's input: shrunk or grown evenly, in the middle, grey round it."""

    frame_width_px: int
    frame_height_px: int
    resized_width_px: int
    resized_height_px: int
    left_px: int
    top_px: int
    input_width_px: int
    input_height_px: int

    @property
    def scale_u(self) -> float:
        """Input px a frame px, across."""
        return self.resized_width_px / self.frame_width_px

    @property
    def scale_v(self) -> float:
        """Input px a frame px, down."""
        return self.resized_height_px / self.frame_height_px


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Boxes:
    """Boxes in the frame, strongest first."""

    centres_px: FloatArray
    """(n, 2), corner px of the frame."""
    sizes_px: FloatArray
    """(n, 2): width and height; of a rotated box along its own axes."""
    angles_rad: FloatArray | None
    """(n,): from the picture's u axis to the box's width axis, towards v (clockwise as seen); None for upright boxes."""
    confidences: FloatArray
    """(n,), 0..1."""
    classes: NDArray[np.int64]
    """(n,)"""


def letterbox(layout: Layout, frame_width_px: int, frame_height_px: int) -> Letterbox:
    """Where a frame of this size lies in the network's input.

    With a dynamic input the grey is cut down to what makes each side a multiple of the stride.
    """
    scale = min(layout.height_px / frame_height_px, layout.width_px / frame_width_px)
    width, height = max(1, round(frame_width_px * scale)), max(1, round(frame_height_px * scale))
    spare_u, spare_v = layout.width_px - width, layout.height_px - height
    if layout.dynamic:
        spare_u, spare_v = spare_u % layout.stride_px, spare_v % layout.stride_px
    return Letterbox(
        frame_width_px=frame_width_px,
        frame_height_px=frame_height_px,
        resized_width_px=width,
        resized_height_px=height,
        left_px=round(spare_u / 2 - 0.1),
        top_px=round(spare_v / 2 - 0.1),
        input_width_px=width + spare_u,
        input_height_px=height + spare_v,
    )


def prepare(image: BgrImage, box: Letterbox, dtype: np.dtype[np.floating]) -> NDArray[np.floating]:
    """The network's input (1, 3, h, w) for the frame `image`: red, green, blue, 0..1."""
    size = (box.resized_width_px, box.resized_height_px)
    picture = image if (image.shape[1], image.shape[0]) == size else cv2.resize(image, size)
    below = box.input_height_px - box.resized_height_px - box.top_px
    right = box.input_width_px - box.resized_width_px - box.left_px
    if box.top_px or box.left_px or below or right:
        grey = (PAD_LEVEL, PAD_LEVEL, PAD_LEVEL)
        edges = (box.top_px, below, box.left_px, right)
        picture = cv2.copyMakeBorder(picture, *edges, cv2.BORDER_CONSTANT, value=grey)
    tensor = np.divide(picture[:, :, ::-1].transpose(2, 0, 1), np.float32(255), dtype=np.float32)
    return np.ascontiguousarray(tensor, dtype=dtype)[None]


def decode(
    answer: NDArray[np.floating],
    layout: Layout,
    box: Letterbox,
    *,
    least_confidence: float,
    iou: float,
    classes: Sequence[int] | None,
    most: int,
) -> Boxes:
    """The boxes of an answer of the layout's shape: more than `least_confidence` sure, of one of `classes` (None: of any).

    Where NMS is not inside, a box goes that overlaps a surer one of its class by more than `iou`. At most `most` boxes.
    """
    rotated = layout.task == "obb"
    rows = answer[0].astype(np.float32, copy=False)
    found = (
        _listed(rows, upright=not rotated)
        if layout.nms_inside
        else _candidates(rows, len(layout.names), rotated=rotated)
    )
    kept = (found[:, 4] > np.float32(least_confidence)) & np.isfinite(found).all(axis=1)
    if classes is not None:
        kept &= np.isin(found[:, 5].astype(np.int64), np.asarray(classes, dtype=np.int64))
    found = found[kept]
    found = found[np.argsort(-found[:, 4], kind="stable")[:MOST_CANDIDATES]]
    if not layout.nms_inside:
        found = found[_rotated_nms(found, iou) if rotated else _upright_nms(found, iou, most)]
    return _in_frame(found[:most], box, rotated=rotated)


def _listed(rows: FloatArray, *, upright: bool) -> FloatArray:
    """Rows (centre u, centre v, width, height, confidence, class (, angle)) of an answer with NMS inside.

    Upright boxes come as two corners, rotated ones as centre and size.
    """
    if not upright:
        return rows
    found = rows.copy()
    found[:, :2] = (rows[:, :2] + rows[:, 2:4]) / 2
    found[:, 2:4] = rows[:, 2:4] - rows[:, :2]
    return found


def _candidates(rows: FloatArray, classes: int, *, rotated: bool) -> FloatArray:
    """The same rows of an answer without NMS, one a candidate with its best class."""
    scores = rows[4 : 4 + classes]
    best = scores.argmax(axis=0)
    confidence = np.take_along_axis(scores, best[None], axis=0)
    parts = [rows[:4], confidence, best[None].astype(np.float32)]
    return np.ascontiguousarray(np.concatenate([*parts, rows[4 + classes :]] if rotated else parts).T)


def _upright_nms(found: FloatArray, iou: float, most: int) -> NDArray[np.int64]:
    """The first `most` rows, strongest first, that overlap no kept stronger one of their class by more than `iou`."""
    half = found[:, 2:4] / 2
    apart = found[:, 5:6] * np.float32(CLASS_APART_PX)
    low, high = found[:, :2] - half + apart, found[:, :2] + half + apart
    areas = np.prod(high - low, axis=1)
    waiting = np.arange(len(found))
    kept: list[int] = []
    while waiting.size and len(kept) < most:
        first, rest = waiting[0], waiting[1:]
        kept.append(int(first))
        sides = np.minimum(high[first], high[rest]) - np.maximum(low[first], low[rest])
        shared = np.prod(np.maximum(sides, 0), axis=1)
        # written without a division, which two boxes without area would not survive
        waiting = rest[shared <= np.float32(iou) * (areas[first] + areas[rest] - shared)]
    return np.asarray(kept, dtype=np.int64)


def _rotated_nms(found: FloatArray, iou: float) -> NDArray[np.int64]:
    """Rows, strongest first, that overlap no stronger one of their class, kept or not, by more than `iou`."""
    centres = found[:, :2] + found[:, 5:6] * np.float32(CLASS_APART_PX)
    spreads = _spreads(found[:, 2:4], found[:, 6])
    order = np.arange(len(found))
    kept = np.ones(len(found), dtype=bool)
    for start in range(0, len(found), _CHUNK):  # in chunks, so that thousands of candidates need no gigabytes
        chunk = slice(start, start + _CHUNK)
        overlap = gaussian_overlap(centres, spreads, centres[chunk], spreads[chunk])
        kept[chunk] = ~((overlap > iou) & (order[:, None] < order[chunk][None])).any(axis=0)
    return np.flatnonzero(kept)


def _spreads(sizes: FloatArray, angles: FloatArray) -> FloatArray:
    """Covariances (n, 3), as (uu, vv, uv), of uniform densities over rotated boxes."""
    along, across = sizes[:, 0] ** 2 / 12, sizes[:, 1] ** 2 / 12
    cos, sin = np.cos(angles), np.sin(angles)
    uu, vv = along * cos**2 + across * sin**2, along * sin**2 + across * cos**2
    return np.stack([uu, vv, (along - across) * cos * sin], axis=1).astype(np.float32)


def gaussian_overlap(
    centres_a: FloatArray, spreads_a: FloatArray, centres_b: FloatArray, spreads_b: FloatArray
) -> FloatArray:
    """Overlap (n, m), 0..1, of boxes taken for Gaussians: 1 - Hellinger distance ("ProbIoU", arXiv 2106.06072).

    Centres are (n, 2) and (m, 2), covariances (n, 3) and (m, 3) as (uu, vv, uv).
    """
    tiny = np.float32(1e-7)
    uu, vv, uv = (spreads_a[:, None, k] + spreads_b[None, :, k] for k in range(3))
    du, dv = (centres_a[:, None, k] - centres_b[None, :, k] for k in range(2))
    joint = uu * vv - uv**2
    mahalanobis = (uu * dv**2 + vv * du**2 - 2 * uv * du * dv) / (joint + tiny)
    own_a, own_b = (np.maximum(s[:, 0] * s[:, 1] - s[:, 2] ** 2, 0) for s in (spreads_a, spreads_b))
    own = np.sqrt(own_a[:, None] * own_b[None])
    distance = mahalanobis / 4 + np.log(joint / (4 * own + tiny) + tiny) / 2
    distance = np.clip(distance, tiny, 100.0)
    return np.asarray(1 - np.sqrt(1 - np.exp(-distance) + tiny), dtype=np.float32)


def _in_frame(found: FloatArray, box: Letterbox, *, rotated: bool) -> Boxes:
    """Rows in the network's input as boxes in the frame; upright ones end at its edges."""
    scale = np.array([box.scale_u, box.scale_v], dtype=np.float32)
    centres = (found[:, :2] - np.array([box.left_px, box.top_px], dtype=np.float32)) / scale
    sizes = found[:, 2:4] / scale
    if not rotated:
        edge = np.array([box.frame_width_px, box.frame_height_px], dtype=np.float32)
        low, high = np.clip(centres - sizes / 2, 0, edge), np.clip(centres + sizes / 2, 0, edge)
        centres, sizes = (low + high) / 2, high - low
    return Boxes(
        centres_px=centres,
        sizes_px=sizes,
        angles_rad=found[:, 6] if rotated else None,
        confidences=found[:, 4],
        classes=found[:, 5].astype(np.int64),
    )


def upright_height_px(width_px: float, height_px: float, angle_rad: float) -> float:
    """Vertical extent of a rotated box."""
    return abs(width_px * math.sin(angle_rad)) + abs(height_px * math.cos(angle_rad))
