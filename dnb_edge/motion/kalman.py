"""A constant-velocity Kalman filter on the track plane, with the time step taken from the frames' stamps.

State (x, y, vx, vy) in track metres and metres per second. Between frames the velocity is disturbed by white noise of
acceleration (the discrete white-noise model of Y. Bar-Shalom, "Estimation with Applications to Tracking and Navigation",
2001, section 6.2). Values in, new values out; knows nothing of identity or pictures.

The 4x4 covariance is kept as its blocks [[A, B], [B', C]] of place and velocity, and all is written out in plain floats: for
two by two that is ten times as fast as matrices, and every machine rounds each step alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dnb_edge.values import PointM

Covariance: TypeAlias = tuple[float, float, float]
"""Of a pair, (xx, xy, yy)."""

Cross: TypeAlias = tuple[float, float, float, float]
"""A 2x2 matrix row by row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What is known of one target at `t_ns`."""

    t_ns: int
    track_m: PointM
    """Estimated position, track metres."""
    velocity_mps: tuple[float, float]
    """Estimated velocity, metres per second along the axes of the track frame."""
    covariance_m2: Covariance
    """A: covariance of the position, (xx, xy, yy), m^2."""
    cross_m2ps: Cross
    """B: covariance of the position (rows x, y) with the velocity (columns vx, vy), m^2/s."""
    velocity_covariance_m2ps2: Covariance
    """C: covariance of the velocity, (xx, xy, yy), m^2/s^2."""


def begin(t_ns: int, track_m: PointM, covariance_m2: Covariance, speed_sigma_mps: float) -> Estimate:
    """A first estimate from one observation: its position, and a velocity of zero known to `speed_sigma_mps`."""
    variance = speed_sigma_mps**2
    return Estimate(
        t_ns=t_ns,
        track_m=track_m,
        velocity_mps=(0.0, 0.0),
        covariance_m2=covariance_m2,
        cross_m2ps=(0.0, 0.0, 0.0, 0.0),
        velocity_covariance_m2ps2=(variance, 0.0, variance),
    )


def predict(estimate: Estimate, t_ns: int, acceleration_sigma_mps2: float) -> Estimate:
    """The estimate at the later stamp `t_ns`. Raises `ValueError` where time would run backwards.

    With F = [[I, dt], [0, I]]: A + dt (B + B') + dt^2 C, B + dt C and C, and the noise of an acceleration that stays the same
    for dt.
    """
    dt = (t_ns - estimate.t_ns) * 1e-9
    if dt < 0:
        raise ValueError(f"cannot predict from {estimate.t_ns} ns back to {t_ns} ns")
    (x, y), (vx, vy) = estimate.track_m, estimate.velocity_mps
    xx, xy, yy = estimate.covariance_m2
    xu, xv, yu, yv = estimate.cross_m2ps
    uu, uv, vv = estimate.velocity_covariance_m2ps2
    square = dt * dt
    noise = acceleration_sigma_mps2 * acceleration_sigma_mps2 * square
    place_noise, cross_noise = noise * square / 4, noise * dt / 2
    return Estimate(
        t_ns=t_ns,
        track_m=(x + dt * vx, y + dt * vy),
        velocity_mps=estimate.velocity_mps,
        covariance_m2=(
            xx + 2 * dt * xu + square * uu + place_noise,
            xy + dt * (xv + yu) + square * uv,
            yy + 2 * dt * yv + square * vv + place_noise,
        ),
        cross_m2ps=(xu + dt * uu + cross_noise, xv + dt * uv, yu + dt * uv, yv + dt * vv + cross_noise),
        velocity_covariance_m2ps2=(uu + noise, uv, vv + noise),
    )


def distance_squared(estimate: Estimate, track_m: PointM, covariance_m2: Covariance) -> float:
    """Squared Mahalanobis distance between the predicted position and an observation; dimensionless."""
    dx, dy = track_m[0] - estimate.track_m[0], track_m[1] - estimate.track_m[1]
    pxx, pxy, pyy = estimate.covariance_m2
    rxx, rxy, ryy = covariance_m2
    sxx, sxy, syy = pxx + rxx, pxy + rxy, pyy + ryy
    return (syy * dx * dx - 2 * sxy * dx * dy + sxx * dy * dy) / (sxx * syy - sxy * sxy)


def update(estimate: Estimate, track_m: PointM, covariance_m2: Covariance) -> Estimate:
    """The estimate after an observation of covariance R at the same stamp.

    With S = A + R and the gains G = A/S and H = B'/S, the covariance becomes G R, (R/S) B and C - H B: the Joseph form for this
    gain, without its differences of nearly equal numbers, and symmetric because only one half of it is kept.
    """
    (x, y), (vx, vy) = estimate.track_m, estimate.velocity_mps
    xx, xy, yy = estimate.covariance_m2
    xu, xv, yu, yv = estimate.cross_m2ps
    uu, uv, vv = estimate.velocity_covariance_m2ps2
    rxx, rxy, ryy = covariance_m2
    sxx, sxy, syy = xx + rxx, xy + rxy, yy + ryy
    k = 1.0 / (sxx * syy - sxy * sxy)
    ixx, ixy, iyy = syy * k, -sxy * k, sxx * k
    gxx, gxy, gyx, gyy = xx * ixx + xy * ixy, xx * ixy + xy * iyy, xy * ixx + yy * ixy, xy * ixy + yy * iyy
    hux, huy, hvx, hvy = xu * ixx + yu * ixy, xu * ixy + yu * iyy, xv * ixx + yv * ixy, xv * ixy + yv * iyy
    lxx, lxy, lyx, lyy = rxx * ixx + rxy * ixy, rxx * ixy + rxy * iyy, rxy * ixx + ryy * ixy, rxy * ixy + ryy * iyy
    dx, dy = track_m[0] - x, track_m[1] - y
    return Estimate(
        t_ns=estimate.t_ns,
        track_m=(x + gxx * dx + gxy * dy, y + gyx * dx + gyy * dy),
        velocity_mps=(vx + hux * dx + huy * dy, vy + hvx * dx + hvy * dy),
        covariance_m2=(gxx * rxx + gxy * rxy, gxx * rxy + gxy * ryy, gyx * rxy + gyy * ryy),
        cross_m2ps=(lxx * xu + lxy * yu, lxx * xv + lxy * yv, lyx * xu + lyy * yu, lyx * xv + lyy * yv),
        velocity_covariance_m2ps2=(uu - hux * xu - huy * yu, uv - hux * xv - huy * yv, vv - hvx * xv - hvy * yv),
    )


def update_mean(estimates: Sequence[Estimate], track_m: PointM, covariance_m2: Covariance) -> list[Estimate]:
    """The estimates after one observation of the middle of them all, independent before it.

    It corrects where they are together and leaves how they lie and move towards each other, as far as they are known
    equally well: the Kalman update of the stacked states with H = [I/n ... I/n], of which the cross terms are dropped.
    """
    share = 1.0 / len(estimates)
    dx = track_m[0] - sum(estimate.track_m[0] for estimate in estimates) * share
    dy = track_m[1] - sum(estimate.track_m[1] for estimate in estimates) * share
    sxx, sxy, syy = (
        sum(estimate.covariance_m2[i] for estimate in estimates) * share**2 + covariance_m2[i] for i in range(3)
    )
    return [_moved(estimate, (dx, dy), (sxx, sxy, syy), share) for estimate in estimates]


def _moved(estimate: Estimate, residual_m: PointM, innovation_m2: Covariance, share: float) -> Estimate:
    """One of several after an observation of their middle, of which it is the part `share`: with the gains G = share A/S and
    H = share B'/S the covariance becomes A - share G A, B - share G B and C - share H B.
    """
    (x, y), (vx, vy), (dx, dy) = estimate.track_m, estimate.velocity_mps, residual_m
    xx, xy, yy = estimate.covariance_m2
    xu, xv, yu, yv = estimate.cross_m2ps
    uu, uv, vv = estimate.velocity_covariance_m2ps2
    sxx, sxy, syy = innovation_m2
    k = share / (sxx * syy - sxy * sxy)
    ixx, ixy, iyy = syy * k, -sxy * k, sxx * k
    gxx, gxy, gyx, gyy = xx * ixx + xy * ixy, xx * ixy + xy * iyy, xy * ixx + yy * ixy, xy * ixy + yy * iyy
    hux, huy, hvx, hvy = xu * ixx + yu * ixy, xu * ixy + yu * iyy, xv * ixx + yv * ixy, xv * ixy + yv * iyy
    return Estimate(
        t_ns=estimate.t_ns,
        track_m=(x + gxx * dx + gxy * dy, y + gyx * dx + gyy * dy),
        velocity_mps=(vx + hux * dx + huy * dy, vy + hvx * dx + hvy * dy),
        covariance_m2=(
            xx - share * (gxx * xx + gxy * xy),
            xy - share * (gxx * xy + gxy * yy),
            yy - share * (gyx * xy + gyy * yy),
        ),
        cross_m2ps=(
            xu - share * (gxx * xu + gxy * yu),
            xv - share * (gxx * xv + gxy * yv),
            yu - share * (gyx * xu + gyy * yu),
            yv - share * (gyx * xv + gyy * yv),
        ),
        velocity_covariance_m2ps2=(
            uu - share * (hux * xu + huy * yu),
            uv - share * (hux * xv + huy * yv),
            vv - share * (hvx * xv + hvy * yv),
        ),
    )
