"""From a scenario's drives to its figures: errors, coverage, what was missed, positions, scores, and how errors hang together.

Knows the plain results of `measure`; gives plain JSON types. Knows no limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dnb_edge.truth.statistics import (
    Z95,
    ErrorSeries,
    clustered_mean,
    clustered_share,
    correlation,
    quantiles,
    reliability,
    repeated_share,
    window_variance_ratio,
    without_place,
)

Drives = Sequence[dict[str, Any]]

LEVELS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, Z95, 2.25, 2.5, 2.75, 3.0)
"""Sizes of an error, in stated sigmas, for which it is told how many errors are smaller."""
_BINS = 41
_SIGMA_GROUPS = 6
FIT_WINDOW_S = 0.3
"""Length of the stretch of observations from which a crossing comes, about."""


def scenario_figures(drives: Drives, *, fps: float) -> dict[str, Any]:
    """The figures of all drives of one scenario."""
    laps = [[lap for lap in drive["laps"] if lap["told"]] for drive in drives]
    told = [lap for some in laps for lap in some]
    errors_ms = [1e3 * lap["error_s"] for lap in told]
    z = [lap["error_s"] / lap["sigma_s"] for lap in told]
    covered = clustered_share([[abs(lap["error_s"]) <= Z95 * lap["sigma_s"] for lap in some] for some in laps])
    bias = clustered_mean([[1e3 * lap["error_s"] for lap in some] for some in laps])
    sizes = quantiles(np.abs(errors_ms).tolist())
    return {
        "drives": len(drives),
        "frames": sum(drive["frames"] for drive in drives),
        "laps": sum(drive["laps_true"] for drive in drives),
        "told": sum(drive["laps_told"] for drive in drives),
        "missed": sum(not lap["told"] for drive in drives for lap in drive["laps"]),
        "phantom": sum(drive["phantom"] for drive in drives),
        "not_valid": sum(not lap["valid"] for lap in told),
        "suspect": sum(lap["suspect"] for lap in told),
        "bias_ms": None if bias is None else bias[0],
        "bias_half_width_ms": None if bias is None else bias[1],
        "p50_ms": sizes["p50"],
        "p95_ms": sizes["p95"],
        "max_ms": sizes["max"],
        "rms_ms": _rms(errors_ms),
        "stated_sigma_ms": quantiles([1e3 * lap["sigma_s"] for lap in told])["p50"],
        "z_rms": _rms(z),
        "coverage_percent": None if covered is None else 100 * covered.share,
        "coverage_low_percent": None if covered is None else 100 * covered.low,
        "coverage_high_percent": None if covered is None else 100 * covered.high,
        "coverage_design_effect": None if covered is None else covered.design_effect,
        "reliability": reliability(z, LEVELS) if z else [],
        "by_sigma": _by_sigma(told),
        "histogram": _histogram(errors_ms),
        **_crossing_figures(drives),
        **_position_figures(drives),
        **_score_figures(laps),
        "detector": _detector_figures(drives, fps),
    }


def _rms(values: Sequence[float]) -> float | None:
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else None


def _histogram(errors_ms: Sequence[float]) -> dict[str, Any]:
    """Counts in even bins from -reach to reach, which holds all but the farthest 1 %; those are in the outer bins."""
    if not errors_ms:
        return {"reach_ms": 1.0, "counts": []}
    reach = max(0.5, float(np.percentile(np.abs(errors_ms), 99)))
    counts, _ = np.histogram(np.clip(errors_ms, -reach, reach), bins=_BINS, range=(-reach, reach))
    return {"reach_ms": reach, "counts": counts.tolist()}


def _by_sigma(told: Sequence[dict[str, Any]]) -> list[dict[str, float]]:
    """Laps in groups of like stated sigma: what was stated, and what came of it (rms), ms."""
    ordered = sorted(told, key=lambda lap: float(lap["sigma_s"]))
    groups = np.array_split(np.arange(len(ordered)), min(_SIGMA_GROUPS, max(1, len(ordered) // 5)))
    return [
        {
            "stated_ms": 1e3 * math.sqrt(float(np.mean([ordered[i]["sigma_s"] ** 2 for i in group]))),
            "rms_ms": 1e3 * math.sqrt(float(np.mean([ordered[i]["error_s"] ** 2 for i in group]))),
            "laps": float(len(group)),
        }
        for group in groups
        if len(group)
    ]


def _crossing_figures(drives: Drives) -> dict[str, Any]:
    """Each crossing's own error. What all crossings of a drive have in common does not show in its laps: it is told apart."""
    every = [drive["crossings"] for drive in drives if drive["crossings"]]
    bias = clustered_mean([[1e3 * one["error_s"] for one in some] for some in every])
    means = [float(np.mean([1e3 * one["error_s"] for one in some])) for some in every]
    own = [
        (one["error_s"] - float(np.mean([other["error_s"] for other in some]))) / one["sigma_s"]
        for some in every
        for one in some
        if len(some) > 1
    ]
    return {
        "crossings": sum(len(some) for some in every),
        "crossings_estimated": sum(one["estimated"] for some in every for one in some),
        "crossing_bias_ms": None if bias is None else bias[0],
        "crossing_bias_half_width_ms": None if bias is None else bias[1],
        "crossing_between_drives_ms": float(np.std(means, ddof=1)) if len(means) > 1 else None,
        "crossing_sigma_ms": quantiles([1e3 * one["sigma_s"] for some in every for one in some])["p50"],
        "crossing_z_rms_within_drives": _rms(own),
    }


