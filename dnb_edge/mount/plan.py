"""A mount plan: what one camera in one place gives a race, and the place that would give more.

Knows the geometry (`mount`), the timing (`mount_timing`) and the search (`mount_suggest`), and joins them into one value. Knows
no file and no drawing; `mount_advice` puts the plan into words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.mount.geometry import Coverage, MountedCamera, Optics, Resolution, TrackArea, edge_points_m
from dnb_edge.mount.suggest import Free, MountLimits, Suggestion, ceiling_needed_m, suggest
from dnb_edge.mount.timing import FIT_HALF_S, crossing_sigma_s, detector_sigma_px
from dnb_edge.values import PointM, Points
from dnb_edge.view.pose import STEEPEST_DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """When the camera looks, and for how long."""

    fps: float
    exposure_s: float
    stamp_sigma_s: float = 0.0
    """One standard deviation of the stamps; 0 where it is not known."""
    readout_s: float | None = None
    """From the first row's exposure to the last row's; None where it is not known, 0 for a global shutter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedCar:
    """The car to be timed."""

    speed_mps: float
    length_m: float
    height_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MountRequest:
    """All that a plan depends on."""

    optics: Optics
    rate: Rate
    track: TrackArea
    car: PlannedCar
    free: Free
    limits: MountLimits
    sigma_px: float | None = None
    """Of the detector's ground point from frame to frame, camera px; None: by the car's length in the picture."""
    fit_half_s: float = FIT_HALF_S
    """Half the time over which the race fits a crossing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointPlan:
    """What one floor point gets."""

    resolution: Resolution
    car_px: float
    """Length of the car there, camera px."""
    blur_px: float
    """Way of the car during the exposure in the direction in which it is most, camera px."""
    sigma_px: float
    """Of the detector's ground point, camera px."""
    sigma_m: float
    """The same on the floor in its worst direction."""
    crossing_sigma_s: float
    """Of a crossing there by a car that drives in that direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MountPlan:
    """What the camera gives in its place."""

    request: MountRequest
    camera: MountedCamera
    coverage: Coverage
    near: PointPlan
    """Where the line of sight enters the part of the track that is seen."""
    far: PointPlan
    """Where it leaves it."""
    worst: PointPlan
    """Where a px covers most."""
    blur_m: float
    """Way of the car during the exposure."""
    parallax_m: float
    """Of the car's top where the track is furthest from the camera's foot, if it were taken to lie on the floor."""
    row_delay_s: float | None
    """Between the first and the last of the picture's rows in which the track is seen; None: the readout is not known."""
    better: MountPlan | None = None
    """The best place for the same track and camera under the ceiling, if it is worth moving for."""
    gentler: MountPlan | None = None
    """The best place from which the keypoints tell the height, where this plan's pitch was ours to choose and is too steep."""


def plan_mount(request: MountRequest) -> MountPlan:
    """The plan for what is given, with the best height, pitch and distance for what is not.

    Raises `InputError` where something is left to choose and no choice has the whole track in the picture, and where what is
    given shows no floor of the track or is below the car.
    """
    free, limits = request.free, request.limits
    found = suggest(request.optics, request.track, limits, free)
    if not found.fits and (free.height_m is None or free.pitch_deg is None):
        raise InputError(_misfit(request))
    plan = _plan(request, found)
    steep = free.pitch_deg is None and found.stand.pitch_deg > STEEPEST_DEG
    return replace(
        plan,
        better=_better(request, plan),
        gentler=_plan_if_fits(request, replace(limits, max_pitch_deg=STEEPEST_DEG), free) if steep else None,
    )


def _better(request: MountRequest, plan: MountPlan) -> MountPlan | None:
    """The best place with height and pitch free, where it sees more of the track or the worst px covers 3 % less.

    The distance stays as given if the track fits from there at all.
    """
    free = request.free
    if free.height_m is None and free.pitch_deg is None:
        return None
    freed = replace(free, height_m=None, pitch_deg=None)
    other = _plan_if_fits(request, request.limits, freed)
    if other is None and not margin_fits(request, plan):
        other = _plan_if_fits(request, request.limits, replace(freed, distance_m=None))
    if other is None:
        return None
    whole = margin_fits(request, plan)
    gain = other.worst.resolution.worst_mm < 0.97 * plan.worst.resolution.worst_mm
    return other if gain or not whole else None


