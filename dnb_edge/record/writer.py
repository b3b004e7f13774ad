"""The recorder: takes frames, detections and events from the race and brings them to disk in a thread of its own.

Knows the queue and what the race may ask; what happens on the other side of the queue is the `Scribe`'s. The race never waits
for the disk (unless the source can, `lossless`) and never hears an exception from it: errors become `health().state`, and
`close` tells them. "Saved" is said only of what fdatasync has acknowledged.
"""

from __future__ import annotations

import errno
import os
import threading
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.channels import TrackScene
from dnb_edge.record.header import RunHeader
from dnb_edge.record.mailbox import Mailbox, Rank
from dnb_edge.record.room import Statvfs
from dnb_edge.record.runfile import FileSpec, Item, LogLine, error_words
from dnb_edge.record.scribe import Plan, Scribe
from dnb_edge.values import Event, Frame, FrameDetections, Observation, Running, Target, VehicleReport

DISK_ERRORS = frozenset({errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EROFS})
"""What a disk says that is full, broken or read-only; anything else is a wrong choice of directory."""

_ADVICE = "run `dnb-edge runs recover` on it"


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
    fallback: tuple[Path, ...] = ()
    """Directories to go on in where the disk of `directory` fails, in their order; one that is not there is passed over."""
    keep_free_bytes: int = 0
    """Room to leave on the disk, at most a tenth of it: below it pictures stop, below half of it telemetry; laps never do."""
    max_total_bytes: int | None = None
    """Of all recordings in the directory; None for no limit."""
    prune: bool = False
    """True to delete the oldest recordings, pictures first, where there is less room than these two want."""
    image_ring_bytes: int | None = None
    """Bytes of the ring of pictures beside the recording; None to keep them all in the recording itself."""
    rotate_s: float | None = None
    """Time after which the recording goes on in another file, behind the end of the next lap; None for one file."""
    go_on: bool = True
    """True to go on in another file where one fails; False for a source that can simply be raced again."""
    start_anyway: bool = False
    """True to start though no disk can be written to, and to try again later: for a race that nobody watches."""


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
    saved_laps: int = 0
    """Laps that a disk has acknowledged."""


