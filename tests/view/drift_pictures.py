"""A floor with texture, seen straight from above by a camera that may be moved: exact inputs for the drift watch's tests."""

from __future__ import annotations

import cv2
import numpy as np

from dnb_edge.track.scale import TwinScale
from dnb_edge.view.drift_judge import WatchedTrack, watched_track
from dnb_edge.view.ground import GroundMap

WIDTH, HEIGHT = 640, 360
MM_PER_PX = 5.0
_SCALE = TwinScale(metres_per_px=MM_PER_PX / 1e3, height_px=float(HEIGHT))
GROUND = GroundMap(camera_to_twin=(1, 0, 0, 0, 1, 0, 0, 0, 1.0), scale=_SCALE, width_px=WIDTH, height_px=HEIGHT)
"""One camera px is 5 mm of floor, everywhere."""


def watched() -> WatchedTrack:
    """An oval 2.4 m long: 0.2 % of its span are 4.8 mm, or about 1 px."""
    angle = np.linspace(0.0, 2 * np.pi, 100, endpoint=False)
    return watched_track(GROUND, np.column_stack((1.6 + 1.2 * np.cos(angle), 0.9 + 0.6 * np.sin(angle))))


class Floor:
    """Blotches of several sizes; `plain` hides them but for a corner."""

    def __init__(self, seed: int = 1, *, plain: bool = False) -> None:
        random = np.random.default_rng(seed)
        big = np.full((2 * HEIGHT + 400, 2 * WIDTH + 400), 128.0, dtype=np.float32)
        for size, depth in ((4, 12.0), (9, 14.0), (30, 18.0)):
            blotches = cv2.GaussianBlur(random.normal(0.0, 1.0, big.shape).astype(np.float32), (0, 0), size)
            big += depth * blotches / blotches.std()
        if plain:
            big[:, 420:] = 128.0
        self._big = np.clip(big, 5, 250).astype(np.uint8)
        self._noises = [random.normal(0.0, 1.0, (HEIGHT, WIDTH)).astype(np.float32) for _ in range(9)]
        self._seen = 0

    def seen(
        self, right_px: float = 0.0, down_px: float = 0.0, *, turn_deg: float = 0.0, noise: float = 2.0
    ) -> np.ndarray:
        """The picture of a camera whose view has been shifted and turned about its middle, with its own noise."""
        middle = ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
        turn = np.vstack((cv2.getRotationMatrix2D(middle, turn_deg, 1.0), (0, 0, 1)))
        shift = np.array([[1, 0, right_px], [0, 1, down_px], [0, 0, 1.0]])
        fine = np.array([[2, 0, 200.5], [0, 2, 200.5], [0, 0, 1.0]])
        to_big = fine @ np.linalg.inv(shift @ turn)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        clean = cv2.warpPerspective(self._big, to_big, (WIDTH, HEIGHT), flags=flags).astype(np.float32)
        self._seen += 1
        return np.clip(clean + noise * self._noises[self._seen % 9], 0, 255).astype(np.uint8)
