"""HTML from values: escaped text, numbers, tables and pictures within the page. Knows no page and no run."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

from dnb_edge.report.table import printable

NONE = "\N{EN DASH}"
"""Stands where there is no figure."""

PLUS_MINUS = "\N{PLUS-MINUS SIGN}"


def text(value: object) -> str:
    """`value` as HTML text or attribute; control characters, which a page cannot hold, as question marks."""
    return html.escape("\n".join(map(printable, str(value).split("\n"))), quote=True)


def data_uri(picture: bytes, kind: str = "image/png") -> str:
    """The picture as an address that needs no other machine."""
    return f"data:{kind};base64," + base64.b64encode(picture).decode("ascii")


def number(value: float | None, form: str, *, none: str = NONE) -> str:
    """`value` in the form, or what stands where there is none."""
    return none if value is None else form.format(value)


def plain_table(caption: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a caption; its first column holds names."""
    first, *rest = headings
    head = f'<th scope="col" class="text">{text(first)}</th>'
    head += "".join(f'<th scope="col">{text(heading)}</th>' for heading in rest)
    body = "".join(
        f'<tr><th scope="row" class="text">{text(first)}</th>'
        + "".join(f"<td>{text(cell)}</td>" for cell in rest)
        + "</tr>\n"
        for first, *rest in rows
    )
    return (
        f'<div class="scroll"><table>\n<caption>{text(caption)}</caption>\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}</tbody>\n</table></div>"
    )
