"""The site itself: built without a warning, closed in itself, to be read and searched without a network or a server."""

import functools
import http.server
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from check_site import check
from playwright.sync_api import sync_playwright

REPOSITORY = Path(__file__).resolve().parents[2]


@contextmanager
def served(site: Path) -> Iterator[str]:
    """The site on this machine, over HTTP."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def read_in_a_browser(start: str) -> set[str]:
    """Reads, goes from page to page and searches; gives the hosts that were asked, blank for files."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no Chromium on this machine: apt install chromium")
    asked: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.on("request", lambda request: asked.append(request.url))
        faults: list[str] = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(f"{start}/index.html")
        page.wait_for_url("**/docs/index.html")
        page.get_by_role("link", name="Every key of the configuration").first.click()
        page.wait_for_url("**/docs/config.html")
        assert page.get_by_role("heading", name="penalties.KIND").is_visible()
        page.get_by_placeholder("Search").fill("hysteresis_m")
        page.get_by_placeholder("Search").press("Enter")
        page.wait_for_url("**/search.html?**")
        page.locator("#search-results li a", has_text="Every key").wait_for()
        page.goto(f"{start}/docs/index.html")
        assert all(page.evaluate("[...document.images].map(one => one.complete && one.naturalWidth > 0)"))
        browser.close()
    assert faults == [], faults
    return {urlsplit(url).hostname or "" for url in asked if not url.startswith(("data:", "blob:"))}


def test_the_site_is_whole_closed_and_can_be_searched(tmp_path: Path) -> None:
    """No warning of Sphinx, no dead link or anchor, no request to any other host: as files, and from a web server.

    One test and not four, since it builds the site once.
    """
    pytest.importorskip("sphinx", reason="the documentation's tools are not installed: pip install 'dnb-edge[docs]'")
    site = tmp_path / "site"
    build = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "-q",
            "-W",
            "--keep-going",
            "-c",
            "docs",
            "-d",
            tmp_path / "doctrees",
            ".",
            site,
        ],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert build.returncode == 0, build.stderr
    found = check(site)
    assert found.faults == ()
    assert found.pages > 80
    assert read_in_a_browser(site.as_uri()) == {""}
    with served(site) as address:
        assert read_in_a_browser(address) == {"127.0.0.1"}
