"""Writes the pages of docs/ that are made from code and tables: `make docs-pages`. With --check it only compares.

Knows which scripts make pages. A script has PAGE, the page's path from the repository's root, and `page()`, its text.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import bom_page
import commands_page
import config_page
import doctor_page
import mount_places
import troubleshooting_page

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES: dict[str, Callable[[], str]] = {
    made.PAGE: made.page
    for made in (bom_page, commands_page, config_page, doctor_page, mount_places, troubleshooting_page)
}
"""What makes each page's text, by the page's path."""


def stale() -> list[str]:
    """The pages that are not as their scripts write them now."""
    return [name for name, page in PAGES.items() if not _is(REPOSITORY / name, page())]


def _is(path: Path, text: str) -> bool:
    return path.is_file() and path.read_text(encoding="utf-8") == text


def main() -> int:
    """Write what is stale, or with --check only name it. Exit code 1 where something was to be named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 where a page is stale")
    only_check = parser.parse_args().check
    found = stale()
    for name in found:
        if not only_check:
            (REPOSITORY / name).write_text(PAGES[name](), encoding="utf-8")
        sys.stdout.write(f"{name}: {'stale: run make docs-pages' if only_check else 'written'}\n")
    return int(only_check and bool(found))


if __name__ == "__main__":
    sys.exit(main())
