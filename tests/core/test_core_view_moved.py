"""Laps that were driven under a camera that had moved: marked, still valid, and marked alike when they are scored again."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from circle import circle_setup, frames, on_circle

from dnb_edge import wire
from dnb_edge.core import Core
from dnb_edge.values import Event, FrameDetections, Lap

OMEGA = 1.3
LAP_S = 2 * math.pi / OMEGA
FIRST_S = 0.6 / OMEGA
"""The first crossing; laps end at FIRST_S + k LAP_S."""


def race(moved: dict[tuple[float, float], float]) -> list[Lap]:
    """The laps of a steady car; `moved` says from when to when the camera was known to have moved, and how far."""
    core, events = Core(circle_setup()), list[Event]()
    for found in frames(lambda t_s: on_circle(-0.6 + OMEGA * t_s), seconds=FIRST_S + 4.2 * LAP_S):
        t_s = found.t_ns * 1e-9
        at = [metres for (from_s, to_s), metres in moved.items() if from_s <= t_s < to_s]
        events += core.step(replace(found, view_moved_m=at[0] if at else None))
    return [event for event in events + core.finish() if isinstance(event, Lap)]


def middle(lap: float) -> float:
    """The middle of lap 1, 2, ..."""
    return FIRST_S + (lap - 0.5) * LAP_S


CASES = [
    ("never", {}, [None, None, None, None]),
    ("from within lap 2 on", {(middle(2), 99.0): 0.0123}, [None, "12 mm", "12 mm", "12 mm"]),
    ("for a moment within lap 2", {(middle(2), middle(2) + 0.2): 0.0123}, [None, "12 mm", None, None]),
    ("over the end of lap 2", {(middle(2), middle(3)): 0.0123}, [None, "12 mm", "12 mm", None]),
    ("further in lap 3", {(middle(2), middle(3)): 0.01, (middle(3), 99.0): 0.02}, [None, "10 mm", "20 mm", "20 mm"]),
    ("after lap 2, before that is told", {(FIRST_S + 2 * LAP_S + 0.02, 99.0): 0.01}, [None, None, "10 mm", "10 mm"]),
    ("before the first lap", {(0.0, FIRST_S / 2): 0.01}, [None, None, None, None]),
    ("far", {(middle(4), 99.0): 1.51}, [None, None, None, "1510 mm"]),
]


@pytest.mark.parametrize(("moved", "sizes"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_a_lap_is_suspect_where_a_frame_of_it_was_seen_by_a_moved_camera(moved, sizes):
    """From start to end, with the greatest distance known in it; nothing else about the lap changes."""
    laps = race(moved)
    sentences = [() if size is None else (f"the camera had moved by {size} since it was calibrated",) for size in sizes]
    assert [lap.suspect for lap in laps] == sentences
    assert [replace(lap, suspect=()) for lap in laps] == race({})
    assert all(lap.valid for lap in laps)


def test_a_view_that_is_another_place_is_not_given_a_size():
    """Where nothing of the view is in its place the drift watch tells the track's span; the lap says what that means."""
    laps = race({(middle(4), 99.0): 2.0})
    assert [lap.suspect for lap in laps] == [
        *[()] * 3,
        ("the camera showed another place than when it was calibrated",),
    ]


def test_recordings_from_before_are_read():
    """Detections and laps that do not know the member mean a camera that was not known to have moved."""
    found = FrameDetections(sequence=1, t_ns=5, detections=(), full_frame=True)
    old = wire.to_dict(found)
    del old["view_moved_m"]
    assert wire.from_dict(FrameDetections, old) == found
    (lap, *_) = race({})
    old = wire.to_dict(lap)
    del old["suspect"]
    assert wire.from_dict(Lap, old) == lap
