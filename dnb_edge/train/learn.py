"""The training loop: batches from shards on disk, a focal loss on the heat, a running mean of the weights.

Knows the loss and the schedule. Deterministic for a seed on one machine and one thread: which shards may be drawn depends on
the iteration, never on how far their making has come.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dnb_edge.errors import WorkError
from dnb_edge.train.batches import Batch, Source, make_batch
from dnb_edge.train.floors import photo_crop
from dnb_edge.train.hard import HardPlace, mine
from dnb_edge.train.network import CentreNet, to_input
from dnb_edge.train.render import to_picture
from dnb_edge.train.scene import LABEL_FIELDS, SCENE_PX
from dnb_edge.train.shards import shard_paths
from dnb_edge.values import BgrImage


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """How long and how fast to learn."""

    iterations: int
    batch: int = 32
    peak_rate: float = 2e-3
    warm_up: int = 200
    decay_from: float = 0.5
    """Share of the iterations after which the rate, constant until then, falls in a straight line."""
    shards: int = 220
    first_shards: int = 16
    """Shards in use from the start; one more is added every `iterations_per_shard`."""
    iterations_per_shard: int = 40
    bare_photos: float = 0.12
    """Share of windows cut from photographs in which there is no car."""
    mine_at: tuple[float, ...] = (0.5, 0.75)
    """Shares of the iterations after which hard places are looked for in all shards and in photographs."""
    hard: float = 0.2
    """Share of windows cut round hard places, once they are known."""
    ema: float = 0.999


_CROPS_A_SHARD = 32
"""Crops of photographs in which hard places are looked for, for each shard."""


class ShardReader:
    """Draws samples from the shards that the schedule allows, waiting for one that is not there yet."""

    def __init__(self, folder: Path, jobs: Sequence[Future[int]] = (), photos: Sequence[BgrImage] = ()) -> None:
        self._folder = folder
        self._jobs = jobs
        self._photos = photos
        self._open: dict[int, tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]] = {}

    def _shard(self, number: int) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]:
        if number not in self._open:
            pictures, labels, leans = shard_paths(self._folder, number)
            if number < len(self._jobs):
                self._jobs[number].result()  # waits for its maker, and raises what the maker raised
            if not pictures.exists():
                raise WorkError(f"{pictures}: no such shard; the making of samples was cut short")
            self._open[number] = (np.load(pictures, mmap_mode="r"), np.load(labels), np.load(leans))
        return self._open[number]

    def _sample(self, number: int, row: int) -> Source:
        shard = self._shard(number)
        return Source(pictures=np.asarray(shard[0][row]), labels=shard[1][row], lean=shard[2][row])

    def _bare_photo(self, rng: np.random.Generator) -> Source:
        picture = to_picture(photo_crop(self._photos, SCENE_PX, rng))
        nothing = np.zeros((1, LABEL_FIELDS), dtype=np.float32)
        return Source(pictures=np.stack([picture, picture]), labels=nothing, lean=_any_lean(rng))

    def _crop(self, number: int) -> Source:
        return self._bare_photo(np.random.default_rng([2**30, number]))

    def samples(self, shards: int) -> Iterator[tuple[int | None, int, NDArray[np.uint8], NDArray[np.float32]]]:
        """(shard or None, row, pictures, labels) of every sample of the first shards and of as many crops of photographs."""
        for number in range(shards):
            for row in range(len(self._shard(number)[1])):
                sample = self._sample(number, row)
                yield number, row, sample.pictures, sample.labels
        for number in range(_CROPS_A_SHARD * shards if self._photos else 0):
            crop = self._crop(number)
            yield None, number, crop.pictures, crop.labels

    def _hard(self, place: HardPlace) -> Source:
        source = self._crop(place.row) if place.shard is None else self._sample(place.shard, place.row)
        return replace(source, about_px=place.centre_px)

    def batch(
        self,
        allowed: range,
        size: int,
        rng: np.random.Generator,
        *,
        bare_photos: float = 0.0,
        hard: Sequence[HardPlace] = (),
        hard_share: float = 0.0,
    ) -> Batch:
        """A batch of windows from random samples of the `allowed` shards, of bare photographs and round hard places."""
        sources: list[Source] = []
        for _ in range(size):
            if self._photos and rng.random() < bare_photos:
                sources.append(self._bare_photo(rng))
            elif hard and rng.random() < hard_share:
                sources.append(self._hard(hard[int(rng.integers(len(hard)))]))
            else:
                number = int(rng.integers(allowed.start, allowed.stop))
                sources.append(self._sample(number, int(rng.integers(len(self._shard(number)[1])))))
        return make_batch(sources, rng)


def _any_lean(rng: np.random.Generator) -> NDArray[np.float32]:
    """A lean (2, 3) that a camera might have over a bare photograph: mostly up, of any length."""
    away = math.pi / 2 + float(rng.normal(0, 0.7))
    length = float(rng.uniform(0.0, 0.9))
    return np.array([[0, 0, math.cos(away) * length], [0, 0, -math.sin(away) * length]], dtype=np.float32)


def losses(outputs: tuple[Tensor, ...], targets: Tensor) -> dict[str, Tensor]:
    """Each part of the loss, for the outputs in OUTPUT_CHANNELS' order and the targets of `batches.targets_for`."""
    heat, offset, size, heading, spread = outputs
    wanted, votes, weight = targets[:, 0:1], targets[:, 1:2], targets[:, 9:10]
    chance = torch.sigmoid(heat).clamp(1e-4, 1 - 1e-4)
    positive = (wanted >= 0.999).to(heat.dtype) * weight
    hit = positive * (1 - chance) ** 2 * torch.log(chance)
    miss = (1 - positive) * weight * (1 - wanted) ** 4 * chance**2 * torch.log(1 - chance)
    count = positive.sum().clamp(min=1.0)
    share = votes / votes.sum().clamp(min=1.0)
    error = (offset - targets[:, 2:4]).abs().sum(dim=1, keepdim=True)
    squared = ((offset - targets[:, 2:4]) ** 2).sum(dim=1, keepdim=True).detach()
    log_sigma = spread.clamp(-4.0, 2.0)
    turned = (heading - targets[:, 5:9]) ** 2
    sense_share = targets[:, 10:11] / targets[:, 10:11].sum().clamp(min=1.0)
    return {
        "heat": -(hit.sum() + miss.sum()) / count,
        "offset": (error * share).sum(),
        "size": ((size - targets[:, 4:5]).abs() * share).sum(),
        "axis": (turned[:, :2].sum(dim=1, keepdim=True) * share).sum(),
        "nose": (turned[:, 2:].sum(dim=1, keepdim=True) * sense_share).sum(),
        "spread": ((squared * torch.exp(-2 * log_sigma) / 2 + 2 * log_sigma) * share).sum(),
    }


