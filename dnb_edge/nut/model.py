"""An ONNX model as a driver: a front picture in, steering and throttle out.

Knows the contract for such models (docs/nut.md): one picture, perhaps the speed, an output (1, 2). Knows no process, no task.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError, WorkError
from dnb_edge.nut.fit import PictureInput, picture_input
from dnb_edge.nut.onnx import Model, load_model
from dnb_edge.sim.control import Briefing, Control, DriverFailed, Sight

INPUTS_WANTED = (
    "one picture (1, 3, height, width) or (1, height, width, 3), float32 or uint8, and at most a speed float32 (1, 1)"
)


class OnnxDriver:
    """Drives by a model whose shapes fit."""

    knows_truth = False

    def __init__(self, model: Model, *, name: str) -> None:
        """Raises InputError where the model's inputs or outputs do not fit, naming what it has and what is wanted."""
        self.name = name
        self._model = model
        self._speed_input = _check(model)
        self._picture: PictureInput | None = None

    def start(self, briefing: Briefing) -> None:
        """Settles the picture's size, which a model may leave open, and runs once. Raises `DriverFailed`."""
        self._picture = picture_input(self._model, _size_px(self._model, briefing.picture_px))
        # A network may fail on the size that it said it takes: better now than in the first bend.
        self._answer(np.zeros(self._picture.shape, dtype=self._picture.kind), 0.0)

    def drive(self, sight: Sight) -> Control:
        """What the network answers, clipped to [-1, 1]. Raises `DriverFailed` for what is no number."""
        assert self._picture is not None, "drive before start"
        steering, throttle = self._answer(self._picture.tensor(sight.bgr), sight.speed_mps)
        if not (np.isfinite(steering) and np.isfinite(throttle)):
            raise DriverFailed(
                f"{self.name}: the network answered steering {steering}, throttle {throttle} to the picture at "
                f"{sight.t_ns * 1e-9:.3f} s: it must answer numbers"
            )
        return Control(steering=min(1.0, max(-1.0, steering)), throttle=min(1.0, max(-1.0, throttle)))

    def close(self) -> None:
        """Nothing to end."""

    def _answer(self, picture: NDArray[Any], speed_mps: float) -> tuple[float, float]:
        feeds = {self._model.inputs[0].name: picture}
        if self._speed_input is not None:
            feeds[self._speed_input] = np.array([[speed_mps]], dtype=np.float32)
        try:
            answer = self._model.run(feeds)[0]
        except WorkError as fault:
            raise DriverFailed(f"{self.name}: {fault}") from fault
        if answer.shape != (1, 2):
            raise DriverFailed(f"{self.name}: the network answered shape {answer.shape}, wanted (1, 2)")
        return float(answer[0, 0]), float(answer[0, 1])


def open_onnx_driver(path: Path, *, name: str | None = None, threads: int = 1) -> OnnxDriver:
    """The driver in `path`, called by the file's stem unless named.

    Raises InputError where it cannot be loaded or does not fit.
    """
    return OnnxDriver(load_model(path, threads=threads), name=path.stem if name is None else name)


def _check(model: Model) -> str | None:
    """The name of the speed's input, None where it has none. Raises InputError where something does not fit."""
    has = "; ".join(one.words for one in model.inputs) or "none"
    try:
        # Any size stands for the one of a vehicle's camera, which is known at the start.
        picture = picture_input(model, _size_px(model, (160, 120)))
    except InputError as fault:
        raise InputError(f"{model.path}: no driver: its inputs are {has}; wanted {INPUTS_WANTED}") from fault
    speed = model.inputs[1] if len(model.inputs) == 2 else None
    if picture.channels != 3 or len(model.inputs) > 2 or not (speed is None or _fits(speed.shape, speed.kind, 1)):
        raise InputError(f"{model.path}: no driver: its inputs are {has}; wanted {INPUTS_WANTED}")
    if not (model.outputs and _fits(model.outputs[0].shape, model.outputs[0].kind, 2)):
        told = "; ".join(one.words for one in model.outputs) or "none"
        raise InputError(
            f"{model.path}: no driver: its outputs are {told}; wanted the first float32 (1, 2): steering, throttle"
        )
    return None if speed is None else speed.name


def _size_px(model: Model, picture_px: tuple[int, int]) -> tuple[int, int] | None:
    """Width and height that the model takes; sides that it leaves open are the picture's. None where it takes no picture."""
    shape = model.inputs[0].shape if model.inputs else ()
    if len(shape) != 4:
        return None
    height, width = shape[2:] if shape[1] in (1, 3) else shape[1:3]
    return (
        width if isinstance(width, int) else picture_px[0],
        height if isinstance(height, int) else picture_px[1],
    )


def _fits(shape: tuple[int | str | None, ...], kind: str, numbers: int) -> bool:
    """Whether it is (1, numbers) in float32; a first side that is open may be 1."""
    return (
        kind == "float32"
        and len(shape) == 2
        and (shape[0] == 1 or not isinstance(shape[0], int))
        and shape[1] == numbers
    )
