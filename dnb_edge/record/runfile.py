"""One file of a recording while it is written: the header first, then whatever comes, synced on request.

Knows the MCAP writer over a `DurableFile`. Knows no queue, no rhythm, and no other file: what happens when the disk fails
is for the recorder to say.
"""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import foxglove
from foxglove.mcap import MCAPCompression, MCAPWriteOptions, MCAPWriter
from foxglove.messages import LogLevel

from dnb_edge.record.channels import ImageNote, RunChannels, TrackScene, event_t_ns
from dnb_edge.record.durable import DurableFile
from dnb_edge.record.header import CONTINUES_METADATA_NAME, LOSS_METADATA_NAME, METADATA_NAME, SETUP_NAME
from dnb_edge.values import Event, Frame, FrameDetections


@dataclass(frozen=True, slots=True, kw_only=True)
class LogLine:
    """A line for the log panel, at `t_ns` or else at the last stamp recorded."""

    message: str
    t_ns: int | None


Item = Frame | FrameDetections | Event | LogLine
"""What can be recorded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileSpec:
    """What every file of one recording has in common."""

    setup_text: str
    """`setup.json`, see `header`."""
    metadata: dict[str, str]
    scene: TrackScene | None = None
    annotate: bool = False
    """True to draw detections over the pictures."""
    jpeg_quality: int = 85
    """For frames that did not come as JPEG."""
    chunk_size_bytes: int = 256 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Continues:
    """Which file a file goes on from, where it is not a recording's first."""

    first: str
    """Name of the recording's first file, without directory, as it is called when finished."""
    previous: str
    part: int
    """From 2."""
    why: str = field(default="")

    def metadata(self) -> dict[str, str]:
        """As MCAP metadata."""
        return {"first": self.first, "previous": self.previous, "part": str(self.part), "why": self.why}


class RunFile:
    """A recording's file. Methods raise what foxglove-sdk, JSON and OpenCV do; the disk's errors are in `failure`."""

    def __init__(self, file: DurableFile, spec: FileSpec, continues: Continues | None = None) -> None:
        """Write the header into `file` and bring it, and the file's name, to the disk.

        Raises OSError where that fails; nothing is left in the directory then.
        """
        self._file = file
        self._spec = spec
        # Kept for as long as the channels: they close, and log to nowhere without an error, when it is collected.
        self._context = foxglove.Context()
        options = MCAPWriteOptions(
            compression=MCAPCompression.Zstd,
            compression_level=1,
            compression_threads=0,
            chunk_size=spec.chunk_size_bytes,
            # Without seeking a crash leaves a clean end, not a chunk that claims 2**64 - 1 bytes.
            disable_seeking=True,
        )
        self._mcap: MCAPWriter = foxglove.open_mcap(file, context=self._context, writer_options=options)
        self._mcap.attach(
            log_time=0, create_time=0, name=SETUP_NAME, media_type="application/json", data=spec.setup_text.encode()
        )
        self._mcap.write_metadata(METADATA_NAME, spec.metadata)
        if continues is not None:
            self._mcap.write_metadata(CONTINUES_METADATA_NAME, continues.metadata())
        self._mcap.flush()
        if not file.sync_new():
            file.discard()
            raise file.failure or OSError(errno.EIO, os.strerror(errno.EIO), str(file.path))
        self._channels = RunChannels(self._context, spec.scene, images=spec.annotate)
        self._last_t_ns = 0

    @property
    def path(self) -> Path:
        """The file as it is called now."""
        return self._file.path

    @property
    def final(self) -> Path:
        """The file as it is called when it is finished."""
        return self._file.final

    @property
    def size_bytes(self) -> int:
        """Bytes written so far; up to a chunk is still in memory."""
        return self._file.tell()

    @property
    def failure(self) -> OSError | None:
        """The first error of the disk; what was written since the last `sync` is not safe then."""
        return self._file.failure

    def write(self, item: Item) -> None:
        """One item, in memory first."""
        match item:
            case Frame():
                self._last_t_ns = max(self._last_t_ns, item.t_ns)
                self._write_image(item)
            case FrameDetections():
                self._last_t_ns = max(self._last_t_ns, item.t_ns)
                self._channels.draw_track(item.t_ns)
                self._channels.detections(item)
            case LogLine():
                when_ns = self._last_t_ns if item.t_ns is None else item.t_ns
                self._channels.log(item.message, when_ns, level=LogLevel.Warning)
            case _:
                self._channels.event(item, event_t_ns(item, self._last_t_ns))

    def sync(self) -> bool:
        """Bring all that was written to the disk; True where it is there."""
        self._mcap.flush()
        return self._file.sync()

    def finish(self, *, lost_messages: int = 0, lost_pictures: int = 0) -> bool:
        """Say what is missing, end the file and give it its final name; False where the disk failed."""
        if lost_messages or lost_pictures:
            loss = {"messages": str(lost_messages), "pictures": str(lost_pictures)}
            self._mcap.write_metadata(LOSS_METADATA_NAME, loss)
        self._mcap.close()
        return self._file.finish()

    def abandon(self) -> None:
        """Leave the `.part` with what was synced."""
        self._file.abandon()

    def _write_image(self, frame: Frame) -> None:
        if frame.bgr is None:
            jpeg = frame.jpeg or b""
        else:
            done, encoded = cv2.imencode(".jpg", frame.bgr, [cv2.IMWRITE_JPEG_QUALITY, self._spec.jpeg_quality])
            if not done:
                raise ValueError(f"frame {frame.sequence} cannot be encoded as JPEG")
            jpeg = encoded.tobytes()
        note = ImageNote(
            sequence=frame.sequence,
            t_ns=frame.t_ns,
            stamp_source=frame.stamp_source,
            width_px=frame.width_px,
            height_px=frame.height_px,
            camera=frame.camera,
        )
        self._channels.image(note, jpeg)


def error_words(error: BaseException | None) -> str:
    """What went wrong, in a few words."""
    if isinstance(error, OSError) and error.errno is not None:
        if error.errno == errno.ENOSPC:
            return "the disk is full"
        return os.strerror(error.errno).lower()
    return str(error)
