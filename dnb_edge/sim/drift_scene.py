"""What goes on in front of a camera that stands still: light, people, cars, a chair, the sensor.

Knows a room's pictures and seconds; each frame follows from the seed and its time alone. Knows nothing of the watch. Meant
to be hard: shadows with edges creep, exposure steps, people stand about for minutes and hide half of the picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.drift_rooms import Bump, DriftRoom, GreyImage, bump_homography
from dnb_edge.values import Points

_GRID_PX = (320, 180)
_NOISES = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class _Person:
    """Comes in at one side, walks to a place, stands there, and goes."""

    from_s: float
    walk_s: float
    stand_s: float
    start: tuple[float, float]
    place: tuple[float, float]
    """Feet, shares of the picture's width and height."""
    tall: float
    """Share of the picture's height."""
    shade: float

    def at(self, t_s: float) -> tuple[float, float, float] | None:
        """(x, y, phase of the step) of the feet at `t_s`; None where nobody is there."""
        since_s = t_s - self.from_s
        if not 0.0 <= since_s < 2 * self.walk_s + self.stand_s:
            return None
        walked = min(1.0, since_s / self.walk_s, max(0.0, (2 * self.walk_s + self.stand_s - since_s) / self.walk_s))
        sway = 0.004 * math.sin(1.3 * t_s) if walked == 1.0 else 0.0
        x = self.start[0] + walked * (self.place[0] - self.start[0]) + sway
        y = self.start[1] + walked * (self.place[1] - self.start[1])
        return x, y, 0.0 if walked == 1.0 else 7.0 * since_s


