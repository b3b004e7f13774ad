"""Copies finished recordings home: which of them, with what lies beside them, and how far that came.

A run is all its files that go on from one another, with a judge's edits, its name for people and its pictures. The one being
recorded is never touched, nor anything deleted. Knows recordings; how a file comes onto a stick, `stick` knows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.archive.index import RunIndex
from dnb_edge.archive.label import label_path
from dnb_edge.archive.stick import NoRoom, Pace, SourceFailed, Stick, StickFailed, TooLarge
from dnb_edge.archive.stick_names import plain_name, plain_names
from dnb_edge.archive.stored import FileState, StoredRecording
from dnb_edge.errors import InputError
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.edits import edits_path
from dnb_edge.record.names import pictures_files

CLUSTER_BYTES = 128 * 1024
"""What a file takes is a multiple of this at worst (exFAT)."""
SPARE_BYTES = 1 << 20
"""For folders and the manifest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFile:
    """A file to be copied."""

    path: Path
    name: str
    """On the stick, from the box's folder on."""
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """A run with all that belongs to it."""

    run: str
    """Name of the file by which it is read."""
    files: tuple[SourceFile, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NotCopied:
    """A run, or a file of one, that is not on the stick, and why."""

    run: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TakenHome:
    """What came of it."""

    directory: str
    """Where the copies lie."""
    copied: tuple[str, ...]
    """Runs of which something was copied now, and all of which is there."""
    already: tuple[str, ...]
    """Runs all of which was there before."""
    files: int
    """Copied now."""
    copied_bytes: int
    left: tuple[NotCopied, ...]
    """Runs that are not for copying, such as the one being recorded."""
    missing: tuple[NotCopied, ...]
    """Runs that were to be copied and are not there."""
    stopped: str | None
    """Why it came to an end before all was copied, in one line; None where it did not."""
    full: bool
    """Whether that is for want of room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far it is."""

    run: str
    runs_done: int
    runs: int
    done_bytes: int
    total_bytes: int


Tell = Callable[[Progress], None]


def take_home(
    directory: Path,
    place: Path,
    *,
    host: str,
    pictures: bool = True,
    check: bool = False,
    pace: Pace | None = None,
    tell: Tell = lambda _: None,
) -> TakenHome:
    """Copies all finished runs in `directory` that are not there yet into `place`/dnb-edge/`host`, the latest first.

    `check` reads what is there again instead of believing the manifest. Whatever stops it, only whole, checked files are left
    there. Raises `InputError` where `directory` cannot be read or nothing can be written at `place`.
    """
    if not directory.is_dir():
        raise InputError(f"{directory}: there is no such directory")
    if not place.is_dir():
        raise InputError(f"{place}: there is no such directory: is the stick mounted?")
    wanted, left = sorted_out(RunIndex(directory).runs())
    bundles = bundled(wanted, pictures=pictures)
    with Stick(place, plain_name(host), pace=pace) as stick:
        work = _Work(stick, bundles, check=check, tell=tell)
        work.do()
    return TakenHome(
        directory=str(stick.path),
        copied=tuple(work.copied),
        already=tuple(work.already),
        files=work.files,
        copied_bytes=work.copied_bytes,
        left=left,
        missing=tuple(work.missing),
        stopped=work.stopped,
        full=work.full,
    )


def sorted_out(runs: Sequence[StoredRecording]) -> tuple[tuple[StoredRecording, ...], tuple[NotCopied, ...]]:
    """(the runs to copy, in their order; those that are left, and why)."""
    found = [(run, _why_left(run)) for run in runs]
    wanted = tuple(run for run, why in found if why is None)
    return wanted, tuple(NotCopied(run=run.last.path.name, why=why) for run, why in found if why is not None)


def bundled(runs: Sequence[StoredRecording], *, pictures: bool) -> tuple[Bundle, ...]:
    """Each run with the files that belong to it, as they are now."""
    names = plain_names(file.stem for run in runs for file in run.files)
    return tuple(Bundle(run=run.last.path.name, files=tuple(_files(run, names, pictures=pictures))) for run in runs)


def room_for(sizes_bytes: Sequence[int]) -> int:
    """What files of these sizes take on a stick at worst, bytes."""
    return sum(-(-size // CLUSTER_BYTES) * CLUSTER_BYTES for size in sizes_bytes) + SPARE_BYTES


def _why_left(run: StoredRecording) -> str | None:
    if any(file.state is FileState.RECORDING for file in run.files):
        return "is being recorded"
    if run.state is FileState.CUT:
        return "was cut short: `dnb-edge runs recover` makes it whole"
    if run.last.head is None:
        return run.last.note or "cannot be read"
    return None


def _files(run: StoredRecording, names: dict[str, str], *, pictures: bool) -> Iterator[SourceFile]:
    for file in run.files:
        name = names[file.stem]
        found = [(file.path, name + file.path.name.removeprefix(file.stem))]
        found += [
            (beside, name + beside.name.removeprefix(file.stem))
            for beside in (edits_path(file.path), label_path(file.path))
        ]
        if pictures:
            ring = [path for path in pictures_files(file.path) if not path.name.endswith(PART_SUFFIX)]
            found += [(path, f"{name}.pictures/{plain_name(path.name)}") for path in ring]
        for path, on_stick in found:
            try:
                size_bytes = path.stat().st_size
            except FileNotFoundError:
                continue
            yield SourceFile(path=path, name=on_stick, size_bytes=size_bytes)


class _Work:
    """Copies bundles one after the other, and keeps the account."""

    def __init__(self, stick: Stick, bundles: tuple[Bundle, ...], *, check: bool, tell: Tell) -> None:
        self.copied: list[str] = []
        self.already: list[str] = []
        self.missing: list[NotCopied] = []
        self.files = 0
        self.copied_bytes = 0
        self.stopped: str | None = None
        self.full = False
        self._stick = stick
        self._bundles = bundles
        self._check = check
        self._tell = tell
        self._done_bytes = 0
        self._total_bytes = 0

    def do(self) -> None:
        """Copies until all is done or the stick takes no more."""
        todo = list(self._bundles)
        try:
            self._total_bytes = sum(file.size_bytes for one in todo for file in one.files if not self._is_known(file))
            while todo:
                self._bundle(todo[0])
                del todo[0]
            if self.files:
                self._stick.finish()
        except (NoRoom, StickFailed) as error:
            self.stopped, self.full = str(error), isinstance(error, NoRoom)
            self.missing += [NotCopied(run=one.run, why="the copying stopped before") for one in todo]

    def _bundle(self, bundle: Bundle) -> None:
        """Copies one run. Raises `NoRoom`, `StickFailed`."""
        try:
            new = [file for file in bundle.files if not self._is_there(file)]
            if not new:
                self.already.append(bundle.run)
                return
            wanted_bytes, free_bytes = room_for([file.size_bytes for file in new]), self._stick.free_bytes
            if wanted_bytes > free_bytes:
                raise NoRoom(
                    f"{self._stick.path}: the stick is full: {bundle.run} takes {wanted_bytes / 1e6:.0f} MB, "
                    f"{free_bytes / 1e6:.0f} are free"
                )
            for file in new:
                entry = self._stick.put(file.path, file.name, lambda count: self._took(bundle, count))
                self.files += 1
                self.copied_bytes += entry.size_bytes
            self.copied.append(bundle.run)
        except (SourceFailed, TooLarge) as error:
            self.missing.append(NotCopied(run=bundle.run, why=str(error)))
        finally:
            self._took(bundle, 0)

    def _is_known(self, file: SourceFile) -> bool:
        try:
            return not self._check and self._stick.is_known(file.path, file.name)
        except SourceFailed:
            # Said when it comes to be copied.
            return False

    def _is_there(self, file: SourceFile) -> bool:
        return self._is_known(file) or self._stick.has(file.path, file.name)

    def _took(self, bundle: Bundle, count: int) -> None:
        self._done_bytes += count
        self._tell(
            Progress(
                run=bundle.run,
                runs_done=len(self.copied) + len(self.already) + len(self.missing),
                runs=len(self._bundles),
                done_bytes=self._done_bytes,
                total_bytes=self._total_bytes,
            )
        )
