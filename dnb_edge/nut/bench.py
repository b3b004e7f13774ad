"""How fast a model is: passes one after the other in this process, and cold starts in fresh ones.

Knows models, pictures in memory and clocks; nothing of files of pictures, of cards on disk or of drivers.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import WorkError
from dnb_edge.nut.bench_card import ColdStart, Latency, Memory, Spread
from dnb_edge.nut.fit import PictureInput
from dnb_edge.nut.onnx import Model
from dnb_edge.values import BgrImage

COLD_LIMIT_S = 600.0
_DIGITS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Passes:
    """Times of single passes, milliseconds, (repeats, passes)."""

    first_ms: float
    """The very first one of this process."""
    inference_ms: NDArray[np.float64]
    """The network alone."""
    cpu_ms: NDArray[np.float64]
    """The same by processor time, all threads of this process together."""
    preprocessing_ms: NDArray[np.float64] | None
    """None where the network saw noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is measured."""

    repeats: int = 5
    passes: int = 200
    """In each repeat."""
    warm_up: int = 20
    """Passes before the clock counts."""
    cold_starts: int = 3


def time_passes(
    model: Model,
    picture: PictureInput,
    asides: dict[str, NDArray[Any]],
    effort: Effort,
    *,
    pictures: Sequence[BgrImage] = (),
    done: Callable[[], object] = lambda: None,
) -> Passes:
    """Times the passes over `pictures` in turn, or over noise where there are none; `done` is called after each of all.

    Raises WorkError where the network fails on what it is shown.
    """
    noise = np.random.default_rng(0).integers(0, 256, (picture.height_px, picture.width_px, 3), dtype=np.uint8)
    fixed = picture.tensor(noise)

    def one(number: int) -> tuple[float, float, float]:
        began = time.perf_counter()
        tensor = picture.tensor(pictures[number % len(pictures)]) if pictures else fixed
        feeds = {picture.name: tensor, **asides}
        cpu_began, ready = time.process_time(), time.perf_counter()
        model.run(feeds)
        ended, cpu_ended = time.perf_counter(), time.process_time()
        done()
        return (ready - began) * 1e3, (ended - ready) * 1e3, (cpu_ended - cpu_began) * 1e3

    first_ms = one(0)[1]
    for number in range(1, effort.warm_up):
        one(number)
    times = np.array([one(number) for number in range(effort.repeats * effort.passes)])
    shaped = times.T.reshape(3, effort.repeats, effort.passes)
    return Passes(
        first_ms=first_ms,
        inference_ms=shaped[1],
        cpu_ms=shaped[2],
        preprocessing_ms=shaped[0] if pictures else None,
    )


def latency_of(times_ms: NDArray[np.float64]) -> Latency:
    """Percentiles over all passes of (repeats, passes), each with the least and the most that one repeat had."""

    def spread(percent: float) -> Spread:
        of_repeats = np.percentile(times_ms, percent, axis=1)
        return Spread(
            all_ms=_rounded(np.percentile(times_ms, percent)),
            least_ms=_rounded(of_repeats.min()),
            most_ms=_rounded(of_repeats.max()),
        )

    return Latency(
        p50=spread(50),
        p95=spread(95),
        p99=spread(99),
        mean_ms=_rounded(times_ms.mean()),
        max_ms=_rounded(times_ms.max()),
    )


def fps_of(times_ms: NDArray[np.float64]) -> float:
    """Pictures a second, one after the other."""
    return _rounded(1e3 / float(times_ms.mean()))


def start_cold(
    model: Model,
    picture: PictureInput,
    asides: dict[str, NDArray[Any]],
    *,
    threads: int,
    starts: int,
    done: Callable[[], object] = lambda: None,
) -> tuple[ColdStart, Memory]:
    """Medians over fresh processes; the peak of memory is the greatest of all. Raises WorkError where one of them fails."""
    feeds = {picture.name: (picture.kind, picture.shape)}
    feeds |= {name: (str(tensor.dtype), tensor.shape) for name, tensor in asides.items()}
    told: list[dict[str, float]] = []
    for _ in range(starts):
        told.append(_one_cold(model, json.dumps(feeds), threads))
        done()
    times = {
        field.name: _rounded(median(one[field.name] for one in told))
        for field in fields(ColdStart)
        if field.name != "starts"
    }
    memory = Memory(
        grown_bytes=int(median(one["grown_bytes"] for one in told)),
        peak_bytes=int(max(one["peak_bytes"] for one in told)),
    )
    return ColdStart(starts=starts, **times), memory


def _one_cold(model: Model, feeds: str, threads: int) -> dict[str, float]:
    words = [sys.executable, "-m", "dnb_edge.nut.cold", str(time.monotonic_ns()), str(model.path), str(threads), feeds]
    try:
        run = subprocess.run(words, capture_output=True, text=True, check=True, timeout=COLD_LIMIT_S)  # noqa: S603 our own
    except subprocess.TimeoutExpired as error:
        raise WorkError(f"{model.path}: no first answer within {COLD_LIMIT_S:g} s in a fresh process") from error
    except subprocess.CalledProcessError as error:
        last = ([line for line in error.stderr.splitlines() if line.strip()] or ["it said nothing"])[-1].strip()
        raise WorkError(f"{model.path}: a fresh process ended with exit code {error.returncode}: {last}") from error
    told: dict[str, float] = json.loads(run.stdout)
    return told


def _rounded(value: Any) -> float:
    return round(float(value), _DIGITS)
