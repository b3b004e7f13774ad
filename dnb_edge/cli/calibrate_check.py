"""`dnb-edge calibrate check`: whether the camera still stands where it was calibrated.

Takes a few pictures from the source and compares their median with the calibration's own picture, as the drift watch does while
a race runs. Changes nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from dnb_edge.assembly import assemble, make_source
from dnb_edge.assembly.pictures import calibrated_picture, in_size
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.capture.source import FrameSource
from dnb_edge.cli.photograph import read_photograph
from dnb_edge.cli.run import ConfigFile, Override
from dnb_edge.cli.run_means import load_run_config
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError, WorkError
from dnb_edge.view.drift import TOO_LITTLE
from dnb_edge.view.drift_judge import DriftJudge, DriftSettings, Look, Verdict, watched_track
from dnb_edge.view.drift_patches import grey
from dnb_edge.view.drift_reference import PlaceReference, median_of_five

PICTURES = 5
APART_S = 0.4
"""Between two of the pictures, seconds of the stamps: what walks by is in few of them."""


def check(
    config_file: ConfigFile = None,
    source: Annotated[
        str | None, typer.Option(help="v4l2:/dev/video0, file:clip.mp4 ... Default: capture.source.")
    ] = None,
    reference: Annotated[
        Path | None, typer.Option(help="The picture to compare with, instead of the calibration's own.")
    ] = None,
    overrides: Override = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Say whether the camera still stands where it was calibrated: exit code 0 in place, 1 moved or not to be told."""
    config = load_run_config(config_file, overrides or [])
    uri = source if source is not None else config.capture.source
    if uri is None:
        raise InputError("no source: give --source, or capture.source in the configuration")
    with closing(make_source(uri, config)) as opened:
        judge = _judge(config, opened, reference)
        look = judge.look_at(_still_picture(opened))
    span_m = judge.watched.span_m
    typer.echo(json.dumps(_facts(look, span_m)) if as_json else _text(look, span_m))
    if look.verdict is Verdict.MOVED:
        raise WorkError("the camera has moved since it was calibrated: put it back, or calibrate again")
    if look.verdict is Verdict.UNSURE:
        raise WorkError(
            "the picture cannot be compared with the calibration's: clear the view, put the light on; if it still cannot, "
            "the camera shows another place: calibrate again"
        )


def _judge(config: Config, source: FrameSource, reference: Path | None) -> DriftJudge:
    """The judge of the source's pictures. Raises `InputError` where there is nothing to compare them with."""
    info = source.info
    setup = assemble(config, info).setup
    if reference is not None:
        picture = in_size(read_photograph(reference), info.width_px, info.height_px, name=str(reference))
    else:
        own = calibrated_picture(config.view, info)
        if own is None:
            raise InputError(
                "no picture of the view as it was calibrated: give --reference PICTURE, or write a calibration file with its "
                "picture (`dnb-edge calibrate keypoints --out FILE --picture PICTURE`) and name it in view.calibration"
            )
        picture = own
    watched = watched_track(setup.ground, setup.track.centreline.points_m)
    made = PlaceReference.of(picture, watched.camera_px)
    if not made.enough:
        raise InputError(TOO_LITTLE)
    return DriftJudge(reference=made, watched=watched, settings=DriftSettings())


def _still_picture(source: FrameSource) -> NDArray[np.uint8]:
    """The median of the first pictures, (h, w): what moves is not in it. Raises `WorkError` where there are none."""
    pictures = list(_spaced(source))
    if not pictures:
        raise WorkError(f"{source.info.uri}: gave no picture")
    # A short clip may have fewer: then some count twice.
    return median_of_five((pictures * PICTURES)[:PICTURES])


def _spaced(source: FrameSource) -> Iterator[NDArray[np.uint8]]:
    given, last_t_ns = 0, None
    for frame in source.frames():
        if last_t_ns is not None and frame.t_ns - last_t_ns < APART_S * 1e9:
            continue
        image = decode_bgr(frame)
        if image is None:
            continue
        last_t_ns, given = frame.t_ns, given + 1
        yield grey(image)
        if given == PICTURES:
            return


def _facts(look: Look, span_m: float) -> dict[str, Any]:
    return {
        "in_place": look.verdict is Verdict.IN_PLACE,
        "verdict": look.verdict.value,
        "moved_px": look.moved_px,
        "moved_m": look.moved_m,
        "sigma_m": look.sigma_m,
        "share_of_span": None if look.moved_m is None else look.moved_m / span_m,
        "span_m": span_m,
        "patches": look.patches,
        "seen": look.seen,
        "agreeing": look.agreeing,
    }


def _text(look: Look, span_m: float) -> str:
    verdict = {
        Verdict.IN_PLACE: "The camera is in its place.",
        Verdict.MOVED: "The camera has moved.",
        Verdict.UNSURE: "The camera's place cannot be told.",
    }[look.verdict]
    lines = [verdict]
    if look.moved_m is not None and look.moved_px is not None:
        lines.append(
            f"  Greatest shift over the track: {look.moved_px:.2f} px, {look.moved_m * 1e3:.1f} mm "
            f"({100.0 * look.moved_m / span_m:.2f} % of its span of {span_m:.2f} m)"
        )
    hidden = look.patches - look.seen
    lines.append(f"  {look.agreeing} of {look.patches} patches agree; {hidden} were hidden or look otherwise now")
    return "\n".join(lines)
