"""A whole box on this machine for tests and measurements: the appliance over a simulated race in real time, pages, a browser.

All are processes of their own, as they are on a real box.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.sim.rig import Rig

PATIENCE_S = 60.0
ALONE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


class Process:
    """`dnb-edge` with its words; `lines` are those of stdout with the moment at which each came."""

    def __init__(self, words: Sequence[str | Path], log: Path, *, program: Sequence[str] = ("-m", "dnb_edge")) -> None:
        self.lines: list[tuple[float, str]] = []
        self.log = log
        self._errors = log.open("w")
        self._process = subprocess.Popen(
            [sys.executable, *program, *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=os.environ | ALONE,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def said(self) -> str:
        """All of stderr so far."""
        return self.log.read_text()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def events(self, kind: str) -> list[dict[str, Any]]:
        """The JSON lines of one kind so far."""
        found = (json.loads(line) for _, line in list(self.lines))
        return [event for event in found if event["event"] == kind]

    def end(self) -> None:
        """SIGTERM, and wait."""
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise
        finally:
            self._reader.join(5.0)
            assert self._process.stdout is not None
            self._process.stdout.close()
            self._errors.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append((time.time(), line))


class RunningBox:
    """The two processes on folders below `folder`; `start_daemon` may be called again after `stop_daemon`."""

    def __init__(self, folder: Path, *, laps: int = 60, source: str | None = None) -> None:
        self.folder = folder
        self.runs, self.setup, self.socket = folder / "runs", folder / "setup", folder / "live.sock"
        for place in (self.runs, self.setup):
            place.mkdir(exist_ok=True)
        config = folder / "config"
        config.mkdir(exist_ok=True)
        self.config = write_demo_config(config, Rig(laps=laps))
        self.source = f"sim:?pace=1&laps={laps}" if source is None else source
        self.port = _free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.daemon: Process | None = None
        self.web: Process | None = None

    def start_daemon(self, *more: str | Path, config: bool = True) -> Process:
        """The appliance; returns once its socket is there."""
        words: list[str | Path] = [
            "run",
            "--source",
            self.source,
            "--record",
            self.runs,
            "--live",
            self.socket,
            "--json",
        ]
        if config:
            words += ["--config", self.config]
        self.daemon = Process([*words, *more], self.folder / "run.log")
        wait_until(self.socket.exists, lambda: self.daemon.said if self.daemon is not None else "")
        return self.daemon

    def start_web(self, *more: str | Path) -> Process:
        """The pages; returns once they answer."""
        words: list[str | Path] = ["web", "--host", "127.0.0.1", "--port", str(self.port), "--socket", self.socket]
        self.web = Process([*words, "--runs", self.runs, "--setup", self.setup, *more], self.folder / "web.log")
        wait_until(self._answers, lambda: self.web.said if self.web is not None else "")
        return self.web

    def stop_daemon(self) -> None:
        if self.daemon is not None:
            self.daemon.end()
            self.daemon = None

    def close(self) -> None:
        self.stop_daemon()
        if self.web is not None:
            self.web.end()
            self.web = None

    def code(self) -> str:
        """The set-up code that was logged last."""
        assert self.web is not None
        return re.findall(r"set-up code ([\d ]{9})", self.web.said)[-1]

    def _answers(self) -> bool:
        try:
            with urllib.request.urlopen(f"{self.url}/api/v1/state", timeout=5.0) as answer:
                return bool(answer.status == 200)
        except OSError:
            return False


@contextlib.contextmanager
def running_box(folder: Path, *, more: Sequence[str] = (), **settings: Any) -> Iterator[RunningBox]:
    """A box with both processes running; `more` words go to the appliance."""
    box = RunningBox(folder, **settings)
    try:
        box.start_daemon(*more)
        box.start_web()
        yield box
    finally:
        box.close()


@contextlib.contextmanager
def chromium() -> Iterator[Browser]:
    """Debian's Chromium, without a window; skips where there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no Chromium on this machine: apt install chromium")
    with sync_playwright() as playwright:
        # A test's container has neither a user namespace for the sandbox nor much shared memory.
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
        )
        yield browser
        browser.close()


def opened(browser: Browser, **settings: Any) -> tuple[Page, list[str]]:
    """A page, and what went wrong on it so far: errors, failed requests, requests to others than the box."""
    page = browser.new_context(**settings).new_page()
    page.set_default_timeout(1000 * PATIENCE_S)
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("request", lambda asked: None if _is_own(asked.url) else wrong.append(f"request to {asked.url}"))
    return page, wrong


def log_in(page: Page, box: RunningBox) -> None:
    """As a user does, with the code that the box shows."""
    page.goto(f"{box.url}/login")
    page.get_by_label("code").fill(box.code())
    page.keyboard.press("Enter")
    page.wait_for_url(lambda url: not url.endswith("/login"))


def wait_until(
    true: Callable[[], Any], told: Callable[[], str] = lambda: "", *, patience_s: float = PATIENCE_S
) -> None:
    """Returns once `true()` holds; fails with `told()` after a minute."""
    deadline_s = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < deadline_s, told()
        time.sleep(0.05)


def _is_own(url: str) -> bool:
    return url.startswith(("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:", "about:"))


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
