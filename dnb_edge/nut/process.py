"""A driver that is a process of its own: started here (`exec:`), or reached over a socket (`tcp:`, `unix:`).

Knows the line protocol of docs/nut.md and how such a process is started and ended. Knows no vehicle. Whatever the process does
(hangs, dies, talks nonsense, answers for another picture), the run ends with one line that says so.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import cv2

from dnb_edge.errors import InputError
from dnb_edge.nut.answer import at, control_of, quoted
from dnb_edge.nut.link import Link, connect_tcp, connect_unix, exec_name, started, words_of
from dnb_edge.nut.patience import Patience
from dnb_edge.nut.stream import MOST_LINE_BYTES, Gone, Late, TooLong
from dnb_edge.sim.control import Briefing, Control, DriverFailed, Sight
from dnb_edge.values import BgrImage

PROTOCOL = 1
JPEG_QUALITY = 95


class Open(Protocol):
    """Reaches a driver's process."""

    def __call__(self, limit_s: float) -> Link:
        """Raises `OSError` where it is not there."""


class ProcessDriver:
    """Drives by what a process answers."""

    knows_truth = False

    def __init__(self, word: str, reach: Open, *, name: str, patience: Patience) -> None:
        self.name = name
        self._word = word
        self._reach = reach
        self._patience = patience
        self._link: Link | None = None
        self._encode = _ENCODERS["rgb"]

    def start(self, briefing: Briefing) -> None:
        """Reaches the process, tells it what it is to drive and waits until it is ready. Raises `DriverFailed`."""
        self.close()
        deadline_s = time.monotonic() + self._patience.start_s
        try:
            self._link = self._reach(self._patience.start_s)
        except OSError as error:
            raise DriverFailed(f"{self.name}: {self._word} cannot be reached: {error.strerror or error}") from error
        with self._faults("when it was to get ready", self._patience.start_s):
            self._link.stream.send(_line(_greeting(briefing)), deadline_s)
            told = self._object(self._link.stream.line(deadline_s), "when it was to get ready")
        if told.get("ready") is not True:
            raise DriverFailed(
                f'{self.name}: answered {quoted(told)} when it was to get ready: must be {{"ready": true}}'
            )
        wanted = told.get("pictures", "rgb")
        if not isinstance(wanted, str) or wanted not in _ENCODERS:
            raise DriverFailed(f"{self.name}: wants pictures {quoted(wanted)}: must be one of {', '.join(_ENCODERS)}")
        self._encode = _ENCODERS[wanted]

    def drive(self, sight: Sight) -> Control:
        """What it answered to the picture. Raises `DriverFailed`."""
        assert self._link is not None, "drive before start"
        deadline_s = time.monotonic() + self._patience.answer_s
        picture = self._encode(sight.bgr)
        head = {"t_ns": sight.t_ns, "speed_mps": sight.speed_mps, "bytes": len(picture)}
        when = at(sight.t_ns)
        with self._faults(when, self._patience.answer_s):
            self._link.stream.send(_line(head) + picture, deadline_s)
            told = self._object(self._link.stream.line(deadline_s), when)
        stamp = told.get("t_ns")
        if isinstance(stamp, bool) or stamp != sight.t_ns:
            raise DriverFailed(
                f"{self.name}: answered for the stamp {quoted(stamp)} {when}: t_ns must be that picture's, {sight.t_ns}"
            )
        return control_of(self.name, sight.t_ns, told.get("steering"), told.get("throttle"))

    def close(self) -> None:
        """Tells the process that it is over, and ends one that was started here and does not end by itself."""
        link, self._link = self._link, None
        if link is not None:
            link.end(_line({"end": True}), self._patience.end_s)

    @contextmanager
    def _faults(self, when: str, limit_s: float) -> Iterator[None]:
        """Turns what befalls the stream into the reason for which the run ends."""
        assert self._link is not None
        try:
            yield
        except Late:
            raise DriverFailed(f"{self.name}: no answer {when} within {limit_s:g} s: it hangs") from None
        except TooLong:
            raise DriverFailed(f"{self.name}: more than {MOST_LINE_BYTES} bytes without a line's end {when}") from None
        except Gone:
            raise DriverFailed(f"{self.name}: {self._link.fate()}, no answer {when}") from None

    def _object(self, line: bytes, when: str) -> dict[str, Any]:
        try:
            told = json.loads(line)
        except (ValueError, RecursionError):
            told = None
        if not isinstance(told, dict):
            raise DriverFailed(
                f"{self.name}: answered {quoted(line.decode('utf-8', 'replace'))} {when}: must be one JSON object "
                "(what is to be read by people belongs on standard error)"
            )
        return told


def open_process(kind: str, place: str, patience: Patience) -> ProcessDriver:
    """The driver behind `kind` (`tcp`, `unix`, `exec`) and `place`, not yet reached.

    Raises InputError where the place is none, or there is no such program.
    """
    word = f"{kind}:{place}"
    if kind == "exec":
        words = words_of(place)
        return ProcessDriver(word, lambda _limit_s: started(words), name=exec_name(words), patience=patience)
    if kind == "unix":
        if not place:
            raise InputError(f"{word}: give unix:PATH of the driver's socket")
        name = re.sub(r"\.sock$", "", place.rsplit("/", 1)[-1])
        return ProcessDriver(word, lambda limit_s: connect_unix(place, limit_s), name=name, patience=patience)
    host, _, port = place.rpartition(":")
    if not host or not (port.isascii() and port.isdecimal() and 0 < int(port) < 65536):
        raise InputError(f"{word}: give tcp:HOST:PORT, a port from 1 to 65535")
    address = (host.removeprefix("[").removesuffix("]"), int(port))
    return ProcessDriver(
        word, lambda limit_s: connect_tcp(address, limit_s), name=f"{address[0]}-{port}", patience=patience
    )


def _greeting(briefing: Briefing) -> dict[str, Any]:
    """What a driver is told that does not know the truth."""
    return {
        "hello": "dnb-edge",
        "protocol": PROTOCOL,
        "seed": briefing.seed,
        "wheelbase_m": briefing.wheelbase_m,
        "steering_lock_rad": briefing.steering_lock_rad,
        "top_speed_mps": briefing.top_speed_mps,
        "picture_px": list(briefing.picture_px),
        "period_s": briefing.period_s,
        "delay_s": briefing.delay_s,
    }


def _line(told: dict[str, Any]) -> bytes:
    return json.dumps(told).encode() + b"\n"


def _jpeg(bgr: BgrImage) -> bytes:
    made, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert made
    return jpeg.tobytes()


_ENCODERS: dict[str, Callable[[BgrImage], bytes]] = {
    "rgb": lambda bgr: bgr[:, :, ::-1].tobytes(),
    "bgr": lambda bgr: bgr.tobytes(),
    "jpeg": _jpeg,
}
"""Pictures as a driver may ask for them: rows from the top, three bytes a pixel; or a JPEG."""
