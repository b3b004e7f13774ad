"""`dnb-edge` with a live camera, `drive:`, that shows a simulated drive over and over; the detector sees the truth. A script.

Cheap to start: nothing is drawn. `DRIVE_LOG` in the environment names a file that gets a line when the first frame is given.
"""

import os
import sys
import threading
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from dnb_edge.cli import run_means
from dnb_edge.daemon import appliance, rooms
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, Detection, Frame, FrameDetections, LostFrames, SourceInfo, StampSource

FPS = 30.0
LAPS = 3


@cache
def rig() -> Rig:
    return Rig(laps=LAPS, fps=FPS)


class Drive:
    """A camera that stamps frames as they come, on CLOCK_MONOTONIC."""

    lost: tuple[LostFrames, ...] = ()

    def __init__(self, uri: str) -> None:
        self._closed = threading.Event()
        camera = rig().camera
        self._pictures = np.random.default_rng(1).integers(60, 180, (4, camera.height_px, camera.width_px, 3), np.uint8)
        self.info = SourceInfo(
            uri=uri,
            width_px=camera.width_px,
            height_px=camera.height_px,
            nominal_fps=FPS,
            clock=Clock.MONOTONIC,
            live=True,
            camera_id="drive",
        )

    def frames(self) -> Iterator[Frame]:
        began_ns, sequence = time.monotonic_ns(), 0
        while not self._closed.is_set():
            t_ns = began_ns + round(sequence * 1e9 / FPS)
            if self._closed.wait(max(0.0, (t_ns - time.monotonic_ns()) * 1e-9)):
                return
            yield Frame(
                sequence=sequence,
                t_ns=t_ns,
                stamp_source=StampSource.START_OF_FRAME,
                width_px=self.info.width_px,
                height_px=self.info.height_px,
                bgr=self._pictures[sequence % 4],
            )
            if sequence == 0 and "DRIVE_LOG" in os.environ:
                Path(os.environ["DRIVE_LOG"]).write_text("first frame\n", encoding="ascii")
            sequence += 1

    def close(self) -> None:
        self._closed.set()


class Truth:
    """Finds the car where it is."""

    def detect(self, image: object, *, sequence: int, t_ns: int, windows: object) -> FrameDetections:
        truth = rig().frame_truth(sequence % rig().frames)
        car = Detection(camera_px=truth.camera_px, sigma_px=0.5, length_px=85.0, confidence=0.9, moving=True)
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=(car,), full_frame=False)


def play() -> None:
    """From now on `drive:` is a source."""
    usual = appliance.make_source
    appliance.make_source = lambda uri, config: Drive(uri) if uri == "drive:" else usual(uri, config)
    rooms.make_detector = lambda *_: Truth()
    simply = run_means.source_of
    run_means.source_of = lambda uri, asked: Drive(uri) if uri == "drive:" else simply(uri, asked)


if __name__ == "__main__":
    from dnb_edge.cli.main import main

    play()
    sys.exit(main())
