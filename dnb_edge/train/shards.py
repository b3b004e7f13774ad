"""Samples on disk: made by several processes, a few hundred to a file, so that training can begin on the early ones.

Sample n of seed s is drawn from `numpy.random.default_rng([s, n])` whatever the number of processes: the shards are the same
bytes for the same seed, assets and library versions. A shard that is already there is kept.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.train.assets import NO_ASSETS, Assets
from dnb_edge.train.meshes import load_clutter_meshes, load_vehicle_meshes, read_meshes, save_meshes
from dnb_edge.train.scene import LABEL_FIELDS, MAX_CARS, SCENE_PX, make_sample
from dnb_edge.values import BgrImage

SHARD_SAMPLES = 128
_PHOTO_SIDE_PX = 900
_WITH_VEHICLES = ("car-detection", "bicycle", "vehicle", "traffic")


def shard_paths(folder: Path, number: int) -> tuple[Path, Path, Path]:
    """Files of a shard: pictures (n, 2, 192, 192, 3) uint8, image then background; labels (n, MAX_CARS, 6) and leans (n, 2, 3)
    float32."""
    pictures, labels, leans = (folder / f"shard-{number:05d}-{part}.npy" for part in ("pictures", "labels", "leans"))
    return pictures, labels, leans


def asset_photos(assets: Path | None) -> tuple[list[Path], list[Path]]:
    """Photographs for backdrops and for floor textures under `assets`/photos; photographs of traffic are left out.

    Raises InputError where the folder holds none.
    """
    if assets is None:
        return [], []
    found = sorted(path for kind in ("*.jpg", "*.jpeg", "*.png") for path in (assets / "photos").rglob(kind))
    found = [path for path in found if not any(word in path.name for word in _WITH_VEHICLES)]
    if not found:
        raise InputError(
            f"{assets}: no photographs in its folder 'photos'; leave --assets out to train on drawn floors only"
        )
    textures = [path for path in found if path.parent.name == "textures"]
    return [path for path in found if path.parent.name != "textures"], textures


def load_photos(paths: Sequence[Path]) -> list[BgrImage]:
    """The photographs, shrunk to at most 900 px. Raises InputError for an unreadable one."""
    out: list[BgrImage] = []
    for path in paths:
        photo = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if photo is None:
            raise InputError(f"{path}: not a readable picture; remove it from the assets")
        scale = _PHOTO_SIDE_PX / max(photo.shape[:2])
        if scale < 1.0:
            photo = cv2.resize(photo, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        if min(photo.shape[:2]) >= 64:
            out.append(np.asarray(photo, dtype=np.uint8))
    return out


def load_assets(folder: Path | None, *, cache: Path) -> Assets:
    """All real material under `folder`; meshes are read from `cache`, which is written where it is not there yet.

    Raises InputError where the folder holds no photographs.
    """
    if folder is None:
        return NO_ASSETS
    photos, textures = asset_photos(folder)
    vehicles, clutter = cache / "vehicles.npz", cache / "clutter.npz"
    cache.mkdir(parents=True, exist_ok=True)
    if not vehicles.exists():
        save_meshes(vehicles, load_vehicle_meshes(folder))
    if not clutter.exists():
        save_meshes(clutter, load_clutter_meshes(folder))
    return Assets(
        photos=load_photos(photos),
        textures=load_photos(textures),
        vehicles=read_meshes(vehicles),
        clutter=read_meshes(clutter),
    )


_worker_assets: list[Assets] = []


def _start_worker(folder: Path | None, cache: Path) -> None:
    cv2.setNumThreads(1)
    os.nice(5)
    _worker_assets[:] = [load_assets(folder, cache=cache)]


def padded(labels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Labels as (MAX_CARS, 6); a row of zero length is no car."""
    out = np.zeros((MAX_CARS, LABEL_FIELDS), dtype=np.float32)
    out[: len(labels)] = labels[:MAX_CARS]
    return out


def write_shard(folder: Path, number: int, seed: int, assets: Assets, *, samples: int = SHARD_SAMPLES) -> None:
    """Make and write one shard; the pictures' file appears last and only when whole."""
    pictures = np.empty((samples, 2, SCENE_PX, SCENE_PX, 3), dtype=np.uint8)
    labels = np.zeros((samples, MAX_CARS, LABEL_FIELDS), dtype=np.float32)
    leans = np.zeros((samples, 2, 3), dtype=np.float32)
    for row in range(samples):
        sample = make_sample(np.random.default_rng([seed, number * SHARD_SAMPLES + row]), assets)
        pictures[row, 0], pictures[row, 1] = sample.image, sample.background
        labels[row], leans[row] = padded(sample.labels), sample.lean
    pictures_path, labels_path, leans_path = shard_paths(folder, number)
    np.save(labels_path, labels)
    np.save(leans_path, leans)
    part = pictures_path.with_suffix(".part.npy")
    np.save(part, pictures)
    part.rename(pictures_path)


def _shard_job(folder: Path, number: int, seed: int) -> int:
    if not shard_paths(folder, number)[0].exists():
        write_shard(folder, number, seed, _worker_assets[0])
    return number


def start_shards(
    folder: Path, *, seed: int, first: int, count: int, workers: int, assets: Path | None
) -> tuple[ProcessPoolExecutor, list[Future[int]]]:
    """Begin to make shards `first` .. `first + count - 1` in other processes; the caller shuts the pool down."""
    folder.mkdir(parents=True, exist_ok=True)
    load_assets(assets, cache=folder)  # fails here, not in a worker, and leaves the meshes ready for them
    pool = ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_start_worker, initargs=(assets, folder)
    )
    return pool, [pool.submit(_shard_job, folder, number, seed) for number in range(first, first + count)]
