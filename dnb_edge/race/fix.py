"""What the race knows of the car in one frame: where it was seen, where it is estimated, and where that is on the route.

Knows track metres, the route and stamps. Unwraps the arc length into progress, so that laps can ask how far a car has
really driven. Where the route crosses itself or comes near itself, the car stays on the branch on which it came.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Observation, PointM, PointPx, StampSource, path_points

BEFORE_ALL_NS = -(2**63)
"""Earlier than any stamp."""

LOST_S = 1.0
"""After this time without a fix, seconds, the car may be on any branch of the route: it is sought on all of it."""

HEADING_M = 0.1
"""Way that tells in which direction the car drives, and so on which branch of a crossing it was found, metres."""

FASTER = 1.2
"""So much faster than it was seen to be a car may have been while nobody saw it."""

SPARE_M = 0.1
"""So much farther than its speed allows a car may be, metres: what observations scatter and bends cut."""

STAMP_SIGMA_S: dict[StampSource | None, float] = {
    StampSource.START_OF_FRAME: 0.3e-3,
    StampSource.END_OF_FRAME: 0.3e-3,
    StampSource.ARRIVAL: 4e-3,
    StampSource.MEDIA: 0.3e-3,
    StampSource.SIMULATED: 0.0,
    None: 0.0,
}
"""One standard deviation of a single stamp against its neighbours, seconds. Assumed, not measured: the kernel stamps in an
interrupt, or uvcvideo from the camera's clock, to a few tenths of a millisecond; a stamp on arrival waits for the bus and the
scheduler (users of usb_cam and pupil report tens of milliseconds, constant parts of which cancel between laps); Matroska
rounds to 1 ms, which has a standard deviation of 1/sqrt(12) ms. None is a recording that does not tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameStamps:
    """What the stamps of a source's frames mean: when in each frame a row was read, and how sure that is."""

    source: StampSource | None = None
    row_s: float = 0.0
    """Time from one row of the picture to the next, seconds; 0 where all are seen at once, or nobody knows."""
    height_px: int = 0

    def read_after_ns(self, v_px: float) -> int:
        """How long after the frame's stamp row `v_px` was read, ns; negative where the stamp is that of the frame's end."""
        at_end = self.source in (StampSource.END_OF_FRAME, StampSource.ARRIVAL)
        return round((v_px - (self.height_px - 1 if at_end else 0)) * self.row_s * 1e9)


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
    read_after_ns: int = 0
    """How long after `t_ns` the row of the picture that shows the car was read, ns (rolling shutter)."""
    stamp_sigma_s: float = 0.0
    """One standard deviation of this frame's stamp against its neighbours', seconds."""
    fastest_mps: float = 0.0
    """How fast the car was ever seen to drive along the route until then, in three steps in a row, metres per second."""
    camera_px: PointPx | None = None
    """Where in the picture it was observed, camera px; None where nobody told."""

    @property
    def seen_t_ns(self) -> int:
        """When the car was where it was observed, on the frames' clock."""
        return self.t_ns + self.read_after_ns


PLAIN_STAMPS = FrameStamps()
"""Stamps of which nothing is known: they are taken as they are."""


