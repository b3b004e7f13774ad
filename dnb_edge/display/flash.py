"""Writes the panel's firmware onto a microcontroller that runs MicroPython, over its USB serial port.

Knows MicroPython's raw REPL (https://docs.micropython.org/en/latest/reference/repl.html): Ctrl-C stops what runs, Ctrl-A asks
for it, code goes up to Ctrl-D, then come `OK`, the output, Ctrl-D, the errors, Ctrl-D. Each file is written beside its place,
checked by its SHA-256 on the board itself and only then put there; a file that is there already is left alone.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import serial
from serial.tools import list_ports

from dnb_edge.display import protocol
from dnb_edge.display.panel.board import settings as board_settings
from dnb_edge.display.serial_port import PORT_FAULTS
from dnb_edge.errors import InputError, WorkError

RASPBERRY_PI = 0x2E8A
"""USB vendor of the RP2040 under MicroPython."""
OLDEST = (1, 22)
"""First version of MicroPython whose `rp2` has the DMA that HUB75 panels are fed by."""
MAIN = b"from panel.board.firmware import run\n\nrun()\n"
"""The board's `main.py`, which MicroPython runs at power on."""
SETTINGS = "settings.json"

ANSWER_S = 5.0
"""Longest silence of a board that has been asked, seconds: it may have to erase its flash memory."""
INTERRUPT_S = 1.0
CHUNK_BYTES = 162
"""Bytes of a file told at once: with what is round them they fit into half of the buffer that boards have for input."""

_BANNER = b"raw REPL; CTRL-B to exit\r\n>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Flashed:
    """What became of a board."""

    port: str
    micropython: str
    """Its version, such as 1.25.0."""
    written: tuple[str, ...]
    unchanged: tuple[str, ...]
    removed: tuple[str, ...]


def board_files() -> dict[str, bytes]:
    """Every file of the firmware by its path on the board, `main.py` last, without the settings."""
    panel = files("dnb_edge.display") / "panel"
    return dict(_sources(panel, "panel")) | {"main.py": MAIN}


def _sources(folder: Traversable, path: str) -> Iterator[tuple[str, bytes]]:
    for entry in sorted(folder.iterdir(), key=lambda one: one.name):
        if entry.is_dir() and entry.name != "__pycache__":
            yield from _sources(entry, f"{path}/{entry.name}")
        elif entry.name.endswith(".py"):
            yield f"{path}/{entry.name}", entry.read_bytes()


def find_port() -> str:
    """The port of the one board that is plugged in. Raises `InputError` where there is none, or several."""
    ports = sorted(port.device for port in list_ports.comports() if port.vid == RASPBERRY_PI)
    if not ports:
        raise InputError(
            "no board with MicroPython is plugged in: hold its BOOTSEL button while you plug it in, copy MicroPython's .uf2"
            " file onto the drive that appears, and try again; any other board: name its port, such as /dev/ttyACM0"
        )
    if len(ports) > 1:
        raise InputError(f"several boards are plugged in: name one of {' '.join(ports)}")
    return ports[0]


def checked_settings(told: Mapping[str, object]) -> bytes:
    """`settings.json` with `told`. Raises `InputError` where the board would not take them."""
    complaint = board_settings.judge(dict(told))
    if complaint:
        raise InputError(f"the panel's settings: {complaint}")
    return (json.dumps(dict(told), indent=2) + "\n").encode()


def flash(
    port: str,
    settings: Mapping[str, object] | None = None,
    *,
    tell: Callable[[str, int, int], None] = lambda _path, _done, _all: None,
) -> Flashed:
    """Write the firmware onto the board at `port` and start it. `settings` go over those that the board has.

    `tell` hears of each file: its path, how many are done, how many there are. Raises `InputError` where the port is not
    there or the settings are wrong, `WorkError` where the board does not answer, is too old, or does not keep what was written.
    """
    changes = settings or {}
    checked_settings(changes)
    with _opened(port) as line:
        try:
            return _write_all(_Repl(line), port, changes, tell)
        except PORT_FAULTS as fault:
            raise WorkError(f"{port}: the board went away while it was written: {fault}") from fault


def _write_all(repl: _Repl, port: str, changes: Mapping[str, object], tell: Callable[[str, int, int], None]) -> Flashed:
    repl.enter()
    version = _version(repl, port)
    repl.run(_HELPERS)
    wanted = board_files()
    if changes:
        wanted = {SETTINGS: checked_settings({**_settings_there(repl), **changes}), **wanted}
    there: dict[str, str] = json.loads(repl.run(f"print(json.dumps(sums({['panel', 'panel/board']!r})))"))
    written: list[str] = []
    unchanged: list[str] = []
    for done, (path, content) in enumerate(wanted.items()):
        tell(path, done, len(wanted))
        digest = hashlib.sha256(content).hexdigest()
        if there.get(path) == digest:
            unchanged.append(path)
            continue
        if not written:
            # Whatever happens from now on, a half-written board does not start.
            repl.run("gone('main.py')")
            there.pop("main.py", None)
        _write(repl, path, content, digest)
        written.append(path)
    stale = sorted(path for path in there if path not in wanted and path.startswith("panel/"))
    for path in stale:
        repl.run(f"gone({path!r})")
    tell("", len(wanted), len(wanted))
    repl.leave()
    return Flashed(
        port=port, micropython=version, written=tuple(written), unchanged=tuple(unchanged), removed=tuple(stale)
    )


def _settings_there(repl: _Repl) -> dict[str, object]:
    """The board's own settings; none where it has none that it would take."""
    text: str = json.loads(repl.run(f"print(json.dumps(text_of({SETTINGS!r})))"))
    try:
        told = json.loads(text)
    except ValueError:
        return {}
    return told if not board_settings.judge(told) else {}


