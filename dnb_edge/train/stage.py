"""Where a camera hangs and how a scene is lit: the settings of a sample, drawn from the generator handed in.

Knows what real set-ups are like (1.5 to 4 m high, 30 to 90 degrees down, ordinary lenses); draws nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dnb_edge.train.camera import View, overhead_view
from dnb_edge.train.render import Light

Rng = np.random.Generator

_NATIVE_PX = (1280, 720)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage:
    """A camera's view, already cut to the sample, with what its picture's size does to sharpness."""

    view: View
    blur_px: float
    """Blur, sample px, of a camera whose own pixels are larger than the sample's."""
    frame_rows_px: float
    """Height of the whole frame in sample px: what the rolling shutter passes in one readout."""


def random_camera(rng: Rng) -> View:
    """A whole camera at 1280x720: low over a table now and then, upright in most cases."""
    height_m = float(rng.uniform(1.5, 4.0)) if rng.random() < 0.85 else float(rng.uniform(0.7, 1.5))
    pitch = math.radians(float(rng.uniform(30.0, 90.0)) if rng.random() < 0.9 else float(rng.uniform(15.0, 32.0)))
    field = math.radians(float(rng.uniform(45.0, 100.0)))
    wide = max(0.0, (field - 0.9) / 0.8)
    radial = (
        float(rng.normal(-0.02, 0.03)) - wide * float(rng.uniform(0.0, 0.25)),
        wide * float(rng.uniform(0.0, 0.05)),
    )
    roll = float(rng.normal(0.0, 0.06)) if rng.random() < 0.88 else float(rng.uniform(-math.pi, math.pi))
    return overhead_view(
        width_px=_NATIVE_PX[0],
        height_px=_NATIVE_PX[1],
        camera_height_m=height_m,
        pitch_rad=pitch,
        field_of_view_rad=field,
        roll_rad=roll,
        radial=radial,
    )


def random_stage(rng: Rng, *, car_length_m: float, size_px: int) -> Stage:
    """A part of a random camera's picture in which a car of `car_length_m` is about 14 to 60 px long."""
    camera = random_camera(rng)
    at_px = (0.0, 0.0)
    for _ in range(20):
        at_px = (float(rng.uniform(0.04, 0.96)) * _NATIVE_PX[0], float(rng.uniform(0.04, 0.96)) * _NATIVE_PX[1])
        if float(camera.distance_m(camera.floor_point(at_px)[None])[0]) < 2.6 * float(camera.eye_m[2]):
            break
    length_px = float(np.exp(rng.uniform(math.log(14.0), math.log(60.0))))
    native_px = car_length_m * camera.px_per_m(camera.floor_point(at_px))
    resolution = float(rng.choice([0.5, 1.0, 1.5, 3.0], p=[0.15, 0.5, 0.2, 0.15]))  # VGA, 720p, 1080p, 4K
    enlarged = min(2.5, length_px / (native_px * resolution))
    scale = enlarged * resolution
    return Stage(
        view=camera.cropped(centre_px=at_px, scale=scale, size_px=(size_px, size_px)),
        blur_px=0.45 * max(0.0, enlarged - 0.6),
        frame_rows_px=_NATIVE_PX[1] * scale,
    )


def random_light(rng: Rng) -> Light:
    """Lamps, windows, gloss."""
    tilt, azimuth = math.radians(float(rng.uniform(0, 60))), float(rng.uniform(0, 2 * math.pi))
    direction = np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])
    return Light(
        direction=direction,
        ambient=float(rng.uniform(0.35, 0.8)),
        shadow_strength=float(rng.uniform(0.1, 0.75)),
        shadow_blur_px=float(np.exp(rng.uniform(math.log(0.6), math.log(5.0)))),
        gloss=float(rng.uniform(0.0, 0.6)) if rng.random() < 0.6 else 0.0,
    )
