"""How the documentation becomes a site: `make docs` writes it to build/site.

The source directory is the repository's root and not docs/, so that every relative link of a page means on the site what
it means on a forge: pages outside docs/ (systemd/README.md, hardware/README.md ...) are pages of the site too, and links
to other files (configs/example.yaml, a module) take a copy of the file with them. See docs/adr/0038-documentation-site.md.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

_HERE = Path(__file__).parent
sys.path.insert(0, str(_HERE / "tools"))

from site_navigation import with_navigation

_INIT = (_HERE.parent / "dnb_edge" / "__init__.py").read_text(encoding="utf-8")

project = "dnb-edge"
author = "the authors of dnb-edge"
copyright = "the authors of dnb-edge, GPL-3.0-or-later"
(version,) = re.findall(r'__version__ = "([^"]+)"', _INIT)
release = version
# Not en_GB: its table of Sphinx 9.0 has empty plurals, at which the search page stumbles.
language = "en"

extensions = ["myst_parser"]
root_doc = "docs/index"
source_suffix = {".md": "markdown"}
include_patterns = [
    "docs/*.md",
    "docs/*/*.md",
    "hardware/*.md",
    "hardware/*/*.md",
    "systemd/*.md",
    "tests/system/README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "README.md",
]
# Folders are named so that they are not walked through, too.
exclude_patterns = ["**/.*", "build", "dist", "runs", "out", "dnb_edge", "paper"]

# Anchors as forges make them, down to headings of the fourth level.
myst_heading_anchors = 4
# Only what forges show, too.
myst_enable_extensions: list[str] = []
nitpicky = True

# Two hyphens are an option's, not a dash.
smartquotes = False

html_theme = "furo"
html_title = f"dnb-edge {version}"
html_static_path = ["site/static"]
html_css_files = ["site.css"]
html_additional_pages = {"index": "to-start.html"}
templates_path = ["site/templates"]
html_copy_source = False
html_show_sphinx = False
# Read as files, a page cannot fetch another one for an excerpt.
html_show_search_summary = False
html_theme_options: dict[str, Any] = {
    "navigation_with_keys": True,
    "top_of_page_buttons": [],
    # No icon or link to anywhere outside.
    "footer_icons": [],
}

# `make docs-links`, with a network: what a page names as an example is no page.
linkcheck_ignore = [r"https?://(127\.0\.0\.1|localhost|NAME\.local|dnb-edge\.local|10\.|192\.168\.)"]
linkcheck_timeout = 15
linkcheck_workers = 4


def _navigate(_app: Any, page: str, source: list[str]) -> None:
    source[0] = with_navigation(page, source[0])


def setup(app: Any) -> None:
    """Have Sphinx take the order of the pages from docs/index.md."""
    app.connect("source-read", _navigate)
