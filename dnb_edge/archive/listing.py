"""One line for each recording in a directory: what it is, how it stands, and what is the matter with it.

Knows recordings; knows nothing of who reads the list.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from dnb_edge.core import CoreSetup
from dnb_edge.errors import InputError
from dnb_edge.record.channels import EVENT_TOPICS
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.header import RunHeader
from dnb_edge.record.identity import identity_of
from dnb_edge.record.reader import damage_text, read_run
from dnb_edge.values import Lap


class RunState(StrEnum):
    """How a recording in a directory stands."""

    WHOLE = "whole"
    PART = "part"
    """Being recorded, or cut short."""
    DAMAGED = "damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedRun:
    """One line of the list. Durations are from first to last stamp."""

    file: str
    state: RunState
    name: str | None
    source: str | None
    duration_s: float | None
    laps: int | None
    size_bytes: int
    note: str | None
    version: str | None = None
    """Of the entry; the entry's name is `name`."""
    checkpoint_sha256: str | None = None
    session: str | None = None
    track: str | None = None
    """Digest of the track; the next two of calibration and rules. None where the setup cannot be read."""
    calibration: str | None = None
    rules: str | None = None


def listed_run(path: Path, *, part_of: Path | None = None) -> ListedRun:
    """What `list` says of one file; a file that cannot be read is listed with the reason. `part_of`: what it is read with."""
    size_bytes = path.stat().st_size
    part = path.name.endswith(PART_SUFFIX)
    nothing: dict[str, Any] = dict.fromkeys(("name", "source", "duration_s", "laps"))
    try:
        run = read_run(path, tolerate_damage=True)
    except InputError as error:
        state = RunState.PART if part else RunState.DAMAGED
        return ListedRun(file=path.name, state=state, size_bytes=size_bytes, note=str(error), **nothing)
    whole = RunState.WHOLE if run.damage is None else RunState.DAMAGED
    duration_s = None
    if run.first_t_ns is not None and run.last_t_ns is not None:
        duration_s = (run.last_t_ns - run.first_t_ns) / 1e9
    notes = [
        *([] if part_of is None else [f"part of {part_of.name}"]),
        *run.warnings,
        *([] if run.damage is None else [damage_text(run.damage)]),
    ]
    return ListedRun(
        file=path.name,
        state=RunState.PART if part else whole,
        name=run.header.name,
        source=run.header.source.uri,
        duration_s=duration_s,
        laps=run.counts.get(EVENT_TOPICS[Lap], 0),
        size_bytes=size_bytes,
        note="; ".join(notes) or None,
        version=run.header.driver.version or None,
        checkpoint_sha256=run.header.driver.checkpoint_sha256,
        session=run.header.session,
        **_identity(run.header),
    )


def _identity(header: RunHeader) -> dict[str, str]:
    """Digests of track, calibration and rules; nothing where another version wrote a setup that cannot be read."""
    try:
        return identity_of(CoreSetup.from_dict(header.setup["core"])).to_dict()
    except (InputError, KeyError, TypeError, ValueError):
        return {}
