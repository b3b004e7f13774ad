"""An hour of live race at ten times its speed: does memory grow, do descriptors or threads pile up? A script, not a test.

    python tests/daemon/soak.py [--hours 1] [--speed 10] [--network]

Real but for the camera and, unless `--network`, the detector: core, recorder with pictures, serial display on a
pseudo-terminal, board, JSON lines through a pipe, the machine's watch. The camera goes away every ten minutes of the race
and comes back. Prints JSON: growth of memory from the first tenth of the race to its end, and the most and fewest descriptors
and threads in that time.
"""

import argparse
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.daemon import appliance, rooms
from dnb_edge.daemon import feed as feed_module
from dnb_edge.daemon.sinks import LiveJsonSink
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay
from dnb_edge.errors import TemporaryFault
from dnb_edge.machine.state import read_machine
from dnb_edge.sim.rig import Rig
from dnb_edge.values import (
    Clock,
    Detection,
    Frame,
    FrameDetections,
    LostFrames,
    SourceInfo,
    StampSource,
)

LAP_S = 6.6
AWAY_EVERY_S = 600.0


@cache
def noise() -> NDArray[np.uint8]:
    """Eight pictures for all cameras: a new set for each would look like a leak."""
    return np.random.default_rng(1).integers(60, 180, (8, 720, 1280, 3), dtype=np.uint8)


class FastCamera:
    """A live camera over a drive, faster than time; it goes on where the one before it went away."""

    lost: tuple[LostFrames, ...] = ()

    def __init__(self, rig: Rig, speed: float, next_index: list[int], *, drawn: bool) -> None:
        self._rig, self._speed, self._next, self._drawn = rig, speed, next_index, drawn
        self._closed = threading.Event()
        self.info = SourceInfo(
            uri="soak:",
            width_px=rig.camera.width_px,
            height_px=rig.camera.height_px,
            nominal_fps=rig.fps,
            clock=Clock.SIMULATED,
            live=True,
            camera_id="soak",
        )

    def frames(self) -> Iterator[Frame]:
        rig, began_s, first = self._rig, time.monotonic(), self._next[0]
        for i in range(first, rig.frames):
            self._next[0] = i + 1
            due_s = began_s + (i - first) / rig.fps / self._speed
            if self._closed.wait(max(0.0, due_s - time.monotonic())):
                return
            picture = rig.frame(i).bgr if self._drawn else noise()[i % 8]
            yield Frame(
                sequence=i - first,
                t_ns=rig.t_ns(i),
                stamp_source=StampSource.SIMULATED,
                width_px=self.info.width_px,
                height_px=self.info.height_px,
                bgr=picture,
            )
            if (i + 1) % round(AWAY_EVERY_S * rig.fps) == 0:
                raise TemporaryFault("soak: the camera went away")

    def close(self) -> None:
        self._closed.set()


class Truth:
    """Finds the car where it is."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    def detect(self, image: object, *, sequence: int, t_ns: int, windows: object) -> FrameDetections:
        truth = self._rig.frame_truth(round(t_ns * self._rig.fps / 1e9))
        car = Detection(camera_px=truth.camera_px, sigma_px=0.5, length_px=85.0, confidence=0.9, moving=True)
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=(car,), full_frame=False)


def drain(descriptor: int) -> None:
    """Reads until there is nothing more to read."""
    try:
        while os.read(descriptor, 65536):
            pass
    except OSError:
        return


def in_background(work: Callable[[], None]) -> None:
    threading.Thread(target=work, daemon=True).start()


class Samples:
    """What the process uses, every few seconds."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, int, int]] = []
        self._stop = threading.Event()
        in_background(self._run)

    def _run(self) -> None:
        while not self._stop.wait(3.0):
            memory = read_machine().memory_bytes or 0
            self.rows.append((memory, len(list(Path("/proc/self/fd").iterdir())), threading.active_count()))

    def verdict(self) -> dict[str, float]:
        self._stop.set()
        warm = self.rows[len(self.rows) // 10 :]
        third = max(1, len(warm) // 10)
        first, last = (np.median([row[0] for row in part]) for part in (warm[:third], warm[-third:]))
        return {
            "samples": len(self.rows),
            "memory_mb": round(float(last) / 1e6, 1),
            "memory_most_mb": round(max(row[0] for row in self.rows) / 1e6, 1),
            "growth_mb": round(float(last - first) / 1e6, 2),
            "descriptors_least": min(row[1] for row in warm),
            "descriptors_most": max(row[1] for row in warm),
            "threads_least": min(row[2] for row in warm),
            "threads_most": max(row[2] for row in warm),
        }


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--hours", type=float, default=1.0)
    asked.add_argument("--speed", type=float, default=10.0)
    asked.add_argument("--fps", type=float, default=30.0)
    asked.add_argument(
        "--network", action="store_true", help="draw the pictures and let the shipped network look at them"
    )
    given = asked.parse_args()
    feed_module.BACK_OFF_S = (0.05,)
    with tempfile.TemporaryDirectory() as scratch:
        laps = round(given.hours * 3600 / LAP_S)
        rig = Rig(laps=laps, fps=given.fps)
        config = load_config(write_demo_config(Path(scratch), Rig(laps=1)), [f"race.laps={laps}"])
        next_index = [0]
        appliance.make_source = lambda uri, config: FastCamera(rig, given.speed, next_index, drawn=given.network)
        if not given.network:
            rooms.make_detector = lambda *_: Truth(rig)
        master, slave = os.openpty()
        reading, writing = os.pipe()
        in_background(lambda: drain(master))
        in_background(lambda: drain(reading))
        options = appliance.RunOptions(
            source_uri="soak:", record_directory=Path(scratch) / "runs", display_uri=f"serial:{os.ttyname(slave)}"
        )
        samples, began_s = Samples(), time.monotonic()
        with (
            Path(os.devnull).open("w", encoding="utf-8") as nowhere,
            TerminalDisplay(BoardConsole(file=nowhere, force_terminal=True, width=80)) as board,
            LiveJsonSink(writing, observations=True) as lines,
        ):
            summary = appliance.run_appliance(config, options, listeners=[lines], displays=[board])
        told = samples.verdict() | {
            "race_s": round(rig.t_ns(rig.frames - 1) * 1e-9),
            "took_s": round(time.monotonic() - began_s),
            "frames": summary.frames,
            "frames_of_the_drive": rig.frames,
            "laps": summary.laps,
            "laps_driven": laps,
        }
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main()
