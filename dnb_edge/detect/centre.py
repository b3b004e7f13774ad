"""The centre detector: our own network over windows round followed cars, or over the whole frame to find them.

Knows frames, search windows and a background; nothing of metres, laps or who is who. With windows it looks at one small crop
each, of native pixels whatever the frame's size, and beside them, every few frames, at one piece of the whole frame and at
what moved elsewhere. Without windows, or where one came up empty, it searches: the whole frame at reduced size, one finer
tile (all in turn), and close looks at the best candidates of this frame and the last and at what moves. State: the
background, the last candidates and whose turn it is; the same frames give the same answers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from dnb_edge.detect.acquire import Candidate, apart, close_looks, moved_blobs
from dnb_edge.detect.background import Background, BackgroundSettings, Disc
from dnb_edge.detect.lean import LeanField, LeanMap
from dnb_edge.detect.looks import Look, halved, halvings, tile_looks, whole_look, window_look
from dnb_edge.detect.onnx import CentreNetwork
from dnb_edge.detect.sense import AxisSeen, AxisSense
from dnb_edge.detect.sight import Sight, merged
from dnb_edge.values import BgrImage, Detection, FrameDetections, SearchWindow


@dataclass(frozen=True, slots=True, kw_only=True)
class CentreDetectorSettings:
    """Sizes, thresholds and rhythms of the centre detector."""

    whole_width_px: int = 352
    """Width of the whole frame as the network sees it."""
    piece_px: tuple[int, int] = (192, 128)
    """Width and height of the pieces in which the whole frame is looked at while a car is followed, network px."""
    piece_every: int = 9
    """While a car is followed one piece is looked at every n-th frame, between the background's; 0: never."""
    tile_px: tuple[int, int] = (320, 256)
    """Width and height of a fine tile, network px."""
    fine_width_px: int = 1280
    """Width of the whole frame at the tiles' scale."""
    overlap_px: int = 32
    """Neighbouring tiles and pieces overlap by as many network px."""
    window_px: int = 128
    window_length_px: float = 44.0
    """Length of the expected car in a window, network px."""
    acquire_confidence: float = 0.2
    follow_confidence: float = 0.15
    most_detections: int = 12
    close_looks: int = 4
    """At most as many candidates are looked at closely in a search."""
    following_looks: int = 2
    """At most as many candidates are looked at closely while cars are followed."""
    one_scale_share: float = 0.85
    """Confidence left to something still that was found in a close look and not in the whole frame."""
    frozen_lengths: float = 0.9
    """The background learns nothing within as many car lengths of a followed car."""
    background_width_px: int = 400
    """The background is the frame halved as often as it stays at least so wide."""
    background: BackgroundSettings = field(default_factory=BackgroundSettings)


