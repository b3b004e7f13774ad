"""Text of generated pages: cells of tables, and the line that says who made a page.

Knows Markdown. Knows nothing of what the pages are about.
"""

from __future__ import annotations

from pathlib import Path


def made_by(script: str) -> str:
    """The comment of a page that is made by `script`: readers of the site do not see it, those of the source do."""
    return f"<!-- Made by docs/tools/{Path(script).name}: change that, or what it reads, and run make docs-pages. -->"


def cell(text: str) -> str:
    """`text` in one cell of a table: one line, its bars escaped."""
    return " ".join(text.split()).replace("|", "\\|")


def paragraphs(text: str) -> str:
    """The paragraphs of `text`, each on one line."""
    return "\n\n".join(" ".join(part.split()) for part in text.strip().split("\n\n"))


def listed(words: list[str], last: str = "or") -> str:
    """`a`, `b` or `c`."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"
