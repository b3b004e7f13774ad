"""The centre detector: our own network over windows round followed cars, or over the whole frame to find them.

Knows frames, search windows and a background; nothing of metres, laps or who is who. With windows it looks at one 160 px crop
each, in which the car is about 36 px long; without, at the whole frame at reduced size, at one finer tile a frame (all tiles in
turn), and once more, closely, at the best candidates of this frame and the last. Now and then it does the latter all the same,
so that a lost car comes back. State: the background and the last candidates; the same frames give the same answers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import Background, BackgroundSettings, Disc
from dnb_edge.detect.decode import Peak, peaks
from dnb_edge.detect.looks import Look, look_pixels, reduce_frame, tile_looks, whole_look, whole_pixels, window_look
from dnb_edge.detect.onnx import CentreNetwork
from dnb_edge.values import BgrImage, Detection, FrameDetections, SearchWindow


@dataclass(frozen=True, slots=True, kw_only=True)
class CentreDetectorSettings:
    """Sizes, thresholds and rhythms of the centre detector."""

    working_width_px: int = 640
    """Width of the whole frame as the network and the background see it."""
    window_px: int = 160
    window_length_px: float = 36.0
    """Length of the expected car in a window, network px."""
    tile_px: tuple[int, int] = (448, 384)
    """Width and height of a fine tile, network px."""
    fine_width_px: int = 1280
    """Width of the whole frame at the tiles' scale."""
    full_look_every: int = 30
    """With windows given, the whole frame is looked at every n-th frame too; 0: never."""
    acquire_confidence: float = 0.2
    follow_confidence: float = 0.15
    most_detections: int = 12
    close_looks: int = 4
    """At most as many candidates are looked at closely in a whole-frame pass."""
    one_scale_share: float = 0.85
    """Confidence left to something still that was found in a close look and not in the whole frame."""
    moving_level: int = 22
    """Difference from the background, 0..255, that counts as moved."""
    moving_share: float = 0.25
    """Share of the car's inner pixels that must have moved."""
    frozen_lengths: float = 0.9
    """The background learns nothing within as many car lengths of a followed car."""
    background: BackgroundSettings = field(default_factory=BackgroundSettings)


