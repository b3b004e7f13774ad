"""What one comparison of a picture with the reference says: whether the camera is in its place, by what the picture's motion
is worth on the track.

Knows patches' matches, the ground map and the route; knows no time. `drift` decides what to believe of several comparisons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.drift_motion import Motion
from dnb_edge.view.drift_patches import Match, Picture
from dnb_edge.view.drift_reference import FEWEST_PARTS, PlaceReference
from dnb_edge.view.ground import GroundMap

_TRACK_POINTS = 72
_STILL_SHARE = 0.25
"""So many patches in their old place, for each that follows a motion, contradict it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftSettings:
    """When the camera counts as moved."""

    moved_share: float = 0.002
    """From this share of the track's span on."""
    back_share: float = 0.0012
    """Below this share of the span it is back in its place."""
    look_every_s: float = 1.0
    """From the beginning of one look to that of the next, seconds of the stamps."""
    spread_s: float = 0.5
    """A look's patches are spread over so much time; 0: all in one frame."""
    learn_every_s: float = 0.6
    """Between the five pictures of which the reference is the median."""
    least_agreement: float = 0.4
    """Share of the patches seen that must agree on one motion, 0..1."""
    least_seen: float = 0.2
    """Share of all patches that must agree at least, 0..1."""
    least_seen_far: float = 0.3
    """The same where they were looked for elsewhere, after a search: then those that stayed are not seen."""
    least_parts: float = 0.45
    """Share of the parts of the picture with patches in which some must agree, 0..1."""
    sure: float = 4.0
    """The motion must be so many of its standard deviations."""
    search_every_s: float = 2.5
    """A search all over the picture takes longer than a look and comes no more often than this, seconds."""
    lost_share: float = 0.1
    """Where fewer of the patches than this share are where they always were, the camera may have gone far, 0..1."""
    lost_s: float = 10.0
    """For so long, seconds."""
    back_looks: int = 5
    """Looks in a row that must find the camera back in its place."""


