"""`dnb-edge` with a camera of its own: `live:SINCE_NS` watches a simulated drive that began at that CLOCK_MONOTONIC.

A process that starts later sees the car where it is by then, as with a real camera: what nobody watched is lost. No picture is
drawn: the detector is told where the car truly is, with noise that depends on the frame alone. Run it as a script.
"""

import sys
import threading
import time
from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np

from dnb_edge.cli.main import main
from dnb_edge.daemon import appliance, rooms
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig, floor_to_camera_px
from dnb_edge.values import (
    BgrImage,
    Clock,
    Detection,
    Frame,
    FrameDetections,
    LostFrames,
    SearchWindow,
    SourceInfo,
    StampSource,
)

LAPS = 12
FPS = 15.0
NOISE_PX = 0.7


@cache
def rig() -> Rig:
    return Rig(seed=1, laps=LAPS, fps=FPS)


class LiveCamera:
    """Frames at their times, the same at the same time for whoever watches."""

    lost: tuple[LostFrames, ...] = ()

    def __init__(self, uri: str) -> None:
        self._since_ns = int(uri.removeprefix("live:"))
        self._closed = threading.Event()
        camera = rig().camera
        v, u = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
        self._chequers = np.where((u // 40 + v // 40) % 2 == 0, 60, 180).astype(np.uint8)
        self.info = SourceInfo(
            uri=uri,
            width_px=camera.width_px,
            height_px=camera.height_px,
            nominal_fps=FPS,
            clock=Clock.MONOTONIC,
            live=True,
            camera_id="live-camera",
        )

    def frames(self) -> Iterator[Frame]:
        late_ns = time.monotonic_ns() - self._since_ns
        first = next((i for i in range(rig().frames) if rig().t_ns(i) > late_ns), rig().frames)
        for i in range(first, rig().frames):
            t_ns = self._since_ns + rig().t_ns(i)
            if self._closed.wait(max(0.0, (t_ns - time.monotonic_ns()) * 1e-9)):
                return
            yield Frame(
                sequence=i - first,
                t_ns=t_ns,
                stamp_source=StampSource.START_OF_FRAME,
                width_px=self.info.width_px,
                height_px=self.info.height_px,
                bgr=self._picture(i),
            )

    def _picture(self, i: int) -> BgrImage:
        picture = np.repeat(self._chequers[..., None], 3, axis=2)
        picture[::16, ::16] += np.random.default_rng(i).integers(0, 4, picture[::16, ::16].shape, dtype=np.uint8)
        return picture

    def close(self) -> None:
        self._closed.set()


class TruthDetector:
    """Finds the car where it truly is, and NOISE_PX beside it."""

    def __init__(self, since_ns: int) -> None:
        self._since_ns = since_ns

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        i = round((t_ns - self._since_ns) * 1e-9 * FPS)
        at_px = floor_to_camera_px(rig().camera, np.array([rig().frame_truth(i).track_m]))[0]
        u, v = (at_px + np.random.default_rng(i).normal(0.0, NOISE_PX, 2)).tolist()
        found = Detection(camera_px=(u, v), sigma_px=NOISE_PX, length_px=85.0, confidence=0.9, moving=True)
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=(found,), full_frame=not windows)


def play(argv: list[str]) -> None:
    (uri,) = (word for word in argv if word.startswith("live:"))
    shown = appliance.make_source

    def make_source(wanted: str, config: object) -> object:
        if not wanted.startswith("live:"):
            return shown(wanted, config)
        if not rig().frames:
            raise InputError("no drive")
        return LiveCamera(wanted)

    appliance.make_source = make_source
    rooms.make_detector = lambda *_: TruthDetector(int(uri.removeprefix("live:")))


if __name__ == "__main__":
    if any(word.startswith("live:") for word in sys.argv):
        play(sys.argv)
    main()
