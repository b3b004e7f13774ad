"""A video file of stamped pictures: it lasts as long as the run did, whatever the pictures' rate.

Knows what OpenCV's FFmpeg can write on every machine that the package runs on. Knows no recording and no overlay.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import scratch_beside
from dnb_edge.values import BgrImage

CODECS = {".mp4": "mp4v", ".webm": "VP80", ".avi": "MJPG", ".mkv": "MJPG"}
"""By the file's ending: what OpenCV's wheels for x86-64 and for aarch64 have. Browsers play WebM; players play all."""

LOWEST_FPS, HIGHEST_FPS = 1.0, 60.0

PAUSE_S = 5.0
"""Where no picture is for longer, the last one stands for so long only: pictures of incidents alone lie hours apart."""


def check_video(path: Path) -> str:
    """The codec for a video of this name. Raises `InputError` for an ending that nobody can write."""
    codec = CODECS.get(path.suffix.lower())
    if codec is None:
        raise InputError(f"{path}: videos are {', '.join(CODECS)}: name the file so")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no directory {path.parent}: make it first")
    if path.is_dir():
        raise InputError(f"{path}: is a directory: name a file")
    return codec


def picture_rate(t_ns: Sequence[int]) -> float:
    """Frames per second of a video of pictures with these stamps, rising: that of most of them, within limits."""
    if len(t_ns) < 2:
        return LOWEST_FPS
    step_s = float(np.median(np.diff(np.asarray(t_ns, dtype=np.int64)))) * 1e-9
    fps = float(np.clip(1.0 / step_s, LOWEST_FPS, HIGHEST_FPS))
    # Containers keep rates as fractions: stamps that tremble should not make an odd one.
    return round(fps) if abs(fps - round(fps)) < 0.05 * fps else round(fps, 2)


def paced(pictures: Iterable[tuple[int, BgrImage]], fps: float) -> Iterator[BgrImage]:
    """What a video of `fps` shows of stamped pictures, rising: at each of its instants the latest one.

    A picture that comes too early for an instant of its own is left out; over a pause, see `PAUSE_S`, the clock stands.
    """
    step_ns = 1e9 / fps
    due_ns: float | None = None
    shown: tuple[int, BgrImage] | None = None
    for t_ns, image in pictures:
        if due_ns is None or shown is None:
            due_ns, shown = float(t_ns), (t_ns, image)
            continue
        if t_ns - shown[0] > PAUSE_S * 1e9:
            until_ns = shown[0] + PAUSE_S * 1e9
            while due_ns < until_ns:
                yield shown[1]
                due_ns += step_ns
            due_ns = float(t_ns)
        # Half a step of tolerance: stamps tremble round the instants of the video.
        while due_ns < t_ns - 0.5 * step_ns:
            yield shown[1]
            due_ns += step_ns
        shown = (t_ns, image)
    if shown is not None:
        yield shown[1]


def write_video(path: Path, images: Iterable[BgrImage], *, fps: float) -> int:
    """Writes pictures of one size as a video that appears under its name only when it is whole; returns their number.

    Raises `InputError` for a name that is no video's, or where there is no picture, `WorkError` where the codec or the disk
    fails. A video that is interrupted leaves nothing.
    """
    codec = check_video(path)
    with scratch_beside(path) as scratch:
        partial = scratch / f"video{path.suffix.lower()}"
        count = _encode(partial, images, codec, fps)
        if not count:
            raise InputError(f"{path}: there is no picture to make a video of")
        try:
            with partial.open("rb") as file:
                os.fsync(file.fileno())
            partial.replace(path)
        except OSError as error:
            raise WorkError(f"{path}: the video cannot be written: {error.strerror}") from error
    return count


def _encode(path: Path, images: Iterable[BgrImage], codec: str, fps: float) -> int:
    writer: cv2.VideoWriter | None = None
    size = (0, 0)
    count = 0
    try:
        for image in images:
            even = image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]
            if writer is None:
                size = (even.shape[1], even.shape[0])
                writer = _opened(path, codec, fps, size)
            if (even.shape[1], even.shape[0]) != size:
                continue
            writer.write(np.ascontiguousarray(even))
            count += 1
    finally:
        if writer is not None:
            writer.release()
    if count and (not path.is_file() or not _is_whole(path, count)):
        raise WorkError(f"{path.name}: the video was not written whole: is the disk full?")
    return count


def _opened(path: Path, codec: str, fps: float, size: tuple[int, int]) -> cv2.VideoWriter:
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    with _without_words():
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), fps, size)
    if not writer.isOpened():
        raise WorkError(f"this OpenCV cannot write {codec} videos of {size[0]}x{size[1]}: choose another ending")
    return writer


@contextmanager
def _without_words() -> Iterator[None]:
    """OpenCV writes what it thinks of a codec to the process's stderr, whatever its log level, beside the line that we owe."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _is_whole(path: Path, count: int) -> bool:
    """Whether the finished file has its pictures, as far as its container tells: OpenCV says nothing of a full disk."""
    reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        return bool(reader.read()[0]) and reader.get(cv2.CAP_PROP_FRAME_COUNT) >= 0.9 * count
    finally:
        reader.release()
