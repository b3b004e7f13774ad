"""`dnb-edge calibrate markers`: printed squares on the floor, and the camera's pose and map from them with no clicks."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from dnb_edge.cli.calibration_out import check_calibration_path, check_places, input_file, save_calibration
from dnb_edge.cli.marker_pictures import Pictures, picture_from_file, pictures_from_source
from dnb_edge.config.lens_file import LensFile, load_lens
from dnb_edge.config.load import load_config
from dnb_edge.config.marker_layout import load_marker_layout
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.values import BgrImage
from dnb_edge.view.calibration import Calibration
from dnb_edge.view.marker_floor import (
    USUAL_METRES_PER_PX,
    MarkerLayout,
    check_layout,
    layout_calibration,
    own_calibration,
    twin_size_m,
)
from dnb_edge.view.marker_overlay import draw_markers
from dnb_edge.view.marker_pose import MarkerPose, MarkerQuestion, pose_from_pictures
from dnb_edge.view.marker_solution import Optics
from dnb_edge.view.markers import grey_of
from dnb_edge.view.rectify import rectified

_BAR_MM = 100.0
_BAR_OFF = 0.005
_USUAL_COUNT = 6


def markers(
    *,
    print_to: Annotated[
        Path | None, typer.Option("--print", help="Write the sheets to print (.pdf) here, and do nothing else.")
    ] = None,
    paper: Annotated[str, typer.Option(help="With --print: a4 or letter.")] = "a4",
    count: Annotated[
        int | None,
        typer.Option(min=1, max=50, help="How many sheets: to print (default 6), or that lie on the floor (any)."),
    ] = None,
    first_id: Annotated[int, typer.Option(min=0, help="Number of the first of them.")] = 0,
    size_mm: Annotated[float, typer.Option(help="Side of the black square, mm.")] = 150.0,
    family: Annotated[str, typer.Option(help="Family of codes.")] = "4X4_50",
    picture: Annotated[Path | None, typer.Option(help="A picture of the markers on the floor.")] = None,
    source: Annotated[
        str | None, typer.Option(help="Or a source that shows them: v4l2:/dev/video0, file:clip.mp4 ...")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=100, help="With --source: pictures to average.")] = 12,
    config_file: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="With --source: the configuration, for the camera's size and rate."),
    ] = None,
    bar_mm: Annotated[
        float | None, typer.Option(help="What the printed 100 mm bar measures, mm: a check of the print.")
    ] = None,
    lens_file: Annotated[
        Path | None, typer.Option("--lens", help="The camera's lens, by `calibrate lens`. Without: it is estimated.")
    ] = None,
    height: Annotated[float | None, typer.Option(help="Measured height of the lens above the floor, m.")] = None,
    layout_file: Annotated[
        Path | None, typer.Option("--layout", help="Measured places of some markers on the track (YAML).")
    ] = None,
    metres_per_px: Annotated[
        float, typer.Option(help="Without --layout: scale of the twin that is made of the floor.")
    ] = USUAL_METRES_PER_PX,
    camera_id: Annotated[
        str | None, typer.Option(help="The camera's identity. Default: the source's, else the lens's.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the calibration file (YAML) here.")] = None,
    rectify: Annotated[
        Path | None, typer.Option(help="Write the floor seen from straight above (PNG) here: a twin's picture.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Write the picture with what was found (PNG) here.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Print floor markers, or find them in a picture: the map to the track, the camera's height, pitch and place.

    Lay at least three (better 4 to 8) sheets flat on the floor, anywhere in view; nothing need be measured. With a --layout
    the map is tied to the track; without one the markers make the floor's axes.
    """
    if print_to is not None:
        if picture is not None or source is not None:
            raise InputError(
                "--print: only writes the sheets: look for markers, with --picture or --source, afterwards"
            )
        _print_sheets(print_to, paper, family, first_id, count if count is not None else _USUAL_COUNT, size_mm)
        return
    _check_options(picture, source, metres_per_px=metres_per_px, height=height, size_mm=size_mm)
    _check_outputs(out, rectify, plot)
    check_places(
        {"--out": out, "--rectify": rectify, "--plot": plot}, reads=(picture, config_file, lens_file, layout_file)
    )
    size_m = _true_size_m(size_mm, bar_mm)
    layout = None if layout_file is None else load_marker_layout(layout_file)
    console = Console(stderr=True)
    if picture is not None:
        seen = picture_from_file(picture)
    else:
        assert source is not None
        config = None if config_file is None else load_config(config_file)
        seen = pictures_from_source(source, wanted=frames, config=config, console=console)
    kept = None if lens_file is None else load_lens(lens_file)
    identity = camera_id if camera_id is not None else seen.camera_id
    question = MarkerQuestion(
        family=family,
        size_m=size_m,
        numbers=None if count is None else tuple(range(first_id, first_id + count)),
        height_m=height,
    )
    with console.status("looking for markers"):
        pose, calibration, twin_m = _calibrated(
            seen, _optics(seen, kept, str(lens_file), identity), question, layout, metres_per_px
        )
    if identity is None and kept is not None:
        identity = kept.camera_id
    extra = [input_file(path) for path in (lens_file, layout_file) if path is not None]
    calibration = replace(
        calibration, camera_id=identity, inputs=(*seen.inputs, *extra), notes=(*pose.notes, *calibration.notes)
    )
    if out is not None:
        calibration = save_calibration(out, calibration, seen.pictures[0])
    if rectify is not None:
        _write_png(rectify, _straight_above(seen.pictures[0], calibration, twin_m))
    if plot is not None:
        corners = dict(zip(pose.solution.numbers, pose.solution.corners_px, strict=True))
        _write_png(plot, draw_markers(seen.pictures[0], calibration.ground, corners))
    facts = _facts(pose, calibration, twin_m)
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        _print(facts, out)


