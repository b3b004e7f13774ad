"""How far the camera was known to have moved, and when, and which laps were driven under such a view.

Knows displacements and stamps; measures nothing.
"""

from __future__ import annotations

import numpy as np

from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Lap


class ViewLog:
    """Told of every frame; asked about every lap."""

    def __init__(self, route: Centreline) -> None:
        self._width_m = float(np.ptp(route.points_m, axis=0).max())
        # Stamps at which it changed how far the camera was known to have moved, and to what.
        self._views: list[tuple[int, float | None]] = [(0, None)]

    def frame(self, t_ns: int, moved_m: float | None) -> None:
        """Says how far the camera was known to have moved at this frame; None where it is not known to have moved."""
        if moved_m != self._views[-1][1]:
            self._views.append((t_ns, moved_m))

    def suspect(self, lap: Lap) -> tuple[str, ...]:
        """Why the numbers of a lap may be wrong though it was driven well."""
        untils = [*(t_ns for t_ns, _ in self._views[1:]), lap.end_t_ns + 1]
        moved = [
            moved_m
            for (from_t_ns, moved_m), until_t_ns in zip(self._views, untils, strict=True)
            if moved_m is not None and from_t_ns <= lap.end_t_ns and until_t_ns > lap.start_t_ns
        ]
        if not moved:
            return ()
        # Farther than the track is wide nobody measures: then nothing of the view was in its place.
        if max(moved) >= self._width_m:
            return ("the camera showed another place than when it was calibrated",)
        return (f"the camera had moved by {max(moved) * 1e3:.0f} mm since it was calibrated",)
