"""Figures of a model on held-out footage of our own: whole frames, raced as in earnest, against the exact truth.

Knows the truth of the footage, the detector and the core; trains nothing. `python -m dnb_edge.train.held_out` prints JSON.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.core import Core, CoreSetup
from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.onnx import CentreNetwork, default_model_path, load_model
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import LapRules
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.train.camera import View
from dnb_edge.train.footage import FPS, Conditions, FilmedFrame, film
from dnb_edge.train.shards import load_assets
from dnb_edge.values import Observation
from dnb_edge.view.ground import GroundMap, Matrix3
from dnb_edge.view.lean import floor_lean

HELD_OUT_SEED = 5_000_000
"""Seeds of clips begin here; no training sample uses them."""
FOUND_LENGTHS = 0.5
"""An observation within so many car lengths of the truth is the car."""
_SHIFT_M = 50.0
"""The twin's corner lies so far to the left of and below the camera's foot, so that all its pixels are positive."""
_SCALE = TwinScale(metres_per_px=0.01, height_px=10_000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FootageFigures:
    """Racing the cars of many clips: what the core told of its one target, with what it told late counted in its frame."""

    clips: int
    frames: int
    recall: float
    """Share of all frames with an observation of the car."""
    recall_after_first: float
    """The same without the first frame of each clip, in which nothing can be seen to move."""
    false_per_1000: float
    """Observations of something else in 1,000 frames."""
    error_p50_mm: float | None
    error_p95_mm: float | None
    error_p95_px: float | None
    error_p95_lengths: float | None
    one_sigma_share: float | None
    """Share of errors, along x and along y on the floor, within the stated sigma; 0.683 where sigmas are true."""


@dataclass(slots=True, kw_only=True)
class _Tally:
    clips: int = 0
    frames: int = 0
    found: int = 0
    found_first: int = 0
    false: int = 0
    mm: list[float] = field(default_factory=list)
    px: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    within: list[bool] = field(default_factory=list)


def ground_of(view: View) -> GroundMap:
    """The exact ground map of a drawn camera with a plain lens; track m are its floor's metres, shifted."""
    wide, high = view.width_px - 1.0, view.height_px - 1.0
    camera = np.array([[0.1 * wide, 0.5 * high], [0.9 * wide, 0.5 * high], [0.9 * wide, high], [0.1 * wide, high]])
    twin = _SCALE.to_twin_px(view.floor_points(camera) + _SHIFT_M)
    matrix = cv2.getPerspectiveTransform(camera.astype(np.float32), twin.astype(np.float32)).astype(np.float64)
    if matrix[2] @ np.array([0.5 * wide, high, 1.0]) < 0:
        matrix = -matrix
    entries: Matrix3 = tuple(matrix.ravel().tolist())  # type: ignore[assignment]
    return GroundMap(camera_to_twin=entries, scale=_SCALE, width_px=view.width_px, height_px=view.height_px)


def setup_of(frame: FilmedFrame) -> CoreSetup:
    """What a calibrated appliance would know of the clip that begins with `frame`."""
    path = frame.path_m[::4] + _SHIFT_M
    half = np.full(len(path), frame.lane_m / 2.0)
    centreline = Centreline(points_m=path, half_left_m=half, half_right_m=half)
    start = line_across(centreline, 0.0, name="start", margin_m=0.05)
    return CoreSetup(
        track=Track(name="held-out", scale=_SCALE, centreline=centreline, start_line=start),
        ground=ground_of(frame.view),
        motion=MotionSettings(),
        crossing=CrossingSettings(),
        laps=LapRules(),
        score=ScoreSettings(),
    )


