"""Bringing a recording back that was cut short by a power cut, a crash or a full disk.

Knows how to copy every whole message of a damaged file into a new one, with an index, and to check the copy before it
gets a final name; `finish` knows how to end one that was only cut short where it stands. A file that is being recorded now
is left alone. No whole record is ever touched, and an original goes only when all of it that is whole is safely in the copy.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record import names
from dnb_edge.record.channels import EVENT_TOPICS
from dnb_edge.record.durable import PART_SUFFIX, DurableFile, sync_directory
from dnb_edge.record.finish import MOST_CUT_BYTES, finish_in_place
from dnb_edge.record.header import RECOVERY_METADATA_NAME, SETUP_NAME
from dnb_edge.record.scan import LinearReader, Record
from dnb_edge.values import Lap

COPY_SUFFIX = ".recovering"
CHUNK_SIZE_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """What came of one damaged file."""

    source: Path
    path: Path
    """The recovered recording."""
    messages: int
    laps: int
    bad_parts: int
    """Parts inside the file that were damaged and left out; the file's torn end is not counted."""
    orphans: int
    """Whole messages left out because the part that described their channel was damaged."""
    cut_bytes: int
    """Bytes behind the last whole record."""
    original_kept: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Leftover:
    """A file that could not be recovered, and why, in one line."""

    source: Path
    reason: str


def damaged_files(directory: Path) -> list[Path]:
    """The `.part` files in `directory`, by name. Raises InputError where there is no such directory."""
    if not directory.is_dir():
        raise InputError(f"{directory}: there is no such directory")
    return sorted(directory.glob(f"*{PART_SUFFIX}"))


def recover_directory(directory: Path, *, leave: Collection[Path] = ()) -> list[Recovery | Leftover]:
    """Recover each `.part` in `directory` but those in `leave`; one that fails does not stop the others. Raises InputError."""
    results: list[Recovery | Leftover] = []
    for path in damaged_files(directory):
        if path in leave:
            continue
        try:
            results.append(recover_file(path))
        except (InputError, WorkError) as error:
            results.append(Leftover(source=path, reason=str(error)))
    return results


def recover_file(path: Path) -> Recovery:
    """Make `path`, or a copy of all that is whole in it, a whole recording with its final name.

    A `.part` that was only cut short is ended where it stands. Everything else is copied and the copy checked: a `.part` gives
    its own name to the copy and is removed, unless something inside it was damaged; any other file stays, and the copy is
    called `-recovered`. Raises InputError where there is nothing to recover or the file is being recorded now, WorkError where
    the disk fails.
    """
    with _locked(path):
        if path.name.endswith(PART_SUFFIX) and (recovery := _finished(path)) is not None:
            return recovery
        reader = LinearReader(path, skip_bad_parts=True)
        target = _create_copy(path)
        try:
            copy = _Copy(target)
            copy.take_all(_records(reader, path))
            if not reader.is_mcap:
                raise InputError(f"{path}: not an MCAP file")
            if reader.complete and not path.name.endswith(PART_SUFFIX):
                raise InputError(f"{path}: the recording is whole, there is nothing to recover")
            if not copy.has_setup:
                raise InputError(f"{path}: nothing to recover: it was cut short before its header was saved")
            copy.finish(path.name, reader.bad_parts)
            _verify(path, target, copy.digest())
            size_bytes = path.stat().st_size
            if not target.finish():
                raise WorkError(f"{target.path}: cannot be written: {target.failure}")
        except (InputError, WorkError):
            target.abandon()
            target.path.unlink(missing_ok=True)
            raise
        cut_bytes = 0 if reader.complete else size_bytes - reader.good_bytes
        original_kept = not path.name.endswith(PART_SUFFIX) or reader.bad_parts > 0 or cut_bytes > MOST_CUT_BYTES
        _put_away(path, remove=not original_kept)
    return Recovery(
        source=path,
        path=target.path,
        messages=copy.messages,
        laps=copy.laps,
        bad_parts=reader.bad_parts,
        orphans=copy.orphans,
        cut_bytes=cut_bytes,
        original_kept=original_kept,
    )


def _finished(path: Path) -> Recovery | None:
    """What came of ending the file where it stands; None where it must be copied."""
    final = names.recovered_name(path)
    try:
        final.with_name(final.name + COPY_SUFFIX).unlink(missing_ok=True)
        done = finish_in_place(path, final)
    except OSError as error:
        raise WorkError(f"{path}: cannot be finished: {error.strerror}") from error
    if done is None:
        return None
    return Recovery(
        source=path,
        path=final,
        messages=sum(done.counts.values()),
        laps=done.counts.get(EVENT_TOPICS[Lap], 0),
        bad_parts=0,
        orphans=0,
        cut_bytes=done.cut_bytes,
        original_kept=False,
    )


