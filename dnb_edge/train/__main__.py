"""`python -m dnb_edge.train`: make samples, learn, quantise, measure, write a model with its card. Needs the extra `train`."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import torch

from dnb_edge.detect.onnx import load_model
from dnb_edge.errors import DnbEdgeError, InputError
from dnb_edge.train.assets import Assets
from dnb_edge.train.card import file_sha256, model_card, photo_and_mesh_attributions, write_card
from dnb_edge.train.learn import Schedule, ShardReader, train
from dnb_edge.train.network import CentreNet, parameter_count, scale_sigma, to_input
from dnb_edge.train.quantise import export_float, quantise
from dnb_edge.train.scene import Sample, make_sample
from dnb_edge.train.shards import SHARD_SAMPLES, load_assets, start_shards
from dnb_edge.train.validate import sigma_scale, window_figures
from dnb_edge.train.weights import save_weights, weights_path

_LOG = logging.getLogger("dnb_edge.train")
_HELD_OUT_SEED = 1_000_000


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m dnb_edge.train", description="Train our own detector on images that this script makes itself."
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for samples, checkpoints and the model")
    parser.add_argument("--name", default="dnb-edge-centre-v2")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--iterations", type=int, default=24000)
    parser.add_argument("--shards", type=int, default=220, help=f"files of {SHARD_SAMPLES} samples each")
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--held-out", type=int, default=400, help="samples to measure on")
    parser.add_argument(
        "--assets",
        type=Path,
        help="folder with permissively licensed photographs and meshes in its subfolders photos, vehicles, clutter",
    )
    parser.add_argument("--workers", type=int, default=2, help="processes that make samples")
    parser.add_argument(
        "--checkpoint-every", type=int, default=500, help="a run that was cut short goes on from OUT/checkpoint.pt"
    )
    given = parser.parse_args(arguments)
    if min(given.iterations, given.shards, given.batch, given.workers) < 1:
        raise InputError("--iterations, --shards, --batch and --workers must be at least 1")
    return given


def _held_out(given: argparse.Namespace, assets: Assets, *, first: int) -> list[Sample]:
    """Samples that training never sees, `--held-out` of them from number `first` on."""
    return [
        make_sample(np.random.default_rng([given.seed + _HELD_OUT_SEED, first + number]), assets)
        for number in range(given.held_out)
    ]


def _finish(network: CentreNet, given: argparse.Namespace, command: str) -> Path:
    """Quantise, set the scale of the sigmas, measure on held-out samples, write model, weights and card; the model's path."""
    rng = np.random.default_rng([given.seed, 2**31 + 1])
    windows = ShardReader(given.out / "shards").batch(range(min(20, given.shards)), 96, rng).inputs
    calibration = [to_input(torch.from_numpy(one[None])).numpy() for one in windows]
    path: Path = given.out / f"{given.name}.onnx"
    assets = load_assets(given.assets, cache=given.out / "shards")
    quantise(network, path, calibration)
    write_card(path, {"sha256": file_sha256(path)})
    scale = sigma_scale(load_model(path), _held_out(given, assets, first=1_000_000))
    scale_sigma(network, scale)
    quantise(network, path, calibration)
    export_float(network, path.with_suffix(".float.onnx"))
    save_weights(weights_path(path), network)
    write_card(path, {"sha256": file_sha256(path)})
    int8, held_out = load_model(path), _held_out(given, assets, first=0)
    metrics = {
        "held_out_samples": given.held_out,
        "window_with_background": window_figures(int8, held_out, with_background=True),
        "window_without_background": window_figures(int8, held_out, with_background=False),
    }
    card = model_card(
        path,
        seed=given.seed,
        iterations=given.iterations,
        samples=given.shards * SHARD_SAMPLES,
        parameters=parameter_count(network),
        command=command,
        attributions=[] if given.assets is None else photo_and_mesh_attributions(given.assets),
        metrics=metrics,
    )
    write_card(path, card)
    return path


def run(arguments: Sequence[str] | None = None) -> Path:
    """Train as the arguments say; the path of the model. Raises InputError and WorkError."""
    given = _arguments(arguments)
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    given.out.mkdir(parents=True, exist_ok=True)
    command = f"python -m dnb_edge.train --out OUT --seed {given.seed} --iterations {given.iterations} --shards {given.shards}"
    command += f" --batch {given.batch}" + ("" if given.assets is None else " --assets ASSETS")
    pool, jobs = start_shards(
        given.out / "shards", seed=given.seed, first=0, count=given.shards, workers=given.workers, assets=given.assets
    )
    try:
        network = train(
            given.out / "shards",
            seed=given.seed,
            schedule=Schedule(
                iterations=given.iterations, batch=given.batch, shards=given.shards, first_shards=min(16, given.shards)
            ),
            report=lambda step, parts: _LOG.info(
                "%6d  %s", step, "  ".join(f"{name} {value:.4f}" for name, value in parts.items())
            ),
            checkpoint=given.out / "checkpoint.pt",
            checkpoint_every=given.checkpoint_every,
            jobs=jobs,
            photos=load_assets(given.assets, cache=given.out / "shards").photos,
        )
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    path = _finish(network, given, command)
    _LOG.info("wrote %s", path)
    return path


def main() -> None:
    """The command: exit code 2 for wrong input, 1 for failed work."""
    os.nice(5)  # hours of work: let everything else go first
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", stream=sys.stderr)
    try:
        run()
    except DnbEdgeError as fault:
        _LOG.error("%s", fault)
        sys.exit(2 if isinstance(fault, InputError) else 1)


if __name__ == "__main__":
    main()
