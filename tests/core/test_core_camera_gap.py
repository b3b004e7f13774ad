"""Laps during which no frames came: marked, and timed all the same where their lines were crossed in sight."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from circle import circle_setup, frames, on_circle

from dnb_edge.core import Core, CoreSetup
from dnb_edge.values import Lap

OMEGA = 1.3
START_RAD = -0.6
LAP_S = 2 * math.pi / OMEGA
FIRST_S = -START_RAD / OMEGA
"""When the first lap begins."""


def laps(setup: CoreSetup, since_s: float, until_s: float) -> list[Lap]:
    """The laps of a steady car of which no frame was taken between two moments."""
    core = Core(setup)
    events = []
    for found in frames(lambda t_s: on_circle(START_RAD + OMEGA * t_s), seconds=FIRST_S + 3 * LAP_S + 1.0):
        if not since_s < found.t_ns * 1e-9 < until_s:
            events += core.step(found)
    return [event for event in [*events, *core.finish()] if isinstance(event, Lap)]


@pytest.mark.parametrize(
    ("begins", "lasts_s", "marked"),
    [
        (1.3, 1.4, [False, True, False]),
        (1.3, 0.9, [False, False, False]),
        (1.9, 1.4, [False, True, True]),
        (2.8, 1.4, [False, False, True]),
    ],
    ids=["within a lap", "too short to count", "over the line", "over the end of the last lap"],
)
def test_a_lap_without_frames_is_marked(begins: float, lasts_s: float, marked: list[bool]) -> None:
    """`begins` is in laps from the first crossing: a gap of the camera is of every lap that it touches, and of no other."""
    since_s = FIRST_S + begins * LAP_S
    driven = laps(circle_setup(), since_s, since_s + lasts_s)
    assert [bool(lap.suspect) for lap in driven] == marked[: len(driven)]
    for lap in driven:
        assert all(text.startswith("camera gap: no frames came for ") for text in lap.suspect)


def test_a_marked_lap_whose_lines_were_crossed_in_sight_is_timed_right() -> None:
    """What happens between the lines moves no time."""
    since_s = FIRST_S + 1.3 * LAP_S
    lap = laps(circle_setup(), since_s, since_s + 2.0)[1]
    assert lap.suspect == ("camera gap: no frames came for 2.0 s",)
    assert lap.time_s == pytest.approx(LAP_S, abs=1e-3)
    assert not lap.estimated


def test_recordings_from_before_are_not_marked() -> None:
    """Their setup has no limit, and reads so from a file that does not name it."""
    stored = circle_setup().to_dict()
    assert CoreSetup.from_dict(stored).camera_gap_s == 1.0
    del stored["camera_gap_s"]
    assert CoreSetup.from_dict(stored).camera_gap_s is None
    since_s = FIRST_S + 1.3 * LAP_S
    driven = laps(replace(circle_setup(), camera_gap_s=None), since_s, since_s + 1.4)
    assert [lap.suspect for lap in driven] == [(), (), ()]
