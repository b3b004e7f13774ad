"""The appliance in the guest, as its user sees it: a configuration, a unit, a display on a serial line, recordings.

Knows paths and the unit's name. Knows no fault: those are each test's own.
"""

from __future__ import annotations

import contextlib
import io
import json
import logging
import socket
import tarfile
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from dnb_edge.display.protocol import Message, parse_line
from dnb_edge.errors import InputError
from dnb_edge.record.reader import RecordedRun, read_run
from dnb_edge.values import Health, Lap
from harness.guest import Guest, GuestFault

UNIT = "dnb-edge"
RUNS = "/var/lib/dnb-edge/runs"
DISPLAY_URI = "serial:/dev/ttyS1"
PATIENCE_S = 240.0
"""How long to wait for what must happen but is not timed: a busy host stretches everything."""
_DROP_IN = f"/etc/systemd/system/{UNIT}.service.d/test.conf"

M = TypeVar("M", bound=Message)
log = logging.getLogger("system-test")


class Display:
    """The far end of the serial line: reads what the appliance tells, with the moment at which it came."""

    def __init__(self, guest: Guest) -> None:
        self.lines: list[tuple[float, Message]] = []
        """(seconds of this machine's monotonic clock, message)."""
        self.refused: list[bytes] = []
        """Lines that the protocol does not know."""
        self._line = socket.socket(socket.AF_UNIX)
        self._line.connect(str(guest.display_socket))
        self._changed = threading.Condition()
        threading.Thread(target=self._read, name="display", daemon=True).start()

    def wait(self, kind: type[M], true: Callable[[M], bool], *, since_s: float, timeout_s: float) -> tuple[float, M]:
        """The first message of that kind after `since_s` for which `true`. Raises `GuestFault` where none comes."""
        deadline_s = time.monotonic() + timeout_s
        with self._changed:
            while True:
                for at_s, message in self.lines:
                    if at_s > since_s and isinstance(message, kind) and true(message):
                        return at_s, message
                if not self._changed.wait(max(0.0, deadline_s - time.monotonic())) and time.monotonic() > deadline_s:
                    last = ", ".join(str(message) for _, message in self.lines[-4:])
                    raise GuestFault(f"no such {kind.__name__} on the display within {timeout_s:g} s; last: {last}")

    def close(self) -> None:
        """Unplugs the display."""
        with contextlib.suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)
        self._line.close()

    def _read(self) -> None:
        rest = b""
        with contextlib.suppress(OSError):
            while part := self._line.recv(4096):
                *lines, rest = (rest + part).split(b"\n")
                now_s = time.monotonic()
                with self._changed:
                    # An empty line begins each repaint: it ends whatever was cut off before.
                    for line in filter(bytes.strip, lines):
                        try:
                            self.lines.append((now_s, parse_line(line)))
                        except InputError:
                            self.refused.append(line)
                    self._changed.notify_all()


