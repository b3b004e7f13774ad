"""The command `dnb-edge` as a shell runs it: a process of its own, its two streams and its exit code."""

import atexit
import fcntl
import json
import os
import subprocess
import sys
import tempfile
import threading
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from warm_command import Warm

COMMAND = (sys.executable, "-m", "dnb_edge")
LAPS = 3
"""Laps of the race that many tests share."""

CLIP_FRAMES = 40
"""Frames of the short clip."""

PATIENCE_S = 120.0
"""How long a command may take before it counts as hung; no statement about speed."""


def environment() -> dict[str, str]:
    """Ours, without a service manager and with as many threads as the tests have processors to spare."""
    kept = {name: value for name, value in os.environ.items() if name not in {"NOTIFY_SOCKET", "WATCHDOG_USEC"}}
    return kept | {"OMP_NUM_THREADS": "1", "COLUMNS": "100", "NO_COLOR": "1"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ran:
    """What one command left behind."""

    code: int
    out: str
    err: str

    @property
    def events(self) -> list[dict[str, Any]]:
        """Its JSON lines; anything else on stdout is an error."""
        return [json.loads(line) for line in self.out.splitlines()]

    def of(self, *kinds: str) -> list[dict[str, Any]]:
        """Its JSON lines of these kinds."""
        return [event for event in self.events if event["event"] in kinds]

    def complaint(self) -> str:
        """The one line that it said on stderr; fails where that is not all."""
        (line,) = self.err.splitlines()
        assert line.startswith("dnb-edge: ")
        return line


@dataclass(frozen=True, slots=True, kw_only=True)
class Race:
    """A finished `dnb-edge demo --fast --json` of `LAPS` laps."""

    ran: Ran
    directory: Path
    recording: Path


@cache
def warm() -> Warm:
    """This test process's own, begun by the first command."""
    one = Warm(environment())
    atexit.register(one.close)
    return one


def edge(*words: object, cwd: Path | None = None) -> Ran:
    """Runs `dnb-edge WORDS` to its end, in a process of its own."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        here = Path.cwd() if cwd is None else cwd
        code = warm().run([str(word) for word in words], here, out.fileno(), err.fileno(), PATIENCE_S)
        out.seek(0)
        err.seek(0)
        return Ran(code=code, out=out.read().decode(), err=err.read().decode())


def edge_cold(*words: object) -> Ran:
    """The same from nothing, imports and all, as a shell does."""
    done = subprocess.run(
        [*COMMAND, *map(str, words)],
        env=environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    return Ran(code=done.returncode, out=done.stdout, err=done.stderr)


class EdgeOnce:
    """`edge`, but a command of one name runs once only, whatever process asks for it; what it said is kept in `directory`."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def __call__(self, name: str, *words: object) -> Ran:
        said = self.directory / f"{name}.json"
        with (self.directory / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not said.exists():
                said.write_text(json.dumps(asdict(edge(*words))))
        return Ran(**json.loads(said.read_text()))


class Running:
    """A `dnb-edge WORDS --json` that runs on, read line by line. Use it in a `with` statement."""

    def __init__(self, *words: object, err: Path, command: tuple[str, ...] = COMMAND) -> None:
        self._err = err
        self._said: list[str] = []
        with err.open("wb") as stream:
            self.process = subprocess.Popen(
                [*command, *map(str, words)],
                env=environment(),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=stream,
                text=True,
            )
        self._hung = threading.Timer(PATIENCE_S, self.process.kill)
        self._hung.start()

    def __enter__(self) -> "Running":
        return self

    def __exit__(self, *error: object) -> None:
        self._hung.cancel()
        self.process.kill()
        self.process.stdout.close()
        self.process.wait()

    def read_until(self, kind: str) -> None:
        """Reads up to the first JSON line of `kind`."""
        for line in self.process.stdout:
            self._said.append(line)
            if json.loads(line)["event"] == kind:
                return
        raise AssertionError(f"ended before the first {kind}: {self._err.read_text()}")

    def ended(self, within_s: float) -> Ran:
        """What it left, once it has ended by itself; fails where that takes longer."""
        code = self.process.wait(within_s)
        self._said += self.process.stdout
        return Ran(code=code, out="".join(self._said), err=self._err.read_text())
