"""Opening a run's camera again: the same one, wherever it is plugged in now, and no other.

Knows what the camera said of itself when the run began, and whom to ask where it is now. A run's calibration holds for that
camera alone, so another one in its place gives no frame. Knows no driver and no thread.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from dnb_edge.capture.source import FrameSource
from dnb_edge.capture.v4l2_nodes import node_of
from dnb_edge.errors import DnbEdgeError, InputError, TemporaryFault
from dnb_edge.values import SourceInfo


class SameCamera:
    """Opens the camera that `first` tells of; call it after the old one was closed."""

    def __init__(
        self,
        first: SourceInfo,
        open_uri: Callable[[str], FrameSource],
        *,
        find: Callable[[str], Path | None] = node_of,
    ) -> None:
        """`find`: where the camera of an identity is now; None where it is not plugged in."""
        self._first = first
        self._open_uri = open_uri
        self._find = find

    def __call__(self) -> FrameSource:
        """The same camera, open. Raises `InputError` or `TemporaryFault` saying why it is not there."""
        faults: list[DnbEdgeError] = []
        for uri in self._places():
            try:
                return self._opened(uri)
            except (InputError, TemporaryFault) as fault:
                faults.append(fault)
        # What is wrong where the camera was says most.
        raise faults[0]

    def _places(self) -> Iterator[str]:
        """Where the camera was, and where it is now: its node may have got another number."""
        yield self._first.uri
        if self._first.camera_id is not None and self._first.uri.startswith("v4l2:"):
            found = self._find(self._first.camera_id)
            if found is not None:
                yield f"v4l2:{found}"

    def _opened(self, uri: str) -> FrameSource:
        source = self._open_uri(uri)
        fault = self._difference(source.info)
        if fault is None:
            return source
        source.close()
        raise TemporaryFault(fault)

    def _difference(self, found: SourceInfo) -> str | None:
        """What tells the camera found from the first one, in words; None where it is the same."""
        first = self._first
        if None not in (first.camera_id, found.camera_id) and found.camera_id != first.camera_id:
            return (
                f"another camera, {found.camera_id}, is plugged in: put {first.camera_id} back, or end the run and "
                "calibrate this one"
            )
        sizes = (first.width_px, first.height_px), (found.width_px, found.height_px)
        if sizes[0] != sizes[1]:
            (width, height), (other_width, other_height) = sizes
            return (
                f"the camera gives {other_width}x{other_height} now and gave {width}x{height} when the run began: unplug it "
                "and plug it in again, or end the run"
            )
        return None