LOSS_WEIGHTS = {"heat": 1.0, "offset": 1.0, "size": 0.5, "axis": 0.3, "nose": 0.5, "spread": 0.05}
"""Weight of each part of the loss."""


def answers(network: CentreNet, inputs: NDArray[np.uint8]) -> tuple[Tensor, ...]:
    """The network's outputs, float32, for inputs (n, h, w, 6) uint8; computed in bfloat16, with gradients."""
    pixels = to_input(torch.from_numpy(inputs)).contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16):
        outputs = network(pixels)
    return tuple(output.float() for output in outputs)


def descend(network: CentreNet, optimiser: torch.optim.Optimizer, parts: dict[str, Tensor]) -> None:
    """One step down the weighted sum of the loss's parts, its gradient's length limited."""
    total = torch.stack([LOSS_WEIGHTS[name] * part for name, part in parts.items()]).sum()
    optimiser.zero_grad(set_to_none=True)
    total.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
    optimiser.step()


def _rate(schedule: Schedule, step: int) -> float:
    if step < schedule.warm_up:
        return schedule.peak_rate * (step + 1) / schedule.warm_up
    left = (schedule.iterations - step) / max(1.0, schedule.iterations * (1.0 - schedule.decay_from))
    return schedule.peak_rate * max(0.01, min(1.0, left))