class Progress:
    """Turns (s, d) frame by frame into fixes with unwrapped progress."""

    def __init__(self, centreline: Centreline) -> None:
        self._centreline = centreline
        self._last: Fix | None = None
        self._speed_mps = 0.0
        self._along_mps = 0.0
        self._paces_mps: tuple[float, ...] = ()
        self._fastest_mps = 0.0
        self._unsure_since: PointM | None = None

    @property
    def last_t_ns(self) -> int:
        """Stamp of the latest fix; before the first one, earlier than any stamp."""
        return BEFORE_ALL_NS if self._last is None else self._last.t_ns

    def is_next(self, observation: Observation, stamps: FrameStamps) -> bool:
        """Whether the observation shows a later moment than the latest fix."""
        if self._last is None:
            return True
        return observation.t_ns + stamps.read_after_ns(observation.camera_px[1]) > self._last.seen_t_ns

    def fix(
        self, observation: Observation, *, target_id: int, track_m: PointM, stamps: FrameStamps = PLAIN_STAMPS
    ) -> Fix:
        """The fix for one observation of the car and its filtered position `track_m`, track m."""
        route, last = self._centreline, self._last
        s_m, d_m = self._located(observation.t_ns, track_m)
        step_m = 0.0 if last is None else self._step_m(last, s_m, observation.t_ns)
        branch = self._other_branch(s_m, track_m)
        if last is not None and branch is not None:
            # It was on this branch before, too: what it drove since is what it drove along it.
            s_m, d_m = branch
            before_m, _ = route.locate_near(last.track_m, s_hint_m=s_m, window_m=4 * HEADING_M)
            step_m = route.step_m(before_m, s_m)
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
            progress_m=0.0 if last is None else last.progress_m + step_m,
            camera_px=observation.camera_px,
            read_after_ns=stamps.read_after_ns(observation.camera_px[1]),
            stamp_sigma_s=STAMP_SIGMA_S[stamps.source],
            fastest_mps=self._fastest_mps,
        )
        if last is not None and fix.t_ns > last.t_ns:
            along_mps = step_m * 1e9 / (fix.t_ns - last.t_ns)
            self._speed_mps += 0.2 * (abs(along_mps) - self._speed_mps)
            self._along_mps += 0.2 * (along_mps - self._along_mps)
            self._paces_mps = (*self._paces_mps[-2:], abs(along_mps))
            if len(self._paces_mps) == 3:
                self._fastest_mps = max(self._fastest_mps, min(self._paces_mps))
        self._last = fix
        return fix

    def _step_m(self, last: Fix, s_m: float, t_ns: int) -> float:
        """The way along the route since the fix before: the shorter way round, or the longer one where the car was unseen for
        about as long as it takes at its speed.
        """
        route = self._centreline
        step_m = route.step_m(last.s_m, s_m)
        dt_s = (t_ns - last.t_ns) * 1e-9
        can_m = FASTER * self._fastest_mps * dt_s + SPARE_M
        # Who can have come round more than once may be anywhere.
        if not route.closed or not 0.5 * route.length_m < can_m < 1.5 * route.length_m:
            return step_m
        expected_m = self._along_mps * dt_s
        other_m = step_m - math.copysign(route.length_m, step_m)
        is_likelier = abs(other_m - expected_m) < abs(step_m - expected_m)
        return other_m if is_likelier and abs(other_m) <= can_m else step_m

    def _located(self, t_ns: int, track_m: PointM) -> tuple[float, float]:
        """(s_m, d_m) of the car: near where it was in the fix before, as far as it can have gone on since; else anywhere."""
        route, last = self._centreline, self._last
        if last is None or (t_ns - last.t_ns) * 1e-9 > LOST_S:
            self._unsure_since = track_m
            (s_m,), (d_m,) = (values.tolist() for values in route.locate(path_points([track_m])))
            return s_m, d_m
        driven_m = math.dist(last.track_m, track_m) + self._speed_mps * (t_ns - last.t_ns) * 1e-9
        reach_m = 2 * driven_m + sum(route.half_widths_at(last.s_m))
        s_m, d_m = route.follow(track_m, s_hint_m=last.s_m, reach_m=reach_m)
        if abs(route.step_m(last.s_m, s_m)) > reach_m:
            self._unsure_since = track_m
        return s_m, d_m

    def _other_branch(self, s_m: float, track_m: PointM) -> tuple[float, float] | None:
        """(s_m, d_m) on another branch of the route, where the car has gone on across the one on which it was found and along
        the other; None where it is on the right one, or has not gone on far enough to tell.
        """
        route, since = self._centreline, self._unsure_since
        if since is None or math.dist(since, track_m) < HEADING_M:
            return None
        self._unsure_since = None
        way_m = math.dist(since, track_m)
        branch = route.locate_along(track_m, ((track_m[0] - since[0]) / way_m, (track_m[1] - since[1]) / way_m))
        if branch is None or route.outside_by_m(*branch) > 0 or abs(route.step_m(s_m, branch[0])) < 4 * HEADING_M:
            return None
        return branch
