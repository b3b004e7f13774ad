"""Frames of the simulated camera: the still room with the cars drawn into it, their shadows, and the sensor's noise.

Knows how to compose one picture for one pose a car. The room is drawn once; a frame redraws only the rectangle round each car.
Knows no time.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.car import car_mesh, posed
from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.driver import Pose
from dnb_edge.sim.room import draw_room
from dnb_edge.sim.solids import Mesh, draw_mesh, draw_shadow, thrown_on_floor
from dnb_edge.values import BgrImage

_SUPERSAMPLE = 3
_MARGIN_PX = 14
_NOISE_PICTURES = 6
_NOISE_SIGMA = 2.2
_SHADOW_DEPTH = 0.55


class Renderer:
    """Pictures of one room, one camera and the cars; all follow from the seed. Not safe for use by several threads."""

    def __init__(
        self, circuit: Circuit, camera: PinholeCamera, seed: int, *, cars: Sequence[Mesh] | None = None
    ) -> None:
        """`cars` in the car's frame each; None for the one that `seed` chooses."""
        self.camera = camera
        self._seed = seed
        self._cars = (car_mesh(seed),) if cars is None else tuple(cars)
        self._room = draw_room(circuit, camera, seed)
        random = np.random.default_rng([seed, 5])
        shape = self._room.shape
        self._noise = [_noise((shape[0], shape[1], shape[2]), random) for _ in range(_NOISE_PICTURES)]
        self._standing: list[Mesh] = []
        """What was stood in the room, and hides cars behind it."""
        # The empty room with each noise added beforehand: a frame starts as a plain copy of one of them.
        self._noisy_rooms = [_add_noise(self._room, noise) for noise in self._noise]

    def picture(self, index: int, pose: Pose | None, *others: Pose) -> BgrImage:
        """The picture with number `index` (it chooses the noise), with the first car at `pose` and those after it at
        `others`; the empty room for None."""
        which = int(np.random.default_rng([self._seed, 6, index]).integers(_NOISE_PICTURES))
        picture = self._noisy_rooms[which].copy()
        if pose is None:
            return picture
        bodies = [posed(car, at) for car, at in zip(self._cars, (pose, *others), strict=True)]
        before = [thing for thing in self._standing if any(self._hides(thing, car) for car in bodies)]
        below = self._room if len(bodies) + len(before) == 1 else self._room.copy()
        # From the farthest to the nearest: a car hides what stands behind it.
        for body in sorted((*bodies, *before), key=self._nearness):
            # What stands in the room has thrown its shadow there already.
            self._draw_car(picture, body, self._noise[which], below, shadow=not any(body is thing for thing in before))
        return picture

    def _hides(self, thing: Mesh, car: Mesh) -> bool:
        """Whether `thing` is nearer to the camera than `car` and may cover some of it."""
        if self._nearness(thing) <= self._nearness(car):
            return False
        one, other = _rectangle(self.camera, thing), _rectangle(self.camera, car)
        if one is None or other is None:
            return False
        return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]

    def _nearness(self, body: Mesh) -> float:
        return -float(self.camera.distance_m(body.corners_m.mean(axis=0)[None])[0])

    def park(self, pose: Pose, seed: int) -> None:
        """Stand another car, the one that `seed` chooses, at `pose` for good: it belongs to the room from now on.

        It stands behind the driven car wherever the two overlap in the picture.
        """
        self._draw_still(posed(car_mesh(seed), pose))

    def stand(self, body: Mesh) -> None:
        """Stand `body`, world m, in the room for good; it hides a car that drives behind it."""
        self._draw_still(body)
        self._standing.append(body)

    def _draw_still(self, body: Mesh) -> None:
        silent = np.zeros(self._room.shape, dtype=np.int16)
        self._draw_car(self._room, body, silent, self._room)
        self._noisy_rooms = [_add_noise(self._room, noise) for noise in self._noise]

    def _draw_car(
        self, picture: BgrImage, body: Mesh, noise: NDArray[np.int16], below: BgrImage, *, shadow: bool = True
    ) -> None:
        """`below` is the picture without noise so far; where it is not the still room, the car is drawn into it too."""
        rectangle = _rectangle(self.camera, body)
        if rectangle is None:
            return
        left, top, right, bottom = rectangle
        size = (right - left, bottom - top)
        floor = below[top:bottom, left:right].astype(np.float32)
        if shadow:
            floor *= 1.0 - _SHADOW_DEPTH * self._shadow(body, (left, top), size)[..., None]
        colour, cover = self._car_layer(body, (left, top), size)
        composed = floor * (1.0 - cover[..., None]) + colour
        noisy = composed + noise[top:bottom, left:right]
        picture[top:bottom, left:right] = np.clip(noisy, 0.0, 255.0).astype(np.uint8)
        if below is not self._room:
            below[top:bottom, left:right] = np.rint(np.clip(composed, 0.0, 255.0)).astype(np.uint8)

    def _shadow(self, body: Mesh, corner: tuple[int, int], size: tuple[int, int]) -> NDArray[np.float32]:
        """(h, w) 0..1: a wide soft shadow and a narrow dark one under the car."""
        mask = np.zeros((size[1], size[0]), dtype=np.uint8)
        draw_shadow(mask, body, self.camera, offset_px=corner, scale=1.0)
        wide, narrow = cv2.GaussianBlur(mask, (0, 0), 3.5), cv2.GaussianBlur(mask, (0, 0), 1.3)
        return np.asarray((0.6 * wide.astype(np.float32) + 0.4 * narrow.astype(np.float32)) / 255.0, dtype=np.float32)

    def _car_layer(
        self, body: Mesh, corner: tuple[int, int], size: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Colour (h, w, 3) already multiplied by cover, and cover (h, w) 0..1, both as sharp as the lens."""
        big_size = (size[1] * _SUPERSAMPLE, size[0] * _SUPERSAMPLE)
        colour = np.zeros((*big_size, 3), dtype=np.uint8)
        draw_mesh(colour, body, self.camera, offset_px=corner, scale=_SUPERSAMPLE)
        # No part of the car is pure black, so what is not black is car. OpenCV, since NumPy's max over channels is slow.
        blue, green, red = cv2.split(colour)
        _, cover = cv2.threshold(cv2.max(cv2.max(blue, green), red), 0.0, 255.0, cv2.THRESH_BINARY)
        layer = cv2.resize(cv2.merge((blue, green, red, cover)), size, interpolation=cv2.INTER_AREA)
        soft = cv2.GaussianBlur(layer, (0, 0), 0.6).astype(np.float32)
        return soft[..., :3], soft[..., 3] / np.float32(255.0)


def _rectangle(camera: PinholeCamera, body: Mesh) -> tuple[int, int, int, int] | None:
    """(left, top, right, bottom) px round the car and its shadow, inside the picture; None where it is outside."""
    pixels = camera.project(np.concatenate((body.corners_m, thrown_on_floor(body))))
    low = np.floor(pixels.min(axis=0)).astype(int) - _MARGIN_PX
    high = np.ceil(pixels.max(axis=0)).astype(int) + _MARGIN_PX + 1
    left, top = max(0, int(low[0])), max(0, int(low[1]))
    right, bottom = min(camera.width_px, int(high[0])), min(camera.height_px, int(high[1]))
    return (left, top, right, bottom) if right > left and bottom > top else None


def _noise(shape: tuple[int, int, int], random: np.random.Generator) -> NDArray[np.int16]:
    """(h, w, 3) sensor noise: mostly grey, a little coloured, slightly smeared as cameras smear it."""
    grey = random.standard_normal(shape[:2], dtype=np.float32)[..., None]
    colour = random.standard_normal(shape, dtype=np.float32)
    mixed = cv2.GaussianBlur(0.85 * grey + 0.5 * colour, (0, 0), 0.5)
    return np.asarray(np.rint(mixed * (_NOISE_SIGMA / float(mixed.std()))), dtype=np.int16)


def _add_noise(picture: BgrImage, noise: NDArray[np.int16]) -> BgrImage:
    return np.asarray(np.clip(picture.astype(np.int16) + noise, 0, 255), dtype=np.uint8)
