"""One camera of a race: whether its pictures show anything, whether it stays in its place, and what is found in them.

Knows pictures and the rooms that look at one camera's. Knows no other camera and no race.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from dnb_edge.capture.picture_health import REMEDIES, PictureFault, PictureJudge, PictureLimits
from dnb_edge.detect.protocol import Detector
from dnb_edge.values import BgrImage, Frame, FrameDetections, SearchWindow
from dnb_edge.view.drift import DriftWatch

FROZEN_S = 5.0
"""For how long a camera may repeat one picture before it is opened anew; each time in vain doubles that."""
FROZEN_MOST_S = 60.0


@dataclass(slots=True, kw_only=True)
class Eye:
    """What looks at one camera's pictures, in the order in which they come."""

    detector: Detector
    live: bool
    drift: DriftWatch | None = None
    """Watches whether the camera stays in its place; None where nobody does."""
    pictures: PictureJudge = field(init=False)
    _frozen_t_ns: int | None = None
    """Since when the picture has been frozen, or was last renewed."""
    _frozen_patience_s: float = FROZEN_S

    def __post_init__(self) -> None:
        self.pictures = PictureJudge(live=self.live)

    def look(self, image: BgrImage, frame: Frame, *, renew: Callable[[str], None]) -> bool:
        """Judges a picture; True where something about the camera has changed. `renew` has it opened anew, with a reason."""
        picture_changed = self.pictures.look(image, frame.t_ns)
        self._thaw(frame.t_ns, renew)
        return self._watch(image, frame) or picture_changed

    def detect(self, image: BgrImage, frame: Frame, windows: Sequence[SearchWindow]) -> FrameDetections:
        """What the detector finds; nothing in a picture that shows nothing, of which it must not learn a background either."""
        if not self.pictures.shows_something:
            return nothing_in(frame)
        return self.detector.detect(image, sequence=frame.sequence, t_ns=frame.t_ns, windows=windows)

    @property
    def moved_m(self) -> float | None:
        """How far the camera is known to have moved over the track, metres; None where it is not known to have moved."""
        return None if self.drift is None else self.drift.moved_m

    def _thaw(self, t_ns: int, renew: Callable[[str], None]) -> None:
        """Has a camera that repeats one picture opened anew, ever more seldom where that does not help."""
        if self.pictures.fault is not PictureFault.FROZEN:
            self._frozen_t_ns, self._frozen_patience_s = None, FROZEN_S
        elif self._frozen_t_ns is None:
            # Told only after a while: by then it has been frozen for so long already.
            self._frozen_t_ns = t_ns - round(PictureLimits().frozen_s * 1e9)
        elif t_ns - self._frozen_t_ns >= self._frozen_patience_s * 1e9:
            self._frozen_t_ns = t_ns
            self._frozen_patience_s = min(2.0 * self._frozen_patience_s, FROZEN_MOST_S)
            renew(REMEDIES[PictureFault.FROZEN])

    def _watch(self, image: BgrImage, frame: Frame) -> bool:
        """Sees whether the camera is still in its place; True where that has changed. A blind picture tells nothing."""
        if self.drift is None or not self.pictures.shows_something:
            return False
        return self.drift.look(image, frame.t_ns)


def nothing_in(frame: Frame) -> FrameDetections:
    """That nothing was found in a frame."""
    return FrameDetections(sequence=frame.sequence, t_ns=frame.t_ns, detections=(), full_frame=False)
