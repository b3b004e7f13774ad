"""What `calibrate keypoints` found, as JSON facts and as tables for people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from dnb_edge.cli.keypoint_input import Given
from dnb_edge.view.findings import Found
from dnb_edge.view.homography import CalibrationError


def facts(given: Given, found: Found) -> dict[str, Any]:
    """The one JSON object."""
    return {
        **_errors(found.plain),
        "by_count": [{"points": row.points, "mean_px": row.mean_px, "sum_px": row.sum_px} for row in found.by_count],
        "by_keypoint": [
            {"name": name, "error_px": plain_px, "fitted_error_px": fitted_px}
            for name, plain_px, fitted_px in zip(
                given.pairs.names, found.plain.per_point_px, found.fit.calibration.error.per_point_px, strict=True
            )
        ],
        "fitted": _errors(found.fit.calibration.error if given.metres_per_px is not None else _in_px(found)),
        "click_sigma_px": found.fit.click_sigma_px,
        "twin_sigma_px": found.fit.twin_sigma_px,
        f"sigma_{given.unit.replace(' ', '_')}": _percentiles(found, given.per_metre),
        "sigma_over": found.over,
        "outliers": [
            {"name": outlier.name, "apart_px": outlier.apart_px, "apart_twin_px": outlier.apart_twin_px}
            for outlier in found.fit.outliers
        ],
        "suspects": list(found.fit.suspects),
        "notes": list(found.notes),
        "advice": list(found.advice),
    }


def print_found(console: Console, given: Given, found: Found, out: Path | None) -> None:
    """Tables, then sentences."""
    console.print(_totals(given, found))
    console.print()
    counts = Table("fitted to the first", "mean, twin px", "accumulated, twin px", box=None)
    for row in found.by_count:
        counts.add_row(str(row.points), f"{row.mean_px:.2f}", f"{row.sum_px:.2f}")
    console.print(counts)
    console.print()
    points = Table("keypoint", "camera px", "twin px", "error, twin px", box=None)
    wrong = {outlier.name for outlier in found.fit.outliers} | set(found.fit.suspects)
    pairs = given.pairs
    for name, (u, v), (x, y), off in zip(
        pairs.names, pairs.camera_px, pairs.twin_px, found.plain.per_point_px, strict=True
    ):
        mark = " [red]?[/red]" if name in wrong else ""
        points.add_row(escape(name) + mark, f"{u:g}, {v:g}", f"{x:g}, {y:g}", f"{off:.2f}")
    console.print(points)
    console.print()
    _say(console, _sigma_sentence(given, found))
    for note in found.notes:
        _say(console, note)
    for sentence in found.advice:
        _say(console, sentence)
    if out is not None:
        _say(console, f"written: {out}; name it in the configuration as view.calibration")


def _totals(given: Given, found: Found) -> Table:
    plain, fitted = found.plain, found.fit.calibration.error
    metres = given.metres_per_px
    columns = ["twin px", *(["mm"] if metres is not None else []), "most likely map, twin px"]
    total = Table("over all keypoints", *columns, box=None)
    for label, in_px, likely_px in (
        ("mean", plain.mean_px, fitted.mean_px),
        ("accumulated", plain.sum_px, fitted.sum_px),
        ("greatest", plain.max_px, fitted.max_px),
        ("mean, each left out in turn", plain.leave_one_out_mean_px, fitted.leave_one_out_mean_px),
    ):
        if in_px is None:
            total.add_row(label, "needs five keypoints")
            continue
        in_mm = [] if metres is None else [f"{in_px * metres * 1000:.1f}"]
        total.add_row(label, f"{in_px:.2f}", *in_mm, "" if likely_px is None else f"{likely_px:.2f}")
    return total


def _sigma_sentence(given: Given, found: Found) -> str:
    middle, most, greatest = (
        given.say(float(value)) for value in (*np.percentile(found.sigmas_m, [50, 95]), found.sigmas_m.max())
    )
    return f"one sigma of the position over {found.over}: half of it under {middle}, 95 % under {most}, all under {greatest}"


def _say(console: Console, sentence: str) -> None:
    console.print(sentence[:1].upper() + sentence[1:] + ".", markup=False, highlight=False, soft_wrap=True)


def _errors(error: CalibrationError) -> dict[str, Any]:
    told: dict[str, Any] = {
        "mean_px": error.mean_px,
        "sum_px": error.sum_px,
        "max_px": error.max_px,
        "leave_one_out_mean_px": error.leave_one_out_mean_px,
    }
    if error.mean_m is not None:
        told |= {
            "mean_m": error.mean_m,
            "sum_m": error.sum_m,
            "max_m": error.max_m,
            "leave_one_out_mean_m": error.leave_one_out_mean_m,
        }
    return told


def _in_px(found: Found) -> CalibrationError:
    """The error of the most likely map without its metres, which are made up where the scale is not known."""
    error = found.fit.calibration.error
    return CalibrationError(
        per_point_px=error.per_point_px,
        mean_px=error.mean_px,
        sum_px=error.sum_px,
        max_px=error.max_px,
        leave_one_out_mean_px=error.leave_one_out_mean_px,
    )


def _percentiles(found: Found, per_metre: float) -> dict[str, float]:
    middle, most = np.percentile(found.sigmas_m, [50, 95]) * per_metre
    return {"p50": float(middle), "p95": float(most), "max": float(found.sigmas_m.max()) * per_metre}
