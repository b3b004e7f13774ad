"""A sweep over rules and thresholds: every combination of the values that `--grid` names, and what each comes to.

Knows keys and values, and sums over recordings. Knows no recording and no picture.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dnb_edge.archive.lot_score import ScoredRun, Setting
from dnb_edge.archive.rescore import Wanted
from dnb_edge.config.load import parse_override
from dnb_edge.errors import InputError
from dnb_edge.report.table import official_percent, official_s

RULES = "rules"
"""The key under which whole rule sets are swept."""
MOST = 1000
"""Combinations; each races every recording once."""

Grid = Mapping[str, tuple[Any, ...]]
"""The values of each key, as YAML has them."""


def parse_grid(texts: Sequence[str]) -> Grid:
    """The grid that `KEY=A,B,C` options make. Raises `InputError` naming the option that has another form."""
    grid: dict[str, tuple[Any, ...]] = {}
    for text in texts:
        key, equals, listed = text.partition("=")
        key = key.strip()
        if not equals or not key or not listed.strip():
            raise InputError(
                f"--grid {text}: must be KEY=A,B,C, such as race.min_lap_s=2,3,4 or rules=practice,deepracer"
            )
        if key in grid:
            raise InputError(f"--grid {text}: {key} is given twice: name all its values at once")
        values = _values(text, listed)
        if len(set(map(repr, values))) < len(values):
            raise InputError(f"--grid {text}: a value is named twice")
        grid[key] = values
    count = math.prod(map(len, grid.values()))
    if count > MOST:
        raise InputError(f"--grid: {count} combinations, more than the {MOST} that are tried: name fewer values")
    return grid


def _values(option: str, listed: str) -> tuple[Any, ...]:
    try:
        _, values = parse_override(f"grid=[{listed}]")
    except InputError as error:
        raise InputError(f"--grid {option}: the values are not valid YAML") from error
    if not isinstance(values, list) or not values:
        raise InputError(f"--grid {option}: must be KEY=A,B,C")
    return tuple(values)


def columns(grid: Grid) -> Grid:
    """The values as results have them: those of one key are all numbers, all truths or all text."""
    return {key: _of_one_kind(values) for key, values in grid.items()}


def _of_one_kind(values: tuple[Any, ...]) -> tuple[Any, ...]:
    kinds = {bool if isinstance(value, bool) else float if isinstance(value, int | float) else str for value in values}
    if len(kinds) == 1 and kinds != {str}:
        return values
    return tuple(value if isinstance(value, str) else json.dumps(value) for value in values)


def settings(wanted: Wanted, grid: Grid) -> tuple[Setting, ...]:
    """What is wanted, under each combination of the grid, the last key's values going round fastest; one where it is empty.

    Raises `InputError` where rules, lines, track or values are wrong by themselves.
    """
    if RULES in grid and wanted.rules is not None:
        raise InputError(f"--rules {wanted.rules}: rule sets are in --grid already")
    found = []
    loaded: dict[Wanted, Any] = {}
    for values, told in zip(itertools.product(*grid.values()), itertools.product(*columns(grid).values()), strict=True):
        chosen = dict(zip(grid, values, strict=True))
        rules = chosen.get(RULES, wanted.rules)
        overrides = [f"{key}={json.dumps(value)}" for key, value in chosen.items() if key != RULES]
        # Files are read once for all combinations.
        base = Wanted(rules=None if rules is None else str(rules), track=wanted.track, lines=tuple(wanted.lines))
        if base not in loaded:
            loaded[base] = base.loaded()
        one = loaded[base].with_overrides((*wanted.overrides, *overrides))
        found.append(Setting(values=tuple(zip(grid, told, strict=True)), loaded=one))
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepRow:
    """One combination over all recordings; figures are means over all valid laps, official ones."""

    values: Mapping[str, Any]
    recordings: int
    """That could be scored under it."""
    laps: int
    """Without warm-up laps."""
    valid_laps: int
    success_rate: float | None
    completion_time_s: float | None
    similarity_percent: float | None
    penalties: int
    penalty_s: float


@dataclass(slots=True)
class Tally:
    """Sums up one combination, recording after recording."""

    recordings: int = 0
    laps: int = 0
    attempted: int = 0
    penalties: int = 0
    times_s: list[float] = field(default_factory=list)
    percents: list[float] = field(default_factory=list)
    penalties_s: list[float] = field(default_factory=list)

    def add(self, scored: ScoredRun) -> None:
        """One recording; nothing of one that could not be scored."""
        if scored.run["error"] is not None:
            return
        self.recordings += 1
        for trial in scored.trials:
            self.laps += len(trial.laps)
            self.attempted += trial.attempted_laps
            for lap in trial.laps:
                self.penalties += len(lap.penalties)
                self.penalties_s.append(lap.penalty_s)
                if lap.valid:
                    self.times_s.append(official_s(lap))
                    percent = official_percent(lap)
                    self.percents += [] if percent is None else [percent]

    def row(self, values: Mapping[str, Any]) -> SweepRow:
        """What it came to."""
        return SweepRow(
            values=values,
            recordings=self.recordings,
            laps=self.laps,
            valid_laps=len(self.times_s),
            success_rate=len(self.times_s) / self.attempted if self.attempted else None,
            completion_time_s=_mean(self.times_s),
            similarity_percent=_mean(self.percents),
            penalties=self.penalties,
            penalty_s=math.fsum(self.penalties_s),
        )


def _mean(values: Sequence[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None


def as_text(rows: Sequence[SweepRow]) -> str:
    """The rows as a table for people, one line a combination; no trailing line feed."""
    columns = [[key, *(_shown(row.values[key]) for row in rows)] for key in (rows[0].values if rows else ())]
    columns += [
        ["Recordings", *(str(row.recordings) for row in rows)],
        ["Valid laps", *(f"{row.valid_laps} of {row.laps}" for row in rows)],
        ["Success", *(_figure(row.success_rate, "{:.1%}") for row in rows)],
        ["Completion time (s)", *(_figure(row.completion_time_s, "{:.3f}") for row in rows)],
        ["Path similarity (%)", *(_figure(row.similarity_percent, "{:.2f}") for row in rows)],
        ["Penalties", *(f"{row.penalties} (+{row.penalty_s:g} s)" for row in rows)],
    ]
    widths = [max(map(len, column)) for column in columns]
    lines = [
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in zip(*columns, strict=True)
    ]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _figure(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)