def margin_fits(request: MountRequest, plan: MountPlan) -> bool:
    """Whether track and margin are inside the plan's picture."""
    spare = plan.camera.spare_px(request.track.corners_m(request.limits.margin_m))
    return spare is not None and spare >= 0


def _plan_if_fits(request: MountRequest, limits: MountLimits, free: Free) -> MountPlan | None:
    found = suggest(request.optics, request.track, limits, free)
    return _plan(replace(request, limits=limits, free=free), found) if found.fits else None


def _plan(request: MountRequest, found: Suggestion) -> MountPlan:
    stand = found.stand
    if not stand.height_m > request.car.height_m:
        raise InputError(
            f"--height {stand.height_m:g}: the camera must be above the car, which is {request.car.height_m:g} m high"
        )
    camera = MountedCamera(optics=request.optics, stand=stand)
    coverage = camera.coverage(request.track)
    if not len(coverage.seen_m):
        raise InputError(
            f"--pitch {stand.pitch_deg:g}: from {stand.height_m:g} m up and {stand.distance_m:g} m from the near edge the "
            "picture shows nothing of the track: change --pitch, --height or --distance"
        )
    seen = np.array(coverage.seen_m)
    near_m, far_m = camera.middle_m(seen)
    near, far = (_point(request, camera, at) for at in (near_m, far_m))
    rim = [_point(request, camera, (float(x), float(y))) for x, y in edge_points_m(seen)]
    corners = request.track.corners_m()
    return MountPlan(
        request=request,
        camera=camera,
        coverage=coverage,
        near=near,
        far=far,
        worst=max(rim, key=lambda point: point.resolution.worst_mm),
        blur_m=request.car.speed_mps * request.rate.exposure_s,
        parallax_m=max(camera.parallax_m((float(x), float(y)), request.car.height_m) for x, y in corners),
        row_delay_s=_row_delay_s(request, camera, seen),
    )


def _point(request: MountRequest, camera: MountedCamera, at_m: PointM) -> PointPlan:
    """What a floor point gets. The car's length is that of its outline's square root of area, as the core measures it."""
    resolution = camera.resolution(at_m)
    mean_mm = math.sqrt(resolution.worst_mm * resolution.finest_mm)
    car_px = 1000.0 * request.car.length_m / mean_mm
    sigma_px = request.sigma_px if request.sigma_px is not None else detector_sigma_px(car_px)
    sigma_m = sigma_px * resolution.worst_mm / 1000.0
    rate = request.rate
    return PointPlan(
        resolution=resolution,
        car_px=car_px,
        blur_px=1000.0 * request.car.speed_mps * rate.exposure_s / resolution.finest_mm,
        sigma_px=sigma_px,
        sigma_m=sigma_m,
        crossing_sigma_s=crossing_sigma_s(
            sigma_m,
            speed_mps=request.car.speed_mps,
            fps=rate.fps,
            fit_half_s=request.fit_half_s,
            stamp_sigma_s=rate.stamp_sigma_s,
        ),
    )


def _row_delay_s(request: MountRequest, camera: MountedCamera, seen_m: Points) -> float | None:
    if request.rate.readout_s is None:
        return None
    rows = camera.to_camera_px(seen_m)[:, 1]
    return float(np.ptp(rows)) / request.optics.height_px * request.rate.readout_s


def _misfit(request: MountRequest) -> str:
    """Why no place fits, and the option to change."""
    free, limits, track = request.free, request.limits, request.track
    named = (("--height", free.height_m), ("--pitch", free.pitch_deg), ("--distance", free.distance_m))
    given = [f"{name} {value:g}" for name, value in named if value is not None]
    where = f"with {' and '.join(given)}" if given else f"below --max-height {limits.max_height_m:g}"
    needed = ceiling_needed_m(request.optics, track, limits, free)
    raised = f"mount it up to {needed:g} m high (--max-height {needed:g})" if needed is not None else ""
    if free.height_m is not None and raised:
        raised = f"leave --height out and {raised}" if needed and needed > limits.max_height_m else "leave --height out"
    options = [raised] if raised else []
    options += ["use a wider lens (--hfov, --camera)"]
    options += [f"leave {name} out" for name, value in named[1:] if value is not None]
    return (
        f"--track {track.width_m:g}x{track.depth_m:g}: no place {where} has the whole track with a margin of "
        f"{limits.margin_m:g} m in the picture of a lens {request.optics.hfov_deg:g} degrees wide: {', or '.join(options)}"
    )