class CentreDetector:
    """Finds cars with a centre network. Implements `detect.protocol.Detector`."""

    def __init__(self, network: CentreNetwork, settings: CentreDetectorSettings | None = None) -> None:
        self._network = network
        self._settings = settings or CentreDetectorSettings()
        self._background = Background(self._settings.background)
        self._candidates: tuple[Detection, ...] = ()
        self._frames = 0
        self._tile = 0

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        """Cars in `image`, (h, w, 3): in the windows, or in the whole frame where there are none; strongest first."""
        settings = self._settings
        whole = whole_look(image.shape[1], image.shape[0], settings.working_width_px)
        periodic = (
            settings.full_look_every > 0 and self._frames % settings.full_look_every == settings.full_look_every - 1
        )
        full_frame = not windows or periodic
        self._frames += 1
        due = self._background.is_due()
        reduced = reduce_frame(image, whole) if full_frame or due or self._changed(whole) else None
        if reduced is not None and self._changed(whole):
            self._background.update(reduced, scale=whole.scale)
        found: list[Detection] = []
        for window in windows:
            look = self._window(window.camera_px, window.length_px)
            found.extend(self._look(image, look, whole.scale, settings.follow_confidence))
        if full_frame and reduced is not None:
            found.extend(self._search(image, reduced, whole, fine=not windows))
        detections = _merged(found, settings.most_detections)
        if due and reduced is not None:
            self._background.update(reduced, scale=whole.scale, frozen=self._frozen(windows, detections))
        self._candidates = detections if full_frame else ()
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=detections, full_frame=full_frame)

    def _changed(self, whole: Look) -> bool:
        """True where there is no background of the frame's size yet."""
        picture = self._background.picture
        return picture is None or picture.shape[:2] != (whole.out_height_px, whole.out_width_px)

    def _window(self, centre_px: tuple[float, float], length_px: float) -> Look:
        settings = self._settings
        return window_look(
            centre_px, max(6.0, length_px), window_px=settings.window_px, window_length_px=settings.window_length_px
        )

    def _frozen(self, windows: Sequence[SearchWindow], detections: Sequence[Detection]) -> list[Disc]:
        """Discs round the followed cars, where they were expected and where they were found."""
        share = self._settings.frozen_lengths
        discs = [Disc(centre_px=window.camera_px, radius_px=share * window.length_px) for window in windows]
        discs.extend(
            Disc(centre_px=found.camera_px, radius_px=share * found.length_px)
            for window in windows
            for found in detections
            if math.dist(found.camera_px, window.camera_px) < 2.0 * window.length_px and found.confidence > 0.3
        )
        return discs

    def _search(self, image: BgrImage, reduced: BgrImage, whole: Look, *, fine: bool) -> list[Detection]:
        """The whole frame at reduced size, one fine tile where `fine`, and close looks at the best candidates."""
        settings = self._settings
        background = self._background.picture
        if background is None:
            return []
        coarse = self._detections(whole_pixels(reduced, background), whole, settings.acquire_confidence)
        at_whole = tuple(coarse)
        tiles = tile_looks(
            whole.width_px, whole.height_px, fine_width_px=settings.fine_width_px, tile_px=settings.tile_px
        )
        if tiles and fine:
            coarse.extend(self._look(image, tiles[self._tile % len(tiles)], whole.scale, settings.acquire_confidence))
            self._tile += 1
        candidates = _merged([*coarse, *self._candidates], settings.close_looks)
        close: list[Detection] = []
        for candidate in candidates:
            look = self._window(candidate.camera_px, candidate.length_px)
            close.extend(self._look(image, look, whole.scale, settings.acquire_confidence))
        close = [self._weighed(found, at_whole) for found in close]
        seen = [(candidate.camera_px, candidate.length_px) for candidate in candidates]
        unseen = [found for found in coarse if all(math.dist(found.camera_px, at) > length for at, length in seen)]
        return [*close, *(replace(found, confidence=found.confidence * 0.8) for found in unseen)]

    def _weighed(self, found: Detection, at_whole: Sequence[Detection]) -> Detection:
        """A still find is less sure where the whole frame did not show it too: small things look like cars from near."""
        agreed = any(math.dist(found.camera_px, other.camera_px) < 0.5 * other.length_px for other in at_whole)
        share = 1.0 if agreed or found.moving else self._settings.one_scale_share
        return replace(found, confidence=found.confidence * share)

    def _look(self, image: BgrImage, look: Look, background_scale: float, least: float) -> list[Detection]:
        background = self._background.picture
        if background is None:
            return []
        return self._detections(look_pixels(image, background, look, background_scale), look, least)

    def _detections(self, pixels: NDArray[np.uint8], look: Look, least: float) -> list[Detection]:
        found = peaks(self._network(pixels), least_confidence=least, most=self._settings.most_detections)
        inside = [peak for peak in found if peak.u_px < look.out_width_px and peak.v_px < look.out_height_px]
        return [self._detection(peak, pixels[:, :, 3], look) for peak in inside]

    def _detection(self, peak: Peak, moved: NDArray[np.uint8], look: Look) -> Detection:
        u, v = look.to_frame(peak.u_px, peak.v_px)
        return Detection(
            camera_px=(u, v),
            sigma_px=peak.sigma_px / look.scale,
            length_px=peak.length_px / look.scale,
            confidence=peak.confidence,
            heading_rad=peak.heading_rad,
            moving=self._has_moved(peak, moved),
        )

    def _has_moved(self, peak: Peak, moved: NDArray[np.uint8]) -> bool:
        """True where enough of the car's middle, a little above its ground point, differs from the background."""
        reach = max(2.0, 0.3 * peak.length_px)
        top, bottom = max(0, round(peak.v_px - 1.3 * reach)), max(1, round(peak.v_px + 0.5 * reach) + 1)
        left, right = max(0, round(peak.u_px - reach)), max(1, round(peak.u_px + reach) + 1)
        patch = moved[top:bottom, left:right]
        # a change of the light differs everywhere: only what differs more has moved
        level = self._settings.moving_level + float(np.median(moved[::8, ::8]))
        return bool(patch.size) and float((patch > level).mean()) >= self._settings.moving_share


def _rank(found: Detection) -> float:
    """What has moved goes before what has not, unless that is much surer."""
    return found.confidence + (0.3 if found.moving else 0.0)


def _merged(found: Sequence[Detection], most: int) -> tuple[Detection, ...]:
    """The detections by rank, without those within 0.4 lengths of a better one."""
    kept: list[Detection] = []
    for detection in sorted(found, key=lambda one: (-_rank(one), one.camera_px)):
        if all(math.dist(detection.camera_px, other.camera_px) > 0.4 * other.length_px for other in kept):
            kept.append(detection)
    return tuple(kept[:most])
