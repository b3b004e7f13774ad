"""Which driver a word on the command line means: `pure-pursuit`, `FILE.onnx`, `python:...`, `tcp:...`, `unix:...`, `exec:...`.

Knows the words and where each kind of driver is; imports a kind when it is asked for. Knows no vehicle and no task.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from dnb_edge.errors import InputError
from dnb_edge.nut.patience import PATIENCE, Patience
from dnb_edge.sim.control import Briefing, Control, Driver, Sight

SHIPPED = {
    "pure-pursuit": ("pursuit", "PurePursuit"),
    "lane-follower": ("lane_follower", "LaneFollower"),
    "network": ("network", "network_driver"),
}
"""Drivers that the package has: the module in this room, and what makes one there."""

FORMS = "FILE.onnx, python:MODULE:CALLABLE, tcp:HOST:PORT, unix:PATH, exec:COMMAND"

_NAMED = re.compile(r"([A-Za-z0-9][A-Za-z0-9._+-]*)=(.+)", re.DOTALL)


@dataclass(frozen=True, slots=True, eq=False)
class Named:
    """A driver under another name."""

    name: str
    driver: Driver

    @property
    def knows_truth(self) -> bool:
        """As the driver's own."""
        return self.driver.knows_truth

    def start(self, briefing: Briefing) -> None:
        """As the driver's own."""
        self.driver.start(briefing)

    def drive(self, sight: Sight) -> Control:
        """As the driver's own."""
        return self.driver.drive(sight)

    def close(self) -> None:
        """As the driver's own."""
        self.driver.close()


def open_driver(word: str, *, patience: Patience = PATIENCE) -> Driver:
    """The driver that `word` means, not started; `NAME=WORD` gives it another name in tables.

    Each call gives a driver of its own. Raises InputError, in one line with what to do, for a word that means none, a model
    that does not fit, a module or a program that is not there. While it drives it raises `DriverFailed`.
    """
    named = _NAMED.fullmatch(word)
    if named is not None:
        return Named(named[1], _opened(named[2], patience))
    return _opened(word, patience)


def _opened(word: str, patience: Patience) -> Driver:
    kind, _, rest = word.partition(":")
    if word in SHIPPED:
        module, maker = SHIPPED[word]
        made: Driver = getattr(import_module(f"dnb_edge.nut.{module}"), maker)()
        return made
    if kind == "python":
        from dnb_edge.nut.function import open_function  # noqa: PLC0415 each kind when it is asked for

        return open_function(rest, patience)
    if kind in {"tcp", "unix", "exec"}:
        from dnb_edge.nut.process import open_process  # noqa: PLC0415 each kind when it is asked for

        return open_process(kind, rest, patience)
    if word.lower().endswith(".onnx"):
        from dnb_edge.nut.model import open_onnx_driver  # noqa: PLC0415 each kind when it is asked for

        return open_onnx_driver(Path(word))
    raise InputError(f"{word or 'driver'}: no driver: give {', '.join(SHIPPED)}, or one of {FORMS}")
