"""The recorder: takes frames, detections and events from the race and brings them to disk in a thread of its own.

Knows the MCAP writer, the queue and the rhythm of flushing. The race never waits for the disk (unless the source can,
`lossless`) and never hears an exception from it: errors become `health().state`, and `close` tells them. "Saved" is
said only of what fdatasync has acknowledged.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import foxglove
from foxglove.mcap import MCAPCompression, MCAPWriteOptions, MCAPWriter
from foxglove.messages import LogLevel

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record import names
from dnb_edge.record.channels import ImageNote, RunChannels, TrackScene
from dnb_edge.record.durable import DurableFile
from dnb_edge.record.header import LOSS_METADATA_NAME, METADATA_NAME, SETUP_NAME, RunHeader
from dnb_edge.record.mailbox import Mailbox, Rank
from dnb_edge.values import (
    Crossing,
    Event,
    Frame,
    FrameDetections,
    Health,
    Incident,
    Lap,
    Observation,
    RaceState,
    Running,
    RunSummary,
    Score,
    Standings,
    Target,
)

BATCH = 64
_ADVICE = "run `dnb-edge runs recover` on it"
WRITE_ERRORS = (OSError, RuntimeError, ValueError, TypeError, OverflowError, cv2.error)
"""What foxglove-sdk (RuntimeError), JSON (ValueError, TypeError), OpenCV and the system can say while we write."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSettings:
    """Where and how to record."""

    directory: Path
    """Made, with its parents, where it is not there."""
    image_fps: float | None = 5.0
    """Pictures per second at most, by their stamps; None records no pictures."""
    jpeg_quality: int = 85
    """For frames that did not come as JPEG."""
    sync_period_s: float = 1.0
    """A power cut loses at most this much, and never a lap that was said to be saved."""
    chunk_size_bytes: int = 256 * 1024
    queue_messages: int = 2048
    queue_pictures: int = 8
    lossless: bool = False
    """True where the producer may wait for the disk (files, the simulator); False for live cameras."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderHealth:
    """How the recording is doing."""

    state: str
    """`recording`, `failed` or `closed`; `recording` and `failed` are the words of `values.Health.recording`."""
    reason: str | None
    """Why it failed, one line; None otherwise."""
    path: Path
    """The file as it is called now."""
    queued: int
    dropped_images: int
    lost_messages: int
    """Detections, observations and targets that found no room; such a recording cannot be scored again exactly."""
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _LogLine:
    message: str
    t_ns: int | None


_Item = Frame | FrameDetections | Event | _LogLine


class Recorder:
    """One recording, from its header to its final name. Methods may be called from several threads."""

    def __init__(self, settings: RecordingSettings, header: RunHeader, scene: TrackScene | None = None) -> None:
        """Create the file and bring its header to the disk.

        Raises InputError where the directory cannot be used, WorkError where the disk fails at once.
        """
        self._settings = settings
        setup_text = header.to_json()
        self._file = _create(settings.directory)
        # Kept for as long as the channels: they close, and log to nowhere without an error, when it is collected.
        self._context = foxglove.Context()
        options = MCAPWriteOptions(
            compression=MCAPCompression.Zstd,
            compression_level=1,
            compression_threads=0,
            chunk_size=settings.chunk_size_bytes,
            # Without seeking a crash leaves a clean end, not a chunk that claims 2**64 - 1 bytes.
            disable_seeking=True,
        )
        self._mcap: MCAPWriter = foxglove.open_mcap(self._file, context=self._context, writer_options=options)
        self._mcap.attach(
            log_time=0, create_time=0, name=SETUP_NAME, media_type="application/json", data=setup_text.encode()
        )
        self._mcap.write_metadata(METADATA_NAME, header.metadata())
        self._mcap.flush()
        if not self._file.sync_new():
            raise WorkError(f"{self._file.path}: cannot record: {_words(self._file.failure)}")
        self._channels = RunChannels(self._context, scene, images=settings.image_fps is not None)
        self._mail: Mailbox[_Item] = Mailbox(capacity=settings.queue_messages, picture_capacity=settings.queue_pictures)
        self._image_due_ns: int | None = None
        self._last_t_ns = 0
        self.progress = 0
        """Rounds of the writer's thread, one a second at least while the disk answers, with or without anything to write."""
        self._saved = threading.Condition()
        self._saved_ticket = 0
        self._wanted_ticket = 0
        self._reason: str | None = None
        self._finished = False
        self._keep_part = False
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def add_frame(self, frame: Frame) -> None:
        """Offer one frame; it is recorded where the settings want pictures and the last one lies far enough back."""
        fps = self._settings.image_fps
        if fps is None:
            return
        period_ns = round(1e9 / fps)
        due_ns = frame.t_ns if self._image_due_ns is None else self._image_due_ns
        if frame.t_ns < due_ns:
            return
        # The grid goes on from the due instant, so that jitter does not lower the rate; after a gap it starts afresh.
        self._image_due_ns = due_ns + period_ns if due_ns + period_ns > frame.t_ns else frame.t_ns + period_ns
        self._mail.put(frame, Rank.PICTURE, wait=self._settings.lossless)

    def add_detections(self, found: FrameDetections) -> int | None:
        """Record one frame's detections; the ticket for `is_saved`, None where there was no room or no recording."""
        return self._mail.put(found, Rank.DATA, wait=self._settings.lossless)

    def add_event(self, event: Event) -> int | None:
        """Record one event; the ticket for `is_saved`, None where there was no room or no recording any more.

        Only observations and targets can find no room. A lap and a score are synced as soon as they are written.
        """
        rank = Rank.DATA if isinstance(event, Observation | Target | Running) else Rank.VITAL
        return self._mail.put(event, rank, wait=self._settings.lossless)

    def add_log(self, message: str, t_ns: int | None = None) -> None:
        """One warning for the log panel, at `t_ns` or else at the last stamp recorded."""
        self._mail.put(_LogLine(message=message, t_ns=t_ns), Rank.VITAL, wait=False)

    def is_saved(self, ticket: int | None) -> bool:
        """True once the disk has acknowledged what `ticket` stands for."""
        with self._saved:
            return ticket is not None and ticket <= self._saved_ticket

    def wait_saved(self, ticket: int | None = None, timeout_s: float = 5.0) -> bool:
        """Wait until `ticket`, or else everything accepted so far, is saved; False after `timeout_s` or a failure."""
        wanted = self._mail.last_ticket if ticket is None else ticket
        self._wanted_ticket = max(self._wanted_ticket, wanted)
        self._mail.hurry()
        with self._saved:
            done = self._saved.wait_for(lambda: self._saved_ticket >= wanted or self._ended(), timeout_s)
            return done and self._saved_ticket >= wanted

    def health(self) -> RecorderHealth:
        """How the recording is doing, at once."""
        warnings = []
        if self._mail.lost:
            warnings.append(f"{self._mail.lost} messages not recorded: the disk cannot keep up")
        if self._mail.dropped_pictures:
            warnings.append(f"{self._mail.dropped_pictures} pictures not recorded: the disk cannot keep up")
        if self._reason is not None:
            warnings.append(f"recording failed: {self._reason}")
        return RecorderHealth(
            state=self.state,
            reason=self._reason,
            path=self.path,
            queued=len(self._mail),
            dropped_images=self._mail.dropped_pictures,
            lost_messages=self._mail.lost,
            warnings=tuple(warnings),
        )

    @property
    def state(self) -> str:
        """`recording`, `failed` or `closed`."""
        if self._reason is not None:
            return "failed"
        return "closed" if not self._thread.is_alive() else "recording"

    @property
    def path(self) -> Path:
        """The file as it is called now."""
        return self._file.path

    def close(self, timeout_s: float | None = None) -> Path:
        """Write what waits, finish the file and give it its final name. May be called again.

        Raises WorkError where anything of the recording failed, or after `timeout_s`; what had been saved stays in
        the `.part`.
        """
        self._mail.close()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise WorkError(f"{self.path}: the disk does not answer; what was saved is in the file, {_ADVICE}")
        if self._reason is not None:
            raise WorkError(f"{self.path}: recording failed: {self._reason}; what was saved is in the file, {_ADVICE}")
        return self.path

    def abandon(self) -> None:
        """Stop now and leave the `.part` with what was saved; what waits is thrown away."""
        self._keep_part = True
        self._mail.close(discard=True)
        self._thread.join()

    def _run(self) -> None:
        """Body of the recorder's thread."""
        try:
            self._write_all()
            if not self._keep_part and self._file.failure is None:
                self._finish()
            if self._file.failure is not None:
                self._reason = _words(self._file.failure)
        except WRITE_ERRORS as error:
            self._reason = _words(error)
        finally:
            # Whatever stopped the thread, nobody may wait for it any more, and a half-written file keeps its `.part`.
            if not self._finished and self._reason is None and not self._keep_part:
                self._reason = "the recorder stopped unexpectedly"
            self._file.abandon()
            self._mail.close(discard=True)
            with self._saved:
                self._saved.notify_all()

    def _write_all(self) -> None:
        next_sync_s = time.monotonic() + self._settings.sync_period_s
        written, synced = 0, 0
        while True:
            self.progress += 1
            batch = self._mail.take(BATCH, max(0.0, next_sync_s - time.monotonic()))
            if batch is None:
                return
            for ticket, item in batch:
                self._write(item)
                written = ticket
            urgent = any(isinstance(item, Lap | Score | RunSummary) for _, item in batch)
            urgent = urgent or written >= self._wanted_ticket > synced
            if urgent or time.monotonic() >= next_sync_s:
                if written > synced:
                    self._sync(written)
                    synced = written
                next_sync_s = time.monotonic() + self._settings.sync_period_s
            if self._file.failure is not None:
                return

    def _write(self, item: _Item) -> None:
        match item:
            case Frame():
                self._last_t_ns = max(self._last_t_ns, item.t_ns)
                self._write_image(item)
            case FrameDetections():
                self._last_t_ns = max(self._last_t_ns, item.t_ns)
                self._channels.draw_track(item.t_ns)
                self._channels.detections(item)
            case _LogLine():
                when_ns = self._last_t_ns if item.t_ns is None else item.t_ns
                self._channels.log(item.message, when_ns, level=LogLevel.Warning)
            case _:
                self._channels.event(item, _event_t_ns(item, self._last_t_ns))

    def _write_image(self, frame: Frame) -> None:
        if frame.bgr is None:
            jpeg = frame.jpeg or b""
        else:
            done, encoded = cv2.imencode(".jpg", frame.bgr, [cv2.IMWRITE_JPEG_QUALITY, self._settings.jpeg_quality])
            if not done:
                raise ValueError(f"frame {frame.sequence} cannot be encoded as JPEG")
            jpeg = encoded.tobytes()
        note = ImageNote(
            sequence=frame.sequence,
            t_ns=frame.t_ns,
            stamp_source=frame.stamp_source,
            width_px=frame.width_px,
            height_px=frame.height_px,
        )
        self._channels.image(note, jpeg)

    def _sync(self, ticket: int) -> None:
        self._mcap.flush()
        if self._file.sync():
            with self._saved:
                self._saved_ticket = ticket
                self._saved.notify_all()

    def _finish(self) -> None:
        if self._mail.lost or self._mail.dropped_pictures:
            loss = {"messages": str(self._mail.lost), "pictures": str(self._mail.dropped_pictures)}
            self._mcap.write_metadata(LOSS_METADATA_NAME, loss)
        self._mcap.close()
        if self._file.finish():
            self._finished = True
            with self._saved:
                self._saved_ticket = self._mail.last_ticket

    def _ended(self) -> bool:
        return self._reason is not None or self._finished or self._keep_part


def _create(directory: Path) -> DurableFile:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return names.create_next(directory, names.boot_tag())
    except OSError as error:
        if error.errno in {errno.ENOSPC, errno.EIO, errno.EDQUOT}:
            raise WorkError(f"{directory}: cannot record: {_words(error)}") from error
        raise InputError(f"{directory}: cannot record there: {_words(error)}") from error


def _event_t_ns(event: Event, last_t_ns: int) -> int:
    """The event's own stamp; for those that have none, the last frame's."""
    match event:
        case Observation() | Target() | Crossing() | Health() | Running() | RaceState() | Standings():
            return event.t_ns
        case Lap() | Incident():
            return event.end_t_ns
        case Score() | RunSummary():
            return last_t_ns


def _words(error: BaseException | None) -> str:
    if isinstance(error, OSError) and error.errno is not None:
        if error.errno == errno.ENOSPC:
            return "the disk is full"
        return os.strerror(error.errno).lower()
    return str(error)