class _Copy:
    """The new file while records are copied to it."""

    def __init__(self, target: DurableFile) -> None:
        self._target = target
        # The writer only ever writes and tells, which is what a DurableFile can do.
        stream = cast("IO[bytes]", target)
        self._writer = Writer(
            stream, chunk_size=CHUNK_SIZE_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        self._writer.start(profile="", library="dnb-edge recover")
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, tuple[int, str]] = {}
        self._digest = hashlib.sha256()
        self.messages = 0
        self.laps = 0
        self.orphans = 0
        self.has_setup = False

    def take_all(self, records: Iterator[Record]) -> None:
        """Copy all of `records`."""
        for record in records:
            self._take(record)
            if self._target.failure is not None:
                raise WorkError(f"{self._target.path}: cannot be written: {self._target.failure.strerror}")

    def finish(self, origin: str, bad_parts: int) -> None:
        """Say where the copy comes from, and end it."""
        note = {"from": origin, "bad_parts": str(bad_parts), "orphans": str(self.orphans)}
        self._writer.add_metadata(RECOVERY_METADATA_NAME, note)
        self._writer.finish()  # type: ignore[no-untyped-call]
        if not self._target.sync_new():
            raise WorkError(f"{self._target.path}: cannot be written: {self._target.failure}")

    def digest(self) -> str:
        """A fingerprint of all messages, to compare with the file read back."""
        return self._digest.hexdigest()

    def _take(self, record: Record) -> None:
        match record:
            case Schema():
                if record.id not in self._schemas:
                    self._schemas[record.id] = self._writer.register_schema(record.name, record.encoding, record.data)
            case Channel():
                self._take_channel(record)
            case Message():
                self._take_message(record)
            case Attachment():
                self.has_setup = self.has_setup or record.name == SETUP_NAME
                self._writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            case Metadata():
                self._writer.add_metadata(record.name, record.metadata)
            case _:
                pass

    def _take_channel(self, record: Channel) -> None:
        if record.id in self._channels or record.schema_id not in self._schemas:
            return
        number = self._writer.register_channel(
            record.topic, record.message_encoding, self._schemas[record.schema_id], record.metadata
        )
        self._channels[record.id] = (number, record.topic)

    def _take_message(self, record: Message) -> None:
        # A channel is described in the chunk of its first message; where that one is damaged, the rest means nothing.
        if record.channel_id not in self._channels:
            self.orphans += 1
            return
        number, topic = self._channels[record.channel_id]
        self._writer.add_message(number, record.log_time, record.data, record.publish_time, record.sequence)
        _add_to_digest(self._digest, topic, record)
        self.messages += 1
        self.laps += topic == EVENT_TOPICS[Lap]


def _verify(path: Path, target: DurableFile, expected: str) -> None:
    """Read the copy back whole. Raises WorkError where it is not what was written."""
    reader = LinearReader(target.path)
    digest = hashlib.sha256()
    topics: dict[int, str] = {}
    for record in _records(reader, path):
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            _add_to_digest(digest, topics[record.channel_id], record)
    if not reader.complete or digest.hexdigest() != expected:
        raise WorkError(f"{target.path}: the copy does not read back as written; {path} is left as it is")


def _add_to_digest(digest: hashlib._Hash, topic: str, record: Message) -> None:
    head = f"{topic}\n{record.log_time}\n{record.publish_time}\n{record.sequence}\n{len(record.data)}\n"
    digest.update(head.encode())
    digest.update(record.data)


def _records(reader: LinearReader, path: Path) -> Iterator[Record]:
    try:
        yield from reader.records()
    except OSError as error:
        raise WorkError(f"{path}: cannot be read: {error.strerror}") from error


def _create_copy(path: Path) -> DurableFile:
    final = names.recovered_name(path)
    try:
        # Left by a recovery that was itself interrupted; the lock on `path` says that no other one is at it now.
        final.with_name(final.name + COPY_SUFFIX).unlink(missing_ok=True)
        return DurableFile(final, suffix=COPY_SUFFIX)
    except OSError as error:
        raise WorkError(f"{final}: cannot be written: {error.strerror}") from error


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock that a recorder has on its file. Raises InputError where it is taken or the file cannot be read."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"{path}: is being recorded just now; stop the run first") from error
        yield
    finally:
        os.close(descriptor)


def _put_away(path: Path, *, remove: bool) -> None:
    """Remove a `.part` that is now whole elsewhere; rename one that lost something, so that it is not tried again."""
    try:
        if remove:
            path.unlink()
        elif path.name.endswith(PART_SUFFIX):
            path.rename(path.with_name(path.name.removesuffix(PART_SUFFIX) + ".damaged"))
        else:
            return
        sync_directory(path.parent)
    except OSError as error:
        raise WorkError(f"{path}: recovered, but the damaged file cannot be put away: {error.strerror}") from error
