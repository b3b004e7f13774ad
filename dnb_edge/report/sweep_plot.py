"""What a sweep over rules and thresholds comes to, as a picture: four figures over the first key, a line for each combination
of the others.

Knows matplotlib's objects and rows of figures. Words of users are drawn as they are, never as formulas. Knows no file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from matplotlib.figure import Figure

from dnb_edge.report.lap_style import DPI, INK, PAPER, colour, legend, line_style
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.table import printable

MOST_LINES = 21
"""So many lines can be told apart: seven colours in three dashes."""
_LONGEST_WORD = 24
_MOST_TICKS = 10


class Swept(Protocol):
    """One combination and what it came to."""

    @property
    def values(self) -> Mapping[str, Any]:
        """The value of each key, in the order of the keys."""

    @property
    def valid_laps(self) -> int:
        """Laps that count."""

    @property
    def completion_time_s(self) -> float | None:
        """Mean over those; None without any."""

    @property
    def similarity_percent(self) -> float | None:
        """Mean over those, 0..100."""

    @property
    def penalty_s(self) -> float:
        """Seconds of all penalties."""


_PANELS: tuple[tuple[str, Callable[[Swept], float | None]], ...] = (
    ("valid laps", lambda row: row.valid_laps),
    ("completion time (s)", lambda row: row.completion_time_s),
    ("path similarity (%)", lambda row: row.similarity_percent),
    ("penalties (s)", lambda row: row.penalty_s),
)


def sweep_picture(rows: Sequence[Swept], *, picture_format: PictureFormat = "png") -> bytes:
    """The picture of a sweep; of more than `MOST_LINES` lines the first ones, which the picture says."""
    figure = Figure(figsize=(10.0, 6.4), dpi=DPI, facecolor=PAPER, layout="constrained")
    panels = figure.subplots(2, 2, sharex=True).ravel().tolist()
    key, *others = rows[0].values
    lines: dict[tuple[Any, ...], list[Swept]] = {}
    for row in rows:
        lines.setdefault(tuple(row.values[other] for other in others), []).append(row)
    xs = list(dict.fromkeys(row.values[key] for row in rows))
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in xs)
    drawn = list(lines.items())[:MOST_LINES]
    for axes, (words, figure_of) in zip(panels, _PANELS, strict=True):
        _dress(axes, words)
        for place, (chosen, line) in enumerate(drawn):
            label = ", ".join(f"{other} {_word(value)}" for other, value in zip(others, chosen, strict=True))
            points = [(row.values[key] if numbers else xs.index(row.values[key]), figure_of(row)) for row in line]
            # A figure that there is none of leaves a gap.
            shown = sorted((x, float("nan") if y is None else y) for x, y in points)
            axes.plot(*zip(*shown, strict=True), marker="o", label=label or "_", **line_style(place, best=False))
        if numbers and len(xs) <= _MOST_TICKS:
            axes.set_xticks(xs)
        elif not numbers:
            axes.set_xticks(range(len(xs)), [_word(x) for x in xs], parse_math=False)
    for axes in panels[2:]:
        axes.set_xlabel(_word(key), color=INK, parse_math=False)
    if len(lines) > len(drawn):
        figure.suptitle(f"the first {len(drawn)} of {len(lines)} combinations", color=INK, fontsize=10)
    legend(figure, panels[0])
    return encoded(figure, picture_format)


def _dress(axes: Any, words: str) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK, labelsize=10)
    axes.set_ylabel(words, color=INK)
    axes.grid(color=colour(6), alpha=0.12)


def _word(value: Any) -> str:
    text = printable(value if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value))
    return text if len(text) <= _LONGEST_WORD else f"{text[: _LONGEST_WORD - 3]}..."
