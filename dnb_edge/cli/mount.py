"""`dnb-edge mount plan`: what a camera would see of a track, and where to put it, before a hole is drilled."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from dnb_edge.errors import InputError
from dnb_edge.mount.advice import advice
from dnb_edge.mount.cameras import CAMERAS, KnownCamera
from dnb_edge.mount.geometry import Optics, TrackArea
from dnb_edge.mount.plan import MountPlan, MountRequest, PlannedCar, PointPlan, Rate, plan_mount
from dnb_edge.mount.suggest import FLATTEST_DEG, LOWEST_M, Free, MountLimits
from dnb_edge.mount.timing import SLOWEST_FPS
from dnb_edge.report.files import write_whole

app = typer.Typer(help="Plan where the camera goes.", no_args_is_help=True)

_DEFAULT_SIZE, _DEFAULT_FPS = (1280, 720), 30.0


@app.callback()
def mount() -> None:
    """Plan where the camera goes."""


@app.command("plan")
def plan(
    *,
    track: Annotated[
        str,
        typer.Option(
            help="The track's floor, m: WIDTHxDEPTH across and along the camera's line of sight, such as 3.0x2.2."
        ),
    ],
    camera: Annotated[
        str | None, typer.Option(help=f"A common camera: {', '.join(CAMERAS)}. Sets --hfov, --size and --fps.")
    ] = None,
    hfov: Annotated[
        float | None,
        typer.Option(
            help="Angle between the picture's left and right edges, degrees (not the diagonal). A width w that fills the "
            "picture from the distance a makes 2 atan(w / 2a)."
        ),
    ] = None,
    size: Annotated[str | None, typer.Option(help="Size of frame, px: WIDTHxHEIGHT. Default 1280x720.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frames a second. Default 30.")] = None,
    exposure_ms: Annotated[float, typer.Option(help="Exposure of one frame, ms.")] = 2.0,
    height: Annotated[
        float | None, typer.Option(help="Of the lens above the floor, m. Left out: the best one is searched.")
    ] = None,
    pitch: Annotated[
        float | None,
        typer.Option(
            help="Of the line of sight below the horizon, degrees; 90 is straight down. Left out: the best one."
        ),
    ] = None,
    distance: Annotated[
        float | None,
        typer.Option(
            help="On the floor, from the track's near edge back to the point below the lens, m; negative where that "
            "point is beyond the edge, over the track. Left out: the best one."
        ),
    ] = None,
    aside: Annotated[float, typer.Option(help="Of the camera to the right of the track's middle, m.")] = 0.0,
    turn: Annotated[float, typer.Option(help="Of the line of sight to the right of straight across, degrees.")] = 0.0,
    max_height: Annotated[float, typer.Option(help="How high a camera can be put, m.")] = 2.5,
    margin: Annotated[float, typer.Option(help="Floor round the track that must be in the picture, too, m.")] = 0.1,
    speed: Annotated[float, typer.Option(help="The car's, m/s.")] = 2.0,
    car_length: Annotated[float, typer.Option(help="Of the car, m.")] = 0.25,
    car_height: Annotated[float, typer.Option(help="Of the car's top, or its roof marker, above the floor, m.")] = 0.1,
    sigma_px: Annotated[
        float | None,
        typer.Option(
            help="Scatter of the detector's ground point from frame to frame, px. Left out: 0.02 car lengths, at "
            "least 0.5 px."
        ),
    ] = None,
    stamp_ms: Annotated[float, typer.Option(help="Sigma of the camera's stamps, ms, where you know it.")] = 0.0,
    readout_ms: Annotated[
        float | None, typer.Option(help="From first to last row of a rolling shutter, ms, where you know it.")
    ] = None,
    out: Annotated[
        list[Path] | None, typer.Option(help="Draw side and top view, to scale, here (.svg or .png); repeat it.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Say what a camera in one place gives: coverage, mm a pixel, blur, timing sigma.

    What is left out of --height, --pitch and --distance is chosen: the whole track in the picture, and the least mm a pixel at
    the track's worst point.

    dnb-edge mount plan --track 3.0x2.2 --camera c920 --out plan.svg
    """  # fmt: skip
    known = _known(camera)
    _check_outputs(out or [])
    width_m, depth_m = _pair("--track", track, "metres, such as 3.0x2.2")
    _within("--track", min(width_m, depth_m), 0.1, math.inf, "m a side")
    _within("--track", max(width_m, depth_m), 0.0, 100.0, "m a side")
    _within("--max-height", max_height, LOWEST_M, 30.0, "m")
    checked_speed = _within("--speed", speed, 0.01, 50.0, "m/s")
    request = MountRequest(
        optics=_optics(known, hfov, size),
        rate=Rate(
            fps=_within("--fps", fps if fps is not None else known.fps if known else _DEFAULT_FPS, SLOWEST_FPS, 1000.0),
            exposure_s=_within("--exposure-ms", exposure_ms, 0.01, 1000.0, "ms") * 1e-3,
            stamp_sigma_s=_within("--stamp-ms", stamp_ms, 0.0, 1000.0, "ms") * 1e-3,
            readout_s=_readout_s(known, readout_ms),
        ),
        track=TrackArea(width_m=width_m, depth_m=depth_m),
        car=PlannedCar(
            speed_mps=checked_speed,
            length_m=_within("--car-length", car_length, 0.01, 5.0, "m"),
            height_m=_within("--car-height", car_height, 0.0, 2.0, "m"),
        ),
        free=Free(
            height_m=None if height is None else _within("--height", height, 0.05, 30.0, "m"),
            pitch_deg=None if pitch is None else _within("--pitch", pitch, FLATTEST_DEG, 90.0, "degrees"),
            distance_m=None if distance is None else _within("--distance", distance, -100.0, 100.0, "m"),
            aside_m=_within("--aside", aside, -100.0, 100.0, "m"),
            turn_deg=_within("--turn", turn, -180.0, 180.0, "degrees"),
        ),
        limits=MountLimits(max_height_m=max_height, margin_m=_within("--margin", margin, 0.0, 10.0, "m")),
        sigma_px=None if sigma_px is None else _within("--sigma-px", sigma_px, 0.01, 1000.0, "px"),
    )
    if request.free.height_m is None and not max_height > request.car.height_m:
        raise InputError(f"--max-height {max_height:g}: must be above the car, which is {car_height:g} m high")
    found = plan_mount(request)
    for path in out or []:
        _draw(path, found)
    if as_json:
        typer.echo(json.dumps(_facts(found, known)))
    else:
        _print(found, known)


