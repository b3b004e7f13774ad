"""Drivers in Python from outside: functions, classes and whole drivers; what raises, hangs or answers nonsense ends the run."""

import re
import sys
import textwrap

import pytest
from nut_driving import BRIEFING, LONG, SHORT, sight

from dnb_edge.errors import InputError
from dnb_edge.nut.open import open_driver
from dnb_edge.sim.control import DriverFailed

CODE = """
    from __future__ import annotations
    import sys, time
    from dataclasses import dataclass
    import numpy as np
    import nut_test_module_beside
    from dnb_edge.sim.control import Control

    def function(rgb, speed_mps):
        return rgb[0, 0, 0] / 255, np.float32(speed_mps)

    class Once:
        made = 0
        def __init__(self):
            Once.made += 1
            self.seen = 0
        def __call__(self, rgb, speed_mps):
            self.seen += 1
            return self.seen / 10, Once.made / 10

    @dataclass
    class Kept:
        gain: float = 0.5
        def __call__(self, rgb, speed_mps):
            return self.gain, nut_test_module_beside.THROTTLE

    class Whole:
        knows_truth = True
        said = []
        def start(self, briefing):
            self.said.append(briefing.seed)
        def drive(self, sight):
            return Control(steering=0.5, throttle=sight.speed_mps)
        def close(self):
            self.said.append("closed")

    class NoCar:
        def __init__(self):
            raise RuntimeError("no car")

    class NoDriver:
        pass

    def raises(rgb, speed_mps): raise ValueError("two\\nlines")
    def leaves(rgb, speed_mps): sys.exit("bye")
    def hangs(rgb, speed_mps): time.sleep(3)
    def one(rgb, speed_mps): return 0.5
    def three(rgb, speed_mps): return 0.5, 0.5, 0.5
    def texts(rgb, speed_mps): return "ab"
    def nan(rgb, speed_mps): return float("nan"), 0
    def far(rgb, speed_mps): return 0, -1.001
    def none(rgb, speed_mps): return None
    number = 3
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    path = tmp_path / "ours.py"
    path.write_text(textwrap.dedent(CODE))
    (tmp_path / "nut_test_module_beside.py").write_text("THROTTLE = 0.75")
    monkeypatch.setattr("sys.path", [*sys.path])
    return path


def test_a_function_drives(file):
    """It gets red, green, blue and the speed, and its two numbers are the control."""
    driver = open_driver(f"python:{file}:function", patience=LONG)
    assert (driver.name, driver.knows_truth) == ("ours.function", False)
    driver.start(BRIEFING)
    control = driver.drive(sight(speed_mps=0.75))
    assert (control.steering, control.throttle) == pytest.approx((0.2, 0.75))
    driver.close()
    driver.close()


def test_a_file_finds_what_lies_beside_it(file):
    """Modules of its own folder, as for a script, and dataclasses, which look for their module."""
    driver = open_driver(f"python:{file}:Kept", patience=LONG)
    driver.start(BRIEFING)
    control = driver.drive(sight())
    assert (control.steering, control.throttle) == (0.5, 0.75)
    driver.close()


def test_a_class_is_made_anew_for_each_run(file):
    """What it remembers of one run it has forgotten in the next."""
    driver = open_driver(f"python:{file}:Once", patience=LONG)
    told = []
    for _ in range(2):
        driver.start(BRIEFING)
        told += [(c.steering, c.throttle) for c in (driver.drive(sight()), driver.drive(sight()))]
        driver.close()
    assert told == [(0.1, 0.1), (0.2, 0.1), (0.1, 0.2), (0.2, 0.2)]


def test_a_whole_driver_is_driven_as_one(file):
    """One with start, drive and close gets all three, and may say that it knows the truth."""
    driver = open_driver(f"python:{file}:Whole", patience=LONG)
    assert driver.knows_truth
    driver.start(BRIEFING)
    assert driver.drive(sight()).throttle == 0.25
    said = driver._driver.said
    driver.close()
    assert said == [7, "closed"]


def test_a_module_of_the_working_directory_is_found(file, monkeypatch):
    """Modules are named as in an import."""
    monkeypatch.chdir(file.parent)
    (file.parent / "nut_test_module_of_ours.py").write_text(file.read_text())
    driver = open_driver("python:nut_test_module_of_ours:function", patience=LONG)
    driver.start(BRIEFING)
    assert driver.drive(sight()).throttle == 0.25
    driver.close()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("raises", "raises: ValueError: two lines, no answer to the picture at 1.000 s"),
        ("leaves", "leaves: SystemExit: bye"),
        ("hangs", "hangs: no answer to the picture at 1.000 s within 0.5 s: it hangs"),
        ("one", "one: answered 0.5 to the picture at 1.000 s: must be two numbers, steering and throttle"),
        ("three", "three: answered (0.5, 0.5, 0.5)"),
        ("texts", "texts: steering 'a'"),
        ("nan", "nan: steering nan to the picture at 1.000 s: must be a number between -1 and 1"),
        ("far", "far: throttle -1.001"),
        ("none", "none: answered None"),
        ("NoCar", "NoCar: RuntimeError: no car, no answer when it was to be made"),
        ("NoDriver", "NoDriver: what its class makes can neither be called nor has a method drive"),
    ],
)
def test_a_bad_driver_ends_the_run_with_its_reason(file, name, says):
    """One line that names the driver and what it did; the program goes on."""
    driver = open_driver(f"python:{file}:{name}", patience=SHORT if name == "hangs" else LONG)
    with pytest.raises(DriverFailed, match=re.escape(says)) as failure:
        start_and_drive(driver)
    assert "\n" not in str(failure.value)
    driver.close()


def start_and_drive(driver):
    driver.start(BRIEFING)
    driver.drive(sight())


def test_one_that_hung_is_asked_nothing_more(file):
    """A thread that is stuck is left behind: what comes after is refused at once."""
    driver = open_driver(f"python:{file}:hangs", patience=SHORT)
    driver.start(BRIEFING)
    for says in ("it hangs", "still hangs"):
        with pytest.raises(DriverFailed, match=says):
            driver.drive(sight())
    driver.close()


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("{file}", "give python:MODULE:CALLABLE"),
        ("no_such_module_here:drive", "ModuleNotFoundError: No module named 'no_such_module_here'"),
        ("{file}:missing", "AttributeError"),
        ("{file}:number", "number can neither be called nor has a method drive"),
        ("{folder}/none.py:drive", "FileNotFoundError"),
        ("{folder}/broken.py:drive", "SyntaxError"),
        ("{folder}/leaves.py:drive", "SystemExit: 4"),
    ],
)
def test_what_cannot_be_imported_is_refused(file, place, says):
    """Told when the driver is named, in one line."""
    (file.parent / "broken.py").write_text("def (:")
    (file.parent / "leaves.py").write_text("import sys; sys.exit(4)")
    with pytest.raises(InputError, match=re.escape(says)) as refusal:
        open_driver("python:" + place.format(file=file, folder=file.parent))
    assert "\n" not in str(refusal.value)
