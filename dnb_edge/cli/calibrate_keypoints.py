"""`dnb-edge calibrate keypoints`: how well clicked points tie the camera's picture to the twin."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.view.homography import CalibrationError, CountError, calibration_error, error_by_count
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs


def keypoints(
    *,
    camera: Annotated[Path | None, typer.Option(help="Points in the camera's picture, .npy of shape (n, 2).")] = None,
    twin: Annotated[Path | None, typer.Option(help="The same points on the twin, .npy of shape (n, 2).")] = None,
    pairs_path: Annotated[
        Path | None, typer.Option("--keypoints", help="A YAML file with both, instead of the two.")
    ] = None,
    metres_per_px: Annotated[float | None, typer.Option(help="The twin's scale, for errors in metres too.")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Write the plot of error against number of keypoints (.png or .svg) here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Fit the homography to keypoint pairs and print its error, in all and by number of keypoints."""
    if metres_per_px is not None and not (math.isfinite(metres_per_px) and metres_per_px > 0):
        raise InputError(f"--metres-per-px {metres_per_px:g}: must be a positive number")
    if plot is not None and plot.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"--plot {plot}: the name must end in .png or .svg")
    pairs = _load(camera, twin, pairs_path)
    error = calibration_error(pairs, metres_per_px=metres_per_px)
    by_count = error_by_count(pairs)
    if plot is not None:
        _draw(plot, by_count)
    if as_json:
        typer.echo(json.dumps(_facts(pairs, error, by_count)))
    else:
        _print(pairs, error, by_count)


def _draw(plot: Path, by_count: tuple[CountError, ...]) -> None:
    from dnb_edge.report.calibration import error_by_count_picture  # noqa: PLC0415 Matplotlib is slow to import

    form: Literal["png", "svg"] = "svg" if plot.suffix.lower() == ".svg" else "png"
    write_whole(plot, error_by_count_picture(by_count, picture_format=form))


def _load(camera: Path | None, twin: Path | None, pairs_path: Path | None) -> KeypointPairs:
    if pairs_path is not None:
        if camera is not None or twin is not None:
            raise InputError("--keypoints: give it or --camera and --twin, not both")
        return load_yaml_pairs(pairs_path)
    if camera is None or twin is None:
        raise InputError("calibrate keypoints: give --camera and --twin (.npy), or --keypoints (.yaml)")
    return load_npy_pairs(camera, twin)


def _facts(pairs: KeypointPairs, error: CalibrationError, by_count: tuple[CountError, ...]) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "mean_px": error.mean_px,
        "sum_px": error.sum_px,
        "max_px": error.max_px,
        "leave_one_out_mean_px": error.leave_one_out_mean_px,
    }
    if error.mean_m is not None:
        facts |= {
            "mean_m": error.mean_m,
            "sum_m": error.sum_m,
            "max_m": error.max_m,
            "leave_one_out_mean_m": error.leave_one_out_mean_m,
        }
    facts["by_count"] = [{"points": row.points, "mean_px": row.mean_px, "sum_px": row.sum_px} for row in by_count]
    named = zip(pairs.names, error.per_point_px, strict=True)
    facts["by_keypoint"] = [{"name": name, "error_px": error_px} for name, error_px in named]
    return facts


def _print(pairs: KeypointPairs, error: CalibrationError, by_count: tuple[CountError, ...]) -> None:
    console = Console()
    total = Table("over all keypoints", "twin px", *(["mm"] if error.mean_m is not None else []), box=None)
    for label, in_px, in_m in (
        ("mean", error.mean_px, error.mean_m),
        ("accumulated", error.sum_px, error.sum_m),
        ("greatest", error.max_px, error.max_m),
        ("mean, each left out in turn", error.leave_one_out_mean_px, error.leave_one_out_mean_m),
    ):
        px = "needs five keypoints" if in_px is None else f"{in_px:.2f}"
        total.add_row(label, px, *([] if in_m is None else [f"{in_m * 1000:.1f}"]))
    console.print(total)
    console.print()
    counts = Table("fitted to the first", "mean, twin px", "accumulated, twin px", box=None)
    for row in by_count:
        counts.add_row(str(row.points), f"{row.mean_px:.2f}", f"{row.sum_px:.2f}")
    console.print(counts)
    console.print()
    points = Table("keypoint", "camera px", "twin px", "error, twin px", box=None)
    for name, (u, v), (x, y), off in zip(pairs.names, pairs.camera_px, pairs.twin_px, error.per_point_px, strict=True):
        points.add_row(escape(name), f"{u:g}, {v:g}", f"{x:g}, {y:g}", f"{off:.2f}")
    console.print(points)
