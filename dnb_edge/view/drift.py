"""Whether the camera still stands where it was calibrated: watched by patches of the still background, never mended.

Knows pictures with their stamps, the ground map and the track, and what a bump of the camera is worth in metres; reads no
clock. A look takes a few patches from each frame and ends with one motion of the whole picture, which most patches must agree
on; two looks of three must say so before the camera counts as moved. The reference never moves, so slow drift is found too.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.drift_motion import Motion
from dnb_edge.view.drift_patches import MOST_PATCHES, Match, Patch, PatchSize, Picture, corner_points, grey, make_patch
from dnb_edge.view.drift_reference import FEWEST_PARTS, PlaceReference, Search, median_of_five
from dnb_edge.view.ground import GroundMap

_TRACK_POINTS = 72
_LEARN_PICTURES = 5
_LEARN_PER_FRAME = 8
_NEARLY_ALL = 0.7
_STILL_SHARE = 0.25
"""So many patches in their old place, for each that follows a motion, contradict it."""

_HIDDEN = 0.4
"""Where fewer than this share of the patches are seen, they may all have gone elsewhere."""

TOO_LITTLE = "the floor shows too little for the camera's place to be watched: lay down markers"


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
    """Where fewer of the patches than this share are seen, the picture may show something else, 0..1."""
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
        motion = self.reference.motion(matches, expected) if seen else None
        if motion is None or not self._agreed(motion, seen, far=expected is not None):
            return self._verdict(Verdict.UNSURE, None, motion, seen)
        moved_m, sigma_m, _ = measured = self.watched.displacement_m(motion)
        if moved_m <= self.settings.moved_share * self.watched.span_m:
            return self._verdict(Verdict.IN_PLACE, measured, motion, seen)
        sure = moved_m >= self.settings.sure * sigma_m and not self._contradicted(motion, matches)
        return self._verdict(Verdict.MOVED if sure else Verdict.UNSURE, measured, motion, seen)

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
        tolerance_px = self.reference.tolerance_px
        found = zip(matches, self.reference.patches, motion.agreeing.tolist(), strict=True)
        still = np.array(
            [
                one is not None
                and one.seen
                and not follows
                and math.dist(one.camera_px, patch.camera_px) <= tolerance_px
                for one, patch, follows in found
            ],
            dtype=bool,
        )
        return bool(still.sum() >= _STILL_SHARE * motion.agreeing.sum() and self.reference.parts(still) >= 2)

    def _verdict(
        self, verdict: Verdict, measured: tuple[float, float, float] | None, motion: Motion | None, seen: int
    ) -> Look:
        moved_m, sigma_m, moved_px = (None, None, None) if measured is None else measured
        return Look(
            verdict=verdict,
            moved_m=moved_m,
            sigma_m=sigma_m,
            moved_px=moved_px,
            agreeing=0 if motion is None else int(motion.agreeing.sum()),
            seen=seen,
            patches=len(self.reference.patches),
            motion=motion,
        )


class DriftWatch:
    """Watches one camera's pictures, in order. The same pictures and stamps give the same verdicts.

    Without a reference picture the first seconds of the run are the reference: what moved before them is not seen.
    """

    def __init__(
        self, watched: WatchedTrack, *, reference: Picture | None = None, settings: DriftSettings | None = None
    ) -> None:
        self._watched = watched
        self._settings = settings or DriftSettings()
        self._judge: DriftJudge | None = None
        self._learner = _Learner(watched.camera_px, self._settings.learn_every_s)
        self._found: list[Match | None] = []
        self._expected: Motion | None = None
        self._search: Search | None = None
        self._searched_t_ns: int | None = None
        self._look_t_ns: int | None = None
        self._last_t_ns: int | None = None
        self._lost_since_ns: int | None = None
        self._recent: deque[Look] = deque(maxlen=3)
        self._in_place = 0
        self._moved_m: float | None = None
        self._elsewhere = False
        self.last: Look | None = None
        """The latest look, for those who measure."""
        if reference is not None:
            self._watch(PlaceReference.of(reference, watched.camera_px))

    @property
    def moved_m(self) -> float | None:
        """How far the camera's picture has moved, the greatest displacement over the track, metres; None where it is not
        known to have moved. Where the picture shows nothing of the reference any more, the track's span."""
        return self._moved_m

    @property
    def warning(self) -> str | None:
        """What a board should say; None where all is well."""
        if self._moved_m is None:
            return None
        if self._elsewhere:
            return "camera shows another place: laps are suspect, calibrate again"
        return f"camera moved {self._moved_m * 1e3:.0f} mm: laps are suspect, calibrate again"

    @property
    def note(self) -> str | None:
        """Says that the place cannot be watched; None where it can, or where that is not known yet."""
        return TOO_LITTLE if self._judge is not None and not self._judge.reference.enough else None

    def look(self, picture: Picture, t_ns: int) -> bool:
        """Takes a frame's picture, stamped `t_ns`; True where `moved_m` has become known or unknown by it."""
        before = self._moved_m is None
        if self._last_t_ns is not None and t_ns - self._last_t_ns > 3e9 * self._settings.look_every_s:
            # What was seen of this look is of another time.
            self._found, self._search, self._lost_since_ns = [], None, None
        self._last_t_ns = t_ns
        if self._judge is None:
            reference = self._learner.take(picture, t_ns)
            if reference is not None:
                self._watch(reference)
        elif self._judge.reference.enough and picture.shape[1::-1] == self._judge.reference.size_px:
            self._step(self._judge, picture, t_ns)
        return before != (self._moved_m is None)

    def _watch(self, reference: PlaceReference) -> None:
        self._judge = DriftJudge(reference=reference, watched=self._watched, settings=self._settings)

    def _step(self, judge: DriftJudge, picture: Picture, t_ns: int) -> None:
        """Looks at as many patches as are due by now; with the last of them the look ends."""
        settings, count = self._settings, len(judge.reference.patches)
        if self._search is not None:
            if self._search.step_to(self._share(self._searched_t_ns, t_ns)):
                self._end_search(self._search, t_ns)
            return
        if not self._found:
            if self._look_t_ns is not None and t_ns - self._look_t_ns < settings.look_every_s * 1e9 - 1e6:
                return
            self._look_t_ns = t_ns
        due = min(count, 3 + round(count * self._share(self._look_t_ns, t_ns)))
        for index in range(len(self._found), due):
            self._found.append(judge.reference.find(index, picture, self._expected))
        if len(self._found) == count:
            look = judge.look(self._found, self._expected)
            self._found = []
            self._count(look)
            if look.verdict is Verdict.UNSURE:
                self._follow(judge, look, picture, t_ns)

    def _share(self, since_t_ns: int | None, t_ns: int) -> float:
        """How much of what is spread over frames is due by now, 0..1."""
        if self._settings.spread_s <= 0.0 or since_t_ns is None:
            return 1.0
        return min(1.0, (t_ns - since_t_ns) * 1e-9 / self._settings.spread_s)

    def _follow(self, judge: DriftJudge, look: Look, picture: Picture, t_ns: int) -> None:
        """After a look that told nothing: says where the next one shall look, or searches the whole picture."""
        worth = self._worth_a_search(look, t_ns)
        guess = look.motion
        if self._expected is None and guess is not None and guess.agreeing.sum() >= max(6.0, _NEARLY_ALL * look.seen):
            # The rest have gone a little too far for the search: look round where they should be, at once.
            self._expected, self._look_t_ns = guess, None
            return
        self._expected = None
        if worth:
            self._search, self._searched_t_ns = Search(judge.reference, picture), t_ns

    def _worth_a_search(self, look: Look, t_ns: int) -> bool:
        """Whether the patches are not where they are looked for, and were not just searched for in vain."""
        if look.seen >= self._settings.lost_share * look.patches:
            self._lost_since_ns = None
        hidden = look.seen < max(6.0, _HIDDEN * look.patches)
        again = len(self._recent) > 1 and self._recent[-2].verdict is Verdict.UNSURE
        rested = self._searched_t_ns is None or t_ns - self._searched_t_ns >= self._settings.search_every_s * 1e9
        return rested and (hidden or again or self._expected is not None)

    def _end_search(self, search: Search, t_ns: int) -> None:
        self._search = None
        self._expected, clear = search.result()
        if self._expected is not None:
            # The next look, round where the search puts the patches, is due at once; and if that is found wrong, a search.
            self._look_t_ns = self._lost_since_ns = None
        elif not clear or self.last is None or self.last.seen >= self._settings.lost_share * self.last.patches:
            self._lost_since_ns = None
        elif self._lost_since_ns is None:
            self._lost_since_ns = t_ns
        elif t_ns - self._lost_since_ns >= self._settings.lost_s * 1e9:
            self._elsewhere, self._moved_m = True, self._watched.span_m

    def _count(self, look: Look) -> None:
        """Believes what looks agree on."""
        self.last = look
        self._recent.append(look)
        moved = [one.moved_m for one in self._recent if one.verdict is Verdict.MOVED and one.moved_m is not None]
        if look.verdict is Verdict.MOVED and len(moved) >= 2:
            latest_m = statistics.median(moved)
            # A figure that changes with every look says no more and reads worse.
            if self._moved_m is None or self._elsewhere or abs(latest_m - self._moved_m) > 0.25 * self._moved_m:
                self._moved_m = latest_m
            self._elsewhere = False
        back_m = self._settings.back_share * self._watched.span_m
        back = look.verdict is Verdict.IN_PLACE and look.moved_m is not None and look.moved_m <= back_m
        self._in_place = self._in_place + 1 if back else 0
        if self._in_place >= self._settings.back_looks:
            self._moved_m, self._elsewhere = None, False


