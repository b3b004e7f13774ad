"""What a detector would say of a drive, drawn from a stated model instead of rendered: the *fast* way to many laps.

The model: the true ground point in the picture, plus a white error of `sigma_px` along either axis, plus an error that follows
from the place (the same in every lap, as of a detector that misjudges the car where it shows its side), plus one that fades
with `memory_s` (as of a detector that errs alike in neighbouring frames). It states the sigma of all three together. Besides:
detections left out, frames that never came, a stretch of the track that is hidden, false detections, another car that stands
beside the lane, and stamps that are off. Knows drives and cameras; knows no detector and no core.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.car import LENGTH_M
from dnb_edge.sim.rig import floor_to_camera_px
from dnb_edge.values import Detection, FrameDetections, Points, StampSource

_STEP_S = 0.002
_PLACE_WAVES = (7, 13, 24)
"""Waves of the place's error round one lap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """What a detector's answers are like, and what becomes of frames. The default: good answers, nothing lost."""

    sigma_px: float = 0.6
    """White error along either axis, one standard deviation, camera px."""
    place_px: float = 0.0
    """The place's error, one standard deviation over a lap, camera px."""
    memory_px: float = 0.0
    """The fading error, one standard deviation, camera px."""
    memory_s: float = 0.15
    """Time in which it fades to a third."""
    missed: float = 0.0
    """Share of frames in which the car is not found."""
    false_rate: float = 0.0
    """Share of frames with a false detection somewhere on the floor."""
    bystander_m: tuple[float, float] | None = None
    """(x, y), track m, of another car that stands there and is found in every frame."""
    dropped: float = 0.0
    """Share of frames that never come."""
    gap_frames: int = 0
    """As many frames in a row never come at every other crossing of the start line, the crossing among them."""
    hidden_m: tuple[float, float] | None = None
    """Stretch along the lap, metres from the start line, in which nothing is seen of the car."""
    stamp_sigma_s: float = 0.0
    """One standard deviation of the stamps' error, seconds."""

    @property
    def stated_px(self) -> float:
        """The sigma that goes with every detection."""
        return math.hypot(self.sigma_px, self.place_px, self.memory_px)


