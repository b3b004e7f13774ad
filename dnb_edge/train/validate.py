"""Figures of a model on held-out synthetic samples, in windows scaled as the detector scales them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.decode import peaks
from dnb_edge.detect.looks import look_pixels, window_look
from dnb_edge.detect.onnx import CentreNetwork
from dnb_edge.train.scene import SCENE_PX, Sample


def _window(
    sample: Sample, car: NDArray[np.float32], rng: np.random.Generator, with_background: bool
) -> tuple[NDArray[np.uint8], Any]:
    settings = CentreDetectorSettings()
    off = rng.uniform(-0.8, 0.8, 2) * float(car[2])
    look = window_look(
        (float(car[0] + off[0]), float(car[1] + off[1])),
        float(car[2]),
        window_px=settings.window_px,
        window_length_px=settings.window_length_px,
    )
    return look_pixels(sample.image, sample.background if with_background else sample.image, look, 1.0), look


def _percentile(values: list[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None


def window_figures(
    network: CentreNetwork, samples: Iterable[Sample], *, with_background: bool, seed: int = 0
) -> dict[str, float | None]:
    """Recall and ground-point error, px of a window with a 36 px car, over the well-visible cars of `samples`.

    Figures of found cars are None where none was found.
    """
    rng = np.random.default_rng(seed)
    errors: list[float] = []
    errors_u: list[float] = []
    errors_v: list[float] = []
    lengths: list[float] = []
    cars = false_peaks = windows = 0
    for sample in samples:
        whole = [car for car in sample.labels if car[5] > 0.5]
        for car in whole:
            if not (15 < car[0] < SCENE_PX - 15 and 15 < car[1] < SCENE_PX - 15):
                continue
            cars += 1
            windows += 1
            pixels, look = _window(sample, car, rng, with_background)
            found = [
                (look.to_frame(peak.u_px, peak.v_px), peak)
                for peak in peaks(network(pixels), least_confidence=0.3, most=8)
            ]
            scale = look.scale
            near = [(math.dist(at, (float(car[0]), float(car[1]))) * scale, at, peak) for at, peak in found]
            hit = min(near, key=lambda one: one[0], default=None)
            if hit is not None and hit[0] < 12.0:
                errors.append(hit[0])
                errors_u.append((hit[1][0] - float(car[0])) * scale)
                errors_v.append((hit[1][1] - float(car[1])) * scale)
                lengths.append(hit[2].length_px / scale / float(car[2]))
            others = sample.labels[:, :2]
            false_peaks += sum(
                all(math.dist(at, (float(o[0]), float(o[1]))) * scale > 18.0 for o in others) for at, _ in found
            )
    return {
        "cars": cars,
        "recall": len(errors) / max(1, cars),
        "false_peaks_per_window": false_peaks / max(1, windows),
        "error_p50_px": _percentile(errors, 50),
        "error_p95_px": _percentile(errors, 95),
        "bias_u_px": float(np.mean(errors_u)) if errors else None,
        "bias_v_px": float(np.mean(errors_v)) if errors else None,
        "length_ratio_p50": _percentile(lengths, 50),
    }
