"""What people call a recording: a small file beside it, so that its own name, by which the others find it, stays.

`RUN.label.json` holds `{"name": "..."}`. Knows the file; knows nothing of who chose the name.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.durable import PART_SUFFIX, sync_directory
from dnb_edge.record.retention import LABEL_SUFFIX

MOST_LETTERS = 120


def stem_of(recording: Path) -> str:
    """The recording's name without ending, whether it is finished or not."""
    return recording.name.removesuffix(PART_SUFFIX).removesuffix(".mcap")


def whole_text(text: str) -> str:
    """`text` as it can be sent: what a name has that is not UTF-8 becomes a question mark."""
    return text.encode(errors="replace").decode()


def label_path(recording: Path) -> Path:
    """Where the label of `recording` lies."""
    return recording.with_name(stem_of(recording) + LABEL_SUFFIX)


def read_label(recording: Path) -> str | None:
    """What people call it; None where nobody named it, or the file holds nothing that could be a name."""
    try:
        found = json.loads(label_path(recording).read_bytes()[: 16 * MOST_LETTERS])
    except (OSError, ValueError, RecursionError):
        # A name for people: nothing depends on it.
        return None
    name = found.get("name") if isinstance(found, dict) else None
    return name if isinstance(name, str) and _fault(name) is None else None


def write_label(recording: Path, name: str | None) -> str | None:
    """Calls it `name`, or nothing any more for None or blanks; what it is called then.

    Raises `InputError` where that is no name for people, `WorkError` where the disk fails.
    """
    name = None if name is None else name.strip()
    path = label_path(recording)
    if not name:
        name = None
    elif (fault := _fault(name)) is not None:
        raise InputError(f"name: {fault}")
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        if name is None:
            path.unlink(missing_ok=True)
        else:
            with partial.open("w", encoding="utf-8") as stream:
                json.dump({"name": name}, stream)
                stream.flush()
                os.fsync(stream.fileno())
            partial.replace(path)
        sync_directory(path.parent)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise WorkError(f"{path}: the name cannot be saved: {error.strerror}") from error
    return name


def _fault(name: str) -> str | None:
    """Why this is no name, a few words; None where it is one."""
    if len(name) > MOST_LETTERS:
        return f"has {len(name)} letters, {MOST_LETTERS} at most"
    return None if name.isprintable() else "has letters that cannot be shown"
