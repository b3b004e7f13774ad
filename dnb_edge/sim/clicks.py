"""How well clicked keypoints tie a simulated camera to the track: many calibrations with drawn clicks against the truth.

Knows the demo's track, four cameras over it and the places where a person would click. Knows nothing of how the map is fitted:
it asks `view.fit` and compares. `python -m dnb_edge.sim.clicks` prints the figures of docs/calibration.md.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.sim.circuit import TWIN_SCALE, demo_circuit, edge_line
from dnb_edge.sim.places import demo_camera
from dnb_edge.sim.rig import floor_to_camera_px
from dnb_edge.values import Points
from dnb_edge.view.fit import KeypointFit, fit_keypoints
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.lens import Lens, LensModel

CHI_SQUARED_95 = 5.991
"""Of two degrees of freedom: the square of the 95 % ellipse's reach in sigmas."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A camera over the demo's track."""

    name: str
    camera: PinholeCamera
    lens: Lens | None = None
    """What bends its picture; known to the calibration."""

    def picture_px(self, points_m: Points) -> Points:
        """Where points of the floor, track m (n, 2), are seen, camera px (n, 2)."""
        ideal = floor_to_camera_px(self.camera, points_m)
        return ideal if self.lens is None else self.lens.to_camera_px(ideal)


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """What many trials came to."""

    trials: int
    span_m: float
    """The greatest distance between two points of the centreline."""
    error_p95_m: float
    """Over all trials and places of the lane."""
    coverage: float
    """Share of trials and places whose truth lies within the stated 95 % ellipse..."""
    worst_place: float
    """...at the place where it is least..."""
    best_place: float
    """...and where it is greatest."""
    stated_sigma_m: float
    """Root mean square over all trials and places..."""
    true_sigma_m: float
    """...and what the error really was."""
    false_outliers: int
    """Trials in which a sound keypoint was named, or suspected."""

    @property
    def error_p95_percent(self) -> float:
        """`error_p95_m` in percent of the span."""
        return 100.0 * self.error_p95_m / self.span_m


def scenes() -> tuple[Scene, ...]:
    """The demo's camera, a low one that slants, one nearly straight above, and the demo's with a lens that bends."""
    low = mast_camera(position_m=(1.5, -1.6, 1.9), pitch_deg=36.0, yaw_deg=-2.0, hfov_deg=70.0)
    steep = mast_camera(position_m=(1.5, 0.9, 2.6), pitch_deg=84.0, yaw_deg=3.0, hfov_deg=75.0)
    demo = demo_camera()
    focal = float(demo.matrix[0, 0])
    lens = Lens(
        model=LensModel.PINHOLE,
        fx_px=focal, fy_px=focal, cx_px=float(demo.matrix[0, 2]), cy_px=float(demo.matrix[1, 2]),
        distortion=(-0.28, 0.09, 0.0, 0.0), width_px=demo.width_px, height_px=demo.height_px,
    )  # fmt: skip
    return (
        Scene(name="demo", camera=demo),
        Scene(name="low", camera=low),
        Scene(name="steep", camera=steep),
        Scene(name="lens", camera=demo, lens=lens),
    )


def clicked_places(count: int) -> Points:
    """`count` marks spread over the track, (count, 2) track m: on the lane's outer and inner border by turns."""
    circuit = demo_circuit()
    half = 0.5 * circuit.lane_width_m
    borders = edge_line(circuit, -half), edge_line(circuit, half)
    return np.array([borders[k % 2][k * len(borders[k % 2]) // count] for k in range(count)])


def lane_places(step_m: float = 0.05) -> Points:
    """Places all over the lane, (n, 2) track m: its middle and both borders."""
    circuit = demo_circuit()
    half = 0.5 * circuit.lane_width_m
    return np.vstack([edge_line(circuit, offset, step_m) for offset in (-half, 0.0, half)])


def span_m() -> float:
    """The greatest distance between two points of the demo track's centreline, metres."""
    line = edge_line(demo_circuit(), 0.0, 0.02)
    return float(np.linalg.norm(line[:, None] - line[None], axis=2).max())


def calibrated(scene: Scene, clicks_px: Points, twin_px: Points) -> KeypointFit:
    """The calibration by such clicks, camera px (n, 2) on twin px (n, 2)."""
    pairs = KeypointPairs.from_arrays(clicks_px, twin_px, source="simulated clicks")
    camera = scene.camera
    return fit_keypoints(pairs, TWIN_SCALE, width_px=camera.width_px, height_px=camera.height_px, lens=scene.lens)


def run_campaign(
    scene: Scene, *, trials: int, clicks: int = 12, sigma_px: float = 1.5, warp_px: float = 0.0, seed: int = 1
) -> Campaign:
    """Calibrates `trials` times with clicks that are off by `sigma_px` along either axis; `warp_px` is by how much the twin
    itself is drawn wrongly, twin px along either axis, in slow waves (the truth then is the place on the drawing).
    """
    chance = np.random.default_rng(seed)
    marks, lane = clicked_places(clicks), lane_places()
    marks_px, lane_px = scene.picture_px(marks), scene.picture_px(lane)
    marks_twin, lane_twin = TWIN_SCALE.to_twin_px(marks), TWIN_SCALE.to_twin_px(lane)
    errors, within, variances, named = [], [], [], 0
    for _ in range(trials):
        waves = _Waves.drawn(chance, warp_px)
        found = calibrated(scene, marks_px + chance.normal(0.0, sigma_px, marks_px.shape), waves.moved(marks_twin))
        named += bool(found.outliers or found.suspects)
        off = found.calibration.ground.to_track_m(lane_px) - TWIN_SCALE.to_track_m(waves.moved(lane_twin))
        covariance = found.calibration.covariance_m2(lane_px)
        squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
        errors.append(np.hypot(*off.T))
        within.append(squares < CHI_SQUARED_95)
        variances.append(np.trace(covariance, axis1=1, axis2=2))
    by_place = np.mean(within, axis=0)
    return Campaign(
        trials=trials,
        span_m=span_m(),
        error_p95_m=float(np.percentile(errors, 95)),
        coverage=float(by_place.mean()),
        worst_place=float(by_place.min()),
        best_place=float(by_place.max()),
        stated_sigma_m=float(np.sqrt(np.mean(variances))),
        true_sigma_m=float(np.sqrt(np.mean(np.square(errors)))),
        false_outliers=named,
    )


@dataclass(frozen=True, slots=True)
class _Waves:
    """A smooth displacement of the twin: six waves of about 1,000 px along either axis."""

    height_px: NDArray[np.float64]
    number: NDArray[np.float64]
    phase: NDArray[np.float64]

    @classmethod
    def drawn(cls, chance: np.random.Generator, sigma_px: float) -> _Waves:
        height = chance.normal(size=(2, 6))
        height *= sigma_px / np.sqrt(0.5 * (height**2).sum(axis=1, keepdims=True))
        number = chance.normal(0.0, 2.0 * np.pi / 1000.0, (2, 6, 2))
        return cls(height, number, chance.uniform(0.0, 2.0 * np.pi, (2, 6)))

    def moved(self, twin_px: Points) -> Points:
        waves = np.sin(np.einsum("aki,ni->nak", self.number, twin_px) + self.phase)
        return np.asarray(twin_px + (self.height_px * waves).sum(axis=2))


_ROW = "{:>8} {:>7} {:>9} {:>8} {:>12} {:>9} {:>15} {:>9} {:>9} {:>9}\n"


def main(arguments: Sequence[str]) -> None:
    """Prints the figures of every scene; the first argument is the number of trials (1,000)."""
    trials = int(arguments[0]) if arguments else 1000
    sys.stdout.write(
        _ROW.format("camera", "clicks", "sigma px", "warp px", "p95 % span", "coverage", "by place", "said mm", "true mm",
                    "named")
    )  # fmt: skip
    cases = [(scene, 12, 1.5, 0.0) for scene in scenes()]
    demo = scenes()[0]
    cases += [(demo, count, 1.5, 0.0) for count in (4, 5, 6, 8)]
    cases += [
        (demo, 12, 0.75, 0.0),
        (demo, 12, 3.0, 0.0),
        (demo, 9, 1.5, 5.0),
        (demo, 9, 1.5, 15.0),
        (demo, 12, 1.5, 15.0),
    ]
    for scene, clicks, sigma_px, warp_px in cases:
        c = run_campaign(scene, trials=trials, clicks=clicks, sigma_px=sigma_px, warp_px=warp_px)
        sys.stdout.write(
            _ROW.format(scene.name, clicks, f"{sigma_px:g}", f"{warp_px:g}", f"{c.error_p95_percent:.3f}",
                        f"{c.coverage:.3f}", f"{c.worst_place:.3f}-{c.best_place:.3f}", f"{1e3 * c.stated_sigma_m:.2f}",
                        f"{1e3 * c.true_sigma_m:.2f}", c.false_outliers)
        )  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
