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
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.capture.decode import is_whole_jpeg
from dnb_edge.capture.v4l2_tally import DAMAGED, SHORT
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How the pixels of a format lie in its planes."""

    planes: tuple[tuple[int, int, int], ...]
    """Of each plane: by what to divide the picture's height for its rows, by what the first plane's stride for its own, and
    the bytes that two pixels of a row take."""
    to_bgr: Callable[[list[NDArray[np.uint8]]], Any]
    """Makes the picture of the planes' rows, each of shape (rows, bytes)."""


def fault_of(name: str, planes: list[bytes], width_px: int, height_px: int, stride: int) -> str | None:
    """Why `planes`, copies of a buffer in the format `name`, are no picture: `damaged` or `short`; None for a whole one.

    `stride`: bytes from one row of the first plane to the next.
    """
    if name == JPEG:
        jpeg = planes[0] if planes else b""
        if is_whole_jpeg(jpeg):
            return None
        return DAMAGED if jpeg and jpeg[:2] != b"\xff\xd8" else SHORT
    wanted = PICTURE_FORMATS[name].planes
    if len(planes) < len(wanted):
        return SHORT
    for plane, (row_part, stride_part, pair_bytes) in zip(planes, wanted, strict=False):
        # The last row need not be padded.
        if len(plane) < stride // stride_part * (height_px // row_part - 1) + pair_bytes * width_px // 2:
            return SHORT
    return None


def to_bgr(name: str, planes: list[bytes], width_px: int, height_px: int, stride: int) -> BgrImage:
    """The picture, shape (height, width, 3), in `planes`, which `fault_of` finds nothing wrong with; not for JPEG."""
    layout = PICTURE_FORMATS[name]
    rows = [
        _rows(plane, height_px // row_part, stride // stride_part, pair_bytes * width_px // 2)
        for plane, (row_part, stride_part, pair_bytes) in zip(planes, layout.planes, strict=False)
    ]
    return np.ascontiguousarray(layout.to_bgr(rows), dtype=np.uint8)


def _rows(plane: bytes, rows: int, stride: int, used: int) -> NDArray[np.uint8]:
    """Rows of `used` bytes each, shape (rows, used), without their padding."""
    padded = plane if len(plane) >= stride * rows else plane.ljust(stride * rows, b"\0")
    flat = np.frombuffer(padded, dtype=np.uint8, count=stride * rows)
    return np.ascontiguousarray(flat.reshape(rows, stride)[:, :used])


def _packed(channels: int, code: int | None) -> Layout:
    """All channels of a pixel together; `code` of OpenCV's conversion, None for blue, green, red."""

    def convert(planes: list[NDArray[np.uint8]]) -> Any:
        pixels = planes[0].reshape(len(planes[0]), -1, channels)
        return pixels if code is None else cv2.cvtColor(pixels, code)

    return Layout(planes=((1, 1, 2 * channels),), to_bgr=convert)


def _nv12(planes: list[NDArray[np.uint8]]) -> Any:
    luma, chroma = planes
    return cv2.cvtColorTwoPlane(luma, chroma.reshape(len(chroma), -1, 2), cv2.COLOR_YUV2BGR_NV12)


def _yuv420(planes: list[NDArray[np.uint8]]) -> Any:
    width = planes[0].shape[1]
    return cv2.cvtColor(np.concatenate([plane.ravel() for plane in planes]).reshape(-1, width), cv2.COLOR_YUV2BGR_I420)


def _decoded_elsewhere(planes: list[NDArray[np.uint8]]) -> Any:
    raise ValueError(f"{len(planes)} planes of JPEG: `decode` reads them")


PICTURE_FORMATS = {
    JPEG: Layout(planes=(), to_bgr=_decoded_elsewhere),
    "RGB888": _packed(3, None),
    "BGR888": _packed(3, cv2.COLOR_RGB2BGR),
    "XRGB8888": _packed(4, cv2.COLOR_BGRA2BGR),
    "XBGR8888": _packed(4, cv2.COLOR_RGBA2BGR),
    "YUYV": _packed(2, cv2.COLOR_YUV2BGR_YUYV),
    "NV12": Layout(planes=((1, 1, 2), (2, 1, 2)), to_bgr=_nv12),
    "YUV420": Layout(planes=((1, 1, 2), (2, 2, 1), (2, 2, 1)), to_bgr=_yuv420),
}
"""By libcamera's names of the formats, the one liked best first: JPEG is recorded as it came, the next need no conversion of
colours, the last carry the least."""
