"""The check of a built site finds what it is there for, and lets the rest pass."""

from pathlib import Path

import pytest
from check_site import check

GOOD = {
    "index.html": '<meta http-equiv="refresh" content="0; url=docs/page.html"><a href="docs/page.html#there">x</a>',
    "docs/page.html": '<link rel="stylesheet" href="../style.css"><h1 id="there">A</h1><img src="a%20b.png">'
    '<a href="#there">x</a><a href="https://example.org/">outside</a><script>var x = "https://example.org/";</script>'
    '<img src="data:image/png;base64,AA=="><img srcset="a%20b.png 1x, a%20b.png 2x">',
    "style.css": "a { background: url(docs/a%20b.png); } b { background: url('data:image/svg+xml;utf8,<svg/>'); }",
    "docs/a b.png": "",
}


def site(place: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text, encoding="utf-8")
    return place


def test_a_good_site_passes(tmp_path: Path) -> None:
    """Links within it, pictures, data and links to other sites are no faults; the latter are listed."""
    found = check(site(tmp_path, GOOD))
    assert found.faults == ()
    assert found.outside == ("https://example.org/",)
    assert found.pages == 2


@pytest.mark.parametrize(
    ("name", "text", "fault"),
    [
        ("docs/bad.html", '<script src="https://cdn.example/x.js"></script>', "asks for https://cdn.example/x.js"),
        ("docs/bad.html", '<img src="//cdn.example/x.png">', "asks for //cdn.example/x.png"),
        ("docs/bad.html", '<link rel="preconnect" href="https://fonts.example">', "asks for https://fonts.example"),
        (
            "docs/bad.html",
            '<img srcset="a%20b.png 1x, https://x.example/y.png 2x">',
            "asks for https://x.example/y.png",
        ),
        ("docs/bad.html", '<p style="background: url(http://x.example/y)">', "asks for http://x.example/y"),
        ("docs/bad.html", "<style>@import 'https://x.example/a.css';</style>", "asks for https://x.example/a.css"),
        ("docs/bad.html", '<svg><image href="https://x.example/a.png"/></svg>', "asks for https://x.example/a.png"),
        ("docs/bad.html", '<script>fetch("https://x.example/a")</script>', "asks for https://x.example/a"),
        ("docs/bad.html", '<script>new WebSocket("wss://x.example/a")</script>', "asks for wss://x.example/a"),
        ("bad.js", "import('https://x.example/a.js')", "asks for https://x.example/a.js"),
        ("bad.css", "@font-face { src: url(https://x.example/f.woff2) }", "asks for https://x.example/f.woff2"),
        ("bad.svg", "<svg><style>@import 'https://x.example/a.css'</style></svg>", "asks for https://x.example/a.css"),
        ("docs/bad.html", '<img src="gone.png">', "loads gone.png, which is not there"),
        ("docs/bad.html", '<a href="gone.html">x</a>', "links to gone.html, which is not there"),
        ("docs/bad.html", '<a href="../index.html#gone">x</a>', "where nothing is called gone"),
        ("docs/bad.html", '<a href="#gone">x</a>', "where nothing is called gone"),
        ("docs/bad.html", '<a href="../docs">x</a>', "links to ../docs, which is not there"),
    ],
)
def test_one_fault_is_found(tmp_path: Path, name: str, text: str, fault: str) -> None:
    """Each kind of outside request and of dead link, with the file that has it, and nothing else."""
    (found,) = check(site(tmp_path, GOOD | {name: text})).faults
    assert found.startswith(f"{name}: ")
    assert found.endswith(fault)