class DriftScene:
    """Everything that changes in `minutes` of one room's pictures though its camera stands still."""

    def __init__(self, *, seed: int, size_px: tuple[int, int], minutes: float, lane_px: Points, jpeg: bool) -> None:
        random = np.random.default_rng([seed, 21])
        self._size_px = size_px
        self._lane_px = lane_px
        self._jpeg_quality = int(random.integers(70, 95)) if jpeg else None
        self._duration_s = minutes * 60.0
        self._seed = seed
        self._light(random)
        self._people = _people(random, self._duration_s)
        self._chair(random)
        self._cars = [float(random.uniform(0.03, 0.12)) for _ in range(int(random.integers(1, 4)))]
        width, height = size_px
        sigma = random.uniform(1.5, 3.5)
        self._noises = [
            cv2.GaussianBlur(random.normal(0.0, 1.6 * sigma, (height + 64, width + 64)).astype(np.float32), (0, 0), 0.5)
            .round()
            .astype(np.int16)
            for _ in range(_NOISES)
        ]

    def frame(
        self, room: DriftRoom, t_s: float, bump: Bump | None = None, bumped: GreyImage | None = None
    ) -> GreyImage:
        """The picture at `t_s`; after a `bump` also give what the empty room looks like then, `room.picture(bump)`."""
        picture = room.still.copy()
        self._draw_chair(picture, t_s)
        self._draw_cars(picture, t_s)
        for person in self._people:
            _draw_person(picture, person, t_s)
        if bump is not None and bumped is not None:
            picture = _moved(picture, room, bump, bumped)
        random = np.random.default_rng([self._seed, 22, round(t_s * 1000)])
        lit = cv2.multiply(picture, self._gain(t_s, random), dtype=cv2.CV_16S)
        height, width = picture.shape
        down, across = (int(random.integers(64)) for _ in range(2))
        noise = self._noises[int(random.integers(_NOISES))][down : down + height, across : across + width]
        noisy = cv2.add(lit, noise)
        seen = np.asarray(cv2.convertScaleAbs(cv2.max(noisy, np.zeros(1, np.int16))), dtype=np.uint8)
        if self._jpeg_quality is None:
            return seen
        _, jpeg = cv2.imencode(".jpg", seen, [cv2.IMWRITE_JPEG_QUALITY, self._jpeg_quality])
        return np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)

    def _light(self, random: np.random.Generator) -> None:
        self._cloud_s = random.uniform(15.0, 150.0, 2)
        self._cloud = float(random.uniform(0.03, 0.22))
        self._trend = float(random.uniform(-0.3, 0.3))
        self._slope_rad = float(random.uniform(0.0, 2 * math.pi))
        self._flicker = float(random.uniform(0.0, 0.05))
        # A window's light on the floor, whose edges creep as the sun goes: up to half the picture in two hours.
        self._sun = None
        if random.uniform() < 0.6:
            self._sun = (*random.uniform(0.1, 0.9, 2), *random.uniform(-0.004, 0.004, 2), random.uniform(0.15, 0.5))
        steps = np.cumsum(random.exponential(90.0, 4 + int(self._duration_s / 60.0)))
        self._step_s = steps
        self._steps = random.uniform(0.65, 1.35, len(steps) + 1)

    def _gain(self, t_s: float, random: np.random.Generator) -> NDArray[np.float32]:
        """(h, w) factor of the light at `t_s`."""
        first, second = (math.sin(2 * math.pi * t_s / period_s) for period_s in self._cloud_s)
        level = 1.0 + self._cloud * first * (0.6 + 0.4 * second) + self._trend * t_s / self._duration_s
        level *= float(self._steps[int(np.searchsorted(self._step_s, t_s))])
        level *= 1.0 + self._flicker * float(random.uniform(-1.0, 1.0))
        columns, rows = _GRID_PX
        v, u = np.mgrid[0:rows, 0:columns].astype(np.float32)
        turn = self._slope_rad + t_s / 1500.0
        slope = math.cos(turn) * (u / columns - 0.5) + math.sin(turn) * (v / rows - 0.5)
        field = np.asarray(level * (1.0 + 0.25 * slope), dtype=np.float32)
        if self._sun is not None:
            field += self._sunlight(t_s)
        return np.asarray(cv2.resize(field, self._size_px, interpolation=cv2.INTER_LINEAR), dtype=np.float32)

    def _sunlight(self, t_s: float) -> NDArray[np.float32]:
        assert self._sun is not None
        x, y, along, down, strength = self._sun
        x, y = x + along * t_s / 60.0, y + down * t_s / 60.0
        corners = np.array([(x, y), (x + 0.22, y + 0.05), (x + 0.30, y + 0.45), (x + 0.06, y + 0.42)]) * _GRID_PX
        mask = np.zeros((_GRID_PX[1], _GRID_PX[0]), dtype=np.uint8)
        cv2.fillConvexPoly(mask, np.rint(corners * 16).astype(np.int32), (255,), cv2.LINE_AA, 4)
        soft = cv2.GaussianBlur(mask, (0, 0), 1.5).astype(np.float32)
        return np.asarray(soft * np.float32(strength / 255.0), dtype=np.float32)

    def _chair(self, random: np.random.Generator) -> None:
        """A chair that hides a part of the picture and is pushed: by a few px or right across, once or several times."""
        width, height = self._size_px
        share = random.uniform(0.1, 0.28)
        size = (int(width * share), int(height * share * 1.4))
        texture = cv2.resize(random.uniform(30, 200, (9, 7)).astype(np.float32), size, interpolation=cv2.INTER_NEAREST)
        self._seat = cv2.GaussianBlur(texture, (0, 0), 0.8).astype(np.uint8)
        self._push_s = np.sort(
            random.uniform(5.0, self._duration_s, int(random.integers(1, 2 + int(self._duration_s / 300.0))))
        )
        place = np.array([random.uniform(0, width - size[0]), random.uniform(0, height - size[1])])
        self._places = [place]
        for _ in self._push_s:
            reach = 6.0 if random.uniform() < 0.6 else 0.5 * width
            place = np.clip(place + random.uniform(-reach, reach, 2), 0, (width - size[0], height - size[1]))
            self._places.append(place)

    def _draw_chair(self, picture: GreyImage, t_s: float) -> None:
        u, v = self._places[int(np.searchsorted(self._push_s, t_s))].astype(int)
        rows, columns = self._seat.shape
        picture[v : v + rows, u : u + columns] = self._seat

    def _draw_cars(self, picture: GreyImage, t_s: float) -> None:
        side = self._size_px[0] / 25.0
        for number, rounds_per_s in enumerate(self._cars):
            at = int((t_s * rounds_per_s + number / 5.0) % 1.0 * len(self._lane_px))
            u, v = self._lane_px[at].tolist()
            ahead = self._lane_px[(at + 3) % len(self._lane_px)] - self._lane_px[at]
            angle = math.degrees(math.atan2(ahead[1], ahead[0]))
            body = cv2.boxPoints(((u, v), (side, side * 0.55), angle)).astype(np.int32)
            roof = cv2.boxPoints(((u, v), (side * 0.5, side * 0.4), angle)).astype(np.int32)
            cv2.fillConvexPoly(picture, body, (200,), cv2.LINE_AA)
            cv2.fillConvexPoly(picture, roof, (40,), cv2.LINE_AA)


