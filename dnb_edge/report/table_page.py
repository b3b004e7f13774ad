"""The result table with its pictures: one HTML page that holds everything it shows, or each picture as a file.

Knows the parts of a page. Whatever a user wrote is escaped (`markup`). Knows no recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.errors import InputError
from dnb_edge.report.compare_plots import entries_picture
from dnb_edge.report.files import write_whole
from dnb_edge.report.html import page, warnings_list
from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, plain_table, text
from dnb_edge.report.picture import PictureFormat
from dnb_edge.report.table import EntryRow, ResultTable, Trial
from dnb_edge.report.table_plots import MOST_RADARS, boxes_picture, radar_picture, ranks_picture
from dnb_edge.report.table_text import INFERENCE, INTERVALS, table_columns
from dnb_edge.score.ranking import RESAMPLES


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePart:
    """One table with the trials that it is made of."""

    table: ResultTable
    trials: tuple[Trial, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TableFigure:
    """One picture of a table."""

    name: str
    """Of its file, without ending."""
    alt: str
    caption: str
    picture: bytes


_BOXES = """A dot a valid lap; boxes are quartiles with the median, whiskers reach one and a half boxes at most; on the right
the success rate with its 95 % interval."""

_MEANS = "A dot a valid lap; the diamond is the mean, its line the 95 % interval."

_RADAR = """Further out is better, the outermost ring is 100 %: path similarity; of the attempted laps the valid ones, and those
without a penalty; the quickest entry's mean time as a share of the own; likewise the least time for one picture (95th
percentile). A gap is where nothing is known."""

_RANKS = f"""In how many of 100 resamples of the runs an entry has a rank, of {RESAMPLES} that were drawn; the diamond is its
rank over all runs."""


def table_figures(part: TablePart, picture_format: PictureFormat = "png") -> tuple[TableFigure, ...]:
    """The pictures that a table has: boxes, means, radars and, where anybody is ranked, ranks."""
    table, trials = part.table, part.trials
    if not table.rows:
        return ()
    count = len(table.rows)
    more = f" The first {MOST_RADARS} entries of {count}." if count > MOST_RADARS else ""
    drawn = (
        ("boxes", "Boxes of each entry's lap times and path similarities, and success rates", _BOXES),
        ("means", "Lap times and path similarities of each entry with their means", _MEANS),
        ("radar", "A radar of each entry", _RADAR + more),
        ("ranks", "How often each entry has each rank", _RANKS),
    )
    pictures = {
        "boxes": boxes_picture(table, trials, picture_format=picture_format),
        "means": entries_picture(table.rows, trials, picture_format=picture_format),
        "radar": radar_picture(table, picture_format=picture_format),
        "ranks": ranks_picture(table, picture_format=picture_format),
    }
    return tuple(
        TableFigure(name=name, alt=alt, caption=" ".join(caption.split()), picture=picture)
        for name, alt, caption in drawn
        if (picture := pictures[name]) is not None
    )


def write_table_figures(parts: Sequence[TablePart], directory: Path, picture_format: PictureFormat) -> list[Path]:
    """Writes each picture of each table into `directory`, which is made where it is missing; returns the files.

    Those of several groups are numbered as the groups are printed: `2-boxes.png`. Raises `InputError` where they cannot be
    written there, `WorkError` where the disk refuses.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: figures cannot be written there: {error.strerror or error}") from error
    written = []
    for number, part in enumerate(parts, start=1):
        prefix = f"{number}-" if len(parts) > 1 else ""
        for figure in table_figures(part, picture_format):
            path = directory / f"{prefix}{figure.name}.{picture_format}"
            write_whole(path, figure.picture)
            written.append(path)
    return written


def render_table(parts: Sequence[TablePart], warnings: Sequence[str] = ()) -> str:
    """The whole page, the same text for the same tables."""
    entries = sum(len(part.table.rows) for part in parts)
    runs = len({trial.run for part in parts for trial in part.trials})
    title = f"{entries} {'entry' if entries == 1 else 'entries'}, {runs} run{'s' * (runs != 1)}"
    header = f"<h1>Entries compared</h1>\n<p>{text(title)}</p>\n{warnings_list(warnings)}"
    return page(title=f"{title}: dnb-edge table", header=header, body="\n".join(map(_section, parts)))


def _section(part: TablePart) -> str:
    table = part.table
    heading = table.conditions if table.conditions is not None else "Entries"
    notes = [*table.notes, INTERVALS]
    if any(row.inference_source is not None for row in table.rows):
        notes.append(INFERENCE)
    said = "".join(f"<li>{text(note)}</li>" for note in notes)
    figures = "\n".join(map(_figure, table_figures(part)))
    return f"<section>\n<h2>{text(heading)}</h2>\n{_rows(table.rows)}\n<ul>{said}</ul>\n{_ranks(table)}\n{figures}\n</section>"


def _rows(rows: Sequence[EntryRow]) -> str:
    columns = [[cell.replace("+-", PLUS_MINUS) for cell in column] for column in table_columns(rows)]
    headings, *cells = zip(*columns[1:], strict=True)
    named = [(row.label, *line) for row, line in zip(rows, cells, strict=True)]
    return plain_table("Means over the valid laps, penalties included", ("Entry", *headings), named)


def _ranks(table: ResultTable) -> str:
    """Each entry's rank by each figure, within which ranks it is in 95 % of the resamples, and how often it has its own."""
    orders = [order for order in table.orders if order.ranking.order_share is not None]
    if not orders:
        return ""
    rows = []
    for i, row in enumerate(table.rows):
        cells = [
            NONE if place is None else f"{place.rank} [{place.low}, {place.high}] {100 * place.share:.0f} %"
            for place in (order.places[i] for order in orders)
        ]
        rows.append((row.label, *cells))
    caption = "Ranks: over all runs, within which in 95 % of the resamples, and in how many of them exactly there"
    return plain_table(caption, ("Entry", *(order.figure for order in orders)), rows)


def _figure(figure: TableFigure) -> str:
    return (
        f'<figure>\n<img alt="{text(figure.alt)}" src="{data_uri(figure.picture)}">\n'
        f"<figcaption>{text(figure.caption)}</figcaption>\n</figure>"
    )
