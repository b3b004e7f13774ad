"""How well the twin's lane and the lane in the picture agree under a map.

Knows the twin's lane, a picture in which lane and floor were told apart, and a map. Fits nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Points
from dnb_edge.view.refine_align import Aligned, Scene, in_picture, lane_px, search
from dnb_edge.view.refine_edges import LaneEdges
from dnb_edge.view.refine_look import LanePicture, odds_everywhere
from dnb_edge.view.refine_solve import PlaneToPicture

Floats = NDArray[np.float64]

_WIDTH_PX = 640
"""Overlap is counted on a picture of at most this width."""

_BESIDE = 0.35
"""Share of the lane's width beside it that is looked at; what lies further off may look like lane and is none."""

_NEAR_PX = 2.0
"""At 1280 px across."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Agreement:
    """How a map fits the picture and the keypoints."""

    overlap: float
    """Intersection over union, 0..1, of the twin's lane as the map puts it into the picture and what looks like lane there,
    counted over camera px on the lane or within a third of its width beside it (by either of the maps compared)."""
    edge_share: float
    """Share of the twin's edge points in the picture with an edge of the lane within 2 px (at 1280 px across)."""
    edge_median_px: float
    """Of the distances between the twin's edges and the lane's, across them, where one was found; camera px."""
    edge_median_m: float
    """The same on the floor, metres."""
    edge_p95_m: float
    """95 % of those distances are shorter, metres."""
    keypoints_px: Floats | None = None
    """Shape (k,): how far the map puts each keypoint from where it lies on the twin, twin px; None without keypoints."""
    left_out_px: Floats | None = None
    """Shape (k,): the same by the fit made in the same way without that keypoint; None with fewer than six."""

    def with_keypoints(self, keypoints_px: Floats, left_out_px: Floats | None) -> Agreement:
        """The same with the keypoints' errors."""
        return replace(self, keypoints_px=keypoints_px, left_out_px=left_out_px)


def agreement(scene: Scene, p: Floats, compared: tuple[Floats, ...], aligned: Aligned, scale: TwinScale) -> Agreement:
    """The agreement under the map `p`, one of those `compared`: all are judged over the same camera px, with the same look
    and the same reach for the edges, those of the fit.
    """
    wide_px = lane_px(scene, p)
    found = search(scene, p, aligned.look, aligned.reach_px, wide_px)
    px_per_m = wide_px / (scene.edges.width_px * scale.metres_per_px)
    seen = in_picture(scene.plane.project(p, scene.edges.points_px), aligned.look.size_px)
    off_px = np.abs(found.offset_px[found.found])
    off_m = off_px / px_per_m[found.found]
    if len(off_px) == 0:
        # None within the reach: they are further off than that.
        off_px, off_m = aligned.reach_px, aligned.reach_px / px_per_m
    near = found.found & (np.abs(found.offset_px) <= _NEAR_PX * max(1.0, aligned.look.size_px[0] / 1280.0))
    return Agreement(
        overlap=_overlap(scene.plane, p, compared, scene.edges, aligned.look),
        edge_share=float(near.sum() / max(1, seen.sum())),
        edge_median_px=float(np.median(off_px)),
        edge_median_m=float(np.median(off_m)),
        edge_p95_m=float(np.quantile(off_m, 0.95)),
    )


def _overlap(
    plane: PlaneToPicture, p: Floats, compared: tuple[Floats, ...], edges: LaneEdges, look: LanePicture
) -> float:
    width_px, height_px = look.size_px
    shrink = min(1.0, _WIDTH_PX / width_px)
    width, height = round(width_px * shrink), round(height_px * shrink)
    v, u = np.mgrid[0:height, 0:width]
    # Pixel centres: px u of the small picture lies at (u + 0.5) / shrink - 0.5 of the large one.
    camera = (np.column_stack((u.ravel(), v.ravel())) + 0.5) * (width_px / width, height_px / height) - 0.5
    ideal = camera if plane.lens is None else plane.lens.to_ideal_px(camera)
    reach = round(_BESIDE * edges.width_px)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    padded = cv2.copyMakeBorder(edges.mask.astype(np.uint8), reach, reach, reach, reach, cv2.BORDER_CONSTANT, value=0)
    wide = np.asarray(cv2.dilate(padded, disc), dtype=np.uint8)
    looked = np.zeros((height, width), dtype=np.bool_)
    for other in compared:
        looked |= _seen(plane, other, ideal, wide, shift=reach).reshape(height, width)
    drawn = _seen(plane, p, ideal, edges.mask.astype(np.uint8), shift=0).reshape(height, width)
    laid = odds_everywhere(look, width_px=width, height_px=height) > 0
    either = looked & (drawn | laid)
    return float((drawn & laid & looked).sum() / max(1, either.sum()))


def _seen(
    plane: PlaneToPicture, p: Floats, ideal_px: Points, mask: NDArray[np.uint8], *, shift: int
) -> NDArray[np.bool_]:
    """`mask`, twin px moved by `shift`, at ideal px (n, 2)."""
    homogeneous = np.column_stack((ideal_px, np.ones(len(ideal_px)))) @ plane.camera_to_twin(p).T
    ahead = homogeneous[:, 2] > 0
    twin = homogeneous[:, :2] / np.where(ahead, homogeneous[:, 2], 1.0)[:, None] + shift
    height, width = mask.shape
    at = np.rint(np.clip(twin, -1.0, max(width, height) + 1.0)).astype(np.int64)
    inside = ahead & (at >= 0).all(axis=1) & (at < (width, height)).all(axis=1)
    return np.asarray(inside & (mask[np.clip(at[:, 1], 0, height - 1), np.clip(at[:, 0], 0, width - 1)] > 0))