class _Learner:
    """Makes the reference of the first pictures, a little in each frame."""

    def __init__(self, favoured_px: Points, every_s: float) -> None:
        self._favoured_px = favoured_px
        self._every_s = every_s
        self._pictures: list[NDArray[np.uint8]] = []
        self._taken_t_ns: int | None = None
        self._median: NDArray[np.uint8] | None = None
        self._points: list[tuple[int, int]] = []
        self._patches: list[Patch] = []

    def take(self, picture: Picture, t_ns: int) -> PlaceReference | None:
        """Takes one frame's picture; the reference with the last of those that are needed."""
        if self._median is None:
            self._gather(picture, t_ns)
            return None
        size = PatchSize.for_width(self._median.shape[1])
        now, self._points = self._points[:_LEARN_PER_FRAME], self._points[_LEARN_PER_FRAME:]
        made = (make_patch(self._median, point, size) for point in now)
        self._patches += [patch for patch in made if patch is not None]
        if self._points and len(self._patches) < MOST_PATCHES:
            return None
        return PlaceReference.from_patches(self._median, self._patches)

    def _gather(self, picture: Picture, t_ns: int) -> None:
        if self._taken_t_ns is not None and t_ns - self._taken_t_ns < self._every_s * 1e9 - 1e6:
            return
        if self._pictures and self._pictures[0].shape != picture.shape[:2]:
            self._pictures = []
        self._taken_t_ns = t_ns
        self._pictures.append(grey(picture).copy())
        if len(self._pictures) == _LEARN_PICTURES:
            self._median = median_of_five(self._pictures)
            self._pictures = []
            size = PatchSize.for_width(self._median.shape[1])
            self._points = corner_points(self._median, size, self._favoured_px)
