"""Figures of a model on held-out footage of our own: whole frames, followed as in earnest, against the exact truth.

Knows the footage's truth and the detector; trains nothing. `python -m dnb_edge.train.held_out` prints one JSON object.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.onnx import CentreNetwork, default_model_path, load_model
from dnb_edge.errors import InputError
from dnb_edge.train.evaluate import Follower
from dnb_edge.train.footage import Conditions, FilmedFrame, film
from dnb_edge.train.shards import load_assets

HELD_OUT_SEED = 5_000_000
"""Seeds of clips begin here; no training sample uses them."""
FOUND_LENGTHS = 0.5
"""A detection within so many car lengths of the truth is the car."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FootageFigures:
    """Following the cars of many clips."""

    clips: int
    frames: int
    recall: float
    """Share of all frames in which the followed detection is the car."""
    false_per_1000: float
    """Frames in 1,000 in which the followed detection is something else."""
    frames_to_acquire_p95: float
    """95th percentile over the clips of the frames until the car was first found."""
    error_p50_mm: float | None
    error_p95_mm: float | None
    error_p95_px: float | None
    error_p95_lengths: float | None
    one_sigma_share: float | None
    """Share of errors, an axis, that lie within the stated sigma; 0.683 where sigmas are true."""
    axis_error_p50_deg: float | None
    """Error of the heading, its sense left aside."""
    sense_share: float | None
    """Share of told headings that point ahead and not back."""


@dataclass(slots=True)
class _Tally:
    frames: int = 0
    found: int = 0
    false: int = 0


def follow_footage(
    network: CentreNetwork, clips: Iterable[Iterable[FilmedFrame]], *, calibrated: bool = True
) -> FootageFigures:
    """Follow the car of each clip from its first frame; where `calibrated`, the network is told how things lean."""
    tally = _Tally()
    acquired: list[float] = []
    mm: list[float] = []
    px: list[float] = []
    lengths: list[float] = []
    within: list[bool] = []
    angles: list[float] = []
    count = 0
    for clip in clips:
        count += 1
        detector, follower = CentreDetector(network), Follower()
        first: int | None = None
        for number, frame in enumerate(clip):
            if number == 0 and calibrated:
                detector = CentreDetector(network, lean=frame.view.lean)
            seen = detector.detect(frame.image, sequence=number, t_ns=number, windows=follower.windows())
            chosen = follower.take(seen.detections)
            tally.frames += 1
            if chosen is None:
                continue
            du, dv = (chosen.camera_px[i] - frame.ground_px[i] for i in (0, 1))
            apart = math.hypot(du, dv)
            if apart > FOUND_LENGTHS * frame.length_px:
                tally.false += 1
                continue
            first = number if first is None else first
            tally.found += 1
            mm.append(frame.error_mm(chosen.camera_px))
            px.append(apart)
            lengths.append(apart / frame.length_px)
            within += [abs(du) <= chosen.sigma_px, abs(dv) <= chosen.sigma_px]
            if chosen.heading_rad is not None:
                angles.append(abs(math.remainder(chosen.heading_rad - frame.heading_rad, 2 * math.pi)))
        acquired.append(math.inf if first is None else first)
    axis = [min(angle, math.pi - angle) for angle in angles]
    return FootageFigures(
        clips=count,
        frames=tally.frames,
        recall=tally.found / max(1, tally.frames),
        false_per_1000=1e3 * tally.false / max(1, tally.frames),
        frames_to_acquire_p95=float(np.percentile(acquired, 95)),
        error_p50_mm=_percentile(mm, 50),
        error_p95_mm=_percentile(mm, 95),
        error_p95_px=_percentile(px, 95),
        error_p95_lengths=_percentile(lengths, 95),
        one_sigma_share=float(np.mean(within)) if within else None,
        axis_error_p50_deg=None if not axis else math.degrees(float(np.median(axis))),
        sense_share=float(np.mean([angle < math.pi / 2 for angle in angles])) if angles else None,
    )


def _percentile(values: Sequence[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None


def run(arguments: Sequence[str] | None = None) -> None:
    """Print the figures. Raises InputError."""
    parser = argparse.ArgumentParser(
        prog="python -m dnb_edge.train.held_out", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--model", type=Path, default=default_model_path())
    parser.add_argument("--clips", type=int, default=14)
    parser.add_argument("--frames", type=int, default=150, help="frames a clip")
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
    figures = follow_footage(network, clips, calibrated=not given.uncalibrated)
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
