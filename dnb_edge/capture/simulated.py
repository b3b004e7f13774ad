"""The simulator as a source: a car or several that drive our own track, on a simulated clock, for as many laps as asked.

Knows how to read `sim:` URIs and how to pace frames in real time. The pictures and their truth come from `sim`.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from urllib.parse import parse_qsl

from dnb_edge.errors import InputError
from dnb_edge.sim.places import PLACES, first_s, place
from dnb_edge.sim.rig import Rig
from dnb_edge.sim.traffic import MOST_CARS
from dnb_edge.values import Clock, Frame, LostFrames, SourceInfo

DEMO = "demo"


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorOptions:
    """What a `sim:` URI asks for."""

    laps: int = 3
    cars: int = 1
    seed: int = 1
    fps: float = 30.0
    place: str = "demo"
    """Which track it is, and under which cameras."""
    camera: int = 0
    """Which of the place's cameras, from 0."""
    pace: float = 0.0
    """How many simulated seconds pass in one real second; 0 gives frames as fast as they are taken."""


class SimulatedSource:
    """A drive of the demo track, by as many cars as asked. The same options give the same frames; they wait to be taken."""

    lost: tuple[LostFrames, ...] = ()
    """Nothing: frames wait to be taken."""

    def __init__(self, uri: str, options: SimulatorOptions) -> None:
        self._options = options
        self._rig, self._first_ns = _rig(options)
        self._next = 0
        self._closed = threading.Event()
        self.info = SourceInfo(
            uri=uri,
            width_px=self._rig.camera.width_px,
            height_px=self._rig.camera.height_px,
            nominal_fps=options.fps,
            clock=Clock.SIMULATED,
            live=False,
        )

    def frames(self) -> Iterator[Frame]:
        """The frames of the drive, to its end or until `close`; with `pace`, none before its time."""
        started_s = time.monotonic()
        first_t_ns = self._rig.t_ns(self._next)
        last = self._rig.frames if self._first_ns == 0 else self._rig.frames - 1
        while self._next < last and not self._closed.is_set():
            frame = self._rig.frame_at(self._rig.t_ns(self._next) + self._first_ns, self._next)
            if self._options.pace > 0.0:
                due_s = started_s + (frame.t_ns - first_t_ns) * 1e-9 / self._options.pace
                if self._closed.wait(max(0.0, due_s - time.monotonic())):
                    return
            self._next += 1
            yield frame

    def close(self) -> None:
        """End the iteration, a paced wait included; safe to repeat and to call from another thread."""
        self._closed.set()


def _rig(options: SimulatorOptions) -> tuple[Rig, int]:
    """What the camera sees, and how much later than the drive it begins, ns: several cameras do not wait for each other."""
    if options.place == DEMO:
        return Rig(seed=options.seed, fps=options.fps, laps=options.laps, cars=options.cars), 0
    here = place(options.place)
    seen = replace(here, camera=here.cameras[options.camera], further=())
    rig = Rig(seed=options.seed, fps=options.fps, laps=options.laps, cars=options.cars, place=seen)
    return rig, round(first_s(options.camera, options.fps) * 1e9)


def parse_simulator_uri(uri: str) -> SimulatorOptions:
    """The options in `sim:` or `sim:?laps=3&cars=1&seed=1&fps=30&pace=1`. Raises `InputError` naming what is wrong."""
    rest = uri.removeprefix("sim:")
    path, _, query = rest.partition("?")
    if path:
        raise InputError(f"{uri}: {path!r} means nothing here: write sim: or sim:?laps=3&cars=1&seed=1&fps=30&pace=1")
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError as error:
        raise InputError(f"{uri}: write the options as sim:?laps=3&cars=1&seed=1&fps=30&pace=1") from error
    readers: dict[str, Callable[[str], float]] = {
        "laps": int, "cars": int, "seed": int, "fps": float, "pace": float, "camera": int,
    }  # fmt: skip
    values: dict[str, float] = {}
    where = DEMO
    for name, text in pairs:
        if name == "place":
            where = text
            continue
        if name not in readers:
            raise InputError(f"{uri}: unknown option {name!r}: the simulator knows {', '.join((*readers, 'place'))}")
        try:
            values[name] = readers[name](text)
        except ValueError as error:
            raise InputError(f"{uri}: {name} must be a number, not {text!r}") from error
    options = SimulatorOptions(
        laps=int(values.get("laps", 3)),
        cars=int(values.get("cars", 1)),
        seed=int(values.get("seed", 1)),
        fps=values.get("fps", 30.0),
        pace=values.get("pace", 0.0),
        place=where,
        camera=int(values.get("camera", 0)),
    )
    _check(uri, options)
    return options


def _check(uri: str, options: SimulatorOptions) -> None:
    if not 1 <= options.laps <= 1000:
        raise InputError(f"{uri}: laps must lie between 1 and 1000, not {options.laps}")
    if not 1 <= options.cars <= MOST_CARS:
        raise InputError(f"{uri}: cars must lie between 1 and {MOST_CARS}, not {options.cars}")
    if options.place not in PLACES:
        raise InputError(f"{uri}: there is no place {options.place!r}: the simulator knows {', '.join(PLACES)}")
    if not 0 <= options.camera < len(place(options.place).cameras):
        raise InputError(f"{uri}: the place {options.place} has no camera {options.camera}: they are counted from 0")
    if options.seed < 0:
        raise InputError(f"{uri}: seed must not be negative, not {options.seed}")
    if not (math.isfinite(options.fps) and 1.0 <= options.fps <= 1000.0):
        raise InputError(f"{uri}: fps must lie between 1 and 1000, not {options.fps:g}")
    if not (math.isfinite(options.pace) and options.pace >= 0.0):
        raise InputError(f"{uri}: pace must not be negative, not {options.pace:g}")
