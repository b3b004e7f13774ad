"""What was told of one drive against what was true: laps, crossings, ground points and scores, as plain numbers.

Knows events and truth. Its results are plain JSON types, so that a campaign can keep them and go on another day. Knows no
statistics over several drives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.score.similarity import score_lap
from dnb_edge.track.model import START_LINE
from dnb_edge.truth.watch import Watched
from dnb_edge.values import Crossing, Direction, Lap, Observation

SAME_CROSSING_S = 0.3
"""A told crossing farther than this from every true one is of none."""

POSITIONS = 400
"""Ground points of a drive whose errors are kept, evenly over it."""


def measured(watched: Watched, *, series: bool) -> dict[str, Any]:
    """One drive's results. With `series`, every frame's error in stated sigmas too."""
    crossings = [
        event
        for event in watched.events
        if isinstance(event, Crossing) and event.line == START_LINE and event.direction is Direction.FORWARD
    ]
    told_laps = [event for event in watched.events if isinstance(event, Lap)]
    laps, phantom = _laps(watched, told_laps)
    errors = _ground_errors(watched)
    result: dict[str, Any] = {
        "laps_true": len(watched.crossings_s) - 1,
        "laps_told": len(told_laps),
        "phantom": phantom,
        "laps": laps,
        "crossings": _crossings(watched, crossings),
        "frames": watched.frames,
        "found_frames": len(errors["frame"]),
        "position_mm": _rounded(_thinned(np.hypot(errors["along_m"], errors["across_m"]) * 1e3), 3),
    }
    if series:
        result["series"] = {
            "frame": errors["frame"].tolist(),
            "place_m": _rounded(errors["place_m"], 4),
            "along_z": _rounded(errors["along_z"], 4),
            "across_z": _rounded(errors["across_z"], 4),
            "along_mm": _rounded(errors["along_m"] * 1e3, 3),
            "across_mm": _rounded(errors["across_m"] * 1e3, 3),
        }
    return result


def nearest(t_s: float, true_s: Sequence[float], within_s: float) -> int | None:
    """Index of the true instant nearest to `t_s`; None where none is within `within_s`."""
    if not true_s:
        return None
    index = int(np.argmin(np.abs(np.asarray(true_s) - t_s)))
    return index if abs(true_s[index] - t_s) <= within_s else None


def _laps(watched: Watched, told: Sequence[Lap]) -> tuple[list[dict[str, Any]], int]:
    """(each true lap's results, in order; number of told laps that are none of the true ones)."""
    true_s = watched.crossings_s
    of_lap: dict[int, Lap] = {}
    phantom = 0
    for lap in told:
        start = nearest(lap.start_t_ns * 1e-9, true_s, SAME_CROSSING_S)
        end = nearest(lap.end_t_ns * 1e-9, true_s, SAME_CROSSING_S)
        if start is None or end != start + 1 or start in of_lap:
            phantom += 1
        else:
            of_lap[start] = lap
    laps = []
    for k in range(len(true_s) - 1):
        lap_told = of_lap.get(k)
        row: dict[str, Any] = {"lap": k + 1, "true_s": true_s[k + 1] - true_s[k], "told": lap_told is not None}
        if lap_told is not None:
            row |= {
                "error_s": lap_told.time_s - row["true_s"],
                "sigma_s": lap_told.sigma_s,
                "valid": lap_told.valid,
                "reasons": list(lap_told.reasons),
                "suspect": bool(lap_told.suspect),
                "similarity_percent": lap_told.similarity_percent,
                "true_similarity_percent": _true_similarity(watched, k, row["true_s"]),
            }
        laps.append(row)
    return laps, phantom


def _true_similarity(watched: Watched, lap: int, time_s: float) -> float:
    setup = watched.course.setup
    score = score_lap(
        np.array(watched.true_paths_m[lap]),
        setup.track.centreline,
        setup.score,
        lap=lap + 1,
        completion_time_s=time_s,
        lap_route_m=setup.track.lap_route_m(),
    )
    return score.similarity_percent


def _crossings(watched: Watched, told: Sequence[Crossing]) -> list[dict[str, Any]]:
    rows = []
    for crossing in told:
        t_s = crossing.t_ns * 1e-9
        k = nearest(t_s, watched.crossings_s, SAME_CROSSING_S)
        if k is not None:
            rows.append(
                {
                    "crossing": k,
                    "error_s": t_s - watched.crossings_s[k],
                    "sigma_s": crossing.sigma_s,
                    "estimated": crossing.estimated,
                }
            )
    return rows


def _ground_errors(watched: Watched) -> dict[str, NDArray[Any]]:
    """Errors of the observed ground points along and across the way, metres and in stated sigmas, frame by frame."""
    index = {int(t_ns): k for k, t_ns in enumerate(watched.at.t_ns.tolist())}
    rows: dict[int, tuple[float, ...]] = {}
    for event in watched.events:
        if not isinstance(event, Observation) or event.t_ns not in index:
            continue
        k = index[event.t_ns]
        heading = float(watched.at.heading_rad[k])
        ahead = (math.cos(heading), math.sin(heading))
        x, y = event.track_m[0] - float(watched.at.track_m[k, 0]), event.track_m[1] - float(watched.at.track_m[k, 1])
        along, across = x * ahead[0] + y * ahead[1], y * ahead[0] - x * ahead[1]
        xx, xy, yy = event.covariance_m2
        along_sigma = math.sqrt(ahead[0] ** 2 * xx + 2 * ahead[0] * ahead[1] * xy + ahead[1] ** 2 * yy)
        across_sigma = math.sqrt(ahead[1] ** 2 * xx - 2 * ahead[0] * ahead[1] * xy + ahead[0] ** 2 * yy)
        place = watched.along_m[k] % watched.lap_m
        rows[k] = (place, along, across, along / along_sigma, across / across_sigma)
    ordered = sorted(rows)
    table = np.array([rows[k] for k in ordered], dtype=np.float64).reshape(-1, 5)
    names = ("place_m", "along_m", "across_m", "along_z", "across_z")
    return {"frame": np.array(ordered, dtype=np.int64), **{name: table[:, i] for i, name in enumerate(names)}}


def _thinned(values: NDArray[np.float64]) -> NDArray[np.float64]:
    if len(values) <= POSITIONS:
        return values
    return np.asarray(values[np.linspace(0, len(values) - 1, POSITIONS).astype(np.intp)])


def _rounded(values: NDArray[np.float64], digits: int) -> list[float]:
    rounded: list[float] = np.round(values, digits).tolist()
    return rounded
