"""How far the camera was known to have moved, and when, when no frames came, and which laps were driven under such a view.

Knows displacements and stamps; measures nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Lap


class ViewLog:
    """Told of every frame; asked about every lap."""

    def __init__(self, route: Centreline, *, camera_gap_s: float | None = None) -> None:
        """`camera_gap_s`: the longest time between two frames that is no gap of the camera; None where nobody asks for gaps."""
        self._gap_ns = None if camera_gap_s is None else round(camera_gap_s * 1e9)
        # By camera: one may be away while others send.
        self._last_t_ns: dict[int, int] = {}
        # From the last frame before a gap to the first one behind it.
        self._gaps: list[tuple[int, int]] = []
        self._width_m = float(np.ptp(route.points_m, axis=0).max())
        # For each camera, stamps at which it changed how far it was known to have moved, and to what.
        self._views: dict[int, list[tuple[int, float | None]]] = {}

    def frame(self, t_ns: int, moved_m: float | None, camera: int = 0) -> None:
        """Says how far that camera was known to have moved at this frame; None where it is not known to have moved."""
        last_t_ns = self._last_t_ns.get(camera)
        if self._gap_ns is not None and last_t_ns is not None and t_ns - last_t_ns > self._gap_ns:
            self._gaps.append((last_t_ns, t_ns))
        self._last_t_ns[camera] = t_ns
        views = self._views.setdefault(camera, [(0, None)])
        if moved_m != views[-1][1]:
            views.append((t_ns, moved_m))

    def suspect(self, lap: Lap) -> tuple[str, ...]:
        """Why the numbers of a lap may be wrong though it was driven well."""
        return (*self._unseen(lap), *self._moved(lap))

    def _unseen(self, lap: Lap) -> tuple[str, ...]:
        gaps_ns = [until - since for since, until in self._gaps if since < lap.end_t_ns and until > lap.start_t_ns]
        return tuple(f"camera gap: no frames came for {gap_ns * 1e-9:.1f} s" for gap_ns in gaps_ns)

    def _moved(self, lap: Lap) -> tuple[str, ...]:
        moved = [moved_m for views in self._views.values() for moved_m in _during(lap, views)]
        if not moved:
            return ()
        # Farther than the track is wide nobody measures: then nothing of the view was in its place.
        if max(moved) >= self._width_m:
            return ("the camera showed another place than when it was calibrated",)
        return (f"the camera had moved by {max(moved) * 1e3:.0f} mm since it was calibrated",)


def _during(lap: Lap, views: Sequence[tuple[int, float | None]]) -> list[float]:
    """How far one camera was known to have moved during the lap; empty where it was in its place."""
    untils = [*(t_ns for t_ns, _ in views[1:]), lap.end_t_ns + 1]
    return [
        moved_m
        for (from_t_ns, moved_m), until_t_ns in zip(views, untils, strict=True)
        if moved_m is not None and from_t_ns <= lap.end_t_ns and until_t_ns > lap.start_t_ns
    ]
