"""`dnb-edge track`: a twin's picture becomes a track file, and a track file becomes a picture again."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer

from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.track.build import TrackSettings, build_route, track_from_route
from dnb_edge.track.file import load_track, track_file
from dnb_edge.track.overlay import draw_track
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
    waypoint: Annotated[
        list[str] | None,
        typer.Option(help="A twin px u,v on a lane that the route takes; repeat it. None: the outer loop."),
    ] = None,
    start_line: Annotated[
        str | None, typer.Option(help="Twin px u,v,u,v; cars cross it to the left of its direction.")
    ] = None,
    close_gap_px: Annotated[float | None, typer.Option(help="Widest seam across the lane to close, twin px.")] = None,
    name: Annotated[str | None, typer.Option(help="The track's name. Default: the picture's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the track file (JSON) here; needs a scale.")] = None,
    overlay: Annotated[Path | None, typer.Option(help="Write a picture of the route on the twin (PNG) here.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Find the route in a twin's picture: closed, ordered, down the middle of the lane."""
    hue, saturation, value = _numbers("--lane-hsv", lane_hsv, 3)
    tolerances = _numbers("--lane-tolerance", lane_tolerance, 3)
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
        start_line_px=None if start_line is None else _line("--start-line", start_line),
        waypoints_px=tuple(_point("--waypoint", text) for text in waypoint or []),
        close_gap_px=close_gap_px,
    )
    _check_scale_options(length_m, measured, metres_per_px)
    picture = load_twin(image)
    route = build_route(picture, settings, source=str(image))
    scale = _scale(picture, route, length_m, measured, metres_per_px)
    if scale is None and out is not None:
        raise InputError("--out: a track file needs the scale: give --length-m (with --measured) or --metres-per-px")
    # Without a scale the track is laid out in pixels, for its direction and its picture only.
    unscaled = TwinScale(metres_per_px=1.0, height_px=float(picture.shape[0]))
    track = track_from_route(route, scale if scale is not None else unscaled, settings, source=str(image))
    if out is not None:
        write_whole(out, track_file(track))
    if overlay is not None:
        write_whole(overlay, _png(draw_track(picture, track)))
    facts = _facts(route, scale)
    typer.echo(json.dumps(facts) if as_json else _sentence(settings.name, facts))


@app.command("show")
def show(
    track_path: Annotated[Path, typer.Argument(metavar="TRACK", help="A track file that `track build --out` wrote.")],
    *,
    overlay: Annotated[Path, typer.Option(help="Write the picture (PNG) here.")],
    image: Annotated[Path | None, typer.Option(help="The twin's picture to draw on. Default: white paper.")] = None,
) -> None:
    """Draw a track file: lane, route, direction, start and sector lines."""
    track = load_track(track_path)
    picture = None if image is None else load_twin(image)
    write_whole(overlay, _png(draw_track(picture, track)))
    line = track.centreline
    typer.echo(f"{track.name}: {line.length_m:.3f} m, {len(line.points_m)} points; picture: {overlay}")


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
        from_px, to_px = _line("--measured", measured)
        return TwinScale.from_measured_length(from_px=from_px, to_px=to_px, length_m=length_m, height_px=height_px)
    if length_m is not None:
        return TwinScale(metres_per_px=length_m / route.length_px, height_px=height_px)
    return None if metres_per_px is None else TwinScale(metres_per_px=metres_per_px, height_px=height_px)


def _facts(route: Route, scale: TwinScale | None) -> dict[str, Any]:
    width_px = float(np.median(route.half_left_px + route.half_right_px))
    metres_per_px = None if scale is None else scale.metres_per_px
    return {
        "length_px": route.length_px,
        "length_m": None if metres_per_px is None else route.length_px * metres_per_px,
        "closed": True,
        "points": len(route.points_px),
        "lane_width_px": width_px,
        "lane_width_m": None if metres_per_px is None else width_px * metres_per_px,
        "metres_per_px": metres_per_px,
    }


def _sentence(name: str, facts: dict[str, Any]) -> str:
    length, width = f"{facts['length_px']:.0f} px", f"{facts['lane_width_px']:.0f} px"
    if facts["length_m"] is not None:
        length, width = f"{length} ({facts['length_m']:.3f} m)", f"{width} ({facts['lane_width_m']:.3f} m)"
    return f"{name}: a closed route of {length}, {facts['points']} points, lane {width} wide"


def _png(picture: BgrImage) -> bytes:
    ok, data = cv2.imencode(".png", picture)
    assert ok, "OpenCV encodes any 8-bit picture as PNG"
    return data.tobytes()


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        raise InputError(f"{option} {text}: must be {count} numbers with commas between them")
    return numbers


def _point(option: str, text: str) -> tuple[float, float]:
    u, v = _numbers(option, text, 2)
    return u, v


def _line(option: str, text: str) -> tuple[tuple[float, float], tuple[float, float]]:
    u0, v0, u1, v1 = _numbers(option, text, 4)
    return (u0, v0), (u1, v1)
