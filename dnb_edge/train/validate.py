"""Figures of a model on held-out synthetic samples, in windows scaled as the detector scales them.

Knows samples, windows and the truth in them; trains nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.decode import Peak, peaks
from dnb_edge.detect.lean import lean_bytes
from dnb_edge.detect.looks import Look, look_pixels, window_look
from dnb_edge.detect.onnx import CentreMaps, CentreNetwork
from dnb_edge.train.scene import SCENE_PX, Sample

_FOUND_LENGTHS = 0.33
_LEAST_CONFIDENCE = 0.3
ONE_SIGMA = 0.6827
"""Share of a normal distribution within one standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Hit:
    """A found car: window px throughout."""

    du_px: float
    dv_px: float
    length_ratio: float
    sigma_px: float
    heading_error_rad: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Seen:
    """One window: the car's hit, where it was found, and how many peaks were no car."""

    hit: _Hit | None
    false_peaks: int


def _window(
    sample: Sample, car: NDArray[np.float32], rng: np.random.Generator, with_background: bool
) -> tuple[NDArray[np.uint8], Look]:
    settings = CentreDetectorSettings()
    off = rng.uniform(-0.6, 0.6, 2) * float(car[2])
    look = window_look(
        (float(car[0] + off[0]), float(car[1] + off[1])),
        float(car[2]),
        window_px=settings.window_px,
        window_length_px=settings.window_length_px,
    )
    return look_pixels(sample.image, sample.background if with_background else sample.image, look, 1.0), look


def _answer(network: CentreNetwork, pixels: NDArray[np.uint8], sample: Sample, look: Look) -> CentreMaps:
    """What the network says of a window, told the lean at its middle as in a calibrated run."""
    at = look.to_frame((look.out_width_px - 1) / 2.0, (look.out_height_px - 1) / 2.0)
    told = lean_bytes(sample.lean @ np.array([*at, 1.0]))
    return network.many(pixels[None], leans=np.tile(told, (1, *pixels.shape[:2], 1)))[0]


def _hit(at: tuple[float, float], peak: Peak, car: NDArray[np.float32], scale: float) -> _Hit:
    truth = math.atan2(float(car[4]), float(car[3]))
    error = None if peak.heading_rad is None else abs(math.remainder(peak.heading_rad - truth, 2 * math.pi))
    return _Hit(
        du_px=(at[0] - float(car[0])) * scale,
        dv_px=(at[1] - float(car[1])) * scale,
        length_ratio=peak.length_px / scale / float(car[2]),
        sigma_px=peak.sigma_px,
        heading_error_rad=error,
    )


def _look_at(network: CentreNetwork, samples: Iterable[Sample], *, with_background: bool, seed: int) -> Iterator[_Seen]:
    """One window for each well-visible car of the samples, off its middle as a prediction would be."""
    rng = np.random.default_rng(seed)
    for sample in samples:
        for car in sample.labels:
            if car[5] < 0.5 or not (15 < car[0] < SCENE_PX - 15 and 15 < car[1] < SCENE_PX - 15):
                continue
            pixels, look = _window(sample, car, rng, with_background)
            found = [
                (look.to_frame(peak.u_px, peak.v_px), peak)
                for peak in peaks(_answer(network, pixels, sample, look), least_confidence=_LEAST_CONFIDENCE, most=8)
            ]
            near = min(found, key=lambda one: math.dist(one[0], (float(car[0]), float(car[1]))), default=None)
            hit = None
            if near is not None:
                hit = _hit(near[0], near[1], car, look.scale)
                if math.hypot(hit.du_px, hit.dv_px) > _FOUND_LENGTHS * float(car[2]) * look.scale:
                    hit = None
            false = sum(
                all(math.dist(at, (float(o[0]), float(o[1]))) > 0.5 * float(o[2]) for o in sample.labels)
                for at, _ in found
            )
            yield _Seen(hit=hit, false_peaks=false)


def _percentile(values: list[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None


def window_figures(
    network: CentreNetwork, samples: Iterable[Sample], *, with_background: bool, seed: int = 0
) -> dict[str, float | None]:
    """Recall, ground-point error (px of the window, in which a car is 44 px long), and how true sigmas and headings are.

    Over the well-visible cars of `samples`. Figures of found cars are None where none was found.
    """
    seen = list(_look_at(network, samples, with_background=with_background, seed=seed))
    hits = [one.hit for one in seen if one.hit is not None]
    errors = [math.hypot(hit.du_px, hit.dv_px) for hit in hits]
    within = [abs(error) <= hit.sigma_px for hit in hits for error in (hit.du_px, hit.dv_px)]
    told = [hit.heading_error_rad for hit in hits if hit.heading_error_rad is not None]
    axis = [math.degrees(min(error, math.pi - error)) for error in told]
    return {
        "cars": len(seen),
        "recall": len(hits) / max(1, len(seen)),
        "false_peaks_per_window": sum(one.false_peaks for one in seen) / max(1, len(seen)),
        "error_p50_px": _percentile(errors, 50),
        "error_p95_px": _percentile(errors, 95),
        "bias_u_px": float(np.mean([hit.du_px for hit in hits])) if hits else None,
        "bias_v_px": float(np.mean([hit.dv_px for hit in hits])) if hits else None,
        "length_ratio_p50": _percentile([hit.length_ratio for hit in hits], 50),
        "one_sigma_share": float(np.mean(within)) if within else None,
        "headings_told": len(told) / max(1, len(hits)),
        "axis_error_p50_deg": _percentile(axis, 50),
        "sense_right_share": float(np.mean([error < math.pi / 2 for error in told])) if told else None,
    }


def sigma_scale(network: CentreNetwork, samples: Iterable[Sample], *, seed: int = 0) -> float:
    """The factor by which stated sigmas must grow so that 68.3 % of the errors, an axis, lie within them.

    1 where nothing was found. A network learns its sigmas on windows of all sizes, and its losses punish large errors more than
    a normal distribution has them: this sets the scale where it is used, in the window of a followed car.
    """
    hits = [one.hit for one in _look_at(network, samples, with_background=True, seed=seed) if one.hit is not None]
    ratios = [abs(error) / hit.sigma_px for hit in hits for error in (hit.du_px, hit.dv_px)]
    return float(np.quantile(ratios, ONE_SIGMA)) if ratios else 1.0