def _known(camera: str | None) -> KnownCamera | None:
    if camera is None:
        return None
    if camera not in CAMERAS:
        raise InputError(f"--camera {camera}: not one of {', '.join(CAMERAS)}: give --hfov, --size and --fps instead")
    return CAMERAS[camera]


def _check_outputs(out: list[Path]) -> None:
    for path in out:
        if path.suffix.lower() not in (".png", ".svg"):
            raise InputError(f"--out {path}: the name must end in .png or .svg")


def _optics(known: KnownCamera | None, hfov: float | None, size: str | None) -> Optics:
    if hfov is None:
        if known is None:
            raise InputError(f"--hfov: give the lens's angle in degrees, or --camera ({', '.join(CAMERAS)})")
        hfov = known.hfov_deg
    width, height = (known.width_px, known.height_px) if known is not None else _DEFAULT_SIZE
    if size is not None:
        across, down = _pair("--size", size, "whole pixels, such as 1280x720")
        if across != int(across) or down != int(down) or not (16 <= down <= 20000 and 16 <= across <= 20000):
            raise InputError(f"--size {size}: must be whole pixels from 16 to 20000, such as 1280x720")
        width, height = int(across), int(down)
    return Optics(hfov_deg=_within("--hfov", hfov, 5.0, 160.0, "degrees"), width_px=width, height_px=height)


def _readout_s(known: KnownCamera | None, readout_ms: float | None) -> float | None:
    if readout_ms is not None:
        return _within("--readout-ms", readout_ms, 0.0, 1000.0, "ms") * 1e-3
    return 0.0 if known is not None and not known.rolling else None


def _pair(option: str, text: str, form: str) -> tuple[float, float]:
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*[xX×]\s*(\d+(?:\.\d*)?|\.\d+)\s*", text)
    if match is None:
        raise InputError(f"{option} {text}: must be two numbers with an x between them, {form}")
    return float(match[1]), float(match[2])


def _within(option: str, value: float, low: float, high: float, unit: str = "") -> float:
    if not low <= value <= high:
        unit = f" {unit}" if unit else ""
        allowed = f"from {low:g} to {high:g}{unit}" if math.isfinite(high) else f"{low:g}{unit} or more"
        raise InputError(f"{option} {value:g}: must be {allowed}")
    return value


def _draw(path: Path, found: MountPlan) -> None:
    from dnb_edge.report.mount import mount_picture  # noqa: PLC0415 Matplotlib is slow to import

    write_whole(path, mount_picture(found, picture_format="svg" if path.suffix.lower() == ".svg" else "png"))


