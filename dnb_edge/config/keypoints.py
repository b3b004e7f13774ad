"""Keypoint pairs from a YAML file, the form that a person writes.

    image_size: [3840, 2160]        # of the picture on which the camera points were clicked; may be left out
    pairs:
      - {name: north gate, camera_px: [1158, 1227], twin_px: [2324, 999]}
      - ...

Knows YAML and the file's form; what makes pairs good is `view.keypoints`' knowledge.
"""

from __future__ import annotations

from pathlib import Path

from dnb_edge.config.document import Part, Size, read_mapping, validated
from dnb_edge.config.sections import Number, Whole
from dnb_edge.errors import InputError
from dnb_edge.view.keypoints import KeypointPairs

_FORM = "it must hold pairs, a list of {name: ..., camera_px: [u, v], twin_px: [u, v]}"


class _Pair(Part):
    name: str | Whole | None = None
    camera_px: tuple[Number, Number]
    twin_px: tuple[Number, Number]


class _File(Part):
    image_size: tuple[Size, Size] | None = None
    pairs: tuple[_Pair, ...]


def load_yaml_pairs(path: Path) -> KeypointPairs:
    """The pairs in the YAML file `path`. Raises `InputError` naming the file, and the line or key at fault."""
    data = read_mapping(path, what="file of keypoints", remedy=_FORM)
    file = validated(_File, data, path, remedy=_FORM)
    for k, pair in enumerate(file.pairs):
        if isinstance(pair.name, str) and not (pair.name.strip() and pair.name.isprintable()):
            raise InputError(f"{path}: pairs.{k}.name: {pair.name!r} cannot be told in a line: use letters and digits")
    return KeypointPairs(
        camera_px=tuple(pair.camera_px for pair in file.pairs),
        twin_px=tuple(pair.twin_px for pair in file.pairs),
        names=tuple(str(k if pair.name is None else pair.name) for k, pair in enumerate(file.pairs, start=1)),
        source=str(path),
        image_size_px=file.image_size,
    )
