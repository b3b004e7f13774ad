"""What the race knows of the car in one frame: where it was seen, where it is estimated, and where that is on the route.

Knows track metres, the route and stamps. Unwraps the arc length into progress, so that laps can ask how far a car has
really driven.
"""

from __future__ import annotations

from dataclasses import dataclass

from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Observation, PointM, path_points

BEFORE_ALL_NS = -(2**63)
"""Earlier than any stamp."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """The car in one frame in which it was seen."""

    t_ns: int
    t_s: float
    target_id: int
    observed_m: PointM
    """The observation's ground point, track m: errors of neighbouring frames are independent, so crossings and paths use it."""
    covariance_m2: tuple[float, float, float]
    """Covariance of `observed_m`, (xx, xy, yy), m^2."""
    track_m: PointM
    """The filtered position, track m: smoother, so progress and lanes use it."""
    s_m: float
    d_m: float
    outside_m: float
    """Metres beyond the lane's edge; negative inside the lane."""
    progress_m: float
    """Distance driven along the route since the first fix, metres; falls while the car goes backwards."""


class Progress:
    """Turns (s, d) frame by frame into fixes with unwrapped progress."""

    def __init__(self, centreline: Centreline) -> None:
        self._centreline = centreline
        self._last: Fix | None = None

    @property
    def last_t_ns(self) -> int:
        """Stamp of the latest fix; before the first one, earlier than any stamp."""
        return BEFORE_ALL_NS if self._last is None else self._last.t_ns

    def fix(self, observation: Observation, *, target_id: int, track_m: PointM) -> Fix:
        """The fix for one observation of the car and its filtered position `track_m`, track m."""
        route = self._centreline
        (s_m,), (d_m,) = (values.tolist() for values in route.locate(path_points([track_m])))
        fix = Fix(
            t_ns=observation.t_ns,
            t_s=observation.t_s,
            target_id=target_id,
            observed_m=observation.track_m,
            covariance_m2=observation.covariance_m2,
            track_m=track_m,
            s_m=s_m,
            d_m=d_m,
            outside_m=route.outside_by_m(s_m, d_m),
            progress_m=0.0 if self._last is None else self._last.progress_m + self._step_m(s_m - self._last.s_m),
        )
        self._last = fix
        return fix

    def _step_m(self, difference_m: float) -> float:
        """The shorter way round the route."""
        length_m = self._centreline.length_m
        return (difference_m + length_m / 2) % length_m - length_m / 2
