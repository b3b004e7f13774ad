"""Reading a run back: its header, the detections and events exactly as they were recorded, and the pictures.

Knows the layout that docs/recording.md describes. Knows nothing of scoring. A file that is cut short or damaged raises
`InputError` with the command that repairs it, before anything of it is given out.
"""

from __future__ import annotations

import heapq
import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from mcap.records import Attachment, Message, Metadata

from dnb_edge import wire
from dnb_edge.errors import InputError
from dnb_edge.record import protobuf
from dnb_edge.record.chain import Head, chain_of, read_head
from dnb_edge.record.channels import (
    DETECTIONS_TOPIC,
    EVENT_TOPICS,
    IMAGE_NOTE_TOPIC,
    IMAGE_TOPIC,
    JSON_TOPICS,
    ImageNote,
)
from dnb_edge.record.header import (
    LOSS_METADATA_NAME,
    RECOVERY_METADATA_NAME,
    SETUP_NAME,
    RunHeader,
    header_from_json,
)
from dnb_edge.record.names import pictures_files
from dnb_edge.record.scan import Damage, LinearReader, Record
from dnb_edge.values import Event, Frame, FrameDetections

T = TypeVar("T")

COMPRESSED_IMAGE_DATA_FIELD = 2
"""Field number of `data` in foxglove.CompressedImage."""

MOST_DIGITS = 19
"""Of a count that a recording tells of itself."""
KEPT_OVERHEAD_BYTES = 128
"""What a kept message takes in memory besides its text, however short that is."""
KEPT_BYTES = 64 * 1024 * 1024
"""Most text of detections that is kept in memory: that of a car over two hours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedRun:
    """One recording, read through once and found in order; its messages are read anew by each iteration."""

    path: Path
    header: RunHeader
    counts: dict[str, int]
    """Messages by topic."""
    first_t_ns: int | None
    """Lowest log time, source clock; None where there is no message."""
    last_t_ns: int | None
    lost_messages: int
    """Detections or events that the recorder or a recovery lost; 0 where re-scoring is exact."""
    damage: Damage | None
    """What is wrong with the file; None unless it was read with `tolerate_damage`."""
    warnings: tuple[str, ...]
    kept: tuple[tuple[int, bytes], ...] | None = field(default=None, repr=False)
    """Log time and text of all detections, as they were found in checking; None where nobody wanted them kept."""
    earlier: tuple[Path, ...] = ()
    """The files that this one goes on from, oldest first: counts, stamps and messages are of all of them together."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the recording, in order."""
        return (*self.earlier, self.path)

    def messages(self) -> Iterator[FrameDetections | Event]:
        """Detections and events, in the order in which they were recorded. Raises InputError where one is malformed."""
        for path, topic, message in self._stored(JSON_TOPICS):
            yield _decoded(path, topic, JSON_TOPICS[topic], message.data, message.log_time)

    def detections(self) -> Iterator[FrameDetections]:
        """What the pure core was given, frame by frame. Raises InputError where one is malformed."""
        texts = self._detection_texts() if self.kept is None else self.kept
        return (_decoded(self.path, DETECTIONS_TOPIC, FrameDetections, text, t_ns) for t_ns, text in texts)

    def race_detections(self) -> Iterator[FrameDetections]:
        """`detections`, of which each is later than the one before it. Raises InputError where one is not."""
        last: FrameDetections | None = None
        for found in self.detections():
            if last is not None and found.t_ns <= last.t_ns:
                raise InputError(
                    f"{self.path}: frame {found.sequence} comes before frame {last.sequence} in time: it is not of one run"
                )
            last = found
            yield found

    def _detection_texts(self) -> Iterator[tuple[int, bytes]]:
        for _, _, message in self._stored((DETECTIONS_TOPIC,)):
            yield message.log_time, message.data

    def _stored(self, topics: Collection[str]) -> Iterator[tuple[Path, str, Message]]:
        """Messages of these topics with their file and topic, file after file."""
        for path in self.files:
            for topic, message in _messages(LinearReader(path, topics=topics)):
                yield path, topic, message

    def events(self) -> Iterator[Event]:
        """What the core and the appliance said, in order."""
        for path, topic, message in self._stored(tuple(EVENT_TOPICS.values())):
            yield _decoded(path, topic, JSON_TOPICS[topic], message.data, message.log_time)


