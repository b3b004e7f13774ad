"""A run, its laps and the disk as the API says them.

Knows the index's values and the API's shapes; knows no request.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

from dnb_edge.archive.label import stem_of, whole_text
from dnb_edge.archive.stored import FileState, SeenFile, StoredRecording, session_id
from dnb_edge.race.marshal import Marshalled, MarshalledLap
from dnb_edge.race.standings import official_s
from dnb_edge.report.table import printable
from dnb_edge.web.runs_asked import ListAsked
from dnb_edge.web.runs_models import Choice, LapLine, RunDetail, RunFile, RunLine


def run_line(run: StoredRecording, *, current: str | None, best_lap_s: float | None) -> RunLine:
    """The run in the list. `current`: the name of the recording that goes on just now, as the daemon says it."""
    return RunLine(**_line(run, current, best_lap_s))


def run_detail(run: StoredRecording, *, current: str | None, best_lap_s: float | None) -> RunDetail:
    """The run by itself."""
    header = None if run.last.head is None else run.last.head.header
    return RunDetail(
        **_line(run, current, best_lap_s),
        identity={} if header is None else header.identity,
        versions={} if header is None else header.versions,
    )


def is_current(run: StoredRecording, current: str | None) -> bool:
    """Whether it is being recorded just now."""
    return run.state is FileState.RECORDING or any(file.stem == current for file in run.files)


def best_lap_s(marshalled: Marshalled) -> float | None:
    """The best valid lap's time with penalties; None where there is none."""
    return min((official_s(one.lap) for one in marshalled.laps if one.lap.valid), default=None)


def file_name(file: SeenFile) -> str:
    """As its download is called: finished, whatever it is here."""
    return whole_text(f"{stem_of(file.path)}.mcap")


def lap_lines(marshalled: Marshalled) -> list[LapLine]:
    """The laps that count, then those that a judge took away."""
    counted = [_lap(one, removed=False) for one in marshalled.laps]
    return [*counted, *(_lap(one, removed=True) for one in marshalled.removed)]


def passes_filter(run: StoredRecording, asked: ListAsked) -> bool:
    """Whether the list shows it; an empty text lets everything through."""
    head = None if run.last.head is None else run.last.head.header
    words = [run.label, run.entry, run.session, *(file.path.name for file in run.files)]
    if head is not None:
        words += [head.driver.version, head.source.uri]
    haystack = "\n".join(word for word in words if word).casefold()
    return (
        all(part in haystack for part in asked.text.casefold().split())
        and (not asked.session or (run.session is not None and session_id(run.session) == asked.session))
        and asked.entry in ("", run.entry)
        and asked.state in ("", run.state.value)
        and asked.pinned in (None, run.pinned)
    )


def sessions_of(runs: Iterable[StoredRecording]) -> list[Choice]:
    """The sessions, by name."""
    counts = Counter(run.session for run in runs if run.session)
    return [Choice(id=session_id(name), name=name, runs=count) for name, count in sorted(counts.items())]


def entries_of(runs: Iterable[StoredRecording]) -> list[Choice]:
    """The entries, by name."""
    counts = Counter(run.entry for run in runs if run.entry)
    return [Choice(name=name, runs=count) for name, count in sorted(counts.items())]


def utc(unix_ns: int) -> str | None:
    """A moment as ISO 8601; None for one that no calendar has."""
    try:
        return datetime.fromtimestamp(unix_ns / 1e9, tz=UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):
        # A recording from elsewhere may say anything.
        return None


def _line(run: StoredRecording, current: str | None, best_s: float | None) -> dict[str, Any]:
    header = None if run.last.head is None else run.last.head.header
    first_ns, last_ns = run.first_t_ns, run.last_t_ns
    return {
        "id": run.id,
        "file": run.last.path.name,
        "files": [_file(file, part) for part, file in enumerate(run.files, start=1)],
        "name": run.label,
        "entry": run.entry,
        "entry_version": None if header is None else header.driver.version or None,
        "session": run.session,
        "session_id": session_id(run.session) if run.session else None,
        "source": None if header is None else header.source.uri,
        "state": run.state.value,
        "started": None if run.started_unix_ns is None else utc(run.started_unix_ns),
        "written": utc(run.last.modified_ns) or "",
        "duration_s": None if first_ns is None or last_ns is None else (last_ns - first_ns) / 1e9,
        "laps": run.laps,
        "best_lap_s": best_s,
        "size_bytes": run.size_bytes,
        "pictures_bytes": run.pictures_bytes,
        "pinned": run.pinned,
        "pinnable": run.pinnable,
        "edited": run.edited,
        "current": is_current(run, current),
        "notes": list(run.notes),
    }


def _file(file: SeenFile, part: int) -> RunFile:
    return RunFile(name=file_name(file), part=part, size_bytes=file.size_bytes, state=file.state.value)


def _lap(one: MarshalledLap, *, removed: bool) -> LapLine:
    lap = one.lap
    return LapLine(
        number=lap.number,
        car=lap.car,
        start_s=lap.start_s,
        time_s=lap.time_s,
        sigma_s=lap.sigma_s,
        official_time_s=lap.official_time_s,
        penalty_s=lap.penalty_s,
        valid=lap.valid,
        reasons=list(lap.reasons),
        suspect=list(lap.suspect),
        similarity_percent=_finite(lap.similarity_percent),
        observed_fraction=lap.observed_fraction,
        estimated=lap.estimated,
        sectors_s=_sectors(one),
        removed=removed,
        edits=[f"{edit.action.value} by {printable(edit.author)}: {printable(edit.reason)}" for edit in one.edits],
    )


def _sectors(one: MarshalledLap) -> list[float | None]:
    found = {sector.number: sector.time_s for sector in one.lap.sectors}
    return [found.get(number) for number in range(1, max(found, default=0) + 1)]


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
