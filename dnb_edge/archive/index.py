"""All recordings in a directory at a glance, fast for a thousand of them and right while one is being recorded.

Each file is looked into once and again only when it changed; of one that is being recorded only what came since. Knows
recordings; knows nothing of who reads the list.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from dnb_edge import wire
from dnb_edge.archive.glance import ChunkPlace, Walked, chunks_of, glance, messages, walk
from dnb_edge.archive.joined import joined
from dnb_edge.archive.label import stem_of
from dnb_edge.archive.stored import FileState, SeenFile, StoredRecording
from dnb_edge.errors import InputError
from dnb_edge.race.marshal import Marshalled, apply
from dnb_edge.record.chain import Head, read_head
from dnb_edge.record.channels import EVENT_TOPICS
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.edits import read_edits
from dnb_edge.record.retention import is_locked
from dnb_edge.values import Crossing, Lap

E = TypeVar("E")

_LAP_TOPIC = EVENT_TOPICS[Lap]
_MARK_BYTES = 64
"""A chunk's stamps, lengths and checksum."""


class _Kept:
    """What is remembered of one file, as long as it is the same one."""

    def __init__(self, inode: int) -> None:
        self.inode = inode
        self.mark: tuple[int, bytes] | None = None
        """Where some of its bytes stand, which another file that came to this name and inode would not have there."""
        self.key: tuple[int, int] | None = None
        """Its size and its time at the last look."""
        self.seen: SeenFile | None = None
        self.head: Head | None = None
        self.going_on: Walked | None = None
        self.chunks: tuple[ChunkPlace, ...] | None = None
        """Of a file without an end."""
        self.laps: dict[int, tuple[Lap, ...]] = {}
        """By the offset of their chunk."""
        self.laps_key: tuple[int, int] | None = None
        """Its size and its time when they were read."""


class RunIndex:
    """The recordings in one directory. Methods may be called from several threads; they read files and take their time."""

    def __init__(self, directory: Path) -> None:
        """Nothing is read yet; the directory need not be there."""
        self.directory = directory
        self._kept: dict[str, _Kept] = {}
        self._lock = threading.Lock()
        self._last: tuple[float, tuple[StoredRecording, ...]] | None = None

    def runs(self, *, within_s: float = 0.0) -> tuple[StoredRecording, ...]:
        """All runs, the latest first; none where the directory is not there. Raises `InputError` where it cannot be read.

        As they were at most `within_s` ago, where many ask.
        """
        last, now_s = self._last, time.monotonic()
        if last is not None and now_s - last[0] < within_s:
            return last[1]
        found = self._runs()
        self._last = (now_s, found)
        return found

    def changed(self) -> None:
        """Somebody has changed something: whoever asks next sees it."""
        self._last = None

    def _runs(self) -> tuple[StoredRecording, ...]:
        try:
            entries = list(os.scandir(self.directory))
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise InputError(f"{self.directory}: cannot be read: {error.strerror}") from error
        names = {entry.name for entry in entries}
        with self._lock:
            wanted = (entry for entry in entries if _is_recording(entry) and not _is_whole_elsewhere(entry.name, names))
            files = [seen for entry in wanted if (seen := self._look(entry)) is not None]
            for gone in self._kept.keys() - {file.stem for file in files}:
                del self._kept[gone]
        return tuple(sorted(joined(files, names), key=lambda run: (-run.ordered_ns, run.id)))

    def find(self, wanted: str, *, within_s: float = 0.0) -> StoredRecording | None:
        """The run with this id; None where there is none. As it was at most `within_s` ago."""
        return next((run for run in self.runs(within_s=within_s) if run.id == wanted), None)

    def laps(self, run: StoredRecording) -> tuple[Lap, ...]:
        """The laps as the race said them. Raises `InputError` where the file is damaged."""
        with self._lock:
            return tuple(lap for file in run.files for lap in self._file_laps(file))

    def marshalled(self, run: StoredRecording) -> Marshalled:
        """The laps after a judge's edits; one that a judge made has no similarity here. Raises `InputError`."""
        laps = self.laps(run)
        if run.edited and run.identity is not None:
            log = read_edits(run.last.path, run.identity)
            if log.edits:
                return apply(laps, log.edits, tuple(self.events(run, Crossing)))
        return apply(laps, ())

    def events(
        self, run: StoredRecording, kind: type[E], *, from_ns: int | None = None, to_ns: int | None = None
    ) -> Iterator[E]:
        """The recorded events of one kind, of all chunks that reach into that time. Raises `InputError`."""
        for file in run.files:
            if file.contents is None:
                continue
            with self._lock:
                chunks = self._chunks(file)
            wanted = [
                chunk
                for chunk in chunks
                if (from_ns is None or chunk.end_t_ns >= from_ns) and (to_ns is None or chunk.start_t_ns <= to_ns)
            ]
            for _, _, message in messages(file.path, file.contents.topics, wanted, (EVENT_TOPICS[kind],)):
                yield _decoded(file.path, kind, message.data)

    def _look(self, entry: os.DirEntry[str]) -> SeenFile | None:
        """The file as it is now; None where it has gone."""
        path = Path(entry.path)
        try:
            found = entry.stat()
        except FileNotFoundError:
            return None
        stem, key = stem_of(path), (found.st_size, found.st_mtime_ns)
        kept = self._kept.get(stem)
        known = kept is not None and kept.key == key and kept.seen is not None and kept.seen.path == path
        if kept is None or kept.inode != found.st_ino or not (known or _has_mark(kept, path)):
            kept = self._kept[stem] = _Kept(found.st_ino)
        if kept.seen is None or not known:
            kept.seen, kept.key = _seen(kept, path, *key), key
        if path.name.endswith(PART_SUFFIX):
            # Whether somebody writes it can change without its content.
            state = FileState.RECORDING if is_locked(path) else FileState.CUT
            kept.seen = replace(kept.seen, state=state)
        return kept.seen

    def _chunks(self, file: SeenFile) -> tuple[ChunkPlace, ...]:
        kept = self._kept.get(file.stem)
        if file.contents is not None and file.contents.complete:
            return chunks_of(file.path) or ()
        return walk(file.path)[1].chunks if kept is None or kept.chunks is None else kept.chunks

    def _file_laps(self, file: SeenFile) -> Iterable[Lap]:
        if file.contents is None or not file.contents.counts.get(_LAP_TOPIC):
            return ()
        # Somebody may know a run by another index, or it has gone since: nothing is remembered then.
        kept = self._kept.get(file.stem) or _Kept(0)
        if kept.laps_key is None or kept.laps_key != kept.key:
            last = max(kept.laps, default=-1)
            fresh = [chunk for chunk in self._chunks(file) if chunk.offset > last]
            found: dict[int, list[Lap]] = {}
            for chunk, _, message in messages(file.path, file.contents.topics, fresh, (_LAP_TOPIC,)):
                found.setdefault(chunk.offset, []).append(_decoded(file.path, Lap, message.data))
            kept.laps |= {offset: tuple(laps) for offset, laps in found.items()}
            kept.laps_key = kept.key
        return [lap for offset in sorted(kept.laps) for lap in kept.laps[offset]]


