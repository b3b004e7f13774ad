"""`dnb-edge calibrate refine`: the lane's edges in a picture of the track against the twin's; never taken by itself."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from dnb_edge.cli.calibration_out import check_calibration_path, check_places, input_file, save_calibration
from dnb_edge.cli.marker_pictures import picture_from_file
from dnb_edge.cli.refine_inputs import RefineInputs, RefineOptions, refine_inputs
from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import write_whole
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.values import BgrImage
from dnb_edge.view.refine import CLICK_SIGMA_PX, Refinement
from dnb_edge.view.refine import refine as align
from dnb_edge.view.refine_overlap import Agreement


def refine(
    *,
    picture: Annotated[Path, typer.Option(help="A picture of the empty track by the calibrated camera.")],
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="The configuration whose view is to be refined.")
    ] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", help="With --config: key.path=value; repeat it.")
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Instead: a calibration file, with --twin-image and --lane-hsv, or --track.")
    ] = None,
    twin_image: Annotated[Path | None, typer.Option(help="The twin's picture.")] = None,
    lane_hsv: Annotated[
        str | None, typer.Option(help="Colour of the lane on it: hue 0..360, saturation and value in percent.")
    ] = None,
    lane: Annotated[
        LaneShade | None,
        typer.Option(help="Instead: the lane is dark or light against the floor, either, or between lines."),
    ] = None,
    track: Annotated[Path | None, typer.Option(help="Or the track file, for its lane.")] = None,
    keypoints: Annotated[
        Path | None, typer.Option(help="With a calibration file: the keypoints it was made from (YAML).")
    ] = None,
    camera: Annotated[Path | None, typer.Option(help="Or its keypoints in the camera's picture (.npy) ...")] = None,
    twin: Annotated[Path | None, typer.Option(help="... and on the twin (.npy).")] = None,
    click_sigma_px: Annotated[
        float, typer.Option(help="How well points were clicked, one sigma, camera px; more where they disagree.")
    ] = CLICK_SIGMA_PX,
    out: Annotated[Path | None, typer.Option(help="Write the refined calibration file (YAML) here.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw both over the picture (.png or .svg) here.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Take it without asking, where it is better.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Align the lane's edges in a picture of the empty track with the twin; say what changes, and let you take it or not.

    Nothing is written without --out and your consent, and nothing at all where it is not better.
    """
    _check_options(out, plot, yes=yes, click_sigma_px=click_sigma_px)
    check_places({"--out": out, "--plot": plot}, reads=(picture, config, keypoints, camera, twin, track, twin_image))
    if overrides and config is None:
        raise InputError("--set: sets keys of --config: give that, too")
    seen = picture_from_file(picture)
    options = RefineOptions(
        config=config, overrides=tuple(overrides or ()), calibration=calibration, keypoints=keypoints, camera=camera,
        twin=twin, track=track, twin_image=twin_image, lane_hsv=lane_hsv, lane=lane,
    )  # fmt: skip
    with Console(stderr=True).status("aligning the lane's edges"):
        inputs = refine_inputs(options, seen.size_px)
        found = align(
            inputs.calibration, inputs.edges, seen.pictures[0], pairs=inputs.pairs, sigma_px=click_sigma_px,
            source=str(picture),
        )  # fmt: skip
        if plot is not None:
            _draw(plot, found, seen.pictures[0])
    if not as_json:
        _print(found)
    taken = _taken(found, out, yes=yes, may_ask=not as_json)
    if taken and out is not None:
        _save(out, found, inputs, picture, seen.pictures[0])
    if as_json:
        typer.echo(json.dumps(_facts(found, out if taken else None)))
    elif taken:
        typer.echo(f"written: {out}")
    if yes and not found.better:
        raise WorkError(f"not better, nothing was written: keep the present calibration ({found.reason})")


def _check_options(out: Path | None, plot: Path | None, *, yes: bool, click_sigma_px: float) -> None:
    if not click_sigma_px > 0:
        raise InputError(f"--click-sigma-px {click_sigma_px:g}: must be a positive number")
    if yes and out is None:
        raise InputError("--yes: takes what --out writes: give --out")
    if out is not None:
        check_calibration_path(out)
    if plot is not None and plot.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"--plot {plot}: the name must end in .png or .svg")


