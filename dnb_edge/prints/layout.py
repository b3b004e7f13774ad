"""Places of printed floor markers on the track, as text that `calibrate markers --layout` reads.

Knows the file's form and metres on the track. Knows no paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.track.scale import TwinScale
from dnb_edge.values import PointM


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedMarker:
    """One floor marker and where its middle lies."""

    number: int
    at_m: PointM
    """Track m."""


def layout_text(markers: Sequence[PlacedMarker], scale: TwinScale, *, sigma_mm: float, says: Sequence[str]) -> str:
    """The layout file; `says` goes to its head as comments."""
    lines = [f"# {line}" for line in says]
    lines += [
        f"twin: {{metres_per_px: {scale.metres_per_px!r}, height_px: {scale.height_px!r}}}",
        f"sigma_mm: {sigma_mm:g}",
        "markers:",
    ]
    lines += [f"- {{number: {one.number}, track_m: [{one.at_m[0]:.4f}, {one.at_m[1]:.4f}]}}" for one in markers]
    return "\n".join(lines) + "\n"
