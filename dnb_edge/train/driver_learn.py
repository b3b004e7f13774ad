"""How the driving network learns: by imitation, and again from where it went astray itself (DAgger).

Knows the loss, the schedule and how pictures are varied. The second part is of Ross, Gordon and Bagnell, "A Reduction of
Imitation Learning and Structured Prediction to No-Regret Online Learning", AISTATS 2011. Knows no world: lessons are handed in.
Deterministic for a seed on one machine and one thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dnb_edge.sim.control import Control, Sight
from dnb_edge.train.driver_data import Lessons, to_pixels
from dnb_edge.train.driver_network import DriverNet

BATCH = 64
PEAK_RATE = 2e-3
STEERING_WEIGHT = 3.0
"""How much more an error of steering counts than one of throttle."""
_FLIPPED = 0.5
_DARKEST = 0.25
_NOISE = 2.0
_NOISES = 64

Report = Callable[[int, float], None]


def learn(network: DriverNet, lessons: Lessons, *, steps: int, seed: int, report: Report) -> None:
    """Teach `network`, in place, for `steps` batches of varied pictures; the rate falls from its peak to nothing.

    `report` is called with the step and the mean loss now and then.
    """
    random = np.random.default_rng([seed, 93])
    noise = np.float32(_NOISE) * random.standard_normal((_NOISES, *lessons.pixels.shape[1:]), dtype=np.float32)
    optimiser = torch.optim.AdamW(network.parameters(), lr=PEAK_RATE, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: _rate(step / steps))
    network.train()
    losses: list[float] = []
    for step in range(steps):
        batch = varied(lessons, random.integers(len(lessons), size=BATCH), noise, random)
        total = loss(
            network(torch.from_numpy(batch.pixels), torch.from_numpy(batch.speed)), torch.from_numpy(batch.wanted)
        )
        optimiser.zero_grad(set_to_none=True)
        total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
        optimiser.step()
        schedule.step()
        losses.append(float(total.detach()))
        if step % 200 == 199 or step == steps - 1:
            report(step + 1, float(np.mean(losses)))
            losses.clear()
    network.eval()


def _rate(done: float) -> float:
    """Share of the peak rate, for the share of the steps that is done: up over the first tenth, then down as a cosine."""
    return min(10.0 * done + 0.01, 0.5 + 0.5 * math.cos(math.pi * done))


def loss(answers: Tensor, wanted: Tensor) -> Tensor:
    """The mean absolute error, rounded off near 0; steering counts more."""
    parts = torch.nn.functional.smooth_l1_loss(answers, wanted, beta=0.05, reduction="none").mean(dim=0)
    return STEERING_WEIGHT * parts[0] + parts[1]


def varied(
    lessons: Lessons, rows: NDArray[np.integer], noise: NDArray[np.float32], random: np.random.Generator
) -> Lessons:
    """The lessons numbered `rows`, half of them mirrored, each in a light of its own, with one of the pictures of `noise`."""
    pixels, wanted = lessons.pixels[rows].astype(np.float32), lessons.wanted[rows].copy()
    mirrored = random.random(len(rows)) < _FLIPPED
    pixels[mirrored] = pixels[mirrored, :, ::-1]
    wanted[mirrored, 0] *= -1.0
    light = np.exp(random.uniform(np.log(_DARKEST), np.log(1.15), (len(rows), 1, 1, 1))).astype(np.float32)
    tint = random.normal(1.0, 0.04, (len(rows), 1, 1, 3)).astype(np.float32)
    pixels *= light * tint
    pixels += noise[random.integers(len(noise), size=len(rows))]
    speed = lessons.speed[rows] + random.normal(0.0, 0.03, (len(rows), 1)).astype(np.float32)
    return Lessons(
        pixels=np.clip(np.rint(pixels), 0.0, 255.0).astype(np.uint8), speed=speed, wanted=np.clip(wanted, -1.0, 1.0)
    )


class Student:
    """The network as it is, driving."""

    def __init__(self, network: DriverNet) -> None:
        self._network = network.eval()

    def __call__(self, sight: Sight) -> Control:
        """What it wants, having seen that."""
        pixels = torch.from_numpy(to_pixels(sight.bgr)[None])
        with torch.inference_mode():
            steering, throttle = self._network(pixels, torch.tensor([[sight.speed_mps]], dtype=torch.float32))[
                0
            ].tolist()
        return Control(steering=min(1.0, max(-1.0, steering)), throttle=min(1.0, max(-1.0, throttle)))
