"""A driver in Python from outside the package: `python:MODULE:CALLABLE` or `python:FILE.py:CALLABLE`.

Knows how it is found and called, in one thread of its own so that one which hangs ends the run and not the program. Knows no
vehicle. Code that is named here runs with all that the user may do.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import queue
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zlib import crc32

import cv2

from dnb_edge.errors import InputError
from dnb_edge.nut.answer import at, control_of, quoted
from dnb_edge.nut.patience import Patience
from dnb_edge.sim.control import Briefing, Control, DriverFailed, Sight


class FunctionDriver:
    """Drives by a function (rgb, speed_mps) -> (steering, throttle), by a class of such things, or by a class of drivers."""

    def __init__(self, found: Any, *, name: str, patience: Patience) -> None:
        self.name = name
        self.knows_truth = getattr(found, "knows_truth", False) is True
        self._found = found
        self._patience = patience
        self._driver: Any = None
        self._thread: _Thread | None = None

    def start(self, briefing: Briefing) -> None:
        """Makes what is a class, and starts what has `start`. Raises `DriverFailed`."""
        self._thread = _Thread(self.name)
        self._driver = self._found
        if inspect.isclass(self._found):
            self._driver = self._ask(self._found, "when it was to be made", self._patience.start_s)
        if not (callable(self._driver) or hasattr(self._driver, "drive")):
            raise DriverFailed(f"{self.name}: what its class makes can neither be called nor has a method drive")
        begin = getattr(self._driver, "start", None)
        if begin is not None:
            self._ask(lambda: begin(briefing), "when it was to start", self._patience.start_s)

    def drive(self, sight: Sight) -> Control:
        """What it answered. Raises `DriverFailed` where it raises, hangs, or answers what is no control."""
        if hasattr(self._driver, "drive"):
            work: Callable[[], Any] = lambda: self._driver.drive(sight)  # noqa: E731 one of two
        else:
            rgb = cv2.cvtColor(sight.bgr, cv2.COLOR_BGR2RGB)
            work = lambda: self._driver(rgb, sight.speed_mps)  # noqa: E731 one of two
        answer = self._ask(work, at(sight.t_ns), self._patience.answer_s)
        if isinstance(answer, Control):
            return answer
        try:
            steering, throttle = answer
        except (TypeError, ValueError) as error:
            raise DriverFailed(
                f"{self.name}: answered {quoted(answer)} {at(sight.t_ns)}: must be two numbers, steering and throttle"
            ) from error
        return control_of(self.name, sight.t_ns, steering, throttle)

    def close(self) -> None:
        """Ends what has `close`; what hangs is left behind. Raises `DriverFailed` where that raises."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        end = getattr(self._driver, "close", None)
        try:
            if end is not None and not inspect.isclass(self._driver) and not thread.stuck:
                thread.ask(end, "when it was to close", self._patience.end_s)
        finally:
            thread.end()

    def _ask(self, work: Callable[[], Any], what: str, limit_s: float) -> Any:
        assert self._thread is not None, "drive before start"
        return self._thread.ask(work, what, limit_s)


class _Thread:
    """One thread that does what it is asked, each with a time limit. One that is stuck is left behind."""

    def __init__(self, name: str) -> None:
        self.stuck = False
        self._name = name
        self._asked: queue.SimpleQueue[Callable[[], Any] | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[bool, Any]] = queue.SimpleQueue()
        threading.Thread(target=self._run, name=f"driver {name}", daemon=True).start()

    def ask(self, work: Callable[[], Any], what: str, limit_s: float) -> Any:
        """What `work` gives. Raises `DriverFailed` where it raises, or takes longer than `limit_s`."""
        if self.stuck:
            raise DriverFailed(f"{self._name}: still hangs")
        self._asked.put(work)
        try:
            fine, answer = self._done.get(timeout=limit_s)
        except queue.Empty:
            self.stuck = True
            raise DriverFailed(f"{self._name}: no answer {what} within {limit_s:g} s: it hangs") from None
        if fine:
            return answer
        raise DriverFailed(f"{self._name}: {_told(answer)}, no answer {what}") from answer

    def end(self) -> None:
        """Nothing more will be asked."""
        self._asked.put(None)

    def _run(self) -> None:
        while (work := self._asked.get()) is not None:
            try:
                self._done.put((True, work()))
            except (Exception, SystemExit) as error:  # noqa: BLE001 foreign code: told to the asking thread as the run's end
                self._done.put((False, error))


def open_function(place: str, patience: Patience) -> FunctionDriver:
    """The driver at `place`, MODULE:CALLABLE or FILE.py:CALLABLE, imported.

    Modules are looked for in the working directory, too. Raises InputError where there is no such module or callable.
    """
    word = f"python:{place}"
    module_name, _, attribute = place.rpartition(":")
    if not module_name or not attribute:
        raise InputError(f"{word}: give python:MODULE:CALLABLE or python:FILE.py:CALLABLE")
    try:
        module = _file(Path(module_name)) if module_name.endswith(".py") else _module(module_name)
        found: Any = module
        for part in attribute.split("."):
            found = getattr(found, part)
    except (Exception, SystemExit) as error:
        raise InputError(f"{word}: cannot be imported: {_told(error)}") from error
    if not (callable(found) or hasattr(found, "drive")):
        raise InputError(f"{word}: {attribute} can neither be called nor has a method drive")
    stem = Path(module_name).stem if module_name.endswith(".py") else module_name
    return FunctionDriver(found, name=f"{stem}.{attribute}", patience=patience)


def _module(name: str) -> Any:
    _look_in(Path.cwd())
    return importlib.import_module(name)


def _file(path: Path) -> Any:
    """The file as a module of its own, run anew; it finds the modules beside it, as a script does."""
    name = f"dnb_edge_driver_{path.stem}_{crc32(str(path.resolve()).encode()):08x}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    _look_in(path.resolve().parent)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _look_in(folder: Path) -> None:
    """Modules are looked for there, too: last, so that a file of the user's hides no package."""
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _told(error: BaseException) -> str:
    """Kind and text in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