class Verdict(StrEnum):
    """What one look says."""

    IN_PLACE = "in_place"
    MOVED = "moved"
    UNSURE = "unsure"
    """Too much was hidden, or patches contradicted one another."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WatchedTrack:
    """What a motion of the picture is worth on the track."""

    camera_px: Points
    """(n, 2) points of the route as they appear in the picture."""
    metres_per_px: NDArray[np.float64]
    """(n, 2, 2) d(track m)/d(camera px) there."""
    span_m: float
    """The greatest distance between two points of the route, metres: what shares of the span are of."""

    def displacement_m(self, motion: Motion) -> tuple[float, float, float]:
        """The greatest displacement over the track, metres, its standard deviation there, and the motion there, px."""
        shift_px = motion.shift_px(self.camera_px)[:, :, None]
        shift_m = np.linalg.norm((self.metres_per_px @ shift_px)[:, :, 0], axis=1)
        worst = int(np.argmax(shift_m))
        jacobian = self.metres_per_px[worst]
        covariance = jacobian @ motion.covariance_px2(self.camera_px[worst : worst + 1])[0] @ jacobian.T
        return float(shift_m[worst]), float(np.sqrt(np.trace(covariance))), float(np.linalg.norm(shift_px[worst]))


def watched_track(ground: GroundMap, route_m: Points) -> WatchedTrack:
    """The route, (n, 2) track m, as `ground` sees it: the points that the picture shows, or all where it shows none."""
    coarse = route_m[:: max(1, len(route_m) // 200)]
    span_m = float(np.linalg.norm(coarse[:, None] - coarse, axis=2).max())
    chosen = route_m[np.linspace(0, len(route_m) - 1, _TRACK_POINTS).astype(int)].tolist()
    ahead = [point for x, y in chosen if (point := ground.point_to_camera_px((x, y))) is not None]
    shown = [(u, v) for u, v in ahead if 0 <= u < ground.width_px and 0 <= v < ground.height_px]
    points = np.array(shown or ahead, dtype=np.float64).reshape(-1, 2)
    points = points[ground.sees_ground(points)]
    jacobians = np.array([ground.jacobian((u, v)) for u, v in points.tolist()]).reshape(-1, 2, 2)
    return WatchedTrack(camera_px=points, metres_per_px=jacobians, span_m=span_m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """What one comparison with the reference says."""

    verdict: Verdict
    moved_m: float | None
    """The greatest displacement over the track, metres; None where no motion was agreed on."""
    sigma_m: float | None
    """One standard deviation of it."""
    moved_px: float | None
    """The picture's motion at that point, camera px."""
    agreeing: int
    seen: int
    still: int
    """How many were found where they always were."""
    patches: int
    motion: Motion | None
    """What was found to be the common motion, though it may not have been believed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriftJudge:
    """Makes a `Look` of where the patches were found."""

    reference: PlaceReference
    watched: WatchedTrack
    settings: DriftSettings

    def look(self, matches: Sequence[Match | None], expected: Motion | None = None) -> Look:
        """The verdict over the matches, one a patch, that were looked for round `expected`."""
        seen = sum(one is not None and one.seen for one in matches)
        still = int(self._still(matches).sum())
        motion = self.reference.motion(matches, expected) if seen else None
        if motion is None or not self._agreed(motion, seen, far=expected is not None):
            return self._verdict(Verdict.UNSURE, None, motion, seen=seen, still=still)
        moved_m, sigma_m, _ = measured = self.watched.displacement_m(motion)
        if moved_m <= self.settings.moved_share * self.watched.span_m:
            return self._verdict(Verdict.IN_PLACE, measured, motion, seen=seen, still=still)
        sure = moved_m >= self.settings.sure * sigma_m and not self._contradicted(motion, matches)
        return self._verdict(Verdict.MOVED if sure else Verdict.UNSURE, measured, motion, seen=seen, still=still)

    def look_at(self, picture: Picture) -> Look:
        """One whole comparison with one picture: near the old place, and where that fails all over."""
        count = len(self.reference.patches)
        look = self.look([self.reference.find(index, picture) for index in range(count)])
        if look.verdict is not Verdict.UNSURE:
            return look
        far, _ = self.reference.search(picture)
        if far is None:
            return look
        again = self.look([self.reference.find(index, picture, far) for index in range(count)], far)
        return look if again.verdict is Verdict.UNSURE else again

    def _agreed(self, motion: Motion, seen: int, *, far: bool) -> bool:
        """Whether enough patches, in enough parts of the picture, follow the motion for it to be the camera's."""
        settings, reference = self.settings, self.reference
        count = len(reference.patches)
        least_seen = settings.least_seen_far if far else settings.least_seen
        fewest = max(6.0, least_seen * count, settings.least_agreement * seen)
        everywhere = reference.parts(np.ones(count, dtype=bool))
        fewest_parts = max(FEWEST_PARTS - 1, settings.least_parts * everywhere)
        return bool(motion.agreeing.sum() >= fewest and reference.parts(motion.agreeing) >= fewest_parts)

    def _contradicted(self, motion: Motion, matches: Sequence[Match | None]) -> bool:
        """Whether patches that do not follow the motion are where they always were: then something in the picture was pushed,
        a chair perhaps with more texture than all of the floor, and not the camera."""
        still = self._still(matches) & ~motion.agreeing
        return bool(still.sum() >= _STILL_SHARE * motion.agreeing.sum() and self.reference.parts(still) >= 2)

    def _still(self, matches: Sequence[Match | None]) -> NDArray[np.bool_]:
        """Which patches are where they always were."""
        tolerance_px = self.reference.tolerance_px
        return np.array(
            [
                one is not None and one.seen and math.dist(one.camera_px, patch.camera_px) <= tolerance_px
                for one, patch in zip(matches, self.reference.patches, strict=True)
            ],
            dtype=bool,
        )

    def _verdict(
        self,
        verdict: Verdict,
        measured: tuple[float, float, float] | None,
        motion: Motion | None,
        *,
        seen: int,
        still: int,
    ) -> Look:
        moved_m, sigma_m, moved_px = (None, None, None) if measured is None else measured
        return Look(
            verdict=verdict,
            moved_m=moved_m,
            sigma_m=sigma_m,
            moved_px=moved_px,
            agreeing=0 if motion is None else int(motion.agreeing.sum()),
            seen=seen,
            still=still,
            patches=len(self.reference.patches),
            motion=motion,
        )
