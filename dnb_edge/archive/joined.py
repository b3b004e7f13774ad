"""Which files make one run: those that go on from one another.

Knows files as the index saw them, and what lies beside them; opens no recording.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from dnb_edge.archive.label import read_label, stem_of
from dnb_edge.archive.stored import SeenFile, StoredRecording, run_id
from dnb_edge.record.edits import edits_path
from dnb_edge.record.names import pictures_directory
from dnb_edge.record.retention import LABEL_SUFFIX, PIN_SUFFIX, has_own_name


def joined(files: Sequence[SeenFile], names: set[str]) -> Iterator[StoredRecording]:
    """The runs that these files make. `names`: of all that lies in their directory."""
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
