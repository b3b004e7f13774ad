"""The filter written out in plain floats is the one with matrices, and its covariance stays one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dnb_edge.motion import kalman
from dnb_edge.motion.kalman import Covariance, Estimate
from dnb_edge.values import PointM

Matrix = NDArray[np.float64]

COORDINATES = st.floats(-20.0, 20.0)
POINTS = st.tuples(COORDINATES, COORDINATES)
SIGMAS = st.floats(1e-4, 0.5)
SHARES = st.floats(-0.95, 0.95)


def spread(across_m: float, down_m: float, share: float) -> Covariance:
    """A covariance of two standard deviations and their correlation."""
    return across_m**2, share * across_m * down_m, down_m**2


COVARIANCES = st.builds(spread, SIGMAS, SIGMAS, SHARES)
STEPS = st.lists(st.tuples(st.integers(1, 400), POINTS, COVARIANCES), min_size=1, max_size=12)


def matrices(estimate: Estimate) -> tuple[Matrix, Matrix]:
    """The mean (4,) and the covariance (4, 4) of the state (x, y, vx, vy)."""
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = square(estimate.covariance_m2)
    covariance[:2, 2:] = np.reshape(estimate.cross_m2ps, (2, 2))
    covariance[2:, :2] = covariance[:2, 2:].T
    covariance[2:, 2:] = square(estimate.velocity_covariance_m2ps2)
    return np.array([*estimate.track_m, *estimate.velocity_mps]), covariance


def square(covariance: Covariance) -> Matrix:
    """The (2, 2) matrix of (xx, xy, yy)."""
    xx, xy, yy = covariance
    return np.array([[xx, xy], [xy, yy]])


def driven(steps: list[tuple[int, PointM, Covariance]]) -> Estimate:
    """An estimate after several steps of (milliseconds, observation, its covariance)."""
    estimate = kalman.begin(0, steps[0][1], steps[0][2], 2.0)
    for step_ms, track_m, covariance_m2 in steps[1:]:
        estimate = kalman.predict(estimate, estimate.t_ns + step_ms * 1_000_000, 4.0)
        estimate = kalman.update(estimate, track_m, covariance_m2)
    return estimate


@given(steps=STEPS, step_ms=st.integers(0, 3000))
def test_prediction_is_the_matrices_one(steps: list[tuple[int, PointM, Covariance]], step_ms: int) -> None:
    """F m and F P F' + G G' q^2, G being what a constant acceleration does in the step."""
    estimate, dt = driven(steps), step_ms * 1e-3
    mean, covariance = matrices(estimate)
    step, gain = np.eye(4), np.vstack((np.eye(2) * dt * dt / 2, np.eye(2) * dt))
    step[:2, 2:] = np.eye(2) * dt
    found_mean, found = matrices(kalman.predict(estimate, estimate.t_ns + step_ms * 1_000_000, 4.0))
    assert found_mean == pytest.approx(step @ mean, rel=1e-9, abs=1e-9)
    assert found == pytest.approx(step @ covariance @ step.T + gain @ gain.T * 4.0**2, rel=1e-9, abs=1e-12)


@given(steps=STEPS, track_m=POINTS, covariance_m2=COVARIANCES)
def test_update_is_josephs(
    steps: list[tuple[int, PointM, Covariance]], track_m: PointM, covariance_m2: Covariance
) -> None:
    """(I - K H) P (I - K H)' + K R K' with the optimal gain, and the Mahalanobis distance by the same innovation."""
    last = driven(steps)
    estimate = kalman.predict(last, last.t_ns + 33_000_000, 4.0)
    (mean, covariance), noise = matrices(estimate), square(covariance_m2)
    innovation = covariance[:2, :2] + noise
    gain = np.linalg.solve(innovation, covariance[:2, :]).T
    keep = np.eye(4) - gain @ np.eye(2, 4)
    residual = np.subtract(track_m, mean[:2])
    found_mean, found = matrices(kalman.update(estimate, track_m, covariance_m2))
    assert found_mean == pytest.approx(mean + gain @ residual, rel=1e-8, abs=1e-8)
    assert found == pytest.approx(keep @ covariance @ keep.T + gain @ noise @ gain.T, rel=1e-7, abs=1e-11)
    distance = kalman.distance_squared(estimate, track_m, covariance_m2)
    assert distance == pytest.approx(float(residual @ np.linalg.solve(innovation, residual)), rel=1e-8, abs=1e-9)


@given(first=STEPS, second=STEPS, track_m=POINTS, covariance_m2=COVARIANCES)
def test_update_of_the_middle_is_the_stacked_one(
    first: list[tuple[int, PointM, Covariance]],
    second: list[tuple[int, PointM, Covariance]],
    track_m: PointM,
    covariance_m2: Covariance,
) -> None:
    """Two cars seen as one: the update of the state of both, H = [I/2 I/2], without what it tells of one by the other."""
    cars = [driven(first), driven(second)]
    means, covariances = zip(*map(matrices, cars), strict=True)
    covariance = np.zeros((8, 8))
    covariance[:4, :4], covariance[4:, 4:] = covariances
    measure = np.hstack((np.eye(2, 4), np.eye(2, 4))) / 2
    innovation = measure @ covariance @ measure.T + square(covariance_m2)
    gain = np.linalg.solve(innovation, measure @ covariance).T
    residual = np.subtract(track_m, measure @ np.concatenate(means))
    mean, after = np.concatenate(means) + gain @ residual, covariance - gain @ innovation @ gain.T
    for i, found in enumerate(map(matrices, kalman.update_mean(cars, track_m, covariance_m2))):
        part = slice(4 * i, 4 * i + 4)
        assert found[0] == pytest.approx(mean[part], rel=1e-7, abs=1e-7)
        assert found[1] == pytest.approx(after[part, part], rel=1e-6, abs=1e-9)


@given(steps=STEPS)
def test_a_covariance_stays_one(steps: list[tuple[int, PointM, Covariance]]) -> None:
    """After any drive no direction has a negative variance, but for the last digits of the greatest."""
    _, covariance = matrices(driven(steps))
    variances = np.linalg.eigvalsh(covariance)
    assert variances.min() > -1e-12 * variances.max()