def _position_figures(drives: Drives) -> dict[str, Any]:
    sizes = quantiles([value for drive in drives for value in drive["position_mm"]])
    return {
        "position_p50_mm": sizes["p50"],
        "position_p95_mm": sizes["p95"],
        "position_max_mm": sizes["max"],
        "found_percent": 100.0 * sum(drive["found_frames"] for drive in drives) / max(1, _frames(drives)),
    }


def _frames(drives: Drives) -> int:
    return sum(int(drive["frames"]) for drive in drives)


def _score_figures(laps: Sequence[Sequence[dict[str, Any]]]) -> dict[str, Any]:
    scored = [[lap for lap in some if lap["similarity_percent"] is not None] for some in laps]
    off = [lap["similarity_percent"] - lap["true_similarity_percent"] for some in scored for lap in some]
    sizes = quantiles(np.abs(off).tolist())
    similarity = clustered_mean([[lap["similarity_percent"] for lap in some] for some in scored])
    time_s = clustered_mean([[lap["true_s"] + lap["error_s"] for lap in some] for some in laps])
    return {
        "score_bias_points": float(np.mean(off)) if off else None,
        "score_p95_points": sizes["p95"],
        "score_max_points": sizes["max"],
        "similarity_percent": None if similarity is None else similarity[0],
        "similarity_half_width_percent": None if similarity is None else similarity[1],
        "lap_s": None if time_s is None else time_s[0],
        "lap_half_width_s": None if time_s is None else time_s[1],
    }


def _detector_figures(drives: Drives, fps: float) -> dict[str, Any] | None:
    """How the detector's errors hang together, along and across the way, in stated sigmas; None for drawn detections."""
    if not drives or any("series" not in drive for drive in drives):
        return None
    frames = max(1, round(FIT_WINDOW_S * fps))
    result: dict[str, Any] = {}
    for axis in ("along", "across"):
        series = [
            ErrorSeries(
                frame=np.array(drive["series"]["frame"], dtype=np.int64),
                place_m=np.array(drive["series"]["place_m"]),
                z=np.array(drive["series"][f"{axis}_z"]),
            )
            for drive in drives
        ]
        every = [value for one in series for value in one.z.tolist()]
        correlations = correlation(series)
        result[axis] = {
            "z_rms": _rms(every),
            "error_rms_mm": _rms([value for drive in drives for value in drive["series"][f"{axis}_mm"]]),
            "mean_mm": float(np.mean([value for drive in drives for value in drive["series"][f"{axis}_mm"]])),
            "autocorrelation": correlations,
            "window_frames": frames,
            "window_variance_ratio": window_variance_ratio(correlations, frames),
            "repeated_share": repeated_share(series),
            "rest": _rest(series, frames),
        }
    return result


def _rest(series: Sequence[ErrorSeries], frames: int) -> dict[str, Any]:
    """The part of the errors that does not come again at the same place of the next lap: what a lap time feels."""
    rest = without_place(series)
    correlations = correlation(rest)
    return {
        "z_rms": _rms([value for one in rest for value in one.z.tolist()]),
        "autocorrelation": correlations,
        "window_variance_ratio": window_variance_ratio(correlations, frames),
    }
