"""The report of several runs together: one HTML file that holds everything it shows, of a bounded size.

Knows the page's parts; each run's section is made from its `RunResult` and kept as text alone, so that any number of runs fits
in memory. Knows no recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.report.along import best_laps, laps_at
from dnb_edge.report.compare_plots import BestLap, best_laps_picture, entries_picture, quickest
from dnb_edge.report.figures import Section, report_figures
from dnb_edge.report.health_section import clock
from dnb_edge.report.html import details, facts_list, figure_html, laid_out, page, warnings_list
from dnb_edge.report.lap_table import lap_table
from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, number, plain_table, text
from dnb_edge.report.race import race_sections
from dnb_edge.report.run import RunResult
from dnb_edge.report.table import ResultTable, Trial, official_percent, official_s
from dnb_edge.report.table_text import INTERVALS, table_columns
from dnb_edge.track.model import Track

MOST_BYTES = 9_000_000
"""Of a page: runs for whose pictures there is no room any more have none, and say so."""

MOST_LAPS = 500
"""Of a run that are told one by one."""

_SHOWN = ("path", "along", "lap-times")
_SHOWN_BEST = ("speed-", "lateral-")
_BARE_BYTES = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPart:
    """What a session's page keeps of one run."""

    section: str
    """HTML."""
    best: tuple[BestLap, ...]
    """Of each of its cars with a valid lap."""
    track: Track


class SessionParts:
    """Takes in runs one by one, and sees to it that the page does not grow too large."""

    def __init__(self, *, most_bytes: int = MOST_BYTES) -> None:
        """No run yet."""
        self._room = most_bytes
        self.parts: list[RunPart] = []
        self.without_pictures = 0
        """Runs for whose pictures there was no room."""

    def add(self, result: RunResult, names: dict[int, str]) -> None:
        """Takes in one run; `names` are the entries by car."""
        pictures = _pictures(result) if self._room > _BARE_BYTES else ""
        if len(pictures) > self._room - _BARE_BYTES:
            pictures = ""
        self.without_pictures += not pictures
        section = _section(result, pictures)
        self._room -= len(section.encode())
        best = tuple(
            BestLap(name=names.get(one.lap.car, result.entry), run=result.recording or "", lap=one.lap, trace=one.trace)
            for one in laps_at(result, best_laps(result.laps).values())
        )
        self.parts.append(RunPart(section=section, best=best, track=result.track))


def render_session(
    title: str, runs: SessionParts, table: ResultTable, trials: Sequence[Trial], warnings: Sequence[str] = ()
) -> str:
    """The whole page, the same text for the same runs."""
    best = [one for part in runs.parts for one in part.best]
    laps = [lap for trial in trials for lap in trial.laps]
    valid = sum(lap.valid for lap in laps)
    facts = (
        f"{_counted(len(runs.parts), 'run')}, {_counted(len(table.rows), 'entry')}, {valid} valid of {len(laps)} laps"
    )
    bare = f" Of {runs.without_pictures} runs there are no pictures here: {_TOO_LARGE}" if runs.without_pictures else ""
    body = [
        f"<section>\n<h2>Entries</h2>\n{_entries(table)}\n</section>",
        f"<section>\n<h2>Comparison</h2>\n{_comparison(table, trials, best, runs.parts)}\n</section>",
        f"<section>\n<h2>Best laps</h2>\n{_best(best)}\n</section>",
        f"<section>\n<h2>Runs</h2>\n<p>Open a run for its laps and pictures.{text(bare)}</p>\n"
        + "\n".join(part.section for part in runs.parts)
        + "\n</section>",
    ]
    header = f"<h1>{text(title)}</h1>\n<p>{text(facts)}</p>\n{warnings_list(warnings)}"
    return page(title=f"{title}: dnb-edge report", header=header, body="\n".join(body))


_TOO_LARGE = "the page would be too large. `dnb-edge report RUN` shows them."


def _counted(count: int, what: str) -> str:
    """`1 entry`, `2 entries`."""
    if count == 1:
        return f"1 {what}"
    return f"{count} {what[:-1]}ies" if what.endswith("y") else f"{count} {what}s"


