"""Small video files that the tests make themselves."""

from pathlib import Path

import cv2
import numpy as np


def write_clip(path: Path, *, frames: int = 12, fps: float = 30.0, fourcc: str = "mp4v") -> Path:
    """A clip of `frames` pictures, 96 x 64, each a different grey with a moving square."""
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*fourcc), fps, (96, 64))
    assert writer.isOpened()
    for i in range(frames):
        picture = np.full((64, 96, 3), 20 + 10 * i, dtype=np.uint8)
        picture[20:40, 4 * i : 4 * i + 20] = (255, 255, 255)
        writer.write(picture)
    writer.release()
    return path


def with_frame_durations(path: Path, durations: list[int], *, hz: int | None = None) -> Path:
    """Rewrite the sample table (`stts`) of the constant-rate MP4 at `path`, in place, so that frame i lasts `durations[i]`
    units of its own time base (of `hz` where given): a clip of any frame rate, made without an encoder that can write one.

    The table grows; nothing else moves that is addressed from outside, since `moov` stands last in OpenCV's files.
    """
    data = bytearray(path.read_bytes())
    moov = data.index(b"moov") - 4
    at = data.index(b"stts", moov) - 4
    old = int.from_bytes(data[at : at + 4], "big")
    entries = b"".join((1).to_bytes(4, "big") + d.to_bytes(4, "big") for d in durations)
    table = (16 + len(entries)).to_bytes(4, "big") + b"stts" + bytes(4) + len(durations).to_bytes(4, "big") + entries
    data[at : at + old] = table
    for name in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        box = data.index(name, moov) - 4
        length = int.from_bytes(data[box : box + 4], "big") + len(table) - old
        data[box : box + 4] = length.to_bytes(4, "big")
    if hz is not None:
        header = data.index(b"mdhd", moov) + 4
        data[header + 12 : header + 16] = hz.to_bytes(4, "big")
    path.write_bytes(data)
    return path


def time_base_hz(path: Path) -> int:
    """Units a second of the first track's time base (`mdhd`, version 0)."""
    data = path.read_bytes()
    at = data.index(b"mdhd") + 4
    return int.from_bytes(data[at + 12 : at + 16], "big")
