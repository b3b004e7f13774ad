"""The account of a camera's buffers: each has a number, and of each that becomes no frame the reason is kept.

Knows the driver's frame numbers and flags and what a whole buffer looks like. Knows no device.
"""

from __future__ import annotations

from collections import Counter

from dnb_edge.capture.decode import is_whole_jpeg
from dnb_edge.capture.v4l2_setup import CameraFormat
from dnb_edge.values import LostFrames

DAMAGED, GAP, OVERTAKEN, SHORT, STAMP = "damaged", "gap", "overtaken", "short", "stamp"
BUFFER_ERROR = 0x40
"""V4L2_BUF_FLAG_ERROR: the driver itself says that the picture is damaged."""

MOST_BUFFERS = 32
"""V4L2's VIDEO_MAX_FRAME: so many buffers at most are under way at a time."""


def fault_of(flags: int, data: bytes, form: CameraFormat) -> str | None:
    """Why a buffer is no frame: `damaged` or `short`; None for a whole one."""
    if flags & BUFFER_ERROR:
        return DAMAGED
    if not form.is_jpeg:
        return SHORT if len(data) < form.bytes_per_line * form.height else None
    if is_whole_jpeg(data):
        return None
    return DAMAGED if data and data[:2] != b"\xff\xd8" else SHORT


class Tally:
    """Numbers a camera's buffers in the order in which they come, and counts those that are lost."""

    def __init__(self) -> None:
        self._raw: int | None = None
        self._raw_t_ns = 0
        self._offset = 0
        self._counts: Counter[str] = Counter()
        self._later: Counter[str] = Counter()
        self._lost: tuple[LostFrames, ...] = ()

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """What was lost before the latest frame given, by reason; may be read from any thread."""
        return self._lost

    def number(self, sequence: int, t_ns: int) -> int | None:
        """The frame number of the next buffer, which its driver calls `sequence` and stamps `t_ns`: the driver's, as long as it
        grows. What it jumps over is a gap. A few drivers leave it at 0, or begin anew: ours then goes on by one.

        None for a buffer that a later one overtook on its way: it is no frame any more, and a gap already. uvcvideo decodes on
        several processors at once, and then now and then hands two buffers over in the wrong order.
        """
        if self._raw is not None:
            if sequence > self._raw:
                self._later[GAP] += sequence - self._raw - 1
            elif self._raw - MOST_BUFFERS < sequence < self._raw and t_ns < self._raw_t_ns:
                return None
            else:
                self._offset += self._raw + 1 - sequence
        self._raw, self._raw_t_ns = sequence, t_ns
        return sequence + self._offset

    def lose(self, reason: str) -> None:
        """The latest buffer, or one that waited, becomes no frame."""
        self._later[reason] += 1

    def give(self) -> None:
        """The latest buffer is to be the next frame: what was lost so far, was lost before it."""
        self._counts.update(self._later)
        self._later.clear()

    def publish(self, *, given: bool) -> None:
        """Lets `lost` tell the account: up to the frame about to be `given`, or all where there is none."""
        if not given:
            self.give()
        self._lost = tuple(
            LostFrames(reason=reason, frames=frames) for reason, frames in sorted(self._counts.items()) if frames
        )
