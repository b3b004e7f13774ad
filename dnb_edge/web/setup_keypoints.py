"""What the draft's keypoints come to: the map, each point's error, which are wrong, where to click next, and the sigma map.

Knows the draft and `view`'s findings, which are those of `dnb-edge calibrate keypoints`. Knows no request and no page.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import BgrImage, PointPx, Points
from dnb_edge.view.findings import Found, find
from dnb_edge.view.fit import CLICK_SIGMA_PX, TWIN_SIGMA_PX, weighted_points
from dnb_edge.view.gate import ErrorLimit, check
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.outliers import find_swap
from dnb_edge.web.setup_draft import Draft

FEWEST = 4
SOURCE = "keypoints"
_LANE_POINTS = 240


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KeypointsFound:
    """The map of the draft's whole pairs, or why there is none."""

    pairs: KeypointPairs | None = None
    found: Found | None = None
    fault: str | None = None
    swapped: tuple[str, ...] = ()
    """Names of two keypoints that seem exchanged."""
    over_limit: str | None = None
    """Why laps would not be scored; None where they would."""


def keypoints_of(draft: Draft, scale: TwinScale | None, track: Track | None) -> KeypointsFound:
    """What the pairs that are clicked on both sides tell. `track`: where its scale is known."""
    whole = [pair for pair in draft.pairs if pair.camera_px is not None and pair.twin_px is not None]
    if draft.photo is None or draft.twin is None or len(whole) < FEWEST:
        return KeypointsFound()
    size_px = draft.photo.width_px, draft.photo.height_px
    try:
        pairs = KeypointPairs(
            camera_px=tuple(pair.camera_px for pair in whole if pair.camera_px is not None),
            twin_px=tuple(pair.twin_px for pair in whole if pair.twin_px is not None),
            names=tuple(pair.name for pair in whole),
            source=SOURCE,
            image_size_px=size_px,
        )
    except InputError as error:
        return KeypointsFound(fault=_for_pages(str(error)))
    metres_per_px = None if scale is None else scale.metres_per_px
    in_scale = scale or TwinScale(metres_per_px=1.0, height_px=float(draft.twin.height_px))
    try:
        found = find(
            pairs,
            in_scale,
            size_px=size_px,
            say=_say_mm if scale is not None else _say_px,
            track=track if scale is not None else None,
            metres_per_px=metres_per_px,
        )
    except InputError as error:
        return KeypointsFound(pairs=pairs, fault=_for_pages(str(error)), swapped=_swapped(pairs))
    limit = ErrorLimit(mean_m=draft.limit_mm / 1000.0)
    # The map that the box would use, and so its error, is the most likely one.
    over = None if scale is None else check(found.fit.calibration.error, limit)
    return KeypointsFound(pairs=pairs, found=found, over_limit=over)


def lane_in_camera(ground: GroundMap, track: Track) -> tuple[tuple[PointPx, ...], ...]:
    """The lane's edges and its middle as the camera sees them: polylines, camera px, broken where it does not."""
    line = track.centreline
    step = max(1, len(line.points_m) // _LANE_POINTS)
    chosen = [*range(0, len(line.points_m), step), *([0] if line.closed else [])]
    found: list[tuple[PointPx, ...]] = []
    for side in (0.0, 1.0, -1.0):
        run: list[PointPx] = []
        for k in chosen:
            half_m = line.half_left_m[k] if side > 0 else line.half_right_m[k]
            seen = ground.point_to_camera_px(line.point_at(float(line.s_m[k]), side * float(half_m)))
            if seen is not None and _near(seen, ground):
                run.append((round(seen[0], 1), round(seen[1], 1)))
                continue
            found += [tuple(run)] if len(run) > 1 else []
            run = []
        found += [tuple(run)] if len(run) > 1 else []
    return tuple(found)


def sigma_picture(found: KeypointsFound, track: Track | None, twin: BgrImage, photo: BgrImage) -> bytes:
    """The map of the position's sigma as PNG. Raises `InputError` where the keypoints make no map."""
    from dnb_edge.report.sigma_map import SigmaMap, sigma_map_picture  # noqa: PLC0415 Matplotlib is slow to import

    if found.found is None or found.pairs is None:
        raise InputError(f"{SOURCE}: make no map yet: {found.fault or 'click at least four pairs'}")
    fit = found.found.fit
    in_metres = found.found.plain.mean_m is not None
    return sigma_map_picture(
        SigmaMap(
            calibration=fit.calibration,
            pairs=found.pairs,
            wrong=(*(outlier.name for outlier in fit.outliers), *fit.suspects),
            track=track if in_metres else None,
            twin=twin,
            picture=photo,
            unit="mm" if in_metres else "twin px",
            per_metre=1000.0 if in_metres else 1.0,
        )
    )


def residuals_px(found: Found, pairs: KeypointPairs) -> Points:
    """(n, 2), twin px: where the most likely map puts each click, for arrows from the keypoint."""
    ground = found.fit.calibration.ground
    clicked = pairs.camera_array()
    seen = ground.sees_ground(clicked)
    put = pairs.twin_array()
    if seen.any():
        put[seen] = ground.scale.to_twin_px(ground.to_track_m(clicked[seen]))
    return np.asarray(put)


def words(sentences: tuple[str, ...]) -> tuple[str, ...]:
    """Sentences of `view` for people at a page: without the command line's options, with a capital and a full stop."""
    told = [_for_pages(text) for text in sentences]
    return tuple(text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".") for text in told)


def _swapped(pairs: KeypointPairs) -> tuple[str, ...]:
    points = weighted_points(pairs, None, click_sigma_px=CLICK_SIGMA_PX, twin_sigma_px=TWIN_SIGMA_PX)
    swap = find_swap(points)
    return () if swap is None else (pairs.names[swap.first], pairs.names[swap.second])


def _near(camera_px: PointPx, ground: GroundMap) -> bool:
    """Whether a place is in the picture or about as near to it as the picture is large."""
    u, v = camera_px
    return -ground.width_px < u < 2 * ground.width_px and -ground.height_px < v < 2 * ground.height_px


def _for_pages(text: str) -> str:
    text = re.sub(r",? or leave it out with --without .*$", ", or delete it", text)
    text = text.replace(" (calibrate lens) and give --lens", " at the command line (dnb-edge calibrate lens)")
    return text.removeprefix(f"{SOURCE}: ")


def _say_mm(length_m: float) -> str:
    value = length_m * 1000.0
    return f"{value:.{1 if value < 10 else 0}f} mm"


def _say_px(length_m: float) -> str:
    return f"{length_m:.{1 if length_m < 10 else 0}f} twin px"