def _version(repl: _Repl, port: str) -> str:
    told = repl.run(
        "import sys\nprint(sys.implementation.name, '.'.join([str(n) for n in sys.implementation.version[:3]]))"
    )
    found = re.fullmatch(r"micropython (\d+)\.(\d+)(\S*)\s*", told)
    if found is None:
        raise WorkError(f"{port}: it runs {told.strip()!r} and not MicroPython")
    version = f"{found[1]}.{found[2]}{found[3]}"
    if (int(found[1]), int(found[2])) < OLDEST:
        raise WorkError(f"{port}: MicroPython {version} is too old: {OLDEST[0]}.{OLDEST[1]} or newer is needed")
    return version


def _write(repl: _Repl, path: str, content: bytes, digest: str) -> None:
    folder = path.rpartition("/")[0]
    for end in range(1, folder.count("/") + 2 if folder else 0):
        repl.run(f"folder({'/'.join(folder.split('/')[:end])!r})")
    repl.run(f"file = open({path + '.new'!r}, 'wb')")
    for start in range(0, len(content), CHUNK_BYTES):
        text = base64.b64encode(content[start : start + CHUNK_BYTES]).decode()
        repl.run(f"file.write(binascii.a2b_base64({text!r}))")
    repl.run("file.close()")
    kept = repl.run(f"print(sum_of({path + '.new'!r}))").strip()
    if kept != digest:
        raise WorkError(f"the board kept {path} wrongly: its flash memory may be full or worn out")
    repl.run(f"gone({path!r})\nos.rename({path + '.new'!r}, {path!r})")


# What the board is taught for the while. Short names of modules: on older versions some have no others.
_HELPERS = """\
import binascii, hashlib, json, os
def sum_of(path):
    total = hashlib.sha256()
    with open(path, 'rb') as file:
        part = file.read(512)
        while part:
            total.update(part)
            part = file.read(512)
    return binascii.hexlify(total.digest()).decode()
def text_of(path):
    try:
        with open(path) as file:
            return file.read()
    except (OSError, ValueError):
        return ''
def listed(folder):
    try:
        return os.listdir(folder)
    except OSError:
        return []
def sums(folders):
    paths = [name for name in ('main.py', 'settings.json') if name in listed('.')]
    for folder in folders:
        paths += [folder + '/' + name for name in listed(folder) if '.' in name]
    return {path: sum_of(path) for path in paths}
def folder(path):
    try:
        os.mkdir(path)
    except OSError:
        pass
def gone(path):
    try:
        os.remove(path)
    except OSError:
        pass
"""


class _Repl:
    """MicroPython's raw REPL at the other end of a line."""

    def __init__(self, line: serial.Serial) -> None:
        self._line = line
        self._heard = b""

    def enter(self) -> None:
        """Stop what runs and take the prompt. Raises `WorkError` where nothing like it answers."""
        self._line.write(b"\r\x03\x03")
        time.sleep(0.1)
        deadline_s = time.monotonic() + INTERRUPT_S
        while self._line.read(4096) and time.monotonic() < deadline_s:
            pass
        self._line.write(b"\r\x01")
        if self._until(_BANNER, ANSWER_S) is None:
            raise WorkError(
                f"{self._line.port}: no MicroPython answers: is it on the board (see docs/wiring.md), and is this its port?"
            )

    def run(self, code: str) -> str:
        """What `code` prints. Raises `WorkError` with the last line of its error where it has one."""
        told = code.encode()
        for start in range(0, len(told), 256):
            self._line.write(told[start : start + 256])
            # The board's buffer holds 512 bytes, and no serial adapter in between waits for it.
            time.sleep(0.01 if len(told) > 256 else 0.0)
        self._line.write(b"\x04")
        taken = self._until(b"OK", ANSWER_S)
        output = self._until(b"\x04", ANSWER_S)
        error = self._until(b"\x04", ANSWER_S)
        if taken is None or output is None or error is None or self._until(b">", ANSWER_S) is None:
            raise WorkError(f"{self._line.port}: the board stopped answering; pull it out, plug it in and try again")
        if error.strip():
            raise WorkError(
                f"{self._line.port}: the board says {error.decode(errors='replace').strip().splitlines()[-1]}"
            )
        return output.decode(errors="replace")

    def leave(self) -> None:
        """Start the board anew, as if it were plugged in: it does not answer any more."""
        self._line.write(b"import machine\nmachine.reset()\n\x04")
        self._line.flush()
        # Closed at once, some systems throw away what is still to be sent.
        time.sleep(0.1)

    def _until(self, end: bytes, patience_s: float) -> bytes | None:
        """What comes before `end`; None where it does not come for `patience_s`."""
        deadline_s = time.monotonic() + patience_s
        while end not in self._heard:
            heard: bytes = self._line.read(max(1, self._line.in_waiting))
            if heard:
                deadline_s = time.monotonic() + patience_s
                self._heard += heard
            elif time.monotonic() > deadline_s:
                return None
        before, _, self._heard = self._heard.partition(end)
        return before


@contextmanager
def _opened(port: str) -> Iterator[Any]:
    try:
        line = serial.Serial(port, protocol.BAUD, timeout=0.05, write_timeout=ANSWER_S, exclusive=True)
    except PORT_FAULTS as fault:
        number = getattr(fault, "errno", None)
        reason = os.strerror(number) if isinstance(number, int) else str(fault)
        raise InputError(
            f"{port}: cannot be opened ({reason}): is the board plugged in, and does nothing else use it? A running service"
            " has it: sudo systemctl stop dnb-edge"
        ) from fault
    with line:
        yield line
