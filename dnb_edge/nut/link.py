"""How a driver's process is reached and ended: a program that is started here, or a socket on which one listens.

Knows processes and sockets; nothing of what is said. A program gets the stream on its standard input and output; what it writes
to standard error is kept for the reason why it ended.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from typing import Protocol

from dnb_edge.errors import InputError
from dnb_edge.nut.stream import Gone, Late, Stream

_FATE_S = 1.0
"""A process whose stream has ended is waited for so long, to say how it ended."""
_POLL_S = 0.005


class Link(Protocol):
    """A reached driver."""

    @property
    def stream(self) -> Stream:
        """Where it is spoken to."""

    def fate(self) -> str:
        """What became of a driver whose stream has ended, in words."""

    def end(self, goodbye: bytes, limit_s: float) -> None:
        """Says goodbye and sees to it that it ends; never raises."""


class _Program:
    """A program that was started here, with all that it starts itself."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        self._process = process
        self.stream = Stream(process.stdout.fileno(), process.stdin.fileno(), process.stderr.fileno())

    def fate(self) -> str:
        """How it ended, and the last that it complained."""
        ended = self._ended(_FATE_S)
        if ended is None:
            return "closed its standard input or output"
        code = ended.si_status
        names = {one.value: one.name for one in signal.Signals}
        how = f"ended with exit code {code}" if ended.si_code == os.CLD_EXITED else f"ended by {names.get(code, code)}"
        said = self.stream.complaint()
        return f"{how} ({said})" if said else how

    def end(self, goodbye: bytes, limit_s: float) -> None:
        """Waits, asks, and kills at last, with it what it started and left behind."""
        _say(self.stream, goodbye, limit_s)
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        assert pipes[0] is not None
        with contextlib.suppress(OSError):  # what was not read before it died
            pipes[0].close()
        if self._ended(limit_s) is None:
            os.killpg(self._process.pid, signal.SIGTERM)
            self._ended(limit_s)
        # Not reaped so far, so that the number still is this group's and nobody else's.
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for pipe in pipes[1:]:
            if pipe is not None:
                pipe.close()

    def _ended(self, limit_s: float) -> os.waitid_result | None:
        """How it ended, within the time; it is not reaped."""
        deadline_s = time.monotonic() + limit_s
        while True:
            ended = os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            if ended is not None or time.monotonic() >= deadline_s:
                return ended
            time.sleep(_POLL_S)


class _Connection:
    """A socket on which a driver listens; the process behind it is somebody else's."""

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected
        self.stream = Stream(connected.fileno(), connected.fileno())

    def fate(self) -> str:
        """All that a socket tells."""
        return "closed the connection"

    def end(self, goodbye: bytes, limit_s: float) -> None:
        """Says goodbye and hangs up."""
        _say(self.stream, goodbye, limit_s)
        self._socket.close()


def _say(stream: Stream, goodbye: bytes, limit_s: float) -> None:
    with contextlib.suppress(Gone, Late):
        stream.send(goodbye, time.monotonic() + limit_s)


def words_of(command: str) -> list[str]:
    """The command line's words. Raises InputError where there are none, or no such program."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(f"exec:{command}: {error}: give a command line as in a shell") from error
    if not words:
        raise InputError("exec: give exec:COMMAND, such as 'exec:python3 my_driver.py'")
    if shutil.which(words[0]) is None:
        raise InputError(f"exec:{command}: there is no program {words[0]}: give its path, or put it on PATH")
    return words


def exec_name(words: list[str]) -> str:
    """What tables call it: the first file with an ending among the words (a script), else the program."""
    scripts = [word for word in words if Path(word).suffix and Path(word).is_file()]
    return Path(scripts[0]).stem if scripts else Path(words[0]).name


def started(words: list[str]) -> Link:
    """The program, started. Raises OSError."""
    return _Program(
        subprocess.Popen(  # noqa: S603 the program that the user named
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,
        )
    )


def connect_tcp(address: tuple[str, int], limit_s: float) -> Link:
    """A connection to (host, port). Raises OSError."""
    connected = socket.create_connection(address, timeout=limit_s)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # a picture's answer is waited for
    return _Connection(connected)


def connect_unix(path: str, limit_s: float) -> Link:
    """A connection to the socket at `path`. Raises OSError."""
    connected = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connected.settimeout(limit_s)
    try:
        connected.connect(path)
    except OSError:
        connected.close()
        raise
    return _Connection(connected)
