"""The places where accuracy is measured: circuits of several shapes, each under one or two cameras.

Knows layouts and mounts by name. Knows no car and no light.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.sim.circuit import Circuit, circuit_along, demo_circuit, rounded
from dnb_edge.sim.path import closed_path
from dnb_edge.values import PointM


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Place:
    """A circuit and the camera, or the cameras, that watch it."""

    name: str
    title: str
    """What it is, in a few words."""
    circuit: Circuit
    camera: PinholeCamera
    further: tuple[PinholeCamera, ...] = ()
    """The cameras after the first, where one does not see all of the track."""

    @property
    def cameras(self) -> tuple[PinholeCamera, ...]:
        """All of them, by their numbers."""
        return (self.camera, *self.further)


_TABLE_M: tuple[PointM, ...] = (
    (0.55, 0.13), (0.83, 0.13), (1.07, 0.33), (1.07, 0.67), (0.83, 0.87), (0.37, 0.87), (0.13, 0.67), (0.13, 0.33),
    (0.37, 0.13),
)  # fmt: skip
_HAIRPIN_M: tuple[PointM, ...] = (
    (2.50, 0.30), (4.35, 0.30), (4.68, 0.65), (4.68, 1.85), (4.35, 2.20), (3.45, 2.20), (3.12, 1.85), (3.12, 1.15),
    (2.85, 0.90), (2.58, 1.15), (2.58, 1.85), (2.25, 2.20), (0.65, 2.20), (0.32, 1.85), (0.32, 0.65), (0.65, 0.30),
)  # fmt: skip


def table_oval() -> Circuit:
    """An oval of 2.7 m on a table of 1.2 m x 1.0 m: short laps."""
    line = closed_path(rounded(_TABLE_M, 0.08))
    return circuit_along(line, start_s_m=0.05, lane_width_m=0.20, name="table oval", twin_size_px=(480, 400))


def figure_eight() -> Circuit:
    """A figure of eight whose branches cross at right angles, 3 m x 2 m."""
    at = np.arange(72) * 2.0 * np.pi / 72
    knots = [(1.5 + 1.2 * float(np.sin(t)), 1.0 + 0.62 * float(np.sin(2.0 * t))) for t in at]
    return circuit_along(closed_path(knots), start_s_m=1.9, name="figure of eight")


def hairpin(start_s_m: float = 0.6) -> Circuit:
    """A long track of 5 m x 2.5 m: straights for 3 m/s and a hairpin between two lanes that lie side by side."""
    line = closed_path(rounded(_HAIRPIN_M, 0.14))
    return circuit_along(line, start_s_m=start_s_m, name="hairpin", twin_size_px=(2000, 1000))


def demo_camera(size_px: tuple[int, int] = (1280, 720)) -> PinholeCamera:
    """The camera of the demo: on a mast beside the track, 2.2 m high, a little askew as mounts are."""
    return mast_camera(
        position_m=(1.5, -0.42, 2.2), pitch_deg=61.0, yaw_deg=1.5, roll_deg=-0.8, hfov_deg=70.0, size_px=size_px
    )


def _demo() -> Place:
    return Place(name="demo", title="demo track under its mast", circuit=demo_circuit(), camera=demo_camera())


def _demo_paper() -> Place:
    camera = mast_camera(position_m=(1.4, -1.5, 2.15), pitch_deg=41.0, yaw_deg=2.0, hfov_deg=66.0)
    title = "demo track, the paper's camera (2.15 m, 41 degrees)"
    return Place(name="demo-paper", title=title, circuit=demo_circuit(), camera=camera)


def _table() -> Place:
    camera = mast_camera(position_m=(0.62, 0.06, 1.35), pitch_deg=72.0, yaw_deg=1.0, hfov_deg=64.0, size_px=(640, 480))
    return Place(name="table", title="oval on a table, 640 x 480", circuit=table_oval(), camera=camera)


def _table_paper() -> Place:
    camera = mast_camera(position_m=(0.7, -1.95, 2.15), pitch_deg=41.0, yaw_deg=2.0, hfov_deg=66.0)
    title = "oval, the paper's camera (2.15 m, 41 degrees)"
    return Place(name="table-paper", title=title, circuit=table_oval(), camera=camera)


def _eight() -> Place:
    camera = mast_camera(position_m=(1.5, -0.42, 2.2), pitch_deg=61.0, yaw_deg=-1.0, roll_deg=0.6, hfov_deg=70.0)
    return Place(name="eight", title="figure of eight under a mast", circuit=figure_eight(), camera=camera)


def _hairpin() -> Place:
    camera = mast_camera(position_m=(2.5, -0.7, 3.1), pitch_deg=58.0, yaw_deg=0.5, hfov_deg=82.0, size_px=(1920, 1080))
    title = "5 m track with a hairpin, 1920 x 1080 from 3.1 m"
    return Place(name="hairpin", title=title, circuit=hairpin(), camera=camera)


LATER = 0.37
"""By so much of a frame's time each camera's first frame is later than the one's before: they are free-running."""


def first_s(number: int, fps: float) -> float:
    """When the camera with that number, from 0, takes its first frame, seconds."""
    return (number * LATER % 1.0) / fps


_HALL_LINE_M = 0.0
"""Where the hall's start line is: in the middle of what both of its cameras see."""
_HALL_HFOV_DEG = 64.0


def _hall_camera(x_m: float, *, pictures: int = 1, yaw_deg: float = 0.0) -> PinholeCamera:
    """A camera 2.5 m above one side of the hall; `pictures` beside each other make one as wide, with pixels as fine."""
    hfov_deg = math.degrees(2.0 * math.atan(pictures * math.tan(math.radians(_HALL_HFOV_DEG / 2.0))))
    return mast_camera(
        position_m=(x_m, -0.4, 2.5), pitch_deg=59.0, yaw_deg=yaw_deg, hfov_deg=hfov_deg, size_px=(pictures * 1280, 720)
    )


def _hall() -> Place:
    return Place(
        name="hall",
        title="5 m track under two cameras, the line where both see it",
        circuit=hairpin(_HALL_LINE_M),
        camera=_hall_camera(1.42, yaw_deg=0.8),
        further=(_hall_camera(3.58, yaw_deg=-1.2),),
    )


def _hall_wide() -> Place:
    return Place(
        name="hall-wide",
        title="the same track under one camera with pixels as fine, 2560 x 720",
        circuit=hairpin(_HALL_LINE_M),
        camera=_hall_camera(2.5, pictures=2),
    )


_PLACES: dict[str, Callable[[], Place]] = {
    "demo": _demo,
    "demo-paper": _demo_paper,
    "table": _table,
    "table-paper": _table_paper,
    "eight": _eight,
    "hairpin": _hairpin,
    "hall": _hall,
    "hall-wide": _hall_wide,
}
PLACES: tuple[str, ...] = tuple(_PLACES)
"""Names of all places."""


def place(name: str) -> Place:
    """The place of that name, one of `PLACES`."""
    return _PLACES[name]()
