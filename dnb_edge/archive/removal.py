"""Deleting one run for good because somebody wants it so: its files, what a judge decided, its name, its pictures.

What goes by itself when room is short `record.retention` knows. Knows runs; knows nothing of who may delete.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dnb_edge.archive.label import label_path, stem_of
from dnb_edge.archive.stored import SeenFile, StoredRecording
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.durable import PART_SUFFIX, sync_directory
from dnb_edge.record.edits import edits_path
from dnb_edge.record.names import pictures_directory
from dnb_edge.record.retention import DAMAGED_SUFFIX, PIN_SUFFIX, Removal, remove


def remove_run(run: StoredRecording) -> tuple[Removal, ...]:
    """Deletes the run, its last file first, so that what a fault leaves is a shorter run; what went.

    Raises `InputError` where one of its files is in use or has changed its name meanwhile, and nothing has gone then;
    `WorkError` where the disk refuses.
    """
    unfinished = [path for file in run.files if (path := _unfinished(file.path)).is_file()]
    with _locked(dict.fromkeys([*(file.path for file in run.files), *unfinished])):
        removals = tuple(_removal(file) for file in reversed(run.files))
        for removal in removals:
            remove(removal)
        try:
            for folder in {file.path.parent for file in run.files}:
                sync_directory(folder)
        except OSError as error:
            raise WorkError(f"{error.filename}: cannot be deleted for good: {error.strerror}") from error
    return removals


def _removal(file: SeenFile) -> Removal:
    path, stem = file.path, stem_of(file.path)
    # The recording goes first: never are its edits away while it lies there as if nobody had judged it.
    beside = (
        *((_unfinished(path),) if path != _unfinished(path) else ()),
        path.with_name(f"{stem}.mcap{DAMAGED_SUFFIX}"),
        edits_path(path),
        label_path(path),
        path.with_name(stem + PIN_SUFFIX),
    )
    place = pictures_directory(path)
    pictures = sorted(one for one in place.iterdir() if one.is_file()) if place.is_dir() else []
    files = (path, *(one for one in beside if one.is_file()), *pictures)
    return Removal(
        name=stem,
        pictures_only=False,
        files=files,
        size_bytes=sum(one.stat().st_size for one in files),
        why="somebody deleted it",
    )


def _unfinished(path: Path) -> Path:
    """The file that a recorder wrote, which a recovery may have left beside what it brought back."""
    return path.with_name(f"{stem_of(path)}.mcap{PART_SUFFIX}")


@contextmanager
def _locked(paths: Iterable[Path]) -> Iterator[None]:
    """Holds the locks that recorders and recoveries have on their files. Raises `InputError` where one is taken."""
    descriptors: list[int] = []
    try:
        for path in paths:
            try:
                descriptors.append(os.open(path, os.O_RDONLY | os.O_CLOEXEC))
                fcntl.flock(descriptors[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError(f"{path}: is being recorded or recovered just now") from error
            except OSError as error:
                raise InputError(f"{path}: cannot be deleted: {error.strerror}") from error
        yield
    finally:
        for descriptor in descriptors:
            os.close(descriptor)
