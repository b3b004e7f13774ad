"""The ground-truth rig: a track, one car or several that drive it, a camera over all, and the truth of every frame and lap.

Knows which frame shows what, exactly. Knows no detector and no rule of racing: it is what those are measured against.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.car import PAINTS, Paint, painted_car_mesh
from dnb_edge.sim.circuit import METRES_PER_PX, Circuit, demo_circuit, draw_twin, edge_line, start_line_px
from dnb_edge.sim.disturb import Disturbance, Disturber
from dnb_edge.sim.driver import Drive, Pose, Style, drive
from dnb_edge.sim.places import Place, demo_camera
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.traffic import drives
from dnb_edge.values import BgrImage, Frame, PointM, PointPx, Points, StampSource


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueLap:
    """One complete lap as it was driven. Seconds from the first frame."""

    number: int
    start_s: float
    end_s: float

    @property
    def time_s(self) -> float:
        """The lap's time, seconds."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What really happened in one car's whole drive."""

    crossings_s: tuple[float, ...]
    """Instants at which the car's ground point crossed the start line, all forward."""
    laps: tuple[TrueLap, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTruth:
    """What one frame really shows of one car."""

    t_ns: int
    track_m: PointM
    """The car's ground point."""
    camera_px: PointPx
    """The same point in the picture."""
    heading_rad: float
    """Direction of travel on the track plane, atan2(dy, dx)."""
    heading_px_rad: float
    """Direction of travel in the picture, atan2 of (-v, u), as a detection's `heading_rad`."""
    speed_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenery:
    """What else is in the pictures, and how they are disturbed."""

    seed: int | None = None
    """Of the room and the car; None for the drive's own."""
    parked_m: tuple[tuple[float, float], ...] = ()
    """(s_m, d_m) on the circuit of other cars that stand there all the time."""
    disturbance: Disturbance = field(default_factory=Disturbance)


class Rig:
    """A seeded drive of `laps` complete laps, of one car or several, seen at `fps` frames a second. The same arguments give the
    same bytes.

    Not safe for use by several threads. Building it takes a second or two: the room is drawn then.
    """

    def __init__(
        self,
        *,
        seed: int = 1,
        fps: float = 30.0,
        laps: int = 3,
        cars: int = 1,
        size_px: tuple[int, int] = (1280, 720),
        place: Place | None = None,
        style: Style | None = None,
        scenery: Scenery | None = None,
    ) -> None:
        """`place`, `style` and `scenery` are the demo's by default; with a `place`, its camera has its own size.

        Several cars are painted `paints` and drive as `traffic.drives` says: who has done its laps drives on until all have.
        """
        if not (math.isfinite(fps) and fps > 0.0):
            raise ValueError(f"fps must be a positive number, not {fps!r}")
        self.fps = fps
        self.circuit = demo_circuit() if place is None else place.circuit
        self.camera = demo_camera(size_px) if place is None else place.camera
        self._drives = (
            (drive(self.circuit, laps=laps, seed=seed, style=style),)
            if cars == 1
            else drives(self.circuit, cars=cars, laps=laps, seed=seed, style=style)
        )
        scenery = scenery or Scenery()
        room_seed = seed if scenery.seed is None else scenery.seed
        bodies = None if cars == 1 else [painted_car_mesh(room_seed, number) for number in range(cars)]
        self._renderer = Renderer(self.circuit, self.camera, room_seed, cars=bodies)
        for k, (s_m, d_m) in enumerate(scenery.parked_m):
            self._renderer.park(_standing(self.circuit, s_m, d_m), room_seed + 1 + k)
        self._disturber = None
        if scenery.disturbance != Disturbance():
            self._disturber = _disturber(self.circuit, self.camera, scenery.disturbance, seed)
        self.truths = tuple(map(truth_of, self._drives))
        """Each car's; a car that has done its laps before the others may have driven more."""

    @property
    def truth(self) -> Truth:
        """The first car's."""
        return self.truths[0]

    @property
    def drive(self) -> Drive:
        """The first car's drive as a function of time."""
        return self._drives[0]

    @property
    def paints(self) -> tuple[Paint, ...]:
        """Each car's paint, in the order of `truths`; none where there is one car only."""
        return PAINTS[: len(self._drives)] if len(self._drives) > 1 else ()

    @property
    def frames(self) -> int:
        """How many frames the drive has."""
        return math.floor(self.drive.duration_s * self.fps) + 1

    @property
    def twin(self) -> BgrImage:
        """The digital twin of the track."""
        return draw_twin(self.circuit)

    @property
    def metres_per_px(self) -> float:
        """Metres on the track for one px of the twin."""
        return METRES_PER_PX

    @property
    def start_line_px(self) -> tuple[PointPx, PointPx]:
        """The directed start line in twin px, (start, end)."""
        return start_line_px(self.circuit)

    def t_ns(self, index: int) -> int:
        """The stamp of frame `index` on the simulated clock, 0 for the first."""
        return round(index * 1_000_000_000 / self.fps)

    def frame(self, index: int) -> Frame:
        """Frame number `index`, 0 up to `frames` - 1."""
        if not 0 <= index < self.frames:
            raise IndexError(f"frame {index} of a drive of {self.frames} frames")
        return self.frame_at(self.t_ns(index), index)

    def frame_at(self, t_ns: int, index: int) -> Frame:
        """The frame that a camera takes at any moment of the drive, as its number `index`."""
        picture = self._renderer.picture(index, *(driven.pose(t_ns * 1e-9) for driven in self._drives))
        if self._disturber is not None:
            picture = self._disturber.apply(picture, index=index, t_s=t_ns * 1e-9)
        return Frame(
            sequence=index,
            t_ns=t_ns,
            stamp_source=StampSource.SIMULATED,
            width_px=self.camera.width_px,
            height_px=self.camera.height_px,
            bgr=picture,
        )

    def frame_truth(self, index: int, car: int = 0) -> FrameTruth:
        """What frame `index` really shows of car number `car`, from 0."""
        t_ns = self.t_ns(index)
        pose = self._drives[car].pose(t_ns * 1e-9)
        x, y = pose.track_m
        ahead = (x + 0.01 * math.cos(pose.heading_rad), y + 0.01 * math.sin(pose.heading_rad))
        at_px, ahead_px = self.camera.project(np.array([[x, y, 0.0], [*ahead, 0.0]]))
        return FrameTruth(
            t_ns=t_ns,
            track_m=pose.track_m,
            camera_px=(float(at_px[0]), float(at_px[1])),
            heading_rad=pose.heading_rad,
            heading_px_rad=math.atan2(at_px[1] - ahead_px[1], ahead_px[0] - at_px[0]),
            speed_mps=pose.speed_mps,
        )

    def keypoint_pairs(self, count: int = 8) -> tuple[Points, Points]:
        """`count` (at least 4) marks on the lane's outer border, as (camera px, twin px), each (count, 2), exact."""
        return border_marks(self.circuit, self.camera, count)


def border_marks(circuit: Circuit, camera: PinholeCamera, count: int = 8) -> tuple[Points, Points]:
    """`count` (at least 4) marks on the lane's outer border that the picture shows, as (camera px, twin px), each (count, 2),
    exact."""
    if count < 4:
        raise ValueError(f"a homography needs at least 4 keypoints, not {count}")
    border = edge_line(circuit, -0.5 * circuit.lane_width_m)
    border = border[camera.shows(floor_to_camera_px(camera, border))]
    chosen = border[np.arange(count) * len(border) // count]
    return floor_to_camera_px(camera, chosen), circuit.scale.to_twin_px(chosen)


def truth_of(driven: Drive) -> Truth:
    """The crossings and laps of a drive."""
    laps_driven = itertools.pairwise(driven.crossings_s)
    return Truth(
        crossings_s=driven.crossings_s,
        laps=tuple(TrueLap(number=i + 1, start_s=a, end_s=b) for i, (a, b) in enumerate(laps_driven)),
    )


def _standing(circuit: Circuit, s_m: float, d_m: float) -> Pose:
    """A car that stands `s_m` along the circuit and `d_m` to its left, along the lane."""
    s, line = np.array([s_m]), circuit.centreline
    at, ahead = (line.at(s) + d_m * line.normal(s))[0], line.tangent(s)[0]
    return Pose(track_m=(float(at[0]), float(at[1])), heading_rad=math.atan2(ahead[1], ahead[0]), speed_mps=0.0)


def _disturber(circuit: Circuit, camera: PinholeCamera, wanted: Disturbance, seed: int) -> Disturber:
    """A hand is 0.09 m wide; how many px that are, the middle of the circuit says."""
    middle = edge_line(circuit, 0.0, 0.05).mean(axis=0)
    ends = floor_to_camera_px(camera, middle + np.array([[0.0, 0.0], [0.09, 0.0]]))
    hand_px = float(np.linalg.norm(ends[1] - ends[0]))
    return Disturber(wanted, seed=seed, size_px=(camera.width_px, camera.height_px), hand_px=hand_px)


def floor_to_camera_px(camera: PinholeCamera, points_m: Points) -> Points:
    """Points on the floor, (n, 2) track m, to (n, 2) camera px."""
    return camera.project(np.column_stack((points_m, np.zeros(len(points_m)))))
