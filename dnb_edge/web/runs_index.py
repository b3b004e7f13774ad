"""The one index of the recordings' directory, and the run that an id means.

Knows the index and how to refuse; knows no request.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from dnb_edge.archive.index import RunIndex
from dnb_edge.archive.stored import StoredRecording
from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import Refused


@lru_cache(maxsize=8)
def index_of(directory: Path) -> RunIndex:
    """The index of `directory`, the same for all who ask: it remembers what it has read."""
    return RunIndex(directory)


def found_run(box: Box, run_id: str, *, within_s: float = 0.0) -> StoredRecording:
    """The run with this id, as it was at most `within_s` ago. Raises `Refused` (404) where there is none. Blocks: call it in a
    thread.
    """
    run = index_of(box.settings.runs).find(run_id, within_s=within_s)
    if run is None:
        raise Refused(404, "not-found", "There is no such recording: it may have been deleted, look at the list.")
    return run


def find_run(box: Box, run_id: str) -> Path:
    """The file by which that run is read, which may still end in `.part`. As `found_run` otherwise."""
    return found_run(box, run_id).last.path
