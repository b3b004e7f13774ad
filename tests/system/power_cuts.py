"""A recorder that tells through a pipe what it was told is saved, and a look at what is left of it when the power has gone.

Both tests of power cuts use it: the cheap one cuts a real ext4 off, the honest one replays a disk's writes up to any point.
"""

import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.errors import InputError
from dnb_edge.record.header import RunHeader, software_versions
from dnb_edge.record.reader import read_run
from dnb_edge.record.recover import Leftover, recover_directory
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import (
    Clock,
    Detection,
    Frame,
    FrameDetections,
    Lap,
    SourceInfo,
    StampSource,
    Target,
    TargetState,
)

FRAME_S = 1 / 60

SOURCE = SourceInfo(uri="v4l2:", width_px=64, height_px=36, nominal_fps=60.0, clock=Clock.MONOTONIC, live=True)
HEADER = RunHeader(
    name="power cut", setup={"core": {}}, config={}, source=SOURCE, versions=software_versions(), wall_offset_ns=0
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a power cut left."""

    laps: tuple[int, ...]
    last_t_ns: int | None
    """Stamp of the last frame that is there."""
    wrong: tuple[str, ...]
    """Messages that are there but not as they were recorded, gaps, files that could not be recovered."""


def obstacle(*programs: str) -> str | None:
    """Why disks cannot be cut off here; None where they can."""
    if os.geteuid() != 0:
        return "needs root, to mount a disk"
    for program in ("mkfs.ext4", "losetup", "mount", *programs):
        if shutil.which(program) is None:
            return f"needs {program}"
    if subprocess.run(["losetup", "-f"], check=False, capture_output=True).returncode != 0:
        return "needs loop devices"
    return None


def detections(sequence: int, t_ns: int) -> FrameDetections:
    """What is recorded of a frame: all of it follows from its number and stamp, so that a changed message is noticed."""
    one = Detection(camera_px=(sequence % 640 + 0.25, t_ns % 360 + 0.5), sigma_px=0.5, length_px=9.0, confidence=0.9)
    return FrameDetections(sequence=sequence, t_ns=t_ns, detections=(one,), full_frame=False)


def lap(number: int, end_t_ns: int) -> Lap:
    """Likewise a lap."""
    return Lap(
        number=number,
        start_t_ns=0,
        end_t_ns=end_t_ns,
        start_s=0.0,
        time_s=end_t_ns % 1_000_003 / 1e3,
        sigma_s=0.002,
        valid=True,
        reasons=(),
        similarity_percent=number % 100 + 0.5,
        observed_fraction=1.0,
    )


def record(directory: Path, tell: Callable[[int], None], seed: int, *, laps_every_s: float) -> None:
    """Record frames at 60 a second with a lap now and then, for ever; `tell` the number of each lap that is saved."""
    dice = random.Random(seed)
    settings = RecordingSettings(directory=directory, image_fps=5.0, image_ring_bytes=2_000_000)
    recorder = Recorder(settings, HEADER)
    sequence = number = 0
    waiting: list[tuple[int, int]] = []
    next_lap_s = time.monotonic() + dice.uniform(0, laps_every_s)
    while True:
        t_ns = time.monotonic_ns()
        jpeg = dice.randbytes(20_000)
        recorder.add_frame(
            Frame(
                sequence=sequence,
                t_ns=t_ns,
                stamp_source=StampSource.START_OF_FRAME,
                width_px=64,
                height_px=36,
                jpeg=jpeg,
                bgr=None,
            )
        )
        recorder.add_detections(detections(sequence, t_ns))
        recorder.add_event(
            Target(
                target_id=1,
                state=TargetState.CONFIRMED,
                t_ns=t_ns,
                t_s=t_ns / 1e9,
                track_m=(0.25, 0.5),
                velocity_mps=(0.0, 1.0),
                covariance_m2=(1e-4, 0.0, 1e-4),
            )
        )
        if t_ns / 1e9 >= next_lap_s:
            next_lap_s += dice.uniform(0.02, laps_every_s)
            number += 1
            ticket = recorder.add_event(lap(number, t_ns))
            assert ticket is not None
            waiting.append((number, ticket))
        while waiting and recorder.is_saved(waiting[0][1]):
            tell(waiting.pop(0)[0])
        sequence += 1
        time.sleep(FRAME_S)


@contextmanager
def recording(directory: Path, seed: int, *, laps_every_s: float) -> Iterator[int]:
    """A process that records into `directory`; gives the pipe for `told`."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        try:
            record(
                directory,
                lambda number: os.write(writing, f"{number} {time.monotonic_ns()}\n".encode()),
                seed,
                laps_every_s=laps_every_s,
            )
        finally:
            os._exit(1)
    os.close(writing)
    try:
        yield reading
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading)


def told(reading: int) -> list[tuple[int, int]]:
    """All that is in the pipe: numbers of laps, and when each was seen to be saved, ns of CLOCK_MONOTONIC."""
    os.set_blocking(reading, False)
    text = b""
    try:
        while data := os.read(reading, 65536):
            text += data
    except BlockingIOError:
        pass
    return [(int(number), int(t_ns)) for number, t_ns in (line.split() for line in text.splitlines())]


def look(directory: Path) -> Found:
    """Recover what is in `directory` and compare every message with what was recorded."""
    wrong = [result.reason for result in recover_directory(directory) if isinstance(result, Leftover)]
    # A cut before the header was on the disk leaves a file with nothing in it, and nothing was acknowledged then.
    wrong = [reason for reason in wrong if "not an MCAP file" not in reason and "before its header" not in reason]
    laps: list[int] = []
    last_t_ns = None
    for path in sorted(directory.glob("*.mcap")):
        try:
            run = read_run(path)
        except InputError as error:
            wrong.append(str(error))
            continue
        sequences = []
        for message in run.messages():
            if isinstance(message, FrameDetections):
                sequences.append(message.sequence)
                last_t_ns = message.t_ns
                if message != detections(message.sequence, message.t_ns):
                    wrong.append(f"frame {message.sequence} is not as it was recorded")
            elif isinstance(message, Lap):
                laps.append(message.number)
                if message != lap(message.number, message.end_t_ns):
                    wrong.append(f"lap {message.number} is not as it was recorded")
        if sequences != list(range(len(sequences))):
            wrong.append(f"{path.name}: frames are missing in the middle")
    return Found(laps=tuple(laps), last_t_ns=last_t_ns, wrong=tuple(wrong))


def make_disk(path: Path, *, size_mb: int = 32) -> None:
    """A file with an empty ext4 file system, as a memory card has it."""
    with path.open("wb") as stream:
        stream.truncate(size_mb * 1024 * 1024)
    subprocess.run(["mkfs.ext4", "-q", "-F", "-E", "lazy_itable_init=0", path], check=True, capture_output=True)


@contextmanager
def mounted(image: Path, place: Path) -> Iterator[Path]:
    """`image` mounted at `place`, through a loop device."""
    place.mkdir(exist_ok=True)
    subprocess.run(["mount", "-o", "loop", image, place], check=True, capture_output=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", place], check=True, capture_output=True)
