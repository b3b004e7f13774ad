"""How long networks take, in turns: one after the other again and again, so that the machine's moods hit all alike.

Knows networks' inputs and two clocks; nothing of frames or cars. A pass is the network alone (`InferenceSession.run`) on
noise: how long a network takes does not depend on what it sees. Beside the time on the wall stands the processor time of this
process, all threads together: where other processes want the same processors a long pass is interrupted and a short one is
not, which processor time leaves out.
"""

from __future__ import annotations

import ast
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.onnx import OpenModel
from dnb_edge.errors import InputError

TURN = 5
"""Timed passes a turn, after one that is not: the first finds others' data in the caches."""

OWN_CHANNELS = (4, 6)
"""Channels of our networks' inputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One network over one input."""

    model: str
    name: str
    """`window`, `full_frame`, or `picture` for a network that takes whole pictures of one size only."""
    width_px: int
    height_px: int
    threads: int
    work: Callable[[], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """How long one pass took, milliseconds."""

    model: str
    name: str
    width_px: int
    height_px: int
    threads: int
    p50_ms: float
    p99_ms: float
    cpu_p50_ms: float
    """Median processor time of all threads together."""
    samples: int


def passes_of(
    model: OpenModel, *, threads: int, window_px: tuple[int, int], full_frame_px: tuple[int, int]
) -> list[Pass]:
    """The passes of a network of ours (a window and a full frame, width and height), or of one that takes colour pictures.

    Raises InputError for a network that takes neither.
    """
    name = model.path.name
    first = model.inputs[0]
    channels = first.shape[3 if first.kind == "tensor(uint8)" else 1] if len(first.shape) == 4 else None
    if channels in OWN_CHANNELS:
        sizes = {"window": window_px, "full_frame": full_frame_px}
    elif channels == 3:
        sizes = {"picture": _picture_size(model)}
    else:
        raise InputError(f"{model.path}: takes neither our networks' channels nor colour pictures: nothing to time")
    return [
        Pass(
            model=name,
            name=kind,
            width_px=width,
            height_px=height,
            threads=threads,
            work=_work(model, _noise(model, width, height)),
        )
        for kind, (width, height) in sizes.items()
    ]


def _work(model: OpenModel, tensor: NDArray[Any]) -> Callable[[], object]:
    return lambda: model.run(tensor)


def _noise(model: OpenModel, width_px: int, height_px: int) -> NDArray[Any]:
    first = model.inputs[0]
    rng = np.random.default_rng(0)
    if first.kind == "tensor(uint8)":
        return rng.integers(0, 256, (1, height_px, width_px, int(first.shape[3] or 4)), dtype=np.uint8)
    kind = np.float16 if first.kind == "tensor(float16)" else np.float32
    return rng.random((1, int(first.shape[1] or 3), height_px, width_px)).astype(kind)


def _picture_size(model: OpenModel) -> tuple[int, int]:
    """Width and height: of the input, or, where they are open, of the metadata's `imgsz`."""
    height, width = model.inputs[0].shape[2:]
    if isinstance(height, int) and isinstance(width, int):
        return width, height
    try:
        told = ast.literal_eval(model.metadata.get("imgsz", ""))
        height, width = (told, told) if isinstance(told, int) else told
        return int(width), int(height)
    except (ValueError, SyntaxError, TypeError) as fault:
        raise InputError(
            f"{model.path}: neither its input nor its metadata 'imgsz' tells a size: export it with a fixed size"
        ) from fault


def in_turns(passes: Sequence[Pass], turns: int, tell: Callable[[], object] = lambda: None) -> list[Timing]:
    """Times all passes in turns, forwards and backwards in alternation; `tell` is called after each turn of all."""
    wall: list[list[float]] = [[] for _ in passes]
    cpu: list[list[float]] = [[] for _ in passes]
    order = list(range(len(passes)))
    for one in passes:
        one.work()
    for _ in range(turns):
        for number in order:
            passes[number].work()
            for _ in range(TURN):
                cpu_began, began = time.process_time(), time.perf_counter()
                passes[number].work()
                ended, cpu_ended = time.perf_counter(), time.process_time()
                wall[number].append((ended - began) * 1e3)
                cpu[number].append((cpu_ended - cpu_began) * 1e3)
        order.reverse()
        tell()
    return [
        Timing(
            model=one.model,
            name=one.name,
            width_px=one.width_px,
            height_px=one.height_px,
            threads=one.threads,
            p50_ms=float(np.percentile(times, 50)),
            p99_ms=float(np.percentile(times, 99)),
            cpu_p50_ms=float(np.percentile(cpu_times, 50)),
            samples=len(times),
        )
        for one, times, cpu_times in zip(passes, wall, cpu, strict=True)
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """How many times longer another network takes, by medians."""

    wall: float
    cpu: float


def ratio_to(timing: Timing, against: Sequence[Timing]) -> Ratio | None:
    """The compared network's time over this one's, on as many threads; None where it was not timed so."""
    for other in against:
        if other.threads == timing.threads:
            return Ratio(wall=other.p50_ms / timing.p50_ms, cpu=other.cpu_p50_ms / timing.cpu_p50_ms)
    return None
