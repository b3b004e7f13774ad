"""An archive's results as Parquet: one file with a row a lap, one beside it with a row a recording.

Knows columns and their types. Each file has its name only once it is whole. The same rows give the same bytes. pyarrow is of
the extra `cluster`.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from dnb_edge.archive.lot_score import Row, ScoredRun
from dnb_edge.archive.lots import MISSING_EXTRA
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.durable import PART_SUFFIX, sync_directory

ENDING = ".parquet"
RUNS_ENDING = ".runs.parquet"
GROUP_ROWS = 20_000
"""Rows that are written at once: they bound what waits in memory."""

_TEXT, _WHOLE, _NUMBER, _TRUTH = "text", "whole", "number", "truth"

_ENTRY = {"entry": _TEXT, "version": _TEXT, "checkpoint_sha256": _TEXT}
_CONDITIONS = {"session": _TEXT, "task": _TEXT, "track": _TEXT, "calibration": _TEXT, "rules": _TEXT, "rule_set": _TEXT}

RUN_COLUMNS: Mapping[str, Any] = {
    "error": _TEXT,
    **_ENTRY,
    **_CONDITIONS,
    "source": _TEXT,
    "started_unix_ns": _WHOLE,
    "duration_s": _NUMBER,
    "frames": _WHOLE,
    "detected_frames": _WHOLE,
    "cars": _WHOLE,
    "laps": _WHOLE,
    "warm_up_laps": _WHOLE,
    "valid_laps": _WHOLE,
    "attempted_laps": _WHOLE,
    "best_lap_s": _NUMBER,
    "completion_time_s": _NUMBER,
    "similarity_percent": _NUMBER,
    "penalties": _WHOLE,
    "penalty_s": _NUMBER,
    "incidents": [_TEXT],
    "dnf": [_TEXT],
    "edits": _WHOLE,
    "lost_messages": _WHOLE,
    "warnings": [_TEXT],
}
LAP_COLUMNS: Mapping[str, Any] = {
    **_ENTRY,
    **_CONDITIONS,
    "car": _WHOLE,
    "lap": _WHOLE,
    "warm_up": _TRUTH,
    "start_t_ns": _WHOLE,
    "end_t_ns": _WHOLE,
    "start_s": _NUMBER,
    "time_s": _NUMBER,
    "sigma_s": _NUMBER,
    "official_time_s": _NUMBER,
    "valid": _TRUTH,
    "reasons": [_TEXT],
    "similarity_percent": _NUMBER,
    "official_percent": _NUMBER,
    "observed_fraction": _NUMBER,
    "target_id": _WHOLE,
    "suspect": [_TEXT],
    "penalties": [
        {
            "offence": _TEXT,
            "seconds": _NUMBER,
            "factor": _NUMBER,
            "invalid": _TRUTH,
            "dnf": _TRUTH,
            "reason": _TEXT,
            "incident": _WHOLE,
        }
    ],
    "penalty_s": _NUMBER,
    "penalty_factor": _NUMBER,
    "estimated": _TRUTH,
    "sectors": [{"number": _WHOLE, "line": _TEXT, "time_s": _NUMBER, "sigma_s": _NUMBER}],
    "metric": _TEXT,
    "dtw_mean_m": _NUMBER,
    "frechet_m": _NUMBER,
    "lateral_mean_m": _NUMBER,
    "lateral_max_m": _NUMBER,
    "lateral_p95_m": _NUMBER,
    "speed_mean_mps": _NUMBER,
    "speed_max_mps": _NUMBER,
}


def runs_path(out: Path) -> Path:
    """The file of recordings that belongs to the file of laps `out`."""
    return out.with_name(out.name.removesuffix(ENDING) + RUNS_ENDING)


def check_out(out: Path) -> None:
    """Raises `InputError` where results cannot be written to `out`."""
    if not out.name.endswith(ENDING) or out.name in (ENDING, RUNS_ENDING):
        raise InputError(f"--out {out}: must be a file that ends in {ENDING}")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no directory {out.parent}")
    for path in (out, runs_path(out)):
        if path.is_dir():
            raise InputError(f"--out {out}: {path} is a directory")
    try:
        import pyarrow.parquet  # noqa: F401, PLC0415 of an extra
    except ImportError as error:
        raise InputError(MISSING_EXTRA.format(name="pyarrow")) from error


class ResultFiles:
    """Both files of one archive's results. Use it in a `with` statement: where that ends by an error, neither is there."""

    def __init__(self, out: Path, grid: Mapping[str, Sequence[Any]]) -> None:
        """`grid`: the values of each key that is swept, whose columns come after the recording's name.

        Raises `InputError` where nothing can be written there.
        """
        self.out, self.runs_out = out, runs_path(out)
        self._tables: list[_Table] = []
        keys = {"recording": _TEXT} | {key: _kind_of(values) for key, values in grid.items()}
        try:
            for path, columns in ((self.runs_out, RUN_COLUMNS), (self.out, LAP_COLUMNS)):
                self._tables.append(_Table(path, keys | dict(columns)))
        except OSError as error:
            self._discard()
            raise InputError(f"--out {out}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> ResultFiles:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._discard()

    def add(self, scored: ScoredRun) -> None:
        """The rows of one recording. Raises `WorkError` where the disk fails."""
        runs, laps = self._tables
        try:
            runs.add((scored.run,))
            laps.add(scored.laps)
        except OSError as error:
            raise self._failed(error) from error

    def finish(self) -> None:
        """Brings both files to the disk and gives them their names. Raises `WorkError` where the disk fails."""
        try:
            for table in self._tables:
                table.close()
            for table in self._tables:
                table.rename()
            sync_directory(self.out.parent)
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> WorkError:
        return WorkError(f"{self.out}: the results were not written: {error.strerror or error}")

    def _discard(self) -> None:
        for table in self._tables:
            table.discard()


class _Table:
    """One file, under another name until it is whole."""

    def __init__(self, path: Path, columns: Mapping[str, Any]) -> None:
        import pyarrow  # noqa: PLC0415 of an extra
        import pyarrow.parquet  # noqa: PLC0415

        self._arrow = pyarrow
        self._path = path
        self._schema = pyarrow.schema([(name, _arrow_type(pyarrow, kind)) for name, kind in columns.items()])
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=PART_SUFFIX, dir=path.parent)
        self._part: Path | None = Path(name)
        # As any other new file: mkstemp's is its owner's alone.
        os.fchmod(descriptor, 0o666 & ~_umask())
        self._stream = os.fdopen(descriptor, "wb")
        self._writer = pyarrow.parquet.ParquetWriter(self._stream, self._schema, compression="zstd")
        self._rows: list[Row] = []

    def add(self, rows: Sequence[Row]) -> None:
        self._rows += rows
        while len(self._rows) >= GROUP_ROWS:
            self._write(self._rows[:GROUP_ROWS])
            del self._rows[:GROUP_ROWS]

    def close(self) -> None:
        self._write(self._rows)
        self._rows = []
        self._writer.close()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()

    def rename(self) -> None:
        assert self._part is not None, "a file is given its name once"
        self._part.replace(self._path)
        self._part = None

    def discard(self) -> None:
        """Removes what is no whole file; nothing where it has its name."""
        if self._part is None:
            return
        # What waits in buffers may fail to be written to a full disk; it is not wanted any more.
        with suppress(OSError, ValueError):
            self._writer.close()
        with suppress(OSError):
            self._stream.close()
        with suppress(OSError):
            self._part.unlink(missing_ok=True)
        self._part = None

    def _write(self, rows: Sequence[Row]) -> None:
        if rows:
            self._writer.write_table(
                self._arrow.Table.from_pylist(list(rows), schema=self._schema), row_group_size=GROUP_ROWS
            )


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _kind_of(values: Sequence[Any]) -> str:
    if all(isinstance(value, bool) for value in values):
        return _TRUTH
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return _NUMBER
    return _TEXT


def _arrow_type(arrow: Any, kind: Any) -> Any:
    if isinstance(kind, list):
        return arrow.list_(_arrow_type(arrow, kind[0]))
    if isinstance(kind, dict):
        return arrow.struct([(name, _arrow_type(arrow, one)) for name, one in kind.items()])
    return {_TEXT: arrow.string(), _WHOLE: arrow.int64(), _NUMBER: arrow.float64(), _TRUTH: arrow.bool_()}[kind]