def _entries(table: ResultTable) -> str:
    columns = [[cell.replace("+-", PLUS_MINUS) for cell in column] for column in table_columns(table.rows)]
    headings, *rows = zip(*columns[1:], strict=True)
    names = [row.label for row in table.rows]
    headings, rows = ("Entry", *headings), [(name, *row) for name, row in zip(names, rows, strict=True)]
    notes = "".join(f"<li>{text(note)}</li>" for note in (*table.notes, INTERVALS))
    return plain_table("Means over the valid laps, penalties included", headings, rows) + f"\n<ul>{notes}</ul>"


def _comparison(table: ResultTable, trials: Sequence[Trial], best: Sequence[BestLap], parts: Sequence[RunPart]) -> str:
    entries = data_uri(entries_picture(table.rows, trials))
    shown = [
        (
            f'<figure>\n<img alt="Lap times and path similarities of each entry" src="{entries}">\n'
            "<figcaption>A dot a valid lap; the diamond is the mean, its line the 95 % interval.</figcaption>\n</figure>"
        )
    ]
    along = best_laps_picture(best, parts[0].track) if parts else None
    if along is not None:
        drawn = len(quickest(best))
        more = f" The {drawn} quickest of {len(best)}." if drawn < len(best) else ""
        shown.append(
            f'<figure>\n<img alt="Best laps along the route: speed, and time behind the best of all" src="{data_uri(along)}">\n'
            f"<figcaption>The best lap of each run along the route: speed; below, how far behind the best of all at the same "
            f"place.{more}</figcaption>\n</figure>"
        )
    return "\n".join(shown)


def _best(best: Sequence[BestLap]) -> str:
    if not best:
        return "<p>No valid lap.</p>"
    rows = [
        (
            one.name,
            one.run or NONE,
            str(one.lap.number),
            f"{one.lap.time_s:.4f} {PLUS_MINUS} {one.lap.sigma_s:.4f}",
            f"{official_s(one.lap):.4f}",
            number(official_percent(one.lap), "{:.2f}"),
        )
        for one in quickest(best, len(best))
    ]
    headings = ("Entry", "Run", "Lap", f"Time {PLUS_MINUS} sigma (s)", "Official (s)", "Similarity (%)")
    return plain_table("The best valid lap of each car in each run, the quickest first", headings, rows)


def _pictures(result: RunResult) -> str:
    """The run's own map, best laps in colours, panels and bars."""
    shown = [
        figure_html(figure)
        for figure in report_figures(result)
        if figure.name in _SHOWN or (figure.section is Section.COLOURED and figure.name.startswith(_SHOWN_BEST))
    ]
    return laid_out(shown)


def _section(result: RunResult, pictures: str) -> str:
    """The run, folded away: all of its own page but for what the session's says already."""
    valid = [lap for lap in result.laps if lap.valid]
    best = min(map(official_s, valid), default=None)
    words = [
        result.entry,
        result.recording or "",
        f"{len(valid)} valid of {len(result.laps)} laps",
        "DNF" if best is None else f"best {best:.3f} s",
    ]
    health = result.health
    lost = "" if health is None else f"<p>{text(_health_words(result))}</p>"
    inside = [
        facts_list(result),
        warnings_list(result.warnings),
        f"<h2>Laps</h2>\n{lap_table(result, most=MOST_LAPS)}",
        race_sections(result),
        pictures,
        lost,
        details(result),
    ]
    # Nothing that a user wrote can hold a tag: it is escaped.
    body = "\n".join(filter(None, inside)).replace("<h2>", "<h3>").replace("</h2>", "</h3>")
    return f'<details class="run"><summary>{text(", ".join(filter(None, words)))}</summary>\n{body}\n</details>'


def _health_words(result: RunResult) -> str:
    """The run's health in a sentence."""
    health = result.health
    assert health is not None, "asked only where it is known"
    gone = sum(health.lost.values())
    told = [f"{health.frames} frames raced and {gone} lost in {clock(health.end_s)}"]
    if health.interruptions:
        count = len(health.interruptions) + health.more_interruptions
        told.append(f"interrupted {count} times for {clock(health.interrupted_s)}")
    told += [f"{one.text} (from {clock(one.first_s)})" for one in health.warnings[:5]]
    return "Health: " + "; ".join(told) + "."
