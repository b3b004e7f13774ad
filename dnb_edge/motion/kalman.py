"""A constant-velocity Kalman filter on the track plane, with the time step taken from the frames' stamps.

State (x, y, vx, vy) in track metres and metres per second. Between frames the velocity is disturbed by white noise of
acceleration (the discrete white-noise model of Y. Bar-Shalom, "Estimation with Applications to Tracking and Navigation",
2001, section 6.2). Values in, new values out; knows nothing of identity or pictures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import PointM

Covariance: TypeAlias = tuple[float, float, float]
"""Of a position, (xx, xy, yy), m^2."""

_MEASURE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """What is known of one target at `t_ns`."""

    t_ns: int
    mean: NDArray[np.float64]
    """(4,): x, y in track metres, vx, vy in metres per second."""
    covariance: NDArray[np.float64]
    """(4, 4), units of `mean`."""

    @property
    def track_m(self) -> PointM:
        """Estimated position, track metres."""
        return float(self.mean[0]), float(self.mean[1])

    @property
    def velocity_mps(self) -> tuple[float, float]:
        """Estimated velocity, metres per second along the axes of the track frame."""
        return float(self.mean[2]), float(self.mean[3])

    @property
    def covariance_m2(self) -> tuple[float, float, float]:
        """Covariance of the position, (xx, xy, yy), m^2."""
        return float(self.covariance[0, 0]), float(self.covariance[0, 1]), float(self.covariance[1, 1])


def square(covariance_m2: tuple[float, float, float]) -> NDArray[np.float64]:
    """The (2, 2) matrix of (xx, xy, yy)."""
    xx, xy, yy = covariance_m2
    return np.array([[xx, xy], [xy, yy]])


def begin(t_ns: int, track_m: PointM, covariance_m2: tuple[float, float, float], speed_sigma_mps: float) -> Estimate:
    """A first estimate from one observation: its position, and a velocity of zero known to `speed_sigma_mps`."""
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = square(covariance_m2)
    covariance[2, 2] = covariance[3, 3] = speed_sigma_mps**2
    return Estimate(t_ns=t_ns, mean=np.array([*track_m, 0.0, 0.0]), covariance=covariance)


def predict(estimate: Estimate, t_ns: int, acceleration_sigma_mps2: float) -> Estimate:
    """The estimate at the later stamp `t_ns`. Raises `ValueError` where time would run backwards."""
    dt = (t_ns - estimate.t_ns) * 1e-9
    if dt < 0:
        raise ValueError(f"cannot predict from {estimate.t_ns} ns back to {t_ns} ns")
    step = np.eye(4)
    step[0, 2] = step[1, 3] = dt
    gain = np.array([[dt * dt / 2, 0.0], [0.0, dt * dt / 2], [dt, 0.0], [0.0, dt]])
    noise = gain @ gain.T * acceleration_sigma_mps2**2
    return Estimate(t_ns=t_ns, mean=step @ estimate.mean, covariance=step @ estimate.covariance @ step.T + noise)


def distance_squared(estimate: Estimate, track_m: PointM, covariance_m2: tuple[float, float, float]) -> float:
    """Squared Mahalanobis distance between the predicted position and an observation; dimensionless."""
    residual = np.asarray(track_m) - estimate.mean[:2]
    innovation = estimate.covariance[:2, :2] + square(covariance_m2)
    return float(residual @ np.linalg.solve(innovation, residual))


def update(estimate: Estimate, track_m: PointM, covariance_m2: tuple[float, float, float]) -> Estimate:
    """The estimate after an observation at the same stamp (Joseph form, so that the covariance stays symmetric)."""
    noise = square(covariance_m2)
    innovation = estimate.covariance[:2, :2] + noise
    gain = np.linalg.solve(innovation, estimate.covariance[:2, :]).T
    keep = np.eye(4) - gain @ _MEASURE
    return Estimate(
        t_ns=estimate.t_ns,
        mean=estimate.mean + gain @ (np.asarray(track_m) - estimate.mean[:2]),
        covariance=keep @ estimate.covariance @ keep.T + gain @ noise @ gain.T,
    )


def update_mean(estimates: Sequence[Estimate], track_m: PointM, covariance_m2: Covariance) -> list[Estimate]:
    """The estimates after one observation of the middle of them all, independent before it.

    It corrects where they are together and leaves how they lie and move towards each other, as far as they are known
    equally well: the Kalman update of the stacked states with H = [I/n ... I/n], of which the cross terms are dropped.
    """
    share = 1.0 / len(estimates)
    middle = sum((estimate.mean[:2] for estimate in estimates), np.zeros(2)) * share
    spread = sum((estimate.covariance[:2, :2] for estimate in estimates), np.zeros((2, 2))) * share**2
    innovation = spread + square(covariance_m2)
    residual = np.asarray(track_m) - middle
    after = []
    for estimate in estimates:
        gain = np.linalg.solve(innovation, estimate.covariance[:2, :] * share).T
        covariance = estimate.covariance - gain @ innovation @ gain.T
        after.append(
            Estimate(
                t_ns=estimate.t_ns,
                mean=estimate.mean + gain @ residual,
                covariance=(covariance + covariance.T) / 2,
            )
        )
    return after
