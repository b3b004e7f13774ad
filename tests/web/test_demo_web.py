"""`dnb-edge demo --web`: one command to a race with its pages, and one Ctrl-C out of it."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

from running_box import ALONE, wait_until
from typer.testing import CliRunner

from dnb_edge.cli.main import app


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def demo(folder: Path, port: int, log: Path) -> subprocess.Popen[str]:
    """In a process group of its own, as a shell starts it."""
    with log.open("w") as said:
        return subprocess.Popen(
            [sys.executable, "-m", "dnb_edge", "demo", "--web", "--port", str(port), "--out", str(folder)],
            stdout=said,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | ALONE,
            start_new_session=True,
        )


def test_one_command_races_with_pages_that_are_told_until_ctrl_c(tmp_path: Path) -> None:
    """It says the address, the pages are there with the race on them, opening the log-in shows the code in the terminal, and
    Ctrl-C ends both processes with a finished recording."""
    log, port = tmp_path / "said", free_port()
    process = demo(tmp_path / "demo", port, log)
    try:
        wait_until(lambda: f"http://127.0.0.1:{port}/" in log.read_text(), log.read_text)

        def asked(path: str) -> str:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=10.0) as answer:
                return str(answer.read().decode())

        def is_there() -> bool:
            # Its address is told before it listens.
            with contextlib.suppress(urllib.error.URLError):
                return bool(asked("/login"))
            return False

        wait_until(is_there, log.read_text)
        wait_until(lambda: '"racing"' in asked("/api/v1/state"), log.read_text)
        assert "Log in" in asked("/login")
        wait_until(lambda: re.search(r"set-up code \d{4} \d{4}", log.read_text()), log.read_text)
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(60.0) == 0
        assert [path.suffix for path in (tmp_path / "demo").glob("run-*")] == [".mcap"]
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_a_port_that_is_taken_is_one_line(tmp_path: Path) -> None:
    """And nothing is raced."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        log = tmp_path / "said"
        process = demo(tmp_path / "demo", taken.getsockname()[1], log)
        assert process.wait(60.0) == 2
    assert "port" in log.read_text().splitlines()[-1]
    assert not list((tmp_path / "demo").glob("run-*"))


def test_fast_pages_are_refused(tmp_path: Path) -> None:
    """A page shows a race as it is driven."""
    told = CliRunner().invoke(app, ["demo", "--web", "--fast", "--out", str(tmp_path)])
    assert told.exit_code != 0
    assert not list(tmp_path.iterdir())
