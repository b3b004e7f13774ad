"""Pictures and label files as users keep them in folders. Knows files; nothing of models."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.train.teach_labels import label_file
from dnb_edge.values import BgrImage

_KINDS = {".jpg", ".jpeg", ".png", ".bmp", ".webp"}


def pictures_in(folder: Path) -> list[Path]:
    """The pictures under `folder`, by name. Raises InputError where there is none."""
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder: give one with pictures")
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _KINDS and path.is_file())
    if not paths:
        raise InputError(f"{folder}: no pictures (.jpg, .png) in this folder")
    return paths


def labelled_pictures(folder: Path) -> tuple[list[tuple[Path, Path]], int]:
    """The pictures under `folder` with their label files, by name, and how many pictures have none.

    Raises InputError for a folder without pictures or without any label file.
    """
    paths = pictures_in(folder)
    found = [(path, labels) for path in paths if (labels := label_file(path)) is not None]
    if not found:
        raise InputError(
            f"{folder}: {len(paths)} pictures and no label file: put YOLO labels beside them, NAME.txt for NAME.jpg"
        )
    return found, len(paths) - len(found)


def read_picture(path: Path) -> BgrImage:
    """The picture in a file. Raises InputError where it is none."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: not a readable picture: mend or remove it")
    return np.asarray(image, dtype=np.uint8)