def _moved(picture: GreyImage, room: DriftRoom, bump: Bump, bumped: GreyImage) -> GreyImage:
    """What stands in the room's picture, brought to the bumped one: the room itself comes from there, finer drawn."""
    matrix = bump_homography(room.camera, bump)
    put = (picture != room.still).astype(np.uint8)
    shift = [
        np.asarray(cv2.warpPerspective(layer, matrix, room.size_px, flags=cv2.INTER_LINEAR)) for layer in (picture, put)
    ]
    return np.where(shift[1] > 0, shift[0], bumped)


def _people(random: np.random.Generator, duration_s: float) -> list[_Person]:
    """Somebody about every minute; one in eight stands so near to the camera that half of the picture is hidden."""
    people, t_s = [], float(random.exponential(40.0))
    while t_s < duration_s:
        near = random.uniform() < 0.125
        start = (float(random.choice([-0.2, 1.2])), float(random.uniform(0.2, 1.1)))
        people.append(
            _Person(
                from_s=t_s,
                walk_s=float(random.uniform(2.0, 6.0)),
                stand_s=float(random.choice([0.0, random.uniform(2.0, 20.0), random.uniform(60.0, 300.0)])),
                start=start,
                place=(
                    float(random.uniform(0.0, 1.0)),
                    float(random.uniform(1.0, 1.7) if near else random.uniform(0.2, 1.2)),
                ),
                tall=float(random.uniform(1.4, 2.2) if near else random.uniform(0.3, 0.7)),
                shade=float(random.uniform(20, 160)),
            )
        )
        t_s += float(random.exponential(60.0))
    return people


def _draw_person(picture: GreyImage, person: _Person, t_s: float) -> None:
    """Two legs that step and a striped body."""
    where = person.at(t_s)
    if where is None:
        return
    height, width = picture.shape
    x, y, phase = where
    tall = person.tall * height
    u, v = x * width, y * height
    for side in (-1.0, 1.0):
        foot = (round(u + side * 0.09 * tall + 0.08 * tall * math.sin(phase) * side), round(v))
        hip = (round(u + side * 0.05 * tall), round(v - 0.45 * tall))
        cv2.line(picture, hip, foot, (person.shade,), max(2, round(0.09 * tall)), cv2.LINE_AA)
    middle, axes = (round(u), round(v - 0.68 * tall)), (max(2, round(0.15 * tall)), max(2, round(0.28 * tall)))
    cv2.ellipse(picture, middle, axes, 0.0, 0.0, 360.0, (person.shade * 0.7 + 40,), -1, cv2.LINE_AA)
    for stripe in (-0.1, 0.0, 0.1):
        row = round(v - (0.68 + stripe) * tall)
        ends = (round(u - 0.12 * tall), row), (round(u + 0.12 * tall), row)
        cv2.line(picture, *ends, (person.shade + 60,), max(1, round(0.02 * tall)), cv2.LINE_AA)