class Recorder:
    """One recording, from its header to its final name. Methods may be called from several threads."""

    def __init__(
        self,
        settings: RecordingSettings,
        header: RunHeader,
        scene: TrackScene | None = None,
        *,
        statvfs: Statvfs = os.statvfs,
    ) -> None:
        """Create the file and bring its header to the disk.

        Raises InputError where the directory cannot be used, WorkError where the disk fails at once; the latter not
        where the settings say to start anyway.
        """
        self._settings = settings
        spec = FileSpec(
            setup_text=header.to_json(),
            metadata=header.metadata(),
            scene=scene,
            annotate=settings.image_fps is not None,
            jpeg_quality=settings.jpeg_quality,
            chunk_size_bytes=settings.chunk_size_bytes,
        )
        plan = Plan(
            directory=settings.directory,
            fallback=settings.fallback,
            sync_period_s=settings.sync_period_s,
            keep_free_bytes=settings.keep_free_bytes,
            max_total_bytes=settings.max_total_bytes,
            prune=settings.prune,
            rotate_s=settings.rotate_s,
            image_ring_bytes=settings.image_ring_bytes,
            go_on=settings.go_on,
        )
        self._mail: Mailbox[Item] = Mailbox(capacity=settings.queue_messages, picture_capacity=settings.queue_pictures)
        self._scribe = Scribe(plan, spec, self._mail, statvfs=statvfs)
        self._image_due_ns: dict[int, int] = {}
        """By camera."""
        try:
            self._scribe.open_first()
        except OSError as error:
            broken = error.errno in DISK_ERRORS
            if not (broken and settings.start_anyway):
                kind = WorkError if broken else InputError
                raise kind(f"{settings.directory}: cannot record there: {error_words(error)}") from error
            self._scribe.start_without(error)
        self._thread = threading.Thread(target=self._scribe.run, name="recorder", daemon=True)
        self._thread.start()

    def add_frame(self, frame: Frame) -> None:
        """Offer one frame; it is recorded where the settings want pictures and the last one lies far enough back."""
        fps = self._settings.image_fps
        if fps is None:
            return
        period_ns = round(1e9 / fps)
        due_ns = self._image_due_ns.get(frame.camera, frame.t_ns)
        if frame.t_ns < due_ns:
            return
        # The grid goes on from the due instant, so that jitter does not lower the rate; after a gap it starts afresh.
        after_ns = due_ns if due_ns + period_ns > frame.t_ns else frame.t_ns
        self._image_due_ns[frame.camera] = after_ns + period_ns
        self._mail.put(frame, Rank.PICTURE, wait=self._settings.lossless)

    def add_detections(self, found: FrameDetections) -> int | None:
        """Record one frame's detections; the ticket for `is_saved`, None where there was no room or no recording."""
        return self._mail.put(found, Rank.DATA, wait=self._settings.lossless)

    def add_event(self, event: Event) -> int | None:
        """Record one event; the ticket for `is_saved`, None where there was no room or no recording any more.

        Only observations, targets and what vehicles say can find no room. A lap and a score are synced as soon as they are
        written.
        """
        rank = Rank.DATA if isinstance(event, Observation | Target | Running) else Rank.VITAL
        if isinstance(event, VehicleReport):
            rank = Rank.EXTRA
        return self._mail.put(event, rank, wait=self._settings.lossless)

    def add_log(self, message: str, t_ns: int | None = None) -> None:
        """One warning for the log panel, at `t_ns` or else at the last stamp recorded."""
        self._mail.put(LogLine(message=message, t_ns=t_ns), Rank.VITAL, wait=False)

    def is_saved(self, ticket: int | None) -> bool:
        """True once the disk has acknowledged what `ticket` stands for."""
        return self._scribe.acks.is_saved(ticket)

    def wait_saved(self, ticket: int | None = None, timeout_s: float = 5.0) -> bool:
        """Wait until `ticket`, or else the last one given out, is saved; False after `timeout_s` or a failure."""
        wanted = self._mail.last_ticket if ticket is None else ticket
        self._scribe.wanted_ticket = max(self._scribe.wanted_ticket, wanted)
        self._mail.hurry()
        return self._scribe.acks.wait(wanted, timeout_s, lambda: self._scribe.ended)

    def health(self) -> RecorderHealth:
        """How the recording is doing, at once."""
        scribe = self._scribe
        lost = scribe.lost + self._mail.lost
        warnings = [*scribe.warnings]
        if self._mail.lost:
            warnings.append(f"{self._mail.lost} messages not recorded: the disk cannot keep up")
        if scribe.lost and scribe.reason is None:
            warnings.append(f"{scribe.lost} messages not recorded: the disk failed or was nearly full")
        if self._mail.dropped_pictures:
            warnings.append(f"{self._mail.dropped_pictures} pictures not recorded: the disk cannot keep up")
        if scribe.reason is not None:
            warnings.append(f"recording failed: {scribe.reason}")
        return RecorderHealth(
            state=self.state,
            reason=scribe.reason,
            path=self.path,
            queued=len(self._mail),
            dropped_images=self._mail.dropped_pictures + scribe.lost_pictures,
            lost_messages=lost,
            warnings=tuple(warnings),
            saved_laps=scribe.saved_laps,
        )

    @property
    def state(self) -> str:
        """`recording`, `failed` or `closed`. One that failed tries again until it is closed."""
        if self._scribe.reason is not None:
            return "failed"
        return "closed" if not self._thread.is_alive() else "recording"

    @property
    def progress(self) -> int:
        """Grows every second while the writer's thread lives and the disk answers: for the watchdog."""
        return self._scribe.progress

    @property
    def path(self) -> Path:
        """The file as it is called now; the last one where there were several."""
        return self._scribe.path

    def close(self, timeout_s: float | None = None) -> Path:
        """Write what waits, finish the file and give it its final name. May be called again.

        Raises WorkError where anything of the recording failed, or after `timeout_s`; what had been saved stays in
        the `.part`.
        """
        self._mail.close()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise WorkError(f"{self.path}: the disk does not answer; what was saved is in the file, {_ADVICE}")
        if self._scribe.reason is not None:
            raise WorkError(
                f"{self.path}: recording failed: {self._scribe.reason}; what was saved is in the file, {_ADVICE}"
            )
        return self.path

    def abandon(self) -> None:
        """Stop now and leave the `.part` with what was saved; what waits is thrown away."""
        self._scribe.keep_part = True
        self._mail.close(discard=True)
        self._thread.join()
