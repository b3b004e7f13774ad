"""How well a model does: following a car through a labelled clip, and finding one in a photograph.

Knows the truth file's form and a follower of the simplest kind (constant velocity from the last two detections, whole frame
after a miss). Never trains on what it reads. As a command it prints one JSON object.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.detect.centre import CentreDetector, CentreDetectorSettings
from dnb_edge.detect.onnx import CentreNetwork, default_model_path, load_model
from dnb_edge.detect.still import look_at_still
from dnb_edge.errors import InputError
from dnb_edge.train.card import write_card
from dnb_edge.values import BgrImage, Detection, SearchWindow


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowResult:
    """Following one car through a clip from its first frame."""

    frames: int
    acquired_at: int | None
    """First frame whose detection lies within `found_px` of the truth; None where none does."""
    found_fraction: float
    """Share of all frames with a detection within `found_px` of the truth."""
    within_14px_fraction: float
    """Share of the frames with any detection in which it lies within 14 px."""
    error_p50_px: float | None
    error_p95_px: float | None
    """Percentiles of the error of all detections, near or not; None where there is none."""
    bias_px: tuple[float, float]
    """Mean error (u, v) of the found frames."""
    full_frames: int
    length_p50_px: float
    """Median length of the found car, camera px."""
    sigma_ratio_rms: float
    """Root mean square of error over the stated sigma, an axis; 1 where the sigmas are true."""


class Follower:
    """Follows the best moving detection, as the core does in earnest."""

    def __init__(self, least_confidence: float = 0.3) -> None:
        self._least = least_confidence
        self._last: list[Detection] = []

    def windows(self) -> tuple[SearchWindow, ...]:
        """Where the car is expected in the coming frame; none where nothing is followed."""
        if not self._last:
            return ()
        newest, before = self._last[-1], self._last[0]
        ahead = tuple(2 * now - then for now, then in zip(newest.camera_px, before.camera_px, strict=True))
        return (SearchWindow(target_id=1, camera_px=(ahead[0], ahead[1]), length_px=newest.length_px),)

    def take(self, detections: Sequence[Detection]) -> Detection | None:
        """The detection that continues the target, or starts one; None where there is none."""
        windows = self.windows()
        if windows:
            window = windows[0]
            near = [one for one in detections if math.dist(one.camera_px, window.camera_px) < 1.2 * window.length_px]
            chosen = max(
                near,
                key=lambda one: one.confidence - 0.3 * math.dist(one.camera_px, window.camera_px) / window.length_px,
                default=None,
            )
        else:
            chosen = next((one for one in detections if one.moving and one.confidence >= self._least), None)
        self._last = [] if chosen is None else [*self._last[-1:], chosen]
        return chosen


def clip_frames(path: Path) -> list[BgrImage]:
    """All frames of a clip. Raises InputError where it cannot be read."""
    capture = cv2.VideoCapture(str(path))
    frames: list[BgrImage] = []
    try:
        while True:
            ok, frame = capture.read()
            if not ok:
                break
            frames.append(np.asarray(frame, dtype=np.uint8))
    finally:
        capture.release()
    if not frames:
        raise InputError(f"{path}: no frame can be read; give a video file")
    return frames


def follow_clip(
    network: CentreNetwork,
    frames: Sequence[BgrImage],
    truth_px: Sequence[tuple[float, float]],
    *,
    settings: CentreDetectorSettings | None = None,
    found_px: float = 30.0,
) -> tuple[FollowResult, list[Detection | None]]:
    """Follow the car through `frames`, whose ground points are `truth_px`."""  # fmt: skip
    detector, follower = CentreDetector(network, settings), Follower()
    chosen: list[Detection | None] = []
    full = 0
    for number, frame in enumerate(frames):
        seen = detector.detect(frame, sequence=number, t_ns=number, windows=follower.windows())
        full += seen.full_frame
        chosen.append(follower.take(seen.detections))
    apart = [
        None if one is None else (one.camera_px[0] - true[0], one.camera_px[1] - true[1])
        for one, true in zip(chosen, truth_px, strict=True)
    ]
    errors = np.array([math.hypot(*pair) for pair in apart if pair is not None])
    hits = [
        (number, one, pair)
        for number, (one, pair) in enumerate(zip(chosen, apart, strict=True))
        if one is not None and pair is not None and math.hypot(*pair) <= found_px
    ]
    bias = np.mean([pair for _, _, pair in hits], axis=0) if hits else np.zeros(2)
    ratio = [math.hypot(*pair) / math.sqrt(2) / one.sigma_px for _, one, pair in hits]
    result = FollowResult(
        frames=len(frames),
        acquired_at=hits[0][0] if hits else None,
        found_fraction=len(hits) / len(frames),
        within_14px_fraction=float((errors <= 14.0).mean()) if len(errors) else 0.0,
        error_p50_px=float(np.percentile(errors, 50)) if len(errors) else None,
        error_p95_px=float(np.percentile(errors, 95)) if len(errors) else None,
        bias_px=(float(bias[0]), float(bias[1])),
        full_frames=full,
        length_p50_px=float(np.median([one.length_px for _, one, _ in hits] or [0.0])),
        sigma_ratio_rms=float(np.sqrt(np.mean(np.square(ratio or [0.0])))),
    )
    return result, chosen


def clip_truth(path: Path) -> list[tuple[float, float]]:
    """Ground points, camera px, of each frame of a truth file. Raises InputError where it is missing or of another form."""
    try:
        truth = json.loads(path.read_text(encoding="utf-8"))
        return [(float(frame["camera"][0]), float(frame["camera"][1])) for frame in truth["frames"]]
    except (OSError, ValueError, KeyError, TypeError, IndexError) as fault:
        raise InputError(
            f"{path}: no truth with frames[i].camera can be read ({fault}); put it beside the clip"
        ) from fault


def find_in_photo(network: CentreNetwork, photo: BgrImage) -> tuple[Detection, ...]:
    """Detections in one picture, strongest first, with no background, after one round of all the detector's looks."""
    return look_at_still(network, photo)


