"""A drive under several cameras that do not wait for each other: whose frame is when, and what each has in its picture.

Knows a place's cameras and merges their frames by their stamps, as a box does whose cameras are stamped by one kernel. Knows
no core.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from heapq import merge

import numpy as np

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.places import first_s
from dnb_edge.sim.rig import floor_to_camera_px
from dnb_edge.truth.sightings import Moments, Motion, Sightings, kept_frames, moments, sighted
from dnb_edge.values import FrameDetections


def sighted_by_all(
    motion: Motion,
    cameras: Sequence[PinholeCamera],
    model: Sightings,
    *,
    fps: float,
    lap_m: float,
    crossings_s: tuple[float, ...],
    seed: int,
) -> Iterator[FrameDetections]:
    """The detections of each frame that comes, whichever camera's, in the order of their stamps."""
    every = []
    for number, camera in enumerate(cameras):
        at = moments(
            motion, fps=fps, stamp_sigma_s=model.stamp_sigma_s, seed=seed + number, first_s=first_s(number, fps)
        )
        kept = kept_frames(model, frames=len(at.t_s), fps=fps, crossings_s=crossings_s, seed=seed + number)
        seen = camera.shows(floor_to_camera_px(camera, at.track_m))
        found = sighted(motion, camera, at, model, lap_m=lap_m, kept=kept, seed=seed + number, seen=seen)
        every.append(_of(found, number))
    return merge(*every, key=lambda found: found.t_ns)


def _of(frames: Iterator[FrameDetections], number: int) -> Iterator[FrameDetections]:
    return (replace(found, camera=number) for found in frames)


def all_moments(motion: Motion, cameras: int, *, fps: float) -> Moments:
    """Where the car truly is in each frame of so many cameras, in the order of stamps."""
    every = [moments(motion, fps=fps, first_s=first_s(number, fps)) for number in range(cameras)]
    t_ns = np.concatenate([at.t_ns for at in every])
    order = np.argsort(t_ns, kind="stable")
    return Moments(
        t_s=np.concatenate([at.t_s for at in every])[order],
        t_ns=t_ns[order],
        track_m=np.concatenate([at.track_m for at in every])[order],
        heading_rad=np.concatenate([at.heading_rad for at in every])[order],
    )
