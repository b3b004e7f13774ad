"""All recordings in a directory at a glance, fast for a thousand of them and right while one is being recorded.

Each file is looked into once and again only when it changed; of one that is being recorded only what came since. Files that
go on from one another are one run. A run has an id that is no path: the same after a restart, and after its file got its final
name. Knows recordings; knows nothing of who reads the list.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

from dnb_edge import wire
from dnb_edge.archive.glance import ChunkPlace, Contents, Walked, chunks_of, glance, messages, walk
from dnb_edge.archive.label import read_label, stem_of
from dnb_edge.errors import InputError
from dnb_edge.race.marshal import Marshalled, apply
from dnb_edge.record.chain import Head, read_head
from dnb_edge.record.channels import EVENT_TOPICS
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.edits import RunIdentity, edits_path, read_edits
from dnb_edge.record.names import pictures_directory
from dnb_edge.record.retention import LABEL_SUFFIX, PIN_SUFFIX, has_own_name, is_locked
from dnb_edge.values import Crossing, Lap

E = TypeVar("E")

_LAP_TOPIC = EVENT_TOPICS[Lap]
_ID_BYTES = 12
_MARK_BYTES = 64
"""A chunk's stamps, lengths and checksum."""


class FileState(StrEnum):
    """How a recording stands."""

    RECORDING = "recording"
    FINISHED = "finished"
    CUT = "cut"
    """It was cut short, and nobody finished it yet."""
    DAMAGED = "damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenFile:
    """One file of a recording."""

    path: Path
    size_bytes: int
    modified_ns: int
    state: FileState
    head: Head | None
    """What it says before its first message, without the setup and the configuration; None where that cannot be read."""
    contents: Contents | None
    note: str | None
    """What is the matter with it, in a line; None where nothing is."""

    @property
    def stem(self) -> str:
        """Its name without ending."""
        return stem_of(self.path)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecording:
    """One run: a file, or several that go on from one another."""

    id: str
    files: tuple[SeenFile, ...]
    """Oldest first."""
    missing: str | None
    """Name of the file that should come first and is not there."""
    label: str | None
    pinned: bool
    pinnable: bool
    """False where it is never deleted anyway, since somebody renamed it."""
    edited: bool
    """A judge has decided something about it."""
    pictures_bytes: int

    @property
    def last(self) -> SeenFile:
        """The file by which all of it is read."""
        return self.files[-1]

    @property
    def state(self) -> FileState:
        """How its last file stands."""
        return self.last.state

    @property
    def entry(self) -> str | None:
        """Who drives; None where the file cannot be read."""
        return None if self.last.head is None else self.last.head.header.driver.name

    @property
    def session(self) -> str | None:
        """Name of its session; None where nobody named one."""
        return None if self.last.head is None else self.last.head.header.session

    @property
    def laps(self) -> int | None:
        """How many the race counted; None where that cannot be read."""
        counts = [file.contents.counts.get(_LAP_TOPIC, 0) for file in self.files if file.contents is not None]
        return sum(counts) if counts else None

    @property
    def first_t_ns(self) -> int | None:
        """Stamp of its first message, the source's clock."""
        stamps = (file.contents.first_t_ns for file in self.files if file.contents is not None)
        return min((one for one in stamps if one is not None), default=None)

    @property
    def last_t_ns(self) -> int | None:
        """Stamp of its last message."""
        stamps = (file.contents.last_t_ns for file in self.files if file.contents is not None)
        return max((one for one in stamps if one is not None), default=None)

    @property
    def started_unix_ns(self) -> int | None:
        """When it began, by the system's clock then; None for a source whose clock has no such time."""
        offset_ns = None if self.last.head is None else self.last.head.header.wall_offset_ns
        return None if offset_ns is None or self.first_t_ns is None else self.first_t_ns + offset_ns

    @property
    def ordered_ns(self) -> int:
        """When it began or, where nobody knows, when its last file was written: for the order of a list."""
        started = self.started_unix_ns
        return self.last.modified_ns if started is None else started

    @property
    def size_bytes(self) -> int:
        """Of its files, without pictures beside them."""
        return sum(file.size_bytes for file in self.files)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is the matter with it, a line each."""
        told = [] if self.missing is None else [f"goes on from {self.missing}, which is not here"]
        return (*told, *(file.note for file in self.files if file.note is not None))

    @property
    def identity(self) -> RunIdentity | None:
        """What tells this recording from others; None where it cannot be read."""
        return None if self.last.head is None else RunIdentity.of(self.last.head.header, self.first_t_ns)

    @property
    def stamp(self) -> str:
        """Text that is another one as soon as anything changes that its results are made of."""
        parts = [f"{file.path.name} {file.size_bytes} {file.modified_ns}" for file in self.files]
        try:
            found = edits_path(self.last.path).stat()
            parts.append(f"edits {found.st_size} {found.st_mtime_ns}")
        except FileNotFoundError:
            pass
        return hashlib.blake2b("\n".join(parts).encode(), digest_size=16).hexdigest()


def run_id(stem: str) -> str:
    """The id of the run whose first file is called `stem`."""
    return hashlib.blake2b(
        stem.encode(errors="surrogateescape"), digest_size=_ID_BYTES, person=b"dnb-edge run"
    ).hexdigest()


def session_id(name: str) -> str:
    """The id of the session of this name."""
    return hashlib.blake2b(name.encode(errors="replace"), digest_size=_ID_BYTES, person=b"dnb-edge ses").hexdigest()


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
            files = [seen for entry in entries if _is_recording(entry) and (seen := self._look(entry)) is not None]
            for gone in self._kept.keys() - {file.stem for file in files}:
                del self._kept[gone]
        return tuple(sorted(_joined(files, names), key=lambda run: (-run.ordered_ns, run.id)))

    def find(self, wanted: str) -> StoredRecording | None:
        """The run with this id; None where there is none."""
        return next((run for run in self.runs() if run.id == wanted), None)

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


def _joined(files: Sequence[SeenFile], names: set[str]) -> Iterator[StoredRecording]:
    """The runs that these files make, those that go on from one another being one."""
    by_final = {f"{file.stem}.mcap": file for file in sorted(files, key=lambda file: file.path.name)}
    taken: set[str] = set()
    gone_on = {file.head.previous for file in by_final.values() if file.head is not None}
    # First the last files of all chains; then whatever is left, which names itself in a ring.
    ends = [name for name in by_final if name not in gone_on]
    for name in (*ends, *by_final):
        if name in taken:
            continue
        chain, missing = _chain(name, by_final, taken)
        taken.update(f"{file.stem}.mcap" for file in chain)
        yield _run(chain, missing, names)


def _chain(name: str, by_final: dict[str, SeenFile], taken: set[str]) -> tuple[tuple[SeenFile, ...], str | None]:
    """(the files up to the one called `name`, oldest first; the name of the one that is missing before them)."""
    chain: list[SeenFile] = []
    before: str | None = name
    while before is not None:
        file = by_final.get(before)
        if file is None:
            break
        if before in taken or file in chain:
            # Two files that go on from the same one: it is read with the first of them.
            before = None
            break
        chain.append(file)
        before = None if file.head is None else file.head.previous
    return tuple(reversed(chain)), before


def _run(files: tuple[SeenFile, ...], missing: str | None, names: set[str]) -> StoredRecording:
    own = [file for file in files if has_own_name(file.path)]
    first = files[0].stem if missing is None else stem_of(Path(missing))
    labels = (read_label(file.path) for file in files if file.stem + LABEL_SUFFIX in names)
    return StoredRecording(
        id=run_id(first),
        files=files,
        missing=missing,
        label=next((label for label in labels if label is not None), None),
        pinned=bool(own) and all(file.stem + PIN_SUFFIX in names for file in own),
        pinnable=bool(own),
        edited=edits_path(files[-1].path).name in names,
        pictures_bytes=sum(_pictures_bytes(file.path) for file in files if f"{file.stem}.pictures" in names),
    )


def _pictures_bytes(recording: Path) -> int:
    total = 0
    try:
        for entry in os.scandir(pictures_directory(recording)):
            total += entry.stat().st_size
    except (FileNotFoundError, NotADirectoryError):
        # The ring goes on meanwhile.
        pass
    return total


def _decoded(path: Path, kind: type[E], text: bytes) -> E:
    try:
        return wire.from_json(kind, text)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: a recorded event is malformed: {error}") from error