class CentreDetector:
    """Finds cars with a centre network. Implements `detect.protocol.Detector`."""

    def __init__(
        self,
        network: CentreNetwork,
        settings: CentreDetectorSettings | None = None,
        *,
        lean: LeanField | None = None,
    ) -> None:
        """`lean` tells how things lean in the frame, where the camera is calibrated."""
        self._lean_field = lean
        self._lean: LeanMap | None = None
        self._network = network
        self._settings = settings or CentreDetectorSettings()
        self._size = (0, 0)
        self._background: Background | None = None
        self._sense = AxisSense()
        self._found: tuple[Detection, ...] = ()
        self._places: tuple[Candidate, ...] = ()
        self._turn = 0

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        """Cars in `image`, (h, w, 3): in the windows, or in the whole frame where there are none; strongest first."""
        if image.ndim != 3 or image.shape[2] != 3:
            raise ValueError(f"frame {sequence}: a picture of shape {image.shape}: needs (height, width, 3)")
        background = self._prepared(image)
        sight = Sight(self._network, image, background, most=self._settings.most_detections, lean=self._lean)
        found = self._followed(sight, windows) if windows else []
        full_frame = any(not _near(window, found) for window in windows) or not windows
        if full_frame:
            found += self._search(sight, image, background, windows, found)
        else:
            found += self._aside(sight, image, background, windows, found)
        detections = self._headed(merged(found, self._settings.most_detections))
        self._found = detections if full_frame else tuple(one for one in detections if one.moving)
        self._turn += 1
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=detections, full_frame=full_frame)

    def _headed(self, found: Sequence[Detection]) -> tuple[Detection, ...]:
        """The network sees a car's axis well and its nose hardly: which way it drives, its movement tells."""
        seen = [AxisSeen(camera_px=one.camera_px, length_px=one.length_px, axis_rad=one.heading_rad) for one in found]
        headings = self._sense.headings(seen)
        return tuple(
            one if one.heading_rad == to else replace(one, heading_rad=to)
            for one, to in zip(found, headings, strict=True)
        )

    def _prepared(self, image: BgrImage) -> Background:
        """The background; a frame of another size than the last starts afresh."""
        height, width = image.shape[:2]
        if self._background is None or self._size != (width, height):
            times = halvings(width, self._settings.background_width_px)
            self._background = Background(halved(image, times), scale=0.5**times, settings=self._settings.background)
            self._size, self._found, self._places, self._turn = (width, height), (), (), 0
            self._sense = AxisSense()
            self._lean = None if self._lean_field is None else LeanMap(self._lean_field, width, height)
        return self._background

    @property
    def _step_px(self) -> int:
        """Frame px to one of the background's."""
        return 1 if self._background is None else round(1.0 / self._background.scale)

    def _window(self, place: SearchWindow | Candidate) -> Look:
        settings = self._settings
        return window_look(
            place.camera_px,
            max(6.0, place.length_px),
            window_px=settings.window_px,
            window_length_px=settings.window_length_px,
            step_px=self._step_px,
        )

    def _tiles(self, working_width_px: int, tile_px: tuple[int, int]) -> list[Look]:
        return tile_looks(
            *self._size,
            working_width_px=working_width_px,
            tile_px=tile_px,
            overlap_px=self._settings.overlap_px,
            step_px=self._step_px,
        )

    def _followed(self, sight: Sight, windows: Sequence[SearchWindow]) -> list[Detection]:
        """What is in the windows, and in the close looks that the last frame asked for: one batch for the network."""
        places = close_looks(_elsewhere(windows, self._found), self._places, self._settings.following_looks)
        looks = [*map(self._window, windows), *map(self._window, places)]
        seen = sight.look(looks, least_confidence=self._settings.follow_confidence)
        return [one for some in seen for one in some]

    def _aside(
        self,
        sight: Sight,
        image: BgrImage,
        background: Background,
        windows: Sequence[SearchWindow],
        found: Sequence[Detection],
    ) -> list[Detection]:
        """While cars are followed: one band for the background, now and then a piece of the whole frame, and what moves."""
        settings = self._settings
        self._places = ()
        if background.is_due(self._turn):
            self._places = self._upkeep(image, background, self._frozen(windows, found))
            return []
        if not settings.piece_every or self._turn % settings.piece_every != 1:
            return []
        pieces = self._tiles(settings.whole_width_px, settings.piece_px)
        piece = pieces[self._turn // settings.piece_every % len(pieces)]
        seen = sight.look([piece], least_confidence=settings.acquire_confidence)[0]
        known = [one for one in seen if all(apart(one.camera_px, other) for other in found)]
        return [replace(one, confidence=0.8 * one.confidence) for one in known]

    def _upkeep(self, image: BgrImage, background: Background, frozen: Sequence[Disc]) -> tuple[Candidate, ...]:
        """Shows the background its next band; when all have been seen, where something has moved away from the cars."""
        rows, step = background.rows(), self._step_px
        reduced = halved(image[rows.start * step : rows.stop * step], halvings_of(background))
        background.compare(reduced, rows)
        background.learn(reduced, rows, frozen=frozen)
        if rows.stop < background.picture.shape[0] or not background.settled:
            return ()
        blobs = moved_blobs(background.moved_cells, scale=background.scale, frozen=frozen)
        return tuple(blobs[: self._settings.following_looks])

    def _search(
        self,
        sight: Sight,
        image: BgrImage,
        background: Background,
        windows: Sequence[SearchWindow],
        found: Sequence[Detection],
    ) -> list[Detection]:
        """The whole frame at reduced size, one fine tile, and close looks at the best candidates."""
        settings = self._settings
        reduced = halved(image, halvings_of(background))
        moved = background.compare(reduced, slice(0, reduced.shape[0]))
        frozen = self._frozen(windows, found)
        whole = whole_look(*self._size, settings.whole_width_px)
        at_whole = sight.whole(reduced, moved, whole, least_confidence=settings.acquire_confidence)
        coarse = list(at_whole)
        tiles = self._tiles(settings.fine_width_px, settings.tile_px)
        if len(tiles) > 1:
            tile = tiles[self._turn % len(tiles)]
            coarse += sight.look([tile], least_confidence=settings.acquire_confidence)[0]
        blobs = moved_blobs(background.moved_cells, scale=background.scale) if background.settled else []
        places = close_looks(merged([*coarse, *self._found], settings.close_looks), blobs, settings.close_looks)
        looks = [self._window(place) for place in places]
        close = [
            self._weighed(one, at_whole)
            for some in sight.look(looks, least_confidence=settings.acquire_confidence)
            for one in some
        ]
        if background.is_due(self._turn):
            rows = background.rows()
            background.learn(reduced[rows], rows, frozen=frozen)
        unseen = [one for one in coarse if all(apart(one.camera_px, place) for place in places)]
        return [*close, *(replace(one, confidence=0.8 * one.confidence) for one in unseen)]

    def _weighed(self, found: Detection, at_whole: Sequence[Detection]) -> Detection:
        """A still find is less sure where the whole frame did not show it too: small things look like cars from near."""
        agreed = any(math.dist(found.camera_px, other.camera_px) < 0.5 * other.length_px for other in at_whole)
        share = 1.0 if agreed or found.moving else self._settings.one_scale_share
        return replace(found, confidence=found.confidence * share)

    def _frozen(self, windows: Sequence[SearchWindow], found: Sequence[Detection]) -> list[Disc]:
        """Discs round the followed cars, where they were expected and where they were found."""
        share = self._settings.frozen_lengths
        discs = [Disc(centre_px=window.camera_px, radius_px=share * window.length_px) for window in windows]
        discs.extend(
            Disc(centre_px=one.camera_px, radius_px=share * one.length_px)
            for window in windows
            for one in found
            if one.confidence > 0.3 and math.dist(one.camera_px, window.camera_px) < window.length_px
        )
        return discs


def halvings_of(background: Background) -> int:
    """How often the frame was halved to the background's size."""
    return round(math.log2(1.0 / background.scale))


def _near(window: SearchWindow, found: Sequence[Detection]) -> bool:
    """True where something was found about where the window's car is expected."""
    return any(math.dist(one.camera_px, window.camera_px) < 1.5 * window.length_px for one in found)


def _elsewhere(windows: Sequence[SearchWindow], found: Sequence[Detection]) -> list[Detection]:
    """What was found well away from all the windows."""
    return [
        one
        for one in found
        if all(math.dist(one.camera_px, window.camera_px) > 1.5 * window.length_px for window in windows)
    ]
