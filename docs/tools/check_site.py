"""Checks a built site: nothing in it asks for anything outside, and every link within it leads somewhere.

Knows HTML and CSS as files. Knows nothing of Sphinx. Links that people may click to other sites are no requests; they are
listed, and `make docs-links` tries them.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_LOADED = {
    ("script", "src"), ("img", "src"), ("img", "srcset"), ("source", "src"), ("source", "srcset"), ("iframe", "src"),
    ("video", "src"), ("video", "poster"), ("audio", "src"), ("embed", "src"), ("object", "data"), ("link", "href"),
    ("use", "href"), ("use", "xlink:href"), ("image", "href"), ("image", "xlink:href"), ("input", "src"), ("track", "src"),
}  # fmt: skip
"""What a browser loads by itself, by tag and attribute."""

_CSS_LOADS = re.compile(r"""url\(\s*['"]?([^'")]+)|@import\s+['"]([^'"]+)""")
_SCRIPT_LOADS = re.compile(
    r"""(?:fetch|importScripts|import|open|WebSocket|EventSource)\s*\(\s*['"`](?:\w+['"`]\s*,\s*['"`])?((?:https?|wss?):[^'"`]+)"""
)


class Page(HTMLParser):
    """What one page loads, links to and can be linked to at."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self._within = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take what the tag loads, links to and names."""
        for name, value in attrs:
            if value is None:
                continue
            if (tag, name) in _LOADED:
                urls = [part.split()[0] for part in value.split(",") if part.split()] if name == "srcset" else [value]
                self.loads += urls
            elif name == "href":
                self.links.append(value)
            elif name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value)
            elif name == "style":
                self.loads += _css_loads(value)
            elif tag == "meta" and name == "content" and "url=" in value:
                self.links.append(value.partition("url=")[2])
        self._within = tag if tag in {"style", "script"} else ""

    def handle_data(self, data: str) -> None:
        """Take what styles and scripts within the page load."""
        if self._within == "style":
            self.loads += _css_loads(data)
        elif self._within == "script":
            self.loads += _SCRIPT_LOADS.findall(data)

    def handle_endtag(self, tag: str) -> None:  # noqa: ARG002 the parser asks so
        """Leave styles and scripts."""
        self._within = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What is wrong with a site, and where it leads out."""

    faults: tuple[str, ...]
    """One line each: the file, and what is wrong there."""
    outside: tuple[str, ...]
    """Addresses of other sites that pages link to, each once."""
    pages: int


def check(site: Path) -> Findings:
    """Look through all of the site at `site`. Raises `OSError` where a file cannot be read."""
    pages = {path.resolve(): _page(path) for path in sorted(site.rglob("*.html"))}
    faults: list[str] = []
    outside: set[str] = set()
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        for url in page.loads:
            faults += _load_faults(url, path, name)
        for url in page.links:
            if _is_outside(url):
                outside.add(url)
            else:
                faults += _link_faults(url, path, name, pages)
    for path in sorted([*site.rglob("*.css"), *site.rglob("*.svg")]):
        for url in _css_loads(path.read_text(encoding="utf-8")):
            faults += _load_faults(url, path.resolve(), path.relative_to(site))
    for path in sorted(site.rglob("*.js")):
        loaded = _SCRIPT_LOADS.findall(path.read_text(encoding="utf-8"))
        faults += [f"{path.relative_to(site)}: asks for {url}" for url in loaded]
    return Findings(faults=tuple(faults), outside=tuple(sorted(outside)), pages=len(pages))


def _page(path: Path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def _css_loads(text: str) -> list[str]:
    return [first or second for first, second in _CSS_LOADS.findall(text)]


def _is_outside(url: str) -> bool:
    return url.startswith("//") or urlsplit(url).scheme in {"http", "https", "ws", "wss", "ftp", "mailto"}


def _load_faults(url: str, path: Path, name: Path) -> list[str]:
    if url.startswith(("data:", "#", "about:")):
        return []
    if _is_outside(url):
        return [f"{name}: asks for {url}"]
    if not (path.parent / unquote(urlsplit(url).path)).exists():
        return [f"{name}: loads {url}, which is not there"]
    return []


def _link_faults(url: str, path: Path, name: Path, pages: dict[Path, Page]) -> list[str]:
    parts = urlsplit(url)
    if parts.scheme in {"data", "javascript", "blob"}:
        return []
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.is_file():
        return [f"{name}: links to {url}, which is not there"]
    anchor = unquote(parts.fragment)
    if anchor and target in pages and anchor not in pages[target].anchors:
        return [f"{name}: links to {url}, where nothing is called {anchor}"]
    return []


def main() -> int:
    """Print what is wrong; exit code 1 where something is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("site", type=Path, help="the built site's directory")
    parser.add_argument("--outside", type=Path, help="write the addresses of other sites to this file")
    options = parser.parse_args()
    found = check(options.site)
    if options.outside is not None:
        options.outside.write_text("".join(f"{url}\n" for url in found.outside), encoding="utf-8")
    for fault in found.faults:
        sys.stdout.write(f"{fault}\n")
    if not found.pages:
        sys.stdout.write(f"{options.site}: no page is there\n")
    sys.stdout.write(f"{found.pages} pages, {len(found.faults)} faults, {len(found.outside)} addresses outside\n")
    return int(bool(found.faults) or not found.pages)


if __name__ == "__main__":
    sys.exit(main())
