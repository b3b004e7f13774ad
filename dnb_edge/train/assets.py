"""What a generator of scenes may draw from besides its own shapes: photographs, floor textures, real meshes.

Knows values only; `shards.py` reads them from disk. All may be empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.train.meshes import Mesh
from dnb_edge.values import BgrImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assets:
    """Real material for scenes."""

    photos: Sequence[BgrImage] = ()
    """Backdrops without small vehicles."""
    textures: Sequence[BgrImage] = ()
    """Floors seen straight from above."""
    vehicles: Sequence[Mesh] = ()
    """Length 1, nose along +x, standing on z = 0."""
    clutter: Sequence[Mesh] = ()
    """Real sizes, metres."""


NO_ASSETS = Assets()