class Appliance:
    """dnb-edge as a service in `guest`, with a display on its second serial port."""

    def __init__(self, guest: Guest) -> None:
        self.guest = guest
        self.display = Display(guest)

    def install(self, files: Mapping[str, bytes], *, unit_lines: str = "") -> None:
        """Writes the configuration, and lets the unit at the display, as systemd/README.md says for a machine's own ports."""
        packed = io.BytesIO()
        with tarfile.open(fileobj=packed, mode="w") as archive:
            for name, content in files.items():
                entry = tarfile.TarInfo(name)
                entry.size = len(content)
                archive.addfile(entry, io.BytesIO(content))
        self.guest.run("mkdir -p /etc/dnb-edge && tar -x -C /etc/dnb-edge", stdin=packed.getvalue())
        self.guest.put(f"[Service]\nDeviceAllow=char-ttyS rw\n{unit_lines}", _DROP_IN)
        self.guest.run("systemctl daemon-reload")

    def start(self, *, timeout_s: float = PATIENCE_S) -> float:
        """Starts the unit and waits until it says that it is ready; how long that took, seconds."""
        begun_s = time.monotonic()
        said = self.guest.run(f"systemctl start {UNIT}", check=False, timeout_s=timeout_s)
        if self.shown("ActiveState") != {"ActiveState": "active"}:
            raise GuestFault(f"the unit does not start: {said}\n{self.journal()}")
        took_s = time.monotonic() - begun_s
        log.info("appliance: ready in %.1f s", took_s)
        return took_s

    def stop(self) -> float:
        """Stops the unit; how long that took, seconds."""
        begun_s = time.monotonic()
        self.guest.run(f"systemctl stop {UNIT}")
        return time.monotonic() - begun_s

    def shown(self, *names: str) -> dict[str, str]:
        """Properties of the unit, as `systemctl show` has them."""
        lines = self.guest.run(f"systemctl show {UNIT} " + " ".join(f"-p {name}" for name in names)).splitlines()
        return dict(line.split("=", 1) for line in lines)

    def main_pid(self) -> int:
        """The daemon's process."""
        return int(self.shown("MainPID")["MainPID"])

    def journal(self) -> str:
        """The unit's log of this boot."""
        return self.guest.run(f"journalctl -b -u {UNIT} -o short-monotonic --no-pager")

    def recordings(self, to: Path) -> list[Path]:
        """Copies all recordings out, whole or not, oldest first."""
        to.mkdir(parents=True, exist_ok=True)
        # tar ends with 1 where a file was being recorded meanwhile.
        packed = self.guest.get_output(f"tar -c -C {RUNS} . || [ $? -eq 1 ]")
        with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
            archive.extractall(to, filter="data")
        return sorted(to.glob("*.mcap*"), key=lambda path: path.stat().st_mtime)


@dataclass(frozen=True, kw_only=True)
class Account:
    """Every frame of a recorded run: raced, or lost for a reason."""

    raced: int
    missing: int
    """Numbers that do not appear between the first and the last frame raced."""
    lost: dict[str, int]
    """What the appliance says about them, by reason."""

    @property
    def unexplained(self) -> int:
        """Missing frames that no reason accounts for; negative where too many are accounted for."""
        return self.missing - sum(self.lost.values())


def account(run: RecordedRun) -> Account:
    """Of the frames of `run`, up to its last one."""
    numbers = [found.sequence for found in run.detections()]
    healths = [event for event in run.events() if isinstance(event, Health)]
    return Account(
        raced=len(numbers),
        missing=numbers[-1] - numbers[0] + 1 - len(numbers),
        lost={lost.reason: lost.frames for lost in healths[-1].lost},
    )


def laps(run: RecordedRun) -> list[Lap]:
    """The run's laps in order."""
    return [event for event in run.events() if isinstance(event, Lap)]


def timed(run: RecordedRun) -> list[Lap]:
    """The run's valid laps. Any other must be one in which the host let the machine stand for longer than a car may be hidden:
    that it is told, and why, is the appliance's duty; that it does not happen is not in its hands.
    """
    for lap in laps(run):
        assert lap.valid or any("the car was not seen for" in reason for reason in lap.reasons), lap
    return [lap for lap in laps(run) if lap.valid]


def stamps_s(run: RecordedRun) -> list[float]:
    """Each raced frame's stamp, seconds of the guest's CLOCK_MONOTONIC."""
    return [found.t_ns * 1e-9 for found in run.detections()]


def the_run(paths: list[Path]) -> RecordedRun:
    """The one recording there is, finished."""
    assert [path.suffix for path in paths] == [".mcap"], paths
    return read_run(paths[0])


def note(logs: Path, **figures: Any) -> None:
    """Keeps what was measured, for people and for the ledger, and shows it."""
    with (logs / "figures.json").open("a") as file:
        file.write(json.dumps(figures) + "\n")
    log.info("measured: %s", ", ".join(f"{name} {value}" for name, value in figures.items()))
