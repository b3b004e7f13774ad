"""The pictures and the page of `dnb-edge table`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dnb_edge.report.files import write_whole
from dnb_edge.report.picture import PictureFormat
from dnb_edge.report.table import ResultTable, Trial
from dnb_edge.report.table_page import TablePart, render_table, write_table_figures


def write_pictures(
    tables: Sequence[tuple[ResultTable, Sequence[Trial]]],
    warnings: Sequence[str],
    *,
    figures: Path | None,
    form: PictureFormat,
    html: Path | None,
) -> list[Path]:
    """Writes the pictures of `tables` into the directory `figures` and the page `html`, where these are wanted; returns the
    files.

    Raises `InputError` where one cannot be written, `WorkError` where the disk refuses.
    """
    parts = [TablePart(table=table, trials=tuple(trials)) for table, trials in tables]
    written = []
    if figures is not None:
        written += write_table_figures(parts, figures, form)
    if html is not None:
        write_whole(html, render_table(parts, warnings).encode())
        written.append(html)
    return written
