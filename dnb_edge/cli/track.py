"""`dnb-edge track`: a twin's picture becomes a track file, and a track file becomes a picture again."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import cv2
import typer

from dnb_edge.archive import coordinates
from dnb_edge.cli import track_lane
from dnb_edge.cli import track_options as options
from dnb_edge.cli import track_origin as origins
from dnb_edge.cli.track_facts import facts, sentence, table
from dnb_edge.cli.track_from import Made, ShowLoops, made_of_files
from dnb_edge.cli.track_lane import LaneOptions
from dnb_edge.cli.track_origin import Origin
from dnb_edge.config.track_file import load_track_file, track_file
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.track.build import TrackSettings, build_route, track_from_route
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.track.loop import Loop, SeveralLoops
from dnb_edge.track.overlay import draw_loops, draw_track
from dnb_edge.track.route import Route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import colour_at, load_twin
from dnb_edge.values import BgrImage
from dnb_edge.view.photograph import UnclearLane

app = typer.Typer(help="Build a track from its twin's picture, and draw one.", no_args_is_help=True)


@app.command("build")
def build(
    *,
    image: Annotated[Path | None, typer.Option(help="The twin's picture: a drawing from straight above.")] = None,
    photo: origins.Photos = None,
    source: origins.Source = None,
    laps: origins.Laps = None,
    drive: origins.Drive = None,
    calibration: origins.CalibrationFile = None,
    lane: track_lane.Shade = None,
    lane_hsv: track_lane.Hsv = None,
    lane_hex: track_lane.Hex = None,
    lane_pixel: track_lane.Pixel = None,
    lane_tolerance: track_lane.Tolerance = track_lane.USUAL_TOLERANCE,
    area: origins.Area = None,
    lane_width_m: origins.LaneWidth = None,
    rounds: origins.Rounds = None,
    detector: origins.DetectorKind = None,
    model: origins.Model = None,
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
    twin_out: origins.TwinOut = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Find the route in a drawing, in photographs of the empty track, or from laps that were driven.

    Ordered, down the middle of the lane, closed or from point to point.
    """
    wanted = origins.Origin(
        image=image,
        photos=tuple(photo or ()),
        source=source,
        laps=tuple(laps or ()),
        drive=drive,
        calibration=calibration,
        lane=track_lane.LaneOptions(
            shade=lane, hsv=lane_hsv, hex_colour=lane_hex, pixel=lane_pixel, tolerance=lane_tolerance
        ),
        area=area,
        lane_width_m=lane_width_m,
        rounds=rounds,
        detector=detector,
        model=model,
        other={
            "--length-m": length_m,
            "--measured": measured,
            "--metres-per-px": metres_per_px,
            "--waypoint": waypoint,
            "--open": open_route,
            "--close-gap-px": close_gap_px,
            "--twin-out": twin_out,
        },
    )
    wanted.check()
    _check_outputs(wanted.files, {"--out": out, "--overlay": overlay, "--twin-out": twin_out})
    settings = TrackSettings(
        name=name if name is not None else wanted.name,
        lane_colour=LaneShade.AUTO,
        closed=not open_route,
        start_line_px=None if start_line is None else coordinates.line("--start-line", start_line),
        start_at_px=None if start_at is None else coordinates.point("--start-at", start_at),
        finish_line_px=None if finish_line is None else coordinates.line("--finish-line", finish_line),
        finish_at_px=None if finish_at is None else coordinates.point("--finish-at", finish_at),
        sector_lines_px=coordinates.lines("--sector-line", sector_line),
        sectors_at_px=coordinates.points("--sector-at", sector_at),
        waypoints_px=coordinates.points("--waypoint", waypoint),
        close_gap_px=close_gap_px,
    )

    def show_loops(picture: BgrImage, loops: tuple[Loop, ...]) -> None:
        if overlay is not None:
            write_whole(overlay, _png(draw_loops(picture, loops)))

    if image is None:
        try:
            made = wanted.made(settings, show_loops)
        except UnclearLane as error:
            if overlay is not None:
                write_whole(overlay, _png(error.picture))
            raise
    else:
        made = _from_drawing(image, wanted.lane, settings, (length_m, measured, metres_per_px), show_loops)
    _write(made, wanted, out=out, overlay=overlay, twin_out=twin_out, as_json=as_json)


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
    _check_outputs([path for path in (track_path, image) if path is not None], {"--overlay": overlay})
    file = load_track_file(track_path)
    picture = None if image is None else load_twin(image)
    drawn = ""
    if overlay is not None:
        write_whole(overlay, _png(draw_track(picture, file.track)))
        drawn = f"; picture: {overlay}"
    typer.echo(f"{file.track.name}: {file.track.centreline.length_m:.3f} m{drawn}\n{table(file)}")


