"""A serial line on a real pseudo-terminal, with a cable that can be pulled, and a display's firmware at its other end."""

import os
import select
import time

from dnb_edge.display import protocol, protocol_race
from dnb_edge.errors import InputError

PATIENCE_S = 10.0


def wait_until(true, patience_s=PATIENCE_S):
    """Wait for `true()`; fail after `patience_s`, which says only how long a broken test may hang."""
    deadline_s = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.005)


class PtyLine:
    """`path` is a symbolic link to a pseudo-terminal's slave, as /dev/serial/by-id has them, and stays the same."""

    def __init__(self, path):
        self.path = path
        self.master = self.slave = None
        self.raw = b""

    def plug(self):
        self.master, self.slave = os.openpty()
        self.path.symlink_to(os.ttyname(self.slave))

    def unplug(self):
        """The device goes: writers get an I/O error and the path is no more."""
        if self.master is not None:
            self.path.unlink()
            os.close(self.slave)
            os.close(self.master)
            self.master = self.slave = None

    def read(self, size=4096):
        """What is there to read now, `size` bytes at most; nothing where nothing is. `raw` keeps all of it."""
        ready, _, _ = select.select([self.master], [], [], 0.02)
        data = os.read(self.master, size) if ready else b""
        self.raw += data
        return data

    def listen(self, firmware, heard, *, size=4096):
        """Read into `firmware`, `size` bytes at a time, until `heard(firmware)`."""

        def more():
            firmware.hear(self.read(size))
            return heard(firmware)

        wait_until(more)


class Firmware:
    """A display as its makers read the protocol: HELLO forgets, RUN draws, lines without right checksum are dropped."""

    def __init__(self):
        self._torn = b""
        self._next = self._blank()
        self.shown = self._blank()
        self.crossings = []
        self.repaints = 0
        self.dropped = []

    @staticmethod
    def _blank():
        return {
            "laps": {},
            "why": {},
            "best": None,
            "state": None,
            "health": None,
            "warnings": [],
            "run": None,
            "race": None,
            "car": None,
            "live": None,
            "places": [],
            "penalties": {},
        }

    def hear(self, data):
        *lines, self._torn = (self._torn + data).split(b"\r\n")
        for line in lines:
            if not line:
                continue
            try:
                message = protocol.parse_line(line)
            except InputError:
                message = None
            if message is None or b" *" not in line:
                self.dropped.append(line)
            else:
                self.obey(message)

    def obey(self, message):
        match message:
            case protocol.Hello():
                self._next = self._blank()
                self.repaints += 1
            case protocol.State():
                self._next["state"] = message
            case protocol.Cross():
                self.crossings.append(message.t_s)
            case protocol.Lap():
                self._next["laps"][message.lap] = message
            case protocol.Why() | protocol.Suspect():
                self._next["why"].setdefault(message.lap, []).append(message.body())
            case protocol.Best():
                self._next["best"] = message
            case protocol.Health():
                self._next["health"], self._next["warnings"] = message, []
            case protocol.Warn():
                self._next["warnings"].append(message.text)
            case protocol.Run():
                self._next["run"] = message
                self.shown = {
                    name: value.copy() if isinstance(value, dict | list) else value
                    for name, value in self._next.items()
                }
            case _:
                self._obey_race(message)

    def _obey_race(self, message):
        match message:
            case protocol_race.Car():
                self._next["car"] = message
            case protocol_race.Grid() | protocol_race.Count() | protocol_race.Go():
                self._next["race"] = message
            case protocol_race.Live():
                none = message.delta_s is None and message.similarity_percent is None
                self._next["live"] = None if none else message
            case protocol_race.Place():
                others = [one for one in self._next["places"] if one.car != message.car]
                self._next["places"] = sorted([*others, message], key=lambda one: (one.place, one.car))
            case protocol_race.Penalty():
                self._next["penalties"][message.lap] = message
