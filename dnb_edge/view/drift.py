"""Whether the camera still stands where it was calibrated: watched by patches of the still background, never mended.

Knows pictures with their stamps; reads no clock. A look takes a few patches from each frame and ends with one motion of the
whole picture (`drift_judge`); two looks of three must say that it has moved before the camera counts as moved. The reference
never moves, so slow drift is found too.
"""

from __future__ import annotations

import statistics
from collections import Counter, deque

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.drift_judge import DriftJudge, DriftSettings, Look, Verdict, WatchedTrack
from dnb_edge.view.drift_motion import Motion
from dnb_edge.view.drift_patches import MOST_PATCHES, Match, Patch, PatchSize, Picture, corner_points, grey, make_patch
from dnb_edge.view.drift_reference import PlaceReference, Search, median_of_five

_LEARN_PICTURES = 5
_LEARN_PER_FRAME = 8
_NEARLY_ALL = 0.7
_HIDDEN = 0.4
"""Where fewer than this share of the patches are seen, they may all have gone elsewhere."""

_STRAY_LOOKS = 10
"""A patch that was seen elsewhere than the rest in so many looks lies on what was pushed: it has no voice any more."""

_BLIND_S = 60.0
TOO_LITTLE = "the floor shows too little for the camera's place to be watched: lay down markers"
BLIND = "the camera's place cannot be told at present: too much of the view is hidden or looks otherwise"


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
        self._strays: Counter[int] = Counter()
        self._sure_t_ns: int | None = None
        self._moved_m: float | None = None
        self._elsewhere = False
        self.last: Look | None = None
        """The latest look, for those who measure."""
        if reference is not None:
            self._watch(PlaceReference.of(reference, watched.camera_px))

    @property
    def moved_m(self) -> float | None:
        """How far the camera's picture has moved, the greatest displacement over the track, metres; None where it is not
        known to have moved. Where nothing of the reference is in its place any more and nobody can tell how far it went, the
        track's span."""
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
        """Says that the place cannot be watched, at all or for a minute now; None where it can, or where that is not known."""
        if self._judge is not None and not self._judge.reference.enough:
            return TOO_LITTLE
        if self._sure_t_ns is None or self._last_t_ns is None or self._moved_m is not None:
            return None
        return BLIND if self._last_t_ns - self._sure_t_ns > _BLIND_S * 1e9 else None

    def look(self, picture: Picture, t_ns: int) -> bool:
        """Takes a frame's picture, stamped `t_ns`; True where `moved_m` has become known or unknown by it."""
        before = self._moved_m is None
        if self._last_t_ns is not None and t_ns - self._last_t_ns > 3e9 * self._settings.look_every_s:
            # What was seen of this look is of another time.
            self._found, self._search, self._lost_since_ns = [], None, None
            self._sure_t_ns = None if self._sure_t_ns is None else t_ns
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
            stray = self._strays[index] >= _STRAY_LOOKS
            self._found.append(None if stray else judge.reference.find(index, picture, self._expected))
        if len(self._found) == count:
            look = judge.look(self._found, self._expected)
            self._note_strays(look)
            self._found = []
            self._count(look)
            if look.verdict is not Verdict.UNSURE:
                self._lost_since_ns = None
            if look.verdict is not Verdict.UNSURE or self._sure_t_ns is None:
                self._sure_t_ns = t_ns
            if look.verdict is Verdict.UNSURE:
                self._follow(judge, look, picture, t_ns)

    def _note_strays(self, look: Look) -> None:
        """Counts in how many looks each patch went its own way, where the rest said clearly what the camera did."""
        if look.verdict is Verdict.UNSURE or look.motion is None:
            return
        for index, (one, follows) in enumerate(zip(self._found, look.motion.agreeing.tolist(), strict=True)):
            if follows:
                self._strays[index] = 0
            elif one is not None and one.seen:
                self._strays[index] += 1

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
        if look.still >= self._settings.lost_share * look.patches:
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
            self._look_t_ns = None
        if not clear or self.last is None or self.last.still >= self._settings.lost_share * self.last.patches:
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