def _from_drawing(
    image: Path,
    lane: LaneOptions,
    settings: TrackSettings,
    scale_options: tuple[float | None, str | None, float | None],
    show_loops: ShowLoops,
) -> Made:
    """The route in a drawing, with its scale where the options tell it."""
    _check_scale_options(*scale_options)
    picture = load_twin(image)
    settings = replace(settings, lane_colour=lane.lane(lambda at: colour_at(picture, at, source=str(image))))
    try:
        route = build_route(picture, settings, source=str(image))
    except SeveralLoops as error:
        show_loops(picture, error.loops)
        raise
    made_of = made_of_files([image], settings.waypoints_px)
    scale = _scale(picture, route, *scale_options)
    return Made(route=route, scale=scale, picture=picture, settings=settings, made_of=made_of)


def _write(
    made: Made, wanted: Origin, *, out: Path | None, overlay: Path | None, twin_out: Path | None, as_json: bool
) -> None:
    """Lays the track out, writes what is wanted and says what came out."""
    scale, picture = made.scale, made.picture
    if scale is None and out is not None:
        raise InputError("--out: a track file needs the scale: give --length-m (with --measured) or --metres-per-px")
    # Without a scale the track is laid out in pixels, for its direction and its picture only.
    laid_out_in = scale
    if laid_out_in is None:
        assert picture is not None, "only a drawing may be without a scale"
        laid_out_in = TwinScale(metres_per_px=1.0, height_px=float(picture.shape[0]))
    track = track_from_route(made.route, laid_out_in, made.settings, source=wanted.source_name)
    if out is not None:
        write_whole(out, track_file(track, made.made_of))
        overlay = _beside(out, twin_out, *wanted.files) if overlay is None else overlay
    if overlay is not None:
        write_whole(overlay, _png(draw_track(picture, track)))
    if twin_out is not None:
        if picture is None:
            raise InputError(
                f"--twin-out {twin_out}: the recording holds no pictures of its frames' size: leave it out"
            )
        write_whole(twin_out, _png(picture))
    found = facts(made.route, scale, track.centreline)
    if made.laps is not None:
        found |= {"laps": made.laps, "spread_m": made.spread_m}
    for note in made.notes:
        typer.echo(note, err=True)
    typer.echo(json.dumps(found) if as_json else sentence(made.settings.name, found))


def _beside(out: Path, *others: Path | None) -> Path:
    """The picture's path for the track file `out`: the same name, unless that is the twin or the track file itself."""
    overlay = out.with_suffix(".png")
    taken = overlay.resolve() in {path.resolve() for path in (out, *others) if path is not None}
    return out.with_name(f"{out.stem}-overlay.png") if taken else overlay


def _check_outputs(inputs: Sequence[Path], outputs: dict[str, Path | None]) -> None:
    """Raises `InputError` where an output is one of the inputs, or two outputs are one file."""
    taken = {path.resolve(): "that file is read, and would be lost" for path in inputs}
    for name, path in outputs.items():
        if path is not None:
            if path.resolve() in taken:
                raise InputError(f"{name} {path}: {taken[path.resolve()]}: name another file")
            taken[path.resolve()] = f"that is where {name} goes"


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
        from_px, to_px = coordinates.line("--measured", measured)
        return TwinScale.from_measured_length(from_px=from_px, to_px=to_px, length_m=length_m, height_px=height_px)
    if length_m is not None:
        return TwinScale(metres_per_px=length_m / route.length_px, height_px=height_px)
    return None if metres_per_px is None else TwinScale(metres_per_px=metres_per_px, height_px=height_px)


def _png(picture: BgrImage) -> bytes:
    ok, data = cv2.imencode(".png", picture)
    assert ok, "OpenCV encodes any 8-bit picture as PNG"
    return data.tobytes()