def read_run(path: Path, *, tolerate_damage: bool = False, keep_detections: bool = False) -> RecordedRun:
    """Open the recording at `path` and check all of it: structure, lengths, checksums, header.

    Raises InputError with one line where it is not there, no MCAP file, no recording of ours, cut short or damaged. With
    `tolerate_damage` the last two are told by `damage` instead, and the messages are those before the damage. With
    `keep_detections` their text stays in memory, up to `KEPT_BYTES`, so that the file need not be read a second time for them.

    A run that goes on from one that was cut short is read with the files of that one, which lie beside it: one of them that
    is not there is told by a warning.
    """
    run = _read_file(path, tolerate_damage=tolerate_damage, keep_detections=keep_detections)
    chain = chain_of(Head(path=path, header=run.header, previous=read_head(path).previous))
    # What was never finished ends where it was cut short, whoever reads it.
    earlier = [
        _read_file(one, tolerate_damage=True, keep_detections=keep_detections and run.kept is not None)
        for one in chain.earlier
    ]
    if chain.missing is not None:
        told = f"it goes on from {chain.missing}, which is not beside it: what came before is left out"
        run = replace(run, warnings=(*run.warnings, told))
    return _joined(earlier, run) if earlier else run


def _joined(earlier: Sequence[RecordedRun], last: RecordedRun) -> RecordedRun:
    """One recording of several files."""
    runs = (*earlier, last)
    firsts = [run.first_t_ns for run in runs if run.first_t_ns is not None]
    lasts = [run.last_t_ns for run in runs if run.last_t_ns is not None]
    kept = [run.kept for run in runs if run.kept is not None]
    whole = len(kept) == len(runs) and sum(len(text) for one in kept for _, text in one) < KEPT_BYTES
    counts: Counter[str] = Counter()
    for run in runs:
        counts.update(run.counts)
    names = ", ".join(run.path.name for run in earlier)
    return replace(
        last,
        counts=dict(counts),
        first_t_ns=min(firsts, default=None),
        last_t_ns=max(lasts, default=None),
        lost_messages=sum(run.lost_messages for run in runs),
        warnings=(f"goes on from {names}, read with it", *(told for run in runs for told in run.warnings)),
        kept=tuple(item for one in kept for item in one) if whole else None,
        earlier=tuple(run.path for run in earlier),
    )


def _read_file(path: Path, *, tolerate_damage: bool, keep_detections: bool) -> RecordedRun:
    """One file of a recording, all of it checked."""
    reader = LinearReader(path, topics=(DETECTIONS_TOPIC,) if keep_detections else ())
    header: RunHeader | None = None
    lost: dict[str, dict[str, str]] = {}
    kept, room = [], KEPT_BYTES if keep_detections else 0
    for record in _records(reader, path):
        match record:
            case Message(log_time=t_ns, data=data):
                room -= len(data) + KEPT_OVERHEAD_BYTES
                if room > 0:
                    kept.append((t_ns, data))
                else:
                    kept.clear()
            case Attachment(name=name, data=data) if name == SETUP_NAME and header is None:
                header = _header(path, data)
            case Metadata(name=name, metadata=metadata):
                lost[name] = metadata
            case _:
                pass
    if not reader.is_mcap:
        raise InputError(f"{path}: not an MCAP file")
    if reader.damage is not None and not tolerate_damage:
        raise InputError(f"{path}: {damage_text(reader.damage)}: run `dnb-edge runs recover {path}`")
    if header is None:
        raise InputError(f"{path}: not a recording of dnb-edge: it has no {SETUP_NAME}")
    lost_messages, warnings = _losses(lost)
    return RecordedRun(
        path=path,
        header=header,
        counts=reader.tally.counts,
        first_t_ns=reader.tally.first_t_ns,
        last_t_ns=reader.tally.last_t_ns,
        lost_messages=lost_messages,
        damage=reader.damage,
        warnings=warnings,
        kept=tuple(kept) if room > 0 else None,
    )


