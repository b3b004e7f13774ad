"""Fine-tuning: a network goes on learning from the user's windows and drawn ones, slowly and for a given time.

Knows the loop, the rate and what the network wrongly takes for cars; nothing of files. The statistics of the normalisation
layers stay as they are: a few pictures of one room would bend them, and nothing else would ever bend them back.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.decode import peaks
from dnb_edge.detect.looks import Look, look_pixels, whole_look
from dnb_edge.detect.onnx import CentreMaps
from dnb_edge.train.learn import answers, descend, losses
from dnb_edge.train.network import INPUT_CHANNELS, CentreNet, to_input
from dnb_edge.train.teach_labels import LabelledPicture, evenly
from dnb_edge.train.teach_windows import HardPlace, WindowMaker, with_unknown_lean

_MINE_AT = (0.0, 0.08, 0.2, 0.4, 0.65)
_MOST_MINED = 48
_MOST_A_PICTURE = 5
_MINED_CONFIDENCE = 0.12


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneSettings:
    """How long and how fast to learn."""

    minutes: float = 14.0
    iterations: int = 6000
    """It ends after as many iterations, or when the minutes are over."""
    batch: int = 24
    rate: float = 1e-3
    ema: float = 0.995
    seed: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuned:
    """What fine-tuning gave."""

    network: CentreNet
    iterations: int
    seconds: float
    interrupted: bool
    """True where Ctrl-C ended it before its time; the network holds what was learnt until then."""


class _TorchMaps:
    """The network as the detector calls it: pixels in, maps out."""

    def __init__(self, network: CentreNet) -> None:
        self._network = network

    def __call__(self, pixels: NDArray[np.uint8]) -> CentreMaps:
        with torch.no_grad():
            outputs = self._network(to_input(torch.from_numpy(pixels[None])))
        return CentreMaps(values=torch.cat([output.float() for output in outputs], dim=1)[0].numpy())


def mined(network: CentreNet, pictures: Sequence[LabelledPicture]) -> list[HardPlace]:
    """Where the network sees cars away from all labels, in whole pictures at the detector's scales, the surest first."""
    ask = _TorchMaps(network)
    places: list[HardPlace] = []
    for number in evenly(len(pictures), _MOST_MINED):
        picture = pictures[number]
        found: list[tuple[float, HardPlace]] = []
        for look in _looks(picture):
            pixels = look_pixels(picture.bgr, picture.bgr, look, 1.0)
            pixels = pixels if pixels.shape[2] == INPUT_CHANNELS else with_unknown_lean(pixels)
            for peak in peaks(ask(pixels), least_confidence=_MINED_CONFIDENCE, most=12):
                at = look.to_frame(peak.u_px, peak.v_px)
                if _is_away(picture, at, peak.length_px / look.scale):
                    found.append((peak.confidence, HardPlace(picture=number, centre_px=at, scale=look.scale)))
        found.sort(key=lambda one: (-one[0], one[1].centre_px))
        places.extend(place for _, place in found[:_MOST_A_PICTURE])
    return places


def _looks(picture: LabelledPicture) -> Iterator[Look]:
    """The whole picture at the detector's two scales."""
    height, width = picture.bgr.shape[:2]
    settings = CentreDetectorSettings()
    yield whole_look(width, height, settings.whole_width_px)
    if width > settings.whole_width_px:
        yield whole_look(width, height, settings.fine_width_px)


def _is_away(picture: LabelledPicture, at: tuple[float, float], length_px: float) -> bool:
    return all(
        math.dist(at, car.ground_px) > 0.8 * max(car.length_px, 0.5 * length_px) and not car.is_hit_by(at)
        for car in picture.cars
    )


def fine_tune(
    network: CentreNet, maker: WindowMaker, settings: TuneSettings, tell: Callable[[float], None] = lambda _: None
) -> Tuned:
    """A copy of `network` after learning from `maker`'s windows; `tell` hears the share that is done.

    The first Ctrl-C ends the learning and keeps what was learnt. The same seed, pictures and number of iterations give the same
    network on one machine.
    """
    torch.manual_seed(settings.seed)
    learner = copy.deepcopy(network).to(memory_format=torch.channels_last)
    mean = copy.deepcopy(network).eval()
    _train_mode(learner)
    optimiser = torch.optim.AdamW(learner.parameters(), lr=settings.rate, weight_decay=1e-4)
    begun_s = time.monotonic()
    step, to_mine, interrupted = 0, list(_MINE_AT), False

    def rng_of(number: int) -> np.random.Generator:
        return np.random.default_rng([settings.seed, 91, number])

    with ThreadPoolExecutor(1) as ahead:
        try:
            coming = ahead.submit(maker.batch, settings.batch, rng_of(0))
            while (done := _done(settings, step, time.monotonic() - begun_s)) < 1.0:
                if to_mine and done >= to_mine[0]:
                    to_mine.pop(0)
                    maker.hard.extend(mined(mean, maker.pictures))
                batch = coming.result()
                coming = ahead.submit(maker.batch, settings.batch, rng_of(step + 1))
                for group in optimiser.param_groups:
                    group["lr"] = (
                        settings.rate * min(1.0, (step + 1) / 50) * (0.02 + 0.98 * math.cos(0.5 * math.pi * done))
                    )
                _step(learner, optimiser, batch.inputs, batch.targets)
                _follow(mean, learner, min(settings.ema, (step + 1) / (step + 10)))
                step += 1
                tell(done)
        except KeyboardInterrupt:
            interrupted = True
    tell(1.0)
    return Tuned(network=mean, iterations=step, seconds=time.monotonic() - begun_s, interrupted=interrupted)


def _done(settings: TuneSettings, step: int, seconds: float) -> float:
    return max(step / settings.iterations, seconds / (60.0 * settings.minutes))


def _train_mode(network: CentreNet) -> None:
    network.train()
    for layer in network.modules():
        if isinstance(layer, nn.BatchNorm2d):
            layer.eval()


def _step(
    network: CentreNet, optimiser: torch.optim.Optimizer, inputs: NDArray[np.uint8], targets: NDArray[np.float32]
) -> None:
    outputs = answers(network, inputs)
    descend(network, optimiser, losses(outputs, _with_unknown_headings(torch.from_numpy(targets), outputs[3])))


def _with_unknown_headings(targets: Tensor, heading: Tensor) -> Tensor:
    """The targets, where a heading that nobody knows, all zero, is what the network says: it teaches nothing then."""
    last = 5 + heading.shape[1]
    wanted = targets[:, 5:last]
    known = wanted.abs().sum(dim=1, keepdim=True) > 0
    return torch.cat([targets[:, :5], torch.where(known, wanted, heading.detach()), targets[:, last:]], dim=1)


def _follow(mean: CentreNet, network: CentreNet, keep: float) -> None:
    """Move the running mean of the weights."""
    with torch.no_grad():
        for kept, new in zip(mean.parameters(), network.parameters(), strict=True):
            kept.mul_(keep).add_(new, alpha=1 - keep)