def _note(network: CentreNetwork, given: argparse.Namespace, figures: dict[str, object]) -> None:
    """Add the figures to the card, each under its file's name, with the command that gave them."""
    real = network.card.setdefault("metrics", {}).setdefault("zero_shot", {})
    for kind, path in (("clip", given.clip), ("photo", given.photo)):
        if path is not None:
            command = f"python -m dnb_edge.train.evaluate --{kind} {path.name}"
            found = figures[kind]
            real[path.name] = {"command": command, kind: found[:3] if isinstance(found, list) else found}
    write_card(given.model, network.card)


def run(arguments: Sequence[str] | None = None) -> None:
    """Print the figures of a model on a labelled clip or on a photograph. Raises InputError."""
    parser = argparse.ArgumentParser(
        prog="python -m dnb_edge.train.evaluate",
        description="Print the figures of a model on a labelled clip or on a photograph.",
    )
    parser.add_argument("--model", type=Path, default=default_model_path())
    parser.add_argument("--clip", type=Path, help="a clip with NAME.truth.json beside it")
    parser.add_argument("--photo", type=Path)
    parser.add_argument(
        "--into-card", action="store_true", help="note the figures in the model's card as zero-shot results"
    )
    given = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    network = load_model(given.model)
    out: dict[str, object] = {}
    if given.clip is not None:
        truth = clip_truth(given.clip.with_suffix(".truth.json"))
        result, _ = follow_clip(network, clip_frames(given.clip), truth)
        out["clip"] = asdict(result)
    if given.photo is not None:
        photo = cv2.imread(str(given.photo))
        if photo is None:
            raise InputError(f"{given.photo}: not a readable picture")
        out["photo"] = [asdict(one) for one in find_in_photo(network, np.asarray(photo, dtype=np.uint8))]
    if given.into_card:
        _note(network, given, out)
    sys.stdout.write(json.dumps(out) + "\n")


def main() -> None:
    """The command: exit code 2 for wrong input."""
    try:
        run()
    except InputError as fault:
        sys.stderr.write(f"{fault}\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