def _facts(found: MountPlan, known: KnownCamera | None) -> dict[str, Any]:
    request, cover, optics = found.request, found.coverage, found.request.optics
    return {
        "camera": None if known is None else known.title,
        "hfov_deg": optics.hfov_deg,
        "vfov_deg": optics.vfov_deg,
        "size_px": [optics.width_px, optics.height_px],
        "focal_px": optics.focal_px,
        "fps": request.rate.fps,
        "track_m": [request.track.width_m, request.track.depth_m],
        "stand": _stand(found),
        "searched": [name for name in ("height_m", "pitch_deg", "distance_m") if getattr(request.free, name) is None],
        "coverage": cover.share,
        "cut_off": list(cover.cut_off),
        "spare_px": cover.spare_px,
        "near": _point(found.near),
        "far": _point(found.far),
        "worst": _point(found.worst),
        "speed_mps": request.car.speed_mps,
        "blur_mm": 1000.0 * found.blur_m,
        "blur_px": max(found.near.blur_px, found.far.blur_px, found.worst.blur_px),
        "crossing_sigma_s": found.worst.crossing_sigma_s,
        "lap_sigma_s": math.sqrt(2.0) * found.worst.crossing_sigma_s,
        "parallax_mm": 1000.0 * found.parallax_m,
        "row_delay_s": found.row_delay_s,
        "better": None if found.better is None else _short(found.better),
        "gentler": None if found.gentler is None else _short(found.gentler),
        "advice": list(advice(found)),
    }


def _stand(found: MountPlan) -> dict[str, float]:
    stand = found.camera.stand
    return {
        "height_m": stand.height_m, "pitch_deg": stand.pitch_deg, "distance_m": stand.distance_m,
        "aside_m": stand.aside_m, "turn_deg": stand.turn_deg,
    }  # fmt: skip


def _short(found: MountPlan) -> dict[str, Any]:
    return {"stand": _stand(found), "coverage": found.coverage.share, "worst": _point(found.worst)}


def _point(point: PointPlan) -> dict[str, Any]:
    """Where: metres to the right of the track's middle, and from its near edge."""
    resolution = point.resolution
    return {
        "at_m": list(resolution.at_m),
        "across_mm_per_px": resolution.across_mm,
        "along_mm_per_px": resolution.along_mm,
        "worst_mm_per_px": resolution.worst_mm,
        "car_px": point.car_px,
        "blur_px": point.blur_px,
        "sigma_px": point.sigma_px,
        "crossing_sigma_s": point.crossing_sigma_s,
    }


def _print(found: MountPlan, known: KnownCamera | None) -> None:
    console = Console()
    request, optics, stand = found.request, found.request.optics, found.camera.stand
    about = f"{known.title}, about " if known is not None else ""
    console.print(
        f"{about}{optics.hfov_deg:g} x {optics.vfov_deg:.0f} degrees, {optics.width_px}x{optics.height_px} at "
        f"{request.rate.fps:g} fps; track {request.track.width_m:g} x {request.track.depth_m:g} m",
        highlight=False,
    )
    free = request.free
    places = Table("place", "", "", box=None)
    for name, value, given in (
        ("height", f"{stand.height_m:.2f} m", free.height_m),
        ("pitch", f"{stand.pitch_deg:g} degrees down", free.pitch_deg),
        ("from the near edge", f"{stand.distance_m:.2f} m", free.distance_m),
    ):
        places.add_row(name, value, "given" if given is not None else "suggested")
    places.add_row("track in the picture", f"{100.0 * found.coverage.share:.1f} %", "")
    places.add_row(f"blur at {request.car.speed_mps:g} m/s", f"{1000.0 * found.blur_m:.1f} mm", "")
    console.print(places)
    console.print()
    table = Table("on the track", "near", "far", "worst", box=None)
    columns = (found.near, found.far, found.worst)
    table.add_row("mm a px across the view", *(f"{one.resolution.across_mm:.2f}" for one in columns))
    table.add_row("mm a px along the view", *(f"{one.resolution.along_mm:.2f}" for one in columns))
    table.add_row("mm a px, worst direction", *(f"{one.resolution.worst_mm:.2f}" for one in columns))
    table.add_row("car, px", *(f"{one.car_px:.0f}" for one in columns))
    table.add_row("blur, px", *(f"{one.blur_px:.1f}" for one in columns))
    table.add_row("sigma of a crossing, ms", *(f"{1e3 * one.crossing_sigma_s:.2f}" for one in columns))
    table.add_row("sigma of a lap, ms", *(f"{1e3 * math.sqrt(2.0) * one.crossing_sigma_s:.2f}" for one in columns))
    console.print(table)
    sentences = advice(found)
    if sentences:
        console.print()
    for sentence in sentences:
        console.print(f"- {sentence}", highlight=False, soft_wrap=True)
