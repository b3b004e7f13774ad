"""`dnb-edge track`: a twin's picture becomes a track file, and a track file becomes a picture again."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Annotated

import cv2
import typer

from dnb_edge.cli import track_options as options
from dnb_edge.cli.track_facts import facts, sentence, table
from dnb_edge.config.track_file import MadeOf, load_track_file, track_file
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.track.build import TrackSettings, build_route, track_from_route
from dnb_edge.track.loop import SeveralLoops
from dnb_edge.track.overlay import draw_loops, draw_track
from dnb_edge.track.route import Route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import LaneColour, load_twin
from dnb_edge.values import BgrImage

app = typer.Typer(help="Build a track from its twin's picture, and draw one.", no_args_is_help=True)


@app.command("build")
def build(
    *,
    image: Annotated[Path, typer.Option(help="The twin's picture.")],
    lane_hsv: Annotated[
        str, typer.Option(help="Lane colour: hue 0-360, saturation 0-100, value 0-100, such as 330,23,84.")
    ],
    lane_tolerance: Annotated[str, typer.Option(help="How far each of the three may differ.")] = "20,14,20",
    length_m: Annotated[
        float | None, typer.Option(help="A measured length, m: of the line --measured, or else of one lap.")
    ] = None,
    measured: Annotated[str | None, typer.Option(help="Ends of the measured line, twin px: u,v,u,v.")] = None,
    metres_per_px: Annotated[float | None, typer.Option(help="The scale, instead of a measured length.")] = None,
    waypoint: options.Waypoints = None,
    open_route: options.OpenRoute = False,
    start_line: options.StartLine = None,
    start_at: options.StartAt = None,
    finish_line: options.FinishLine = None,
    finish_at: options.FinishAt = None,
    sector_line: options.SectorLines = None,
    sector_at: options.SectorsAt = None,
    close_gap_px: Annotated[float | None, typer.Option(help="Widest seam across the lane to close, twin px.")] = None,
    name: Annotated[str | None, typer.Option(help="The track's name. Default: the picture's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the track file (YAML) here; needs a scale.")] = None,
    overlay: Annotated[
        Path | None, typer.Option(help="Write a picture of the route on the twin (PNG) here. Default: beside --out.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Find the route in a twin's picture: ordered, down the middle of the lane, closed or from point to point."""
    hue, saturation, value = options.numbers("--lane-hsv", lane_hsv, 3)
    tolerances = options.numbers("--lane-tolerance", lane_tolerance, 3)
    settings = TrackSettings(
        name=name if name is not None else image.stem,
        lane_colour=LaneColour(
            hue_deg=hue,
            saturation_percent=saturation,
            value_percent=value,
            hue_tolerance_deg=tolerances[0],
            saturation_tolerance_percent=tolerances[1],
            value_tolerance_percent=tolerances[2],
        ),
        closed=not open_route,
        start_line_px=None if start_line is None else options.line("--start-line", start_line),
        start_at_px=None if start_at is None else options.point("--start-at", start_at),
        finish_line_px=None if finish_line is None else options.line("--finish-line", finish_line),
        finish_at_px=None if finish_at is None else options.point("--finish-at", finish_at),
        sector_lines_px=options.lines("--sector-line", sector_line),
        sectors_at_px=options.points("--sector-at", sector_at),
        waypoints_px=options.points("--waypoint", waypoint),
        close_gap_px=close_gap_px,
    )
    _check_scale_options(length_m, measured, metres_per_px)
    picture = load_twin(image)
    try:
        route = build_route(picture, settings, source=str(image))
    except SeveralLoops as error:
        if overlay is not None:
            write_whole(overlay, _png(draw_loops(picture, error.loops)))
        raise
    scale = _scale(picture, route, length_m, measured, metres_per_px)
    if scale is None and out is not None:
        raise InputError("--out: a track file needs the scale: give --length-m (with --measured) or --metres-per-px")
    # Without a scale the track is laid out in pixels, for its direction and its picture only.
    unscaled = TwinScale(metres_per_px=1.0, height_px=float(picture.shape[0]))
    track = track_from_route(route, scale if scale is not None else unscaled, settings, source=str(image))
    if out is not None:
        sha256 = hashlib.sha256(image.read_bytes()).hexdigest()
        made_of = MadeOf(picture=image.name, sha256=sha256, waypoints_px=settings.waypoints_px)
        write_whole(out, track_file(track, made_of))
        overlay = _beside(out, image) if overlay is None else overlay
    if overlay is not None:
        write_whole(overlay, _png(draw_track(picture, track)))
    found = facts(route, scale, track.centreline)
    typer.echo(json.dumps(found) if as_json else sentence(settings.name, found))


@app.command("show")
def show(
    track_path: Annotated[Path, typer.Argument(metavar="TRACK", help="A track file that `track build --out` wrote.")],
    *,
    overlay: Annotated[Path | None, typer.Option(help="Write a picture of the track (PNG) here.")] = None,
    image: Annotated[Path | None, typer.Option(help="The twin's picture to draw on. Default: white paper.")] = None,
) -> None:
    """Show a track file as a table, and draw it: lane, route, direction, start, finish and sector lines."""
    if image is not None and overlay is None:
        raise InputError(f"--image {image}: say where the picture goes with --overlay")
    file = load_track_file(track_path)
    picture = None if image is None else load_twin(image)
    drawn = ""
    if overlay is not None:
        write_whole(overlay, _png(draw_track(picture, file.track)))
        drawn = f"; picture: {overlay}"
    typer.echo(f"{file.track.name}: {file.track.centreline.length_m:.3f} m{drawn}\n{table(file)}")


def _beside(out: Path, image: Path) -> Path:
    """The picture's path for the track file `out`: the same name, unless that is the twin or the track file itself."""
    overlay = out.with_suffix(".png")
    taken = overlay.resolve() in (image.resolve(), out.resolve())
    return out.with_name(f"{out.stem}-overlay.png") if taken else overlay


def _check_scale_options(length_m: float | None, measured: str | None, metres_per_px: float | None) -> None:
    if measured is not None and length_m is None:
        raise InputError("--measured: give its length on the floor with --length-m")
    if metres_per_px is not None and length_m is not None:
        raise InputError("--metres-per-px: give it or --length-m, not both")
    if length_m is not None and not (math.isfinite(length_m) and length_m > 0):
        raise InputError(f"--length-m {length_m:g}: must be a positive number of metres")


def _scale(
    picture: BgrImage, route: Route, length_m: float | None, measured: str | None, metres_per_px: float | None
) -> TwinScale | None:
    height_px = float(picture.shape[0])
    if length_m is not None and measured is not None:
        from_px, to_px = options.line("--measured", measured)
        return TwinScale.from_measured_length(from_px=from_px, to_px=to_px, length_m=length_m, height_px=height_px)
    if length_m is not None:
        return TwinScale(metres_per_px=length_m / route.length_px, height_px=height_px)
    return None if metres_per_px is None else TwinScale(metres_per_px=metres_per_px, height_px=height_px)


def _png(picture: BgrImage) -> bytes:
    ok, data = cv2.imencode(".png", picture)
    assert ok, "OpenCV encodes any 8-bit picture as PNG"
    return data.tobytes()
