"""libcamera's buffers: their memory, and the pictures in them.

Knows dma-bufs and the pixel formats by libcamera's names, which are those of Linux's DRM: `RGB888` names the bits of a
little-endian word, so that its bytes are blue, green, red. Knows no camera.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import mmap
import struct
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import BgrImage

JPEG = "MJPEG"

_SYNC = 0x40086200  # DMA_BUF_IOCTL_SYNC
_READ, _END = 1, 4


class MappedBuffer:
    """The memory of one of the bindings' frame buffers, for reading."""

    def __init__(self, planes: Any) -> None:
        """Maps each file behind `planes` (of the bindings' FrameBuffer) once. Raises `OSError`."""
        self._files: dict[int, mmap.mmap] = {}
        self._planes = [(plane.fd, plane.offset, plane.length) for plane in planes if plane.length > 0]
        for fd in {fd for fd, _, _ in self._planes}:
            length = max(offset + size for own, offset, size in self._planes if own == fd)
            self._files[fd] = mmap.mmap(fd, length, mmap.MAP_SHARED, mmap.PROT_READ)

    def read(self, bytes_used: list[int]) -> list[bytes]:
        """A copy of each plane, as far as the camera says that it has filled it."""
        with contextlib.ExitStack() as stack:
            for fd in self._files:
                stack.enter_context(_readable(fd))
            return [
                self._files[fd][offset : offset + min(length, used)]
                for (fd, offset, length), used in zip(self._planes, bytes_used, strict=False)
            ]

    def close(self) -> None:
        """Unmap it all."""
        for mapped in self._files.values():
            mapped.close()


@contextlib.contextmanager
def _readable(fd: int) -> Iterator[None]:
    """The processor sees what the camera wrote into the dma-buf, not what its caches hold, until this ends."""
    try:
        fcntl.ioctl(fd, _SYNC, struct.pack("Q", _READ))
    except OSError as error:
        if error.errno != errno.ENOTTY:  # plain shared memory needs no such care
            raise
        yield
        return
    yield
    fcntl.ioctl(fd, _SYNC, struct.pack("Q", _READ | _END))


def to_bgr(name: str, planes: list[bytes], width_px: int, height_px: int, stride: int) -> BgrImage | None:
    """The picture in `planes`, copies of a buffer in the format `name`, shape (height, width, 3); None where it is too short.

    `stride`: bytes from one row of the first plane to the next.
    """
    try:
        picture = PICTURE_FORMATS[name](planes, width_px, height_px, stride)
    except (_TooShort, IndexError):
        return None
    return np.ascontiguousarray(picture, dtype=np.uint8)


class _TooShort(Exception):
    """A plane holds fewer bytes than its rows take."""


def _rows(plane: bytes, rows: int, stride: int, used: int) -> NDArray[np.uint8]:
    """Rows of `used` bytes each, shape (rows, used). The last one need not be padded."""
    if rows == 0 or len(plane) < stride * (rows - 1) + used:
        raise _TooShort
    padded = plane if len(plane) >= stride * rows else plane.ljust(stride * rows, b"\0")
    flat = np.frombuffer(padded, dtype=np.uint8, count=stride * rows)
    return np.ascontiguousarray(flat.reshape(rows, stride)[:, :used])


def _packed(channels: int, code: int | None) -> Callable[[list[bytes], int, int, int], NDArray[np.uint8]]:
    """Reader of a format with all channels of a pixel together; `code` of OpenCV's conversion, None for blue, green, red."""

    def read(planes: list[bytes], width: int, height: int, stride: int) -> NDArray[np.uint8]:
        pixels = _rows(planes[0], height, stride, width * channels).reshape(height, width, channels)
        return pixels if code is None else np.asarray(cv2.cvtColor(pixels, code), dtype=np.uint8)

    return read


def _half_planar(code: int) -> Callable[[list[bytes], int, int, int], NDArray[np.uint8]]:
    def read(planes: list[bytes], width: int, height: int, stride: int) -> NDArray[np.uint8]:
        luma = _rows(planes[0], height, stride, width)
        chroma = _rows(planes[1], height // 2, stride, width).reshape(height // 2, width // 2, 2)
        return np.asarray(cv2.cvtColorTwoPlane(luma, chroma, code), dtype=np.uint8)

    return read


def _planar(planes: list[bytes], width: int, height: int, stride: int) -> NDArray[np.uint8]:
    parts = [_rows(planes[0], height, stride, width)]
    parts += [_rows(plane, height // 2, stride // 2, width // 2) for plane in (planes[1], planes[2])]
    stacked = np.concatenate([part.ravel() for part in parts]).reshape(height * 3 // 2, width)
    return np.asarray(cv2.cvtColor(stacked, cv2.COLOR_YUV2BGR_I420), dtype=np.uint8)


def _no_pixels(planes: list[bytes], width: int, height: int, stride: int) -> NDArray[np.uint8]:
    raise ValueError(f"{len(planes)} planes of {width}x{height} JPEG (stride {stride}) are decoded elsewhere")


PICTURE_FORMATS: dict[str, Callable[[list[bytes], int, int, int], NDArray[np.uint8]]] = {
    JPEG: _no_pixels,
    "RGB888": _packed(3, None),
    "BGR888": _packed(3, cv2.COLOR_RGB2BGR),
    "XRGB8888": _packed(4, cv2.COLOR_BGRA2BGR),
    "XBGR8888": _packed(4, cv2.COLOR_RGBA2BGR),
    "YUYV": _packed(2, cv2.COLOR_YUV2BGR_YUYV),
    "NV12": _half_planar(cv2.COLOR_YUV2BGR_NV12),
    "YUV420": _planar,
}
"""Readers by libcamera's names of the formats, the one liked best first: JPEG is recorded as it came, the next need no
conversion of colours, the last carry the least."""