def _print_sheets(path: Path, paper: str, family: str, first_id: int, count: int, size_mm: float) -> None:
    from dnb_edge.prints.floor import FloorSettings, floor_pages  # noqa: PLC0415 Matplotlib is slow to import
    from dnb_edge.prints.paper import parse_paper, pdf_of  # noqa: PLC0415 as above

    if path.suffix.lower() != ".pdf":
        raise InputError(f"--print {path}: the name must end in .pdf")
    if not (math.isfinite(size_mm) and size_mm > 0):
        raise InputError(f"--size-mm {size_mm:g}: must be a positive number")
    numbers = tuple(range(first_id, first_id + count))
    settings = FloorSettings(family=family, numbers=numbers, size_mm=size_mm, paper=parse_paper(paper))
    write_whole(path, pdf_of(floor_pages(settings), title="Floor markers"))
    typer.echo(
        f"{path}: {count} sheet{'s' if count > 1 else ''} ({paper.lower()}), markers {numbers[0]} to {numbers[-1]} of "
        f"{family}, {size_mm:g} mm. Print at 100 % (not fitted to the page) and measure the bar: 100 mm."
    )


def _check_options(
    picture: Path | None, source: str | None, *, metres_per_px: float, height: float | None, size_mm: float
) -> None:
    if (picture is None) == (source is None):
        raise InputError("calibrate markers: give --print FILE.pdf, --picture FILE or --source URI, one of them")
    for option, value in (("--metres-per-px", metres_per_px), ("--height", height), ("--size-mm", size_mm)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{option} {value:g}: must be a positive number")


def _check_outputs(out: Path | None, rectify: Path | None, plot: Path | None) -> None:
    if out is not None:
        check_calibration_path(out)
    for option, path in (("--rectify", rectify), ("--plot", plot)):
        if path is not None and path.suffix.lower() != ".png":
            raise InputError(f"{option} {path}: the name must end in .png")
        if path is not None and not path.parent.is_dir():
            raise InputError(f"{option} {path}: there is no directory {path.parent}: make it first")


def _true_size_m(size_mm: float, bar_mm: float | None) -> float:
    """The square's side as printed, by the bar. Raises `InputError` where the bar is off by too much to be a matter of ink."""
    if bar_mm is None:
        return size_mm / 1000.0
    if not (math.isfinite(bar_mm) and bar_mm > 0):
        raise InputError(f"--bar-mm {bar_mm:g}: must be a positive number")
    if abs(bar_mm / _BAR_MM - 1.0) > _BAR_OFF:
        raise InputError(
            f"--bar-mm {bar_mm:g}: the sheets were printed at {bar_mm:g} %: print again at 100 % (not fitted to the page), or "
            f"keep them, measure a black square's side (about {size_mm * bar_mm / _BAR_MM:.1f} mm) and give it as --size-mm, "
            "without --bar-mm"
        )
    return size_mm * bar_mm / _BAR_MM / 1000.0


def _optics(seen: Pictures, kept: LensFile | None, source: str, camera_id: str | None) -> Optics:
    width, height = seen.size_px
    if kept is None:
        return Optics(width_px=width, height_px=height, lens=None)
    try:
        lens = kept.lens_for(width, height, camera_id)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    scale = width / kept.lens.width_px
    sigmas = (
        kept.sigmas.get("fx_px", 0.0) / kept.lens.fx_px,
        kept.sigmas.get("cx_px", 0.0) * scale,
        kept.sigmas.get("cy_px", 0.0) * scale,
    )
    return Optics(width_px=width, height_px=height, lens=lens, lens_sigmas=sigmas)


def _calibrated(
    seen: Pictures, optics: Optics, question: MarkerQuestion, layout: MarkerLayout | None, metres_per_px: float
) -> tuple[MarkerPose, Calibration, tuple[float, float]]:
    """Pose, calibration and the twin's width and height, metres."""
    greys = [grey_of(picture) for picture in seen.pictures]
    pose = pose_from_pictures(greys, optics, question)
    if layout is None:
        return pose, *own_calibration(pose.solution, metres_per_px=metres_per_px)
    check_layout(layout, pose.solution)
    try:
        tied = pose_from_pictures(greys, optics, replace(question, measured=layout.points))
    except InputError:
        # Lengths that cannot be make the pose vague, too: say which, rather than what came of it.
        check_layout(layout, pose.solution, tied=True)
        raise
    pose = tied
    check_layout(layout, pose.solution, tied=True)
    calibration = layout_calibration(pose.solution, layout)
    return pose, calibration, twin_size_m(pose.solution, calibration)


def _straight_above(picture: BgrImage, calibration: Calibration, twin_m: tuple[float, float]) -> BgrImage:
    return rectified(
        picture,
        calibration.ground,
        metres_per_px=calibration.ground.scale.metres_per_px,
        extent_m=(0.0, 0.0, twin_m[0], twin_m[1]),
    )


def _write_png(path: Path, picture: BgrImage) -> None:
    ok, data = cv2.imencode(".png", picture)
    assert ok, "OpenCV encodes any 8-bit picture as PNG"
    write_whole(path, data.tobytes())


def _facts(pose: MarkerPose, calibration: Calibration, twin_m: tuple[float, float]) -> dict[str, Any]:
    solution, scale = pose.solution, calibration.ground.scale
    assert calibration.pose is not None
    x, y, _ = calibration.pose.position_m
    middles = calibration.ground.to_track_m(solution.corners_px.mean(axis=1))
    lens = solution.lens
    return {
        "markers": [
            {
                "number": number,
                "track_m": middle,
                "side_px": pose.sides_px[number],
                "error_px": float(errors.mean()),
            }
            for number, middle, errors in zip(solution.numbers, middles.tolist(), solution.residual_px, strict=True)
        ],
        "set_aside": list(solution.aside),
        "height_m": solution.height_m,
        "height_sigma_m": solution.height_sigma_m,
        "pitch_deg": solution.pitch_deg,
        "pitch_sigma_deg": solution.pitch_sigma_deg,
        "roll_deg": solution.roll_deg,
        "centre_m": [x, y],
        "focal_px": lens.fx_px,
        "focal_sigma_px": solution.focal_sigma_px,
        "field_of_view_deg": math.degrees(2.0 * math.atan(lens.width_px / 2.0 / lens.fx_px)),
        "lens": "given" if solution.optics.lens is not None else "estimated",
        "corner_mean_px": float(solution.residual_px.mean()),
        "corner_max_px": float(solution.residual_px.max()),
        "corner_mean_mm": None if calibration.error.mean_m is None else calibration.error.mean_m * 1000.0,
        "corner_max_mm": None if calibration.error.max_m is None else calibration.error.max_m * 1000.0,
        "twin": {
            "metres_per_px": scale.metres_per_px,
            "width_px": round(twin_m[0] / scale.metres_per_px),
            "height_px": round(scale.height_px),
        },
        "sigma_mm": float(np.median(calibration.sigma_m(solution.corners_px.mean(axis=1)))) * 1000.0,
        "notes": list(calibration.notes),
    }


def _print(facts: dict[str, Any], out: Path | None) -> None:
    console = Console(soft_wrap=True, highlight=False, markup=False)
    table = Table("marker", "track m", "side, px", "error, px", box=None)
    for one in facts["markers"]:
        x, y = one["track_m"]
        table.add_row(str(one["number"]), f"{x:.3f}, {y:.3f}", f"{one['side_px']:.0f}", f"{one['error_px']:.2f}")
    console.print(table)
    x, y = facts["centre_m"]
    console.print(
        f"height {facts['height_m']:.3f} +- {facts['height_sigma_m']:.3f} m, pitch {facts['pitch_deg']:.2f} +- "
        f"{facts['pitch_sigma_deg']:.2f} degrees below the horizon; the camera is above track m {x:.3f}, {y:.3f}"
    )
    console.print(
        f"lens ({facts['lens']}): focal length {facts['focal_px']:.0f} +- {facts['focal_sigma_px']:.0f} px, field of view "
        f"{facts['field_of_view_deg']:.1f} degrees"
    )
    console.print(
        f"corners: mean {facts['corner_mean_px']:.2f} px ({facts['corner_mean_mm']:.1f} mm), greatest "
        f"{facts['corner_max_px']:.2f} px ({facts['corner_max_mm']:.1f} mm); sigma of the map at the markers "
        f"{facts['sigma_mm']:.1f} mm"
    )
    for note in facts["notes"]:
        console.print(f"note: {note}")
    if out is not None:
        console.print(f"calibration: {out}")
