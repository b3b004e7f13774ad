"""The order of the site's pages, read out of plain lists of links: forges show them as they are, Sphinx gets its table.

Knows docs/index.md and docs/adr/README.md. Knows nothing of what the pages say.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

INDEX = "docs/index"
"""The start page: each heading of the second level is a section, the links of its list are that section's pages."""

DECISIONS = "docs/adr/README"
"""The list of decisions: all of its links are pages below it."""

_ENTRY = re.compile(r"^- \[([^\]]*)\]\(([\w./-]+)\.md\)", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A section of the site."""

    title: str
    entries: tuple[tuple[str, str], ...]
    """Of each page its short name, and where it is: relative to the page with the list, without `.md`."""

    @property
    def pages(self) -> tuple[str, ...]:
        """Where its pages are."""
        return tuple(page for _, page in self.entries)


def parts(text: str) -> list[Part]:
    """The sections of a start page, in their order."""
    found = []
    for chunk in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title, _, rest = chunk.partition("\n")
        entries = tuple(_ENTRY.findall(rest))
        if entries:
            found.append(Part(title=title.strip(), entries=entries))
    return found


def with_navigation(page: str, text: str) -> str:
    """`text` of the page of that name with tables of contents that Sphinx understands and does not show."""
    if page == INDEX:
        return "\n\n".join([text, *(_table(part.entries, part.title) for part in parts(text))])
    if page == DECISIONS:
        return f"{text}\n\n{_table(tuple(_ENTRY.findall(text)))}"
    return text


def _table(entries: tuple[tuple[str, str], ...], caption: str | None = None) -> str:
    options = [":hidden:", *([f":caption: {caption}"] if caption else [])]
    return "\n".join(["```{toctree}", *options, "", *(f"{name} <{page}>" for name, page in entries), "```", ""])