def _count(tally: _Tally, told: Sequence[Observation], truth: Sequence[FilmedFrame]) -> None:
    seen: set[int] = set()
    for one in told:
        number = round(one.t_s * FPS)
        frame = truth[number]
        apart_px = math.dist(one.camera_px, frame.ground_px)
        if apart_px > FOUND_LENGTHS * frame.length_px:
            tally.false += 1
            continue
        seen.add(number)
        errors = [one.track_m[i] - _SHIFT_M - frame.ground_m[i] for i in (0, 1)]
        tally.mm.append(1e3 * math.hypot(*errors))
        tally.px.append(apart_px)
        tally.lengths.append(apart_px / frame.length_px)
        xx, _, yy = one.covariance_m2
        tally.within += [abs(errors[0]) <= math.sqrt(xx), abs(errors[1]) <= math.sqrt(yy)]
    tally.clips += 1
    tally.frames += len(truth)
    tally.found += len(seen)
    tally.found_first += 0 in seen


def race_footage(
    network: CentreNetwork, clips: Iterable[Iterable[FilmedFrame]], *, calibrated: bool = True
) -> FootageFigures:
    """Race the car of each clip; the network is told how things lean where `calibrated`."""
    tally = _Tally()
    for clip in clips:
        told: list[Observation] = []
        truth: list[FilmedFrame] = []
        core: Core | None = None
        for number, frame in enumerate(clip):
            if core is None:
                setup = setup_of(frame)
                core = Core(setup)
                detector = CentreDetector(network, lean=floor_lean(setup.ground) if calibrated else None)
            t_ns = round(number * 1e9 / FPS)
            windows = core.windows(t_ns) if number else ()
            events = core.step(detector.detect(frame.image, sequence=number, t_ns=t_ns, windows=windows))
            told += [event for event in events if isinstance(event, Observation)]
            truth.append(frame)
        _count(tally, told, truth)
    return _figures(tally)


def _figures(tally: _Tally) -> FootageFigures:
    frames = max(1, tally.frames)
    return FootageFigures(
        clips=tally.clips,
        frames=tally.frames,
        recall=tally.found / frames,
        recall_after_first=(tally.found - tally.found_first) / max(1, tally.frames - tally.clips),
        false_per_1000=1e3 * tally.false / frames,
        error_p50_mm=_percentile(tally.mm, 50),
        error_p95_mm=_percentile(tally.mm, 95),
        error_p95_px=_percentile(tally.px, 95),
        error_p95_lengths=_percentile(tally.lengths, 95),
        one_sigma_share=float(np.mean(tally.within)) if tally.within else None,
    )


def _percentile(values: Sequence[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None


def run(arguments: Sequence[str] | None = None) -> None:
    """Print the figures. Raises InputError."""
    parser = argparse.ArgumentParser(
        prog="python -m dnb_edge.train.held_out", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--model", type=Path, default=default_model_path())
    parser.add_argument("--clips", type=int, default=10)
    parser.add_argument("--frames", type=int, default=210, help="frames a clip")
    parser.add_argument(
        "--height", type=float, default=2.15, help="the camera's height, metres; 0: anything from 1.5 to 4"
    )
    parser.add_argument("--uncalibrated", action="store_true", help="do not tell the network how things lean")
    parser.add_argument("--assets", type=Path, help="folder with photographs and meshes, as in training")
    parser.add_argument("--cache", type=Path, default=Path(), help="where the assets' meshes are kept")
    given = parser.parse_args(arguments)
    if min(given.clips, given.frames) < 1:
        raise InputError("--clips and --frames must be at least 1")
    cv2.setNumThreads(1)
    network = load_model(given.model)
    assets = load_assets(given.assets, cache=given.cache)
    conditions = Conditions(camera_height_m=given.height or None)
    clips = (
        film(HELD_OUT_SEED + i, frames=given.frames, conditions=conditions, assets=assets) for i in range(given.clips)
    )
    figures = race_footage(network, clips, calibrated=not given.uncalibrated)
    sys.stdout.write(json.dumps(asdict(figures)) + "\n")


def main() -> None:
    """The command: exit code 2 for wrong input."""
    try:
        run()
    except InputError as fault:
        sys.stderr.write(f"{fault}\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
