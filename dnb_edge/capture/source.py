"""The one shape of every source of frames, and the way from a URI to a source.

Knows the protocol and the schemes. The sources themselves are peers in the modules beside this one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

from dnb_edge.capture.libcamera import LibcameraSource
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.simulated import SimulatedSource, parse_simulator_uri
from dnb_edge.capture.v4l2 import V4l2Source
from dnb_edge.capture.video import VideoSource
from dnb_edge.errors import InputError
from dnb_edge.values import Frame, LostFrames, SourceInfo

KNOWN_SCHEMES = ("v4l2:/dev/video0", "libcamera:0", "file:clip.mp4", "mcap:run.mcap", "sim:")
"""One example of each kind of URI."""


class FrameSource(Protocol):
    """Where frames come from. Opening happens in the constructor; each source serves one run."""

    @property
    def info(self) -> SourceInfo:
        """What the source says about itself; known as soon as it is open."""

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """What the source itself lost since it was opened, by reason, up to the frame given last; empty for files."""

    def frames(self) -> Iterator[Frame]:
        """Frames with strictly increasing stamps and sequence numbers, blocking until the next is there.

        Ends at the end of the medium and after `close`. Raises `TemporaryFault` where a live device goes away (close the
        source and open it anew), `InputError` where a file turns out to be unusable.
        """

    def close(self) -> None:
        """Give the medium back. Safe to repeat and to call from another thread; a blocked `frames` then ends."""


_NAMING_SCHEMES = ("v4l2", "libcamera", "file", "mcap")
"""Those behind whose colon a device or file is named."""


def check_uri(uri: str) -> None:
    """Raises `InputError` where `uri` names no source, as far as that shows without looking for the device or file."""
    scheme, colon, rest = uri.partition(":")
    if scheme == "sim" and colon:
        parse_simulator_uri(uri)
    elif scheme not in _NAMING_SCHEMES:
        raise InputError(f"{uri or 'source'}: unknown kind of source: write one of {', '.join(KNOWN_SCHEMES)}")
    elif not rest:
        raise InputError(f"{uri}: names no device or file: write one of {', '.join(KNOWN_SCHEMES)}")


def open_source(
    uri: str,
    settings: CaptureSettings | None = None,
    *,
    open_recording: Callable[[str, Path], FrameSource] | None = None,
) -> FrameSource:
    """The source that `uri` names, open. `open_recording(uri, path)` serves `mcap:`, whose format this room does not know.

    Raises `InputError` for an unknown scheme and for a device or file that cannot be used.
    """
    check_uri(uri)
    scheme, _, rest = uri.partition(":")
    if scheme == "sim":
        return SimulatedSource(uri, parse_simulator_uri(uri))
    path = Path(rest).expanduser()
    if scheme == "file":
        return VideoSource(uri, path)
    if scheme == "v4l2":
        return V4l2Source(uri, path, settings if settings is not None else CaptureSettings())
    if scheme == "mcap" and open_recording is not None:
        return open_recording(uri, path)
    if scheme == "mcap":
        raise InputError(f"{uri}: recordings cannot be opened as a source here")
    return LibcameraSource(uri, settings if settings is not None else CaptureSettings())
