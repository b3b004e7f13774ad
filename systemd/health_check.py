"""Whether the service that was just started is healthy: asks its live socket, prints one line, exit code 0 or 1.

`install.sh` runs it with Debian's own Python, whatever release is installed: the standard library alone, and of the socket's
protocol (docs/live-socket.md) only what every version has. Knows neither units nor releases.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ANSWER_S = 5.0
"""A daemon that lives says what it does at once."""
RETRY_S = 0.5


def messages(path: Path, deadline_s: float) -> Iterator[dict[str, Any]]:
    """What the daemon at `path` says, until it is silent up to `deadline_s` of the monotonic clock. Raises `OSError`."""
    with contextlib.closing(socket.socket(socket.AF_UNIX)) as line:
        line.settimeout(max(0.05, deadline_s - time.monotonic()))
        line.connect(str(path))
        line.sendall(b'{"say": "follow", "ask": 1, "since": 0}\n')
        with line.makefile("rb") as file:
            while (left_s := deadline_s - time.monotonic()) > 0:
                line.settimeout(left_s)
                said = file.readline()
                if not said:
                    raise ConnectionError("it closed the line")
                message = json.loads(said)
                if isinstance(message, dict):
                    file.read(int(message.get("blob_bytes") or 0))
                    yield message


def phase(path: Path) -> str | None:
    """What it is doing now; None where nothing answers."""
    with contextlib.suppress(OSError, ValueError):
        for message in messages(path, time.monotonic() + ANSWER_S):
            if message.get("say") == "state":
                return str(message.get("phase"))
    return None


def wait(path: Path, *, within_s: float, must_race: bool) -> tuple[bool, str]:
    """(healthy, in words), as soon as that is sure.

    Healthy is a race whose frames come, one that is over, or a reason why none can begin yet, such as no camera; with
    `must_race` that last one is not enough.
    """
    deadline_s = time.monotonic() + within_s
    last = None
    while time.monotonic() < deadline_s:
        try:
            for message in messages(path, deadline_s):
                verdict = _verdict(message)
                if verdict is None:
                    continue
                waiting, last = verdict
                if not (waiting and must_race):
                    return True, last
        except TimeoutError:
            last = last or f"its socket {path} says nothing"
        except (OSError, ValueError) as error:
            last = f"its socket {path} does not answer: {error}"
        time.sleep(RETRY_S)
    last = last or "nobody asked it"
    return False, f"it raced before, and now: {last}" if must_race else last


def _verdict(message: dict[str, Any]) -> tuple[bool, str] | None:
    """(whether it only waits, what it does in words); None where that says nothing yet."""
    match message:
        case {"say": "event", "event": {"event": "health"}}:
            return False, "racing: frames come"
        case {"say": "state", "phase": "finished"}:
            return False, "the race is over"
        case {"say": "state", "phase": "setup" | "fault" as now, "reason": reason}:
            what = "it waits to be set up" if now == "setup" else "it waits"
            return True, f"{what}: {reason}" if reason else what
    return None


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description="Ask a dnb-edge service whether it is healthy.")
    parser.add_argument("socket", type=Path)
    parser.add_argument("--phase", action="store_true", help="only say what it is doing")
    parser.add_argument("--within", type=float, default=90.0, metavar="SECONDS")
    parser.add_argument("--must-race", action="store_true", help="waiting for a camera or a set-up is not enough")
    given = parser.parse_args()
    if given.phase:
        found = phase(given.socket)
        sys.stdout.write(f"{found or 'down'}\n")
        return 0 if found else 1
    healthy, said = wait(given.socket, within_s=given.within, must_race=given.must_race)
    sys.stdout.write(said + "\n")
    return 0 if healthy else 1


if __name__ == "__main__":
    sys.exit(main())
