"""The card beside a model: what it is, how it was made, from what, and how well it does.

Knows the card's fields; runs nothing.
"""

from __future__ import annotations

import hashlib
import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dnb_edge.train.meshes import attributions as mesh_attributions

ATTRIBUTIONS = (
    "Playing-card photographs: Apache-2.0, (c) EdjeElectronics, TensorFlow-Object-Detection-API-Tutorial",
    "Video frames of sam2's demo: Apache-2.0, (c) Meta",
    "Frames of sample-videos: CC BY 4.0, Intel",
    "Surface textures of gazebo_models: CC BY 3.0, (c) 2012 Nathan Koenig, Open Source Robotics Foundation",
    "Surface textures of AWS RoboMaker worlds: MIT-0, (c) Amazon",
    "Surface textures of godot-demo-projects: MIT, (c) Godot contributors, and CC0, Poly Haven",
    "Room panoramas: CC0, Poly Haven",
    "Cognitive-services sample photographs: MIT, (c) Microsoft",
    "Small-object photographs of object_detection_demo: MIT, Tony607",
    "jsk_recognition sample pictures: BSD, JSK laboratory",
)
"""Photographs that a model trained with --assets has seen as backdrops, floor textures and negatives."""


def photo_and_mesh_attributions(assets: Path) -> list[str]:
    """Whose photographs and meshes a model trained with `assets` has seen, and under which licence."""
    meshes = mesh_attributions(assets)
    return [*ATTRIBUTIONS, *(f"Mesh {mesh['folder']}: {mesh['licence']}, from {mesh['repo']}" for mesh in meshes)]


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def model_card(
    path: Path,
    *,
    seed: int,
    iterations: int,
    samples: int,
    parameters: int,
    command: str,
    attributions: list[str],
    metrics: dict[str, Any],
) -> dict[str, Any]:
    """The card of the model in `path`."""
    return {
        "name": path.stem,
        "sha256": file_sha256(path),
        "bytes": path.stat().st_size,
        "licence": "GPL-3.0-or-later",
        "task": "ground-contact points of miniature cars in pictures of a fixed camera",
        "input": "pixels (n, h, w, 6) uint8: blue, green, red, difference from the background, lean (2); h, w multiples of 16",
        "outputs": "maps (n, 9, h / 4, w / 4): heat, offset (2), size, heading (4), spread; see dnb_edge/train/network.py",
        "quantisation": "static int8, QDQ, U8S8, per channel, MinMax on synthetic windows",
        "car_length_px": [12, 80],
        "parameters": parameters,
        "seed": seed,
        "iterations": iterations,
        "samples": samples,
        "command": command,
        "data": "synthetic scenes drawn by dnb_edge.train.scene from the seed: floors, lanes, cars, clutter, light, camera"
        + ("; photographs as backdrops, floors and negatives; meshes of vehicles and clutter" if attributions else ""),
        "attributions": attributions,
        "packages": {
            name: version(name) for name in ("torch", "onnx", "onnxruntime", "numpy", "opencv-python-headless")
        },
        "python": platform.python_version(),
        "metrics": metrics,
    }


def write_card(path: Path, card: dict[str, Any]) -> Path:
    """Write the card beside the model in `path`."""
    card_path = path.with_suffix(".json")
    card_path.write_text(json.dumps(card, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return card_path
