"""`track build --drive`: follows a car with a calibration and no track, and keeps where it went.

Knows how to look for a car where nobody knows the lane yet: all floor that the camera sees counts as lane.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress, TextColumn, TimeElapsedColumn

from dnb_edge.assembly import detector_of, make_source
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.cli.track_from import Made, SpreadOut, from_laps, ground_for, rounds_of
from dnb_edge.config.schema import DetectorConfig
from dnb_edge.config.track_file import MadeOf
from dnb_edge.core import Core, CoreSetup
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import LapRules
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.build import TrackSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import START_LINE, Track
from dnb_edge.values import BgrImage, Frame, Observation, PointM, path_points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.lean import floor_lean
from dnb_edge.view.rectify import visible_extent_m

PICTURE_EVERY_S = 0.5
"""A picture of the drive is kept as often as this, for the twin."""
_LOOK_EVERY_S = 1.0
"""How often the way so far is looked at for complete rounds."""
_FARTHER = 4.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """What was seen of a drive."""

    way_m: tuple[PointM, ...]
    """Where the car was, track m, in order."""
    pictures: tuple[BgrImage, ...]
    ground: GroundMap
    frames: int


def from_drive(
    uri: str,
    calibration: Path,
    detector: DetectorConfig,
    settings: TrackSettings,
    *,
    rounds: int,
    lane_width_m: float | None,
) -> Made:
    """The median path of the first `rounds` complete rounds of the car before the camera (or until Ctrl-C, or the clip's end).

    Raises `InputError` where no car is found, it does not come round, or its rounds do not agree.
    """
    source = make_source(uri, None)
    try:
        with _progress() as tell:
            drive = watch(source.frames(), source.info.width_px, source.info.height_px, calibration, detector,
                          uri=uri, rounds=rounds, tell=tell)  # fmt: skip
    finally:
        source.close()
    if not drive.way_m:
        raise InputError(
            f"{uri}: no moving car was found in {drive.frames} frames: drive or push one round on the track"
        )
    laps, _ = rounds_of([path_points(drive.way_m)], "")
    return from_laps(laps, drive.ground, settings, drive.pictures, uri, lane_width_m=lane_width_m, made_of=MadeOf())


def watch(
    frames: Iterator[Frame],
    width_px: int,
    height_px: int,
    calibration: Path,
    detector_config: DetectorConfig,
    *,
    uri: str,
    rounds: int,
    tell: Callable[[str], None],
) -> Drive:
    """Follows the car through the frames until it has come round `rounds` times, the frames end or Ctrl-C is pressed."""
    ground = ground_for(calibration, width_px, height_px, uri)
    core = Core(open_floor(ground))
    detector = detector_of(detector_config, floor_lean(ground))
    way: list[PointM] = []
    pictures = SpreadOut()
    count, looked_t_ns, kept_t_ns = 0, 0, 0
    try:
        for frame in frames:
            picture = decode_bgr(frame)
            if picture is None:
                continue
            count += 1
            if count == 1 or frame.t_ns - kept_t_ns >= PICTURE_EVERY_S * 1e9:
                pictures.add(picture)
                kept_t_ns = frame.t_ns
            found = detector.detect(picture, sequence=frame.sequence, t_ns=frame.t_ns, windows=core.windows(frame.t_ns))
            way += [event.track_m for event in core.step(found) if isinstance(event, Observation)]
            if frame.t_ns - looked_t_ns >= _LOOK_EVERY_S * 1e9:
                looked_t_ns = frame.t_ns
                done = len(rounds_of([path_points(way)], "")[0])
                tell(f"{done} of {rounds} rounds" if way else "waiting for a car that moves")
                if done >= rounds:
                    break
    except KeyboardInterrupt:
        tell("stopped")
    return Drive(way_m=tuple(way), pictures=tuple(pictures.kept), ground=ground, frames=count)


def open_floor(ground: GroundMap) -> CoreSetup:
    """A core's setup in which all floor that the camera sees is lane, and laps mean nothing."""
    x0, y0, x1, y1 = visible_extent_m(ground)
    middle, reach_m = np.array([(x0 + x1) / 2, (y0 + y1) / 2]), float(np.hypot(x1 - x0, y1 - y0))
    angle = np.arange(180) * (2 * np.pi / 180)
    # A ring about all of it: the lane reaches to the ring's middle on one side, and far out on the other.
    ring = Centreline(
        points_m=middle + reach_m * np.column_stack((np.cos(angle), np.sin(angle))),
        half_left_m=np.full(180, reach_m),
        half_right_m=np.full(180, _FARTHER * reach_m),
    )
    track = Track(
        name="open floor",
        scale=ground.scale,
        centreline=ring,
        start_line=line_across(ring, 0.0, name=START_LINE, margin_m=-0.999 * reach_m),
    )
    return CoreSetup(
        track=track,
        ground=ground,
        motion=MotionSettings(),
        crossing=CrossingSettings(),
        laps=LapRules(),
        score=ScoreSettings(),
        not_scored_because="there is no track yet",
    )


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """A line on a terminal's stderr that says how far the drive is."""
    console = Console(file=sys.stderr)
    columns = (TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("looking for a car", total=None)
        yield lambda text: progress.update(task, description=text)