class Motion(Protocol):
    """A car's way as a function of time."""

    @property
    def duration_s(self) -> float:
        """How long it is on its way."""
        ...

    def points(self, t_s: NDArray[np.float64]) -> Points:
        """(n, 2) ground points at (n,) instants, track m."""
        ...

    def along_m(self, t_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance along the centreline from the start line, unwrapped."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moments:
    """Where the car truly is in each frame of a drive. All arrays are as long as there are frames."""

    t_s: NDArray[np.float64]
    """When the picture was taken."""
    t_ns: NDArray[np.int64]
    """What its stamp says."""
    track_m: Points
    heading_rad: NDArray[np.float64]
    """Direction of travel on the track plane; of a car that stands, the one before."""


def moments(motion: Motion, *, fps: float, stamp_sigma_s: float = 0.0, seed: int = 0, first_s: float = 0.0) -> Moments:
    """The frames of `motion` at `fps` a second, of which the first is taken at `first_s`."""
    k = np.arange(math.floor((motion.duration_s - first_s) * fps) + 1)
    exact_ns = np.rint(k * 1e9 / fps + first_s * 1e9).astype(np.int64)
    t_s = exact_ns * 1e-9
    points = motion.points(t_s)
    ahead = motion.points(np.minimum(t_s + _STEP_S, motion.duration_s)) - motion.points(np.maximum(t_s - _STEP_S, 0.0))
    off_s = np.zeros(len(k))
    if stamp_sigma_s > 0.0:
        random = np.random.default_rng([seed, 61])
        # Stamps stay in order whatever their error.
        off_s = np.clip(random.normal(0.0, stamp_sigma_s, len(k)), -0.45 / fps, 0.45 / fps)
    return Moments(
        t_s=t_s,
        t_ns=exact_ns + np.rint(off_s * 1e9).astype(np.int64),
        track_m=points,
        heading_rad=np.arctan2(ahead[:, 1], ahead[:, 0]),
    )


def kept_frames(
    model: Sightings, *, frames: int, fps: float, crossings_s: tuple[float, ...], seed: int
) -> NDArray[np.bool_]:
    """(frames,) True for the frames that come."""
    random = np.random.default_rng([seed, 62])
    kept: NDArray[np.bool_] = random.random(frames) >= model.dropped
    kept[0] = True
    for crossing_s in crossings_s[::2] if model.gap_frames else ():
        after = math.ceil(crossing_s * fps)
        first = after - int(random.integers(1, model.gap_frames + 1)) if model.gap_frames > 1 else after
        kept[max(1, first) : first + model.gap_frames] = False
    return kept


def sighted(
    motion: Motion,
    camera: PinholeCamera,
    at: Moments,
    model: Sightings,
    *,
    lap_m: float,
    kept: NDArray[np.bool_],
    seed: int,
    seen: NDArray[np.bool_] | None = None,
) -> Iterator[FrameDetections]:
    """The detections of each frame that comes. `seen` (frames,) says in which the car can be seen at all."""
    random = np.random.default_rng([seed, 63])
    count = len(at.t_s)
    along_m = motion.along_m(at.t_s)
    px = floor_to_camera_px(camera, at.track_m) + _errors(model, at, along_m / lap_m, random)
    half = 0.5 * LENGTH_M * np.column_stack((np.cos(at.heading_rad), np.sin(at.heading_rad)))
    length_px = np.linalg.norm(
        floor_to_camera_px(camera, at.track_m + half) - floor_to_camera_px(camera, at.track_m - half), axis=1
    )
    found = random.random(count) >= model.missed
    if seen is not None:
        found &= seen
    if model.hidden_m is not None:
        low, high = model.hidden_m
        place_m = np.mod(along_m, lap_m)
        found &= ~((place_m > low) & (place_m < high))
    false = random.random(count) < model.false_rate
    low, high = at.track_m.min(axis=0) - 0.1, at.track_m.max(axis=0) + 0.1
    false_px = floor_to_camera_px(camera, random.uniform(low, high, (count, 2)))
    for k in np.flatnonzero(kept).tolist():
        detections = []
        if found[k]:
            detections.append(_detection(px[k], model.stated_px, float(length_px[k]), 0.9))
        if false[k]:
            detections.append(_detection(false_px[k], model.stated_px, float(length_px[k]), 0.4))
        if model.bystander_m is not None:
            (standing,) = floor_to_camera_px(camera, np.array([model.bystander_m]))
            standing = standing + random.normal(0.0, 0.2, 2)
            detections.append(_detection(standing, model.stated_px, float(length_px[k]), 0.8))
        yield FrameDetections(
            sequence=k,
            t_ns=int(at.t_ns[k]),
            detections=tuple(detections),
            full_frame=False,
            stamp_source=StampSource.SIMULATED,
        )


def _detection(at: NDArray[np.float64], sigma_px: float, length_px: float, confidence: float) -> Detection:
    return Detection(
        camera_px=(float(at[0]), float(at[1])),
        sigma_px=sigma_px,
        length_px=max(length_px, 4.0),
        confidence=confidence,
        moving=True,
    )


def _errors(
    model: Sightings, at: Moments, laps: NDArray[np.float64], random: np.random.Generator
) -> NDArray[np.float64]:
    """(frames, 2) camera px; `laps` (frames,) is the distance along the lap as a share of it."""
    errors = random.normal(0.0, 1.0, (len(at.t_s), 2)) * model.sigma_px
    for axis in (0, 1):
        phases = random.uniform(0.0, 2.0 * np.pi, len(_PLACE_WAVES))
        if model.place_px > 0.0:
            waves = sum(np.sin(2.0 * np.pi * n * laps + p) for n, p in zip(_PLACE_WAVES, phases, strict=True))
            errors[:, axis] += model.place_px * math.sqrt(2.0 / len(_PLACE_WAVES)) * waves
        if model.memory_px > 0.0:
            errors[:, axis] += model.memory_px * _fading(at.t_s, model.memory_s, random)
    return errors


def _fading(t_s: NDArray[np.float64], memory_s: float, random: np.random.Generator) -> NDArray[np.float64]:
    """(n,) a series of unit variance whose correlation falls as exp(-dt / memory)."""
    keeps = np.exp(-np.diff(t_s, prepend=t_s[0]) / memory_s)
    fresh = random.standard_normal(len(t_s)) * np.sqrt(np.maximum(1.0 - keeps**2, 0.0))
    values = np.empty(len(t_s))
    last = float(random.standard_normal())
    for k, (keep, new) in enumerate(zip(keeps.tolist(), fresh.tolist(), strict=True)):
        last = keep * last + new
        values[k] = last
    return values