def _taken(found: Refinement, out: Path | None, *, yes: bool, may_ask: bool) -> bool:
    """Whether to write it: only where it is better, has a place to go, and somebody said so."""
    say = Console(stderr=True, soft_wrap=True)
    if not found.better:
        say.print("not better: keep the present calibration", highlight=False)
        return False
    if out is None:
        say.print("nothing written: give --out to keep it", highlight=False)
        return False
    if yes:
        return True
    if not may_ask or not (sys.stdin.isatty() and sys.stdout.isatty()):
        say.print("nothing written: nobody to ask here; give --yes to take it", highlight=False)
        return False
    return typer.confirm("take it?", default=False)


def _save(out: Path, found: Refinement, inputs: RefineInputs, path: Path, picture: BgrImage) -> None:
    refined, ground = found.calibration, found.calibration.ground
    size = (ground.width_px, ground.height_px)
    reference = picture
    if (picture.shape[1], picture.shape[0]) != size:
        reference = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    save_calibration(out, replace(refined, inputs=(*inputs.calibration.inputs, input_file(path))), reference)


def _draw(plot: Path, found: Refinement, picture: BgrImage) -> None:
    from dnb_edge.report.refine import refinement_picture  # noqa: PLC0415 Matplotlib is slow to import

    form: Literal["png", "svg"] = "svg" if plot.suffix.lower() == ".svg" else "png"
    write_whole(plot, refinement_picture(found, picture, picture_format=form))


def _facts(found: Refinement, written: Path | None) -> dict[str, Any]:
    return {
        "before": _agreement(found.before),
        "after": _agreement(found.after),
        "better": found.better,
        "reason": found.reason,
        "moved_px": found.moved_px,
        "reach_px": found.reach_px,
        "tension_sigmas": found.tension,
        "written": None if written is None else str(written),
    }


def _agreement(one: Agreement) -> dict[str, Any]:
    points, left_out = one.keypoints_px, one.left_out_px
    return {
        "overlap": one.overlap,
        "edge_share": one.edge_share,
        "edge_median_px": one.edge_median_px,
        "edge_median_m": one.edge_median_m,
        "edge_p95_m": one.edge_p95_m,
        "mean_px": None if points is None else float(points.mean()),
        "max_px": None if points is None else float(points.max()),
        "leave_one_out_mean_px": None if left_out is None else float(left_out.mean()),
        "leave_one_out_px": None if left_out is None else left_out.tolist(),
    }


def _print(found: Refinement) -> None:
    table = Table("", "before", "refined", box=None)
    before, after = found.before, found.after
    table.add_row("overlap of the lanes", f"{before.overlap:.1%}", f"{after.overlap:.1%}")
    table.add_row("edges within 2 px of 1280 across", f"{before.edge_share:.0%}", f"{after.edge_share:.0%}")
    table.add_row("edges off by, median, mm", *(f"{one.edge_median_m * 1000:.1f}" for one in (before, after)))
    table.add_row("edges off by, 95 %, mm", *(f"{one.edge_p95_m * 1000:.1f}" for one in (before, after)))
    for label, name, combine in (
        ("keypoints off by, mean, twin px", "keypoints_px", "mean"),
        ("keypoints off by, greatest, twin px", "keypoints_px", "max"),
        ("mean, each left out in turn, twin px", "left_out_px", "mean"),
    ):
        values = [getattr(one, name) for one in (before, after)]
        if values[0] is not None:
            table.add_row(label, *(f"{getattr(value, combine)():.2f}" for value in values))
    console = Console()
    console.print(table)
    console.print(
        f"moves the edges by up to {found.moved_px:.1f} px (looked as far as {found.reach_px:.0f} px); they contradict the "
        f"calibration by {found.tension:.1f} sigmas",
        highlight=False,
    )
    console.print(("better: " if found.better else "not better: ") + found.reason, highlight=False, markup=False)