def iter_frames(path: Path) -> Iterator[Frame]:
    """The recorded pictures with their stamps and the source's own frame numbers, as JPEG, of all files of the recording.

    Those in the rings beside the files are among them, each picture once, in the order of their stamps. Raises InputError.
    """
    last_t_ns: int | None = None
    for file in (*chain_of(read_head(path)).earlier, path):
        ring = itertools.chain.from_iterable(_file_frames(one, whole=False) for one in pictures_files(file))
        own = _file_frames(file, whole=file == path)
        for frame in heapq.merge(own, ring, key=lambda frame: frame.t_ns):
            if last_t_ns is None or frame.t_ns > last_t_ns:
                last_t_ns = frame.t_ns
                yield frame


def iter_told(path: Path, kind: type[T]) -> Iterator[T]:
    """The recorded events of one kind, such as `Health`, of all files of the recording, in order. Raises InputError."""
    topic = EVENT_TOPICS[kind]
    for file in (*chain_of(read_head(path)).earlier, path):
        for _, message in _messages(LinearReader(file, topics=(topic,))):
            yield _decoded(file, topic, kind, message.data, message.log_time)


def _file_frames(path: Path, *, whole: bool) -> Iterator[Frame]:
    note: ImageNote | None = None
    reader = LinearReader(path, topics=(IMAGE_NOTE_TOPIC, IMAGE_TOPIC))
    for topic, message in _messages(reader):
        if topic == IMAGE_NOTE_TOPIC:
            note = _decoded(path, topic, ImageNote, message.data, message.log_time)
        elif topic == IMAGE_TOPIC and note is not None and note.t_ns == message.log_time:
            yield _frame(path, note, message)
            note = None
    if not reader.is_mcap:
        raise InputError(f"{path}: not an MCAP file")
    if whole and reader.damage is not None:
        raise InputError(f"{path}: {damage_text(reader.damage)}: run `dnb-edge runs recover {path}`")


def damage_text(damage: Damage) -> str:
    """What `damage` means, in a few words for a message."""
    if damage.truncated:
        return f"the recording is truncated ({damage.reason}, byte {damage.offset})"
    return f"the recording is damaged ({damage.reason}, byte {damage.offset})"


def _records(reader: LinearReader, path: Path) -> Iterator[Record]:
    try:
        yield from reader.records()
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such recording") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def _messages(reader: LinearReader) -> Iterator[tuple[str, Message]]:
    """The reader's messages with their topics; one whose channel is unknown is left out, since nobody can say what it is."""
    for record in _records(reader, reader.path):
        if isinstance(record, Message) and (topic := reader.tally.topic(record.channel_id)) is not None:
            yield topic, record


def _decoded(path: Path, topic: str, kind: type[T], text: bytes, t_ns: int) -> T:
    try:
        return wire.from_json(kind, text)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: a message of {topic} at {t_ns} ns is malformed: {error}") from error


def _header(path: Path, data: bytes) -> RunHeader:
    try:
        return header_from_json(data)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def frame_of(note: ImageNote, data: bytes) -> Frame:
    """The recorded frame that `note` tells of, from its picture's message. Raises `ValueError` where that is malformed."""
    return Frame(
        sequence=note.sequence,
        t_ns=note.t_ns,
        stamp_source=note.stamp_source,
        width_px=note.width_px,
        height_px=note.height_px,
        jpeg=protobuf.bytes_field(data, COMPRESSED_IMAGE_DATA_FIELD),
    )


def _frame(path: Path, note: ImageNote, message: Message) -> Frame:
    try:
        return frame_of(note, message.data)
    except ValueError as error:
        raise InputError(f"{path}: the picture at {message.log_time} ns is malformed: {error}") from error


def _losses(metadata: dict[str, dict[str, str]]) -> tuple[int, tuple[str, ...]]:
    """Messages lost, and what to tell about it."""
    warnings = []
    lost_messages = _count(metadata.get(LOSS_METADATA_NAME, {}).get("messages"))
    if lost_messages:
        warnings.append(f"{lost_messages} messages were not recorded, the disk could not keep up")
    recovery = metadata.get(RECOVERY_METADATA_NAME)
    if recovery is not None:
        bad_parts = _count(recovery.get("bad_parts"))
        lost_messages += bad_parts + _count(recovery.get("orphans"))
        warnings.append(f"recovered from {recovery.get('from', 'a damaged file')}, {bad_parts} damaged parts left out")
    return lost_messages, tuple(warnings)


def _count(text: str | None) -> int:
    return int(text) if text is not None and text.isdecimal() and len(text) < MOST_DIGITS else 0
