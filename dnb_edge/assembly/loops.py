"""How a `loop:` URI becomes an open source: a driver and a task by their names.

Knows what the URI says. Knows neither drivers nor tasks themselves.
"""

from __future__ import annotations

import math
from urllib.parse import parse_qsl

from dnb_edge.config.loop_task import load_task
from dnb_edge.errors import InputError
from dnb_edge.nut.closed_loop import ClosedLoopSource
from dnb_edge.nut.open import open_driver
from dnb_edge.sim.task import LoopTask

FORM = "loop:DRIVER?task=lane-following&seed=1&laps=3"

_OPTIONS = ("task", "seed", "laps", "pace")


def open_loop(uri: str) -> ClosedLoopSource:
    """The closed loop that `uri` names, open. Raises `InputError` naming what is wrong."""
    word, task, pace = _parsed(uri)
    try:
        return ClosedLoopSource(task, open_driver(word), uri=uri, pace=pace)
    except InputError as error:
        raise InputError(f"{uri}: {error}") from error


def check_loop(uri: str) -> None:
    """Raises `InputError` where `uri` names no closed loop, as far as that shows without opening its driver."""
    _parsed(uri)


def _parsed(uri: str) -> tuple[str, LoopTask, float]:
    """(the driver's word, the task, the pace)."""
    # The last question mark, since a driver's command or path may hold others.
    word, mark, query = uri.removeprefix("loop:").rpartition("?")
    word, query = (word, query) if mark else (query, "")
    if not word:
        raise InputError(f"{uri}: names no driver: write {FORM}")
    try:
        given = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query)))
    except ValueError as error:
        raise InputError(f"{uri}: write the options as {FORM}") from error
    unknown = next((name for name in given if name not in _OPTIONS), None)
    if unknown is not None:
        raise InputError(f"{uri}: unknown option {unknown!r}: a closed loop knows {', '.join(_OPTIONS)}")
    numbers: dict[str, int] = {}
    for name in ("seed", "laps"):
        if name in given:
            if not given[name].isdecimal():
                raise InputError(f"{uri}: {name} must be a whole number, not {given[name]!r}")
            numbers[name] = int(given[name])
    try:
        pace = float(given.get("pace", "0"))
    except ValueError:
        pace = -1.0
    if not (math.isfinite(pace) and pace >= 0.0):
        raise InputError(f"{uri}: pace must be a number and not negative, not {given['pace']!r}")
    try:
        task = load_task(given.get("task", "lane-following")).loop(numbers.get("seed", 1), numbers.get("laps"))
    except InputError as error:
        raise InputError(f"{uri}: {error}") from error
    return word, task, pace