def _update_mean(mean: CentreNet, network: CentreNet, keep: float) -> None:
    with torch.no_grad():
        for kept, new in zip(mean.state_dict().values(), network.state_dict().values(), strict=True):
            if kept.dtype.is_floating_point:
                kept.mul_(keep).add_(new, alpha=1 - keep)
            else:
                kept.copy_(new)


def _save(
    path: Path,
    step: int,
    network: CentreNet,
    mean: CentreNet,
    optimiser: torch.optim.Optimizer,
    hard: Sequence[HardPlace],
) -> None:
    part = path.with_suffix(".part")
    state = {
        "step": step,
        "network": network.state_dict(),
        "mean": mean.state_dict(),
        "optimiser": optimiser.state_dict(),
        "hard": [(one.shard, one.row, one.centre_px, one.confidence) for one in hard],
    }
    torch.save(state, part)
    part.replace(path)


def _restore(
    path: Path, network: CentreNet, mean: CentreNet, optimiser: torch.optim.Optimizer
) -> tuple[int, list[HardPlace]]:
    """Take up a checkpoint; the number of iterations already done, and the hard places known then."""
    state = torch.load(path)
    network.load_state_dict(state["network"])
    mean.load_state_dict(state["mean"])
    optimiser.load_state_dict(state["optimiser"])
    hard = [
        HardPlace(shard=shard, row=row, centre_px=centre_px, confidence=confidence)
        for shard, row, centre_px, confidence in state.get("hard", ())
    ]
    return int(state["step"]), hard


def train(
    folder: Path,
    *,
    seed: int,
    schedule: Schedule,
    report: Callable[[int, dict[str, float]], None],
    checkpoint: Path | None = None,
    checkpoint_every: int = 500,
    jobs: Sequence[Future[int]] = (),
    photos: Sequence[BgrImage] = (),
) -> CentreNet:
    """Learn from the shards in `folder`, which `jobs` make in order.

    Returns the network with the running mean of its weights, in eval mode. Goes on from `checkpoint` where there is one; until
    the rate begins to fall that is the same as having run through, whatever the number of iterations.
    """
    torch.manual_seed(seed)
    network = CentreNet()
    network.to(memory_format=torch.channels_last)
    mean = copy.deepcopy(network)
    optimiser = torch.optim.AdamW(network.parameters(), lr=schedule.peak_rate, weight_decay=1e-4)
    reader = ShardReader(folder, jobs, photos)
    seen: dict[str, float] = {}
    first, hard = 0, list[HardPlace]()
    if checkpoint is not None and checkpoint.exists():
        first, hard = _restore(checkpoint, network, mean, optimiser)
    mining = {round(share * schedule.iterations) for share in schedule.mine_at} - {0}

    def batch_for(step: int) -> Batch:
        count = min(schedule.shards, schedule.first_shards + step // schedule.iterations_per_shard)
        rng = np.random.default_rng([seed, 2**31, step])
        return reader.batch(
            range(count), schedule.batch, rng, bare_photos=schedule.bare_photos, hard=hard, hard_share=schedule.hard
        )

    network.train()
    with ThreadPoolExecutor(1) as ahead:
        coming = None
        for step in range(first, schedule.iterations):
            if step in mining:
                hard = mine(mean, reader.samples(schedule.shards))
                report(step, {"hard places": float(len(hard))})
            batch = batch_for(step) if coming is None or step in mining else coming.result()
            coming = ahead.submit(batch_for, step + 1)
            for group in optimiser.param_groups:
                group["lr"] = _rate(schedule, step)
            parts = losses(answers(network, batch.inputs), torch.from_numpy(batch.targets))
            descend(network, optimiser, parts)
            _update_mean(mean, network, min(schedule.ema, (step + 1) / (step + 10)))
            for name, part in parts.items():
                seen[name] = 0.98 * seen.get(name, float(part.detach())) + 0.02 * float(part.detach())
            if (step + 1) % 50 == 0 or step + 1 == schedule.iterations:
                report(step + 1, dict(seen))
            if checkpoint is not None and (step + 1) % checkpoint_every == 0:
                _save(checkpoint, step + 1, network, mean, optimiser, hard)
    mean.eval()
    return mean
