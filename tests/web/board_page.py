"""The board's pages in a real browser, with a live stream that the test speaks: pages and files are the app's own, under its
content policy, and the stream is a list of messages. No socket is opened, so that nothing but the browser takes time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from starlette.datastructures import MutableHeaders
from starlette.requests import Request

from dnb_edge import wire
from dnb_edge.web.board import PAGES
from dnb_edge.web.guard import security_headers
from dnb_edge.web.pages import TemplatePages
from dnb_edge.web.static_files import TYPES, StaticFiles

CHROMIUM = Path("/usr/bin/chromium")
HOST = "http://localhost"
PATIENCE_MS = 15_000


class Stream:
    """The server's end of the live stream, of as many connections as the page opens."""

    def __init__(self):
        self.asked = []
        """The addresses that were asked for, in order."""
        self.sockets = []
        self.greeting = []
        """Messages for each new connection."""

    def opened(self, socket):
        """The page has connected."""
        self.asked.append(socket.url)
        self.sockets.append(socket)
        for message in self.greeting:
            socket.send(json.dumps(message))

    def send(self, *messages):
        """To the latest connection."""
        for message in messages:
            self.sockets[-1].send(json.dumps(message))

    def drop(self):
        """Ends the latest connection."""
        self.sockets[-1].close()


def hello(epoch="e1", following=0, resumed=False):
    return {"kind": "hello", "epoch": epoch, "next": following, "resumed": resumed}


def told(events, first=0):
    """Events as the stream has them, numbered from `first`."""
    return [
        {"kind": "event", "sequence": first + at, "event": json.loads(wire.event_to_json(event))}
        for at, event in enumerate(events)
    ]


def state(phase="racing", **more):
    known = {
        "phase": phase,
        "reason": None,
        "run": "run-1",
        "source": "sim:",
        "track": "a track",
        "laps_wanted": None,
        "scenery": None,
        "first_sequence": 0,
    }
    return {"kind": "state", "state": known | more}


DOWN = {"kind": "state", "state": None}


class Site:
    """Pages of the app in one browser."""

    def __init__(self, browser):
        self._browser = browser
        self._files = StaticFiles()
        self._pages = TemplatePages(self._files)
        self.faults = []
        """What the browser complained of: errors of scripts, breaches of the content policy."""
        self.session = None
        """Of who asks for a page; None for somebody who only watches."""
        self.posted = []
        """What was posted: (address, token, body)."""

    def page(self, stream=None, *, width=1280, height=720, scheme="light", **context):
        """An empty page whose addresses lead to the app and to `stream`."""
        context = self._browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, base_url=HOST, **context
        )
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("console", lambda line: self.faults.append(line.text) if line.type == "error" else None)
        page.route("**/*", self._answer)
        stream = Stream() if stream is None else stream
        page.route_web_socket("**/api/v1/live*", stream.opened)
        return page

    def close_all(self):
        """Closes every page: each that is left open goes on painting."""
        for context in self._browser.contexts:
            context.close()

    def _answer(self, route):
        address = urlsplit(route.request.url)
        if f"{address.scheme}://{address.netloc}" != HOST:
            self.faults.append(f"an outside request: {route.request.url}")
            route.abort()
            return
        if route.request.method == "POST":
            self.posted.append((address.path, route.request.headers.get("x-csrf-token"), route.request.post_data_json))
            route.fulfill(json={"done": True})
            return
        body, kind = self._found(address.path)
        headers = MutableHeaders({"content-type": kind})
        security_headers(headers, address.netloc)
        route.fulfill(status=404 if body is None else 200, headers=dict(headers), body=body or b"")

    def _found(self, path):
        template = next((template for at, template, _ in PAGES if at == path), None)
        if template is not None:
            scope = {"type": "http", "method": "GET", "path": path, "headers": [], "query_string": b""}
            request = Request(scope | {"state": {"session": self.session}})
            return self._pages.page(request, template).body, "text/html; charset=utf-8"
        file = self._files.file(path.removeprefix("/static/"))
        return (None, "text/plain") if file is None else (file.content, TYPES[Path(path).suffix])


@contextmanager
def site() -> Iterator[Site]:
    """A browser and the pages."""
    if not CHROMIUM.exists():
        pytest.skip(f"there is no browser at {CHROMIUM}: install Debian's chromium")
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 only where there is a browser

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        yield Site(browser)
        browser.close()