def _has_mark(kept: _Kept, path: Path) -> bool:
    """Whether the file has grown out of the one that is remembered, or got its final name."""
    if kept.mark is None:
        return False
    offset, expected = kept.mark
    return _bytes_at(path, offset) == expected


def _bytes_at(path: Path, offset: int) -> bytes | None:
    """Some bytes of the file from `offset` on; None where it cannot be read."""
    try:
        with path.open("rb") as stream:
            stream.seek(offset)
            return stream.read(_MARK_BYTES)
    except OSError:
        return None


def _is_recording(entry: os.DirEntry[str]) -> bool:
    return entry.name.endswith((".mcap", f".mcap{PART_SUFFIX}")) and not entry.name.startswith(".") and entry.is_file()


def _is_whole_elsewhere(name: str, names: set[str]) -> bool:
    """Whether it is what a recovery made a whole file of, and did not come to remove."""
    return name.endswith(PART_SUFFIX) and name.removesuffix(PART_SUFFIX) in names


def _seen(kept: _Kept, path: Path, size_bytes: int, modified_ns: int) -> SeenFile:
    """What there is to see in the file now; what is remembered of it goes on."""
    unfinished = path.name.endswith(PART_SUFFIX)
    contents, note = None, None
    state = FileState.CUT if unfinished else FileState.FINISHED
    try:
        if kept.head is None:
            head = read_head(path)
            # The setup takes hundreds of kilobytes, and nobody here wants it.
            kept.head = replace(head, header=replace(head.header, setup={}, config={}))
        contents = None if unfinished else glance(path)
        if contents is None:
            kept.going_on, now = walk(path, kept.going_on)
            kept.chunks, contents = now.chunks, now.contents()
            if kept.going_on.chunks and (found := _bytes_at(path, kept.going_on.chunks[-1].offset)) is not None:
                kept.mark = (kept.going_on.chunks[-1].offset, found)
            if not unfinished:
                state, note = FileState.DAMAGED, "it does not end as a finished recording does"
    except InputError as error:
        state = state if unfinished else FileState.DAMAGED
        note = str(error).replace(str(path), path.name)
    return SeenFile(
        path=path,
        size_bytes=size_bytes,
        modified_ns=modified_ns,
        state=state,
        head=kept.head,
        contents=contents,
        note=note,
    )


def _decoded(path: Path, kind: type[E], text: bytes) -> E:
    try:
        return wire.from_json(kind, text)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: a recorded event is malformed: {error}") from error
