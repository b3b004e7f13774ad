"""What disturbs a picture: light that rises, lamps that flicker, a sensor that hisses, and a hand that reaches in.

Knows pictures and seconds; everything follows from a seed. Knows no track and no car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dnb_edge.values import BgrImage, PointPx

_SKIN = (132.0, 158.0, 206.0)
_SLEEVE = (96.0, 70.0, 52.0)
_REACH_S = 0.35
"""Time in which a hand comes in, and in which it goes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """How much of what. The default disturbs nothing."""

    ramp: float = 0.0
    """Share by which the light rises and falls again over `ramp_s`."""
    ramp_s: float = 20.0
    flicker: float = 0.0
    """Amplitude of the lamps' flicker, a share of the light."""
    flicker_hz: float = 9.3
    """Its frequency as the camera's frames show it."""
    noise_sigma: float = 0.0
    """More noise of the sensor, grey levels."""
    hands: float = 0.0
    """Share of the time in which a hand is in the picture."""

    def __post_init__(self) -> None:
        if not (0.0 <= self.ramp < 1.0 and 0.0 <= self.flicker < 1.0 and 0.0 <= self.hands < 1.0):
            raise ValueError(f"shares of a disturbance lie between 0 and 1, not {self}")


class Disturber:
    """Disturbs the pictures of one drive, (height, width) px each. The same arguments give the same bytes."""

    def __init__(self, wanted: Disturbance, *, seed: int, size_px: tuple[int, int], hand_px: float) -> None:
        """`hand_px` is the width of a hand in the picture; `size_px` is (width, height)."""
        self._wanted = wanted
        self._seed = seed
        self._size = size_px
        self._hand_px = hand_px
        random = np.random.default_rng([seed, 51])
        # One sheet of noise larger than the picture: each frame takes another piece of it.
        shape = (size_px[1] + 64, size_px[0] + 64, 3)
        self._noise = None
        if wanted.noise_sigma > 0.0:
            sheet = random.standard_normal(shape, dtype=np.float32) * np.float32(wanted.noise_sigma)
            self._noise = np.rint(sheet).astype(np.int16)

    def apply(self, picture: BgrImage, *, index: int, t_s: float) -> BgrImage:
        """Frame number `index`, shown at `t_s`, as the camera delivers it. May draw into `picture`."""
        if self._wanted.hands > 0.0:
            self._draw_hand(picture, t_s)
        gain = self._gain(t_s)
        if gain != 1.0:
            picture = cv2.convertScaleAbs(picture, alpha=gain).astype(np.uint8, copy=False)
        if self._noise is not None:
            row, column = np.random.default_rng([self._seed, 52, index]).integers(0, 64, 2)
            piece = self._noise[row : row + self._size[1], column : column + self._size[0]]
            picture = cv2.add(picture, piece, dtype=cv2.CV_8U).astype(np.uint8, copy=False)
        return picture

    def _gain(self, t_s: float) -> float:
        wanted = self._wanted
        ramp = wanted.ramp * math.sin(math.pi * t_s / wanted.ramp_s) ** 2
        return 1.0 - ramp + wanted.flicker * math.sin(2.0 * math.pi * wanted.flicker_hz * t_s)

    def _draw_hand(self, picture: BgrImage, t_s: float) -> None:
        """An arm from the picture's lower or upper edge to a place that follows from the seed, anew every few seconds."""
        period_s = 4.0
        number, in_period_s = divmod(t_s, period_s)
        random = np.random.default_rng([self._seed, 53, int(number)])
        stays_s = self._wanted.hands * period_s
        if in_period_s > stays_s:
            return
        width, height = self._size
        share = min(1.0, in_period_s / _REACH_S, (stays_s - in_period_s) / _REACH_S)
        at = (float(random.uniform(0.1, 0.9)) * width, float(random.uniform(0.15, 0.85)) * height)
        from_below = bool(random.integers(2))
        edge = (
            at[0] + float(random.uniform(-0.2, 0.2)) * width,
            height + self._hand_px if from_below else -self._hand_px,
        )
        tremble = 0.03 * self._hand_px * math.sin(11.0 * t_s)
        palm = (edge[0] + share * (at[0] - edge[0]) + tremble, edge[1] + share * (at[1] - edge[1]) + tremble)
        _draw_arm(picture, edge, palm, self._hand_px)


def _draw_arm(picture: BgrImage, edge: PointPx, palm: PointPx, hand_px: float) -> None:
    """Sleeve, forearm, palm and four fingers; `hand_px` is the palm's width."""
    direction = np.subtract(palm, edge)
    length = float(np.hypot(*direction))
    if length < 1.0:
        return
    ahead = direction / length
    aside = np.array([-ahead[1], ahead[0]])
    wrist = np.subtract(palm, 0.6 * hand_px * ahead)

    def stroke(start: np.ndarray, end: np.ndarray, colour: tuple[float, float, float], thick: float) -> None:
        ends = [tuple(np.rint(16.0 * point).astype(int).tolist()) for point in (start, end)]
        cv2.line(picture, ends[0], ends[1], colour, max(1, round(thick)), cv2.LINE_AA, 4)

    elbow = np.asarray(edge) + 0.35 * max(0.0, length - hand_px) * ahead
    stroke(np.asarray(edge, dtype=np.float64), elbow, _SLEEVE, 1.1 * hand_px)
    stroke(elbow, wrist, _SKIN, 0.7 * hand_px)
    stroke(wrist, np.asarray(palm), _SKIN, 0.95 * hand_px)
    for k in (-1.5, -0.5, 0.5, 1.5):
        root = np.asarray(palm) + 0.24 * k * hand_px * aside
        stroke(root, root + (0.75 - 0.08 * abs(k)) * hand_px * (ahead + 0.12 * k * aside), _SKIN, 0.2 * hand_px)
