"""What a camera does to a clean picture: exposure, white balance, gloss, vignette, blur, noise, sharpening, JPEG.

Knows pixels only. Every effect draws its strength from the generator it is handed.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.render import to_picture
from dnb_edge.values import BgrImage

Rng = np.random.Generator
Picture = NDArray[np.float32]


def uneven_light(size_px: int, rng: Rng) -> Picture:
    """A slow gain over the picture, (size, size, 1): lamps, windows, gloss on the floor."""
    coarse = np.exp(rng.normal(0.0, float(rng.uniform(0.02, 0.22)), (4, 4))).astype(np.float32)
    gain = cv2.resize(coarse, (size_px, size_px), interpolation=cv2.INTER_CUBIC)
    return np.asarray(gain[:, :, None], dtype=np.float32)


def _streak(length_px: float, angle_rad: float) -> NDArray[np.float32]:
    """The kernel of a straight, even movement."""
    side = 2 * int(length_px / 2 + 1) + 1
    kernel = np.zeros((4 * side, 4 * side), dtype=np.float32)
    middle, du, dv = (4 * side - 1) / 2.0, 2 * length_px * np.cos(angle_rad), 2 * length_px * np.sin(angle_rad)
    start, end = (round(middle - du), round(middle - dv)), (round(middle + du), round(middle + dv))
    cv2.line(kernel, start, end, (1.0,), 4)
    small = cv2.resize(kernel, (side, side), interpolation=cv2.INTER_AREA)
    return np.asarray(small / small.sum(), dtype=np.float32)


class Camera:
    """One camera with settings drawn once, so that two pictures of the same scene are alike."""

    def __init__(self, rng: Rng, *, blur_px: float = 0.0, shaken: bool = False) -> None:
        """`blur_px`: blur, in px of the picture, of a camera whose own pixels are larger; `shaken`: it moved while exposing."""
        exposure = float(np.exp(rng.normal(0.0, 0.25)))
        if rng.random() < 0.12:  # over- or under-exposed
            exposure = float(rng.uniform(1.5, 2.4)) if rng.random() < 0.5 else float(rng.uniform(0.25, 0.5))
        self._gain = np.exp(rng.normal(0.0, 0.06, 3)) * exposure
        self._gamma = float(np.exp(rng.normal(0.0, 0.15)))
        self._lift = float(rng.uniform(0, 22)) if rng.random() < 0.4 else 0.0
        focus = float(rng.uniform(0.3, 1.1)) if rng.random() < 0.5 else 0.0
        self._blur = float(np.hypot(focus, blur_px))
        self._sharpen = float(rng.uniform(0.3, 1.2)) if rng.random() < 0.3 else 0.0
        self._noise = float(rng.uniform(0.5, 3.0)) if rng.random() < 0.75 else float(rng.uniform(3.0, 9.0))
        self._shake = _streak(float(rng.uniform(2.0, 14.0)), float(rng.uniform(0, np.pi))) if shaken else None
        self._quality = int(rng.integers(35, 96))

    def develop(self, picture: Picture, rng: Rng, *, noise: float = 1.0) -> BgrImage:
        """The picture as this camera delivers it; `noise` scales its noise (a mean of many frames has little)."""
        levels = np.arange(1024, dtype=np.float32) / 1023.0
        out = np.clip(picture * self._gain.astype(np.float32), 0.0, 255.0)
        curve = (levels**self._gamma * (255.0 - self._lift) + self._lift).astype(np.float32)
        out = curve[(out * np.float32(1023.0 / 255.0)).astype(np.int32)]
        if self._shake is not None:
            out = np.asarray(cv2.filter2D(out, -1, self._shake, borderType=cv2.BORDER_REPLICATE), dtype=np.float32)
        if self._blur > 0.2:
            out = np.asarray(cv2.GaussianBlur(out, (0, 0), self._blur), dtype=np.float32)
        if self._sharpen > 0.0:
            out = out + np.float32(self._sharpen) * (out - cv2.GaussianBlur(out, (0, 0), 1.2))
        height, width = out.shape[:2]
        if self._noise * noise > 0.1:
            grain = np.empty((height, width, 3), dtype=np.float32)
            rng.standard_normal(out=grain, dtype=np.float32)
            out = out + grain * np.float32(self._noise * noise)
        _, encoded = cv2.imencode(".jpg", to_picture(out), [cv2.IMWRITE_JPEG_QUALITY, self._quality])
        return np.asarray(cv2.imdecode(encoded, cv2.IMREAD_COLOR), dtype=np.uint8)
