"""Cases in which the number of laps must be exactly right: cars that stand, shake, turn, vanish, and a clock that jumps.

Knows each case's manoeuvre and its laps, which follow from the definition alone: a lap is driven from one forward crossing of
the start line to the next, once round the route. Knows no figures.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

import numpy as np

from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.disturb import Disturbance
from dnb_edge.sim.manoeuvre import Leg, ahead, manoeuvre
from dnb_edge.sim.rig import Scenery
from dnb_edge.truth.course import course
from dnb_edge.truth.scenarios import Scenario, by_curvature
from dnb_edge.truth.sightings import Sightings, moments, sighted
from dnb_edge.truth.watch import told, watch
from dnb_edge.values import Event, Lap

_PLACE = "demo"
_FPS = 30.0
_SPEED_MPS = 1.2
_DRIVEN_LAPS = 3
"""Laps of the cases in which a plain drive is disturbed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CountCase:
    """One case and its right answer."""

    name: str
    title: str
    laps: int
    """Complete laps driven."""
    valid: int
    """Those that nothing is wrong with; what is wrong with the others stands in their reasons."""
    legs: Callable[[float], list[Leg]] | None = None
    """The manoeuvre, for the length of a lap in metres; it begins 1.1 m before the start line. None for a plain drive."""
    scenario: Scenario | None = None
    """The plain drive, where it is one."""
    clock_steps: bool = False
    """True where the machine's wall clock jumps by an hour, to and fro, while the race runs."""


def _drive_to(metres: float) -> Leg:
    return ahead(metres, _SPEED_MPS)


def _parked(off_m: float) -> Callable[[float], list[Leg]]:
    return lambda lap_m: [_drive_to(1.1 + 2 * lap_m + off_m), Leg(seconds=300.0), _drive_to(lap_m + 0.5 - off_m)]


def _shaking(lap_m: float) -> list[Leg]:
    return [_drive_to(1.1 + 2 * lap_m), Leg(seconds=60.0, shake_m=0.02), _drive_to(lap_m + 0.5)]


def _reversing(lap_m: float) -> list[Leg]:
    return [_drive_to(1.5 + 2 * lap_m), ahead(-0.8, 0.6), _drive_to(lap_m + 0.9)]


def _u_turn(lap_m: float) -> list[Leg]:
    turn = Leg(seconds=0.8, metres=0.05, to_d_m=-0.06)
    return [
        ahead(1.4 + 2 * lap_m, _SPEED_MPS, to_d_m=0.06), turn, ahead(-0.7, 0.9, to_d_m=-0.06),
        Leg(seconds=0.8, metres=-0.05), _drive_to(lap_m + 0.9),
    ]  # fmt: skip


def _wrong_way_round(lap_m: float) -> list[Leg]:
    """A lap, then twice round against the route."""
    return [_drive_to(1.4 + lap_m), Leg(seconds=0.8), ahead(-2 * lap_m, _SPEED_MPS, to_d_m=-0.05), Leg(seconds=2.0)]


def _lifted(away_s: float, put_m: float) -> Callable[[float], list[Leg]]:
    return lambda lap_m: [
        _drive_to(1.1 + 1.4 * lap_m), Leg(seconds=away_s, seen=False), Leg(seconds=1.0, jump_m=put_m),
        _drive_to(1.6 * lap_m + 0.5 - put_m),
    ]  # fmt: skip


def _plain(name: str, **changes: Any) -> Scenario:
    base = Scenario(
        name=f"count-{name}", title="", place=_PLACE, fps=_FPS, styles=(by_curvature(1.45, 2.0),),
        sightings=Sightings(memory_px=0.4),
    )  # fmt: skip
    return replace(base, **changes)


def cases() -> tuple[CountCase, ...]:
    """All cases, in the certificate's order."""
    hand = Scenery(disturbance=Disturbance(hands=0.5))
    other = Scenery(parked_m=((0.9, 0.36), (5.2, -0.34)))
    return (
        CountCase(name="parked-before", title="parked 5 min, 5 mm before the line", laps=3, valid=3, legs=_parked(-0.005)),
        CountCase(name="parked-behind", title="parked 5 min, 5 mm behind the line", laps=3, valid=3, legs=_parked(0.005)),
        CountCase(name="shaking", title="shaking by 20 mm on the line for a minute", laps=3, valid=3, legs=_shaking),
        CountCase(name="reversing", title="back over the line by 0.4 m, and forward again", laps=3, valid=3, legs=_reversing),
        CountCase(name="u-turn", title="a U-turn behind the line, back over it, and again", laps=3, valid=3, legs=_u_turn),
        CountCase(
            name="wrong-way-round", title="a lap, then two rounds against the route", laps=1, valid=1, legs=_wrong_way_round
        ),
        CountCase(name="lifted", title="lifted for 2 s, put down 0.2 m further back", laps=3, valid=2, legs=_lifted(2.0, -0.2)),
        CountCase(
            name="lifted-long", title="lifted for 12 s, put down where it was", laps=3, valid=2, legs=_lifted(12.0, 0.0)
        ),
        CountCase(
            name="hand", title="a hand in the picture half of the time (rendered)", laps=_DRIVEN_LAPS, valid=_DRIVEN_LAPS,
            scenario=_plain("hand", rendered=True, scenery=hand),
        ),
        CountCase(
            name="second-object", title="two other cars beside the lane (rendered)", laps=_DRIVEN_LAPS, valid=_DRIVEN_LAPS,
            scenario=_plain("second-object", rendered=True, scenery=other),
        ),
        CountCase(
            name="wall-clock", title="the wall clock steps by an hour, to and fro", laps=_DRIVEN_LAPS, valid=_DRIVEN_LAPS,
            scenario=_plain("wall-clock"), clock_steps=True,
        ),
    )  # fmt: skip


def counted(case: CountCase, *, seed: int, trial: int) -> dict[str, Any]:
    """What was told in one trial of a case, plain JSON types."""
    if case.legs is not None:
        events = _manoeuvred(case, case.legs, seed, trial)
    else:
        assert case.scenario is not None, "a case is a manoeuvre or a drive"
        events = watch(case.scenario, laps=case.laps, seed=seed, number=trial).events
    same = True
    if case.clock_steps:
        assert case.scenario is not None, "a drive is watched twice"
        with stepping_wall_clock():
            stepped = watch(case.scenario, laps=case.laps, seed=seed, number=trial).events
        same = stepped == events
    laps = [event for event in events if isinstance(event, Lap)]
    return {
        "told": len(laps),
        "told_valid": sum(lap.valid for lap in laps),
        "reasons": sorted({reason for lap in laps for reason in lap.reasons}),
        "same": same,
    }


def _manoeuvred(case: CountCase, legs: Callable[[float], list[Leg]], seed: int, trial: int) -> tuple[Event, ...]:
    here = course(_PLACE)
    circuit: Circuit = here.place.circuit
    lap_m = circuit.centreline.length_m
    moved = manoeuvre(circuit, -1.1, legs(lap_m))
    at = moments(moved, fps=_FPS)
    noise_seed = _plain(case.name).noise_seed(seed, trial)
    found = sighted(
        moved, here.place.camera, at, Sightings(memory_px=0.4), lap_m=lap_m,
        kept=np.ones(len(at.t_s), dtype=np.bool_), seed=noise_seed, seen=moved.seen(at.t_s),
    )  # fmt: skip
    return told(here, found)


@contextmanager
def stepping_wall_clock(step_s: float = 3600.0) -> Iterator[None]:
    """While it lasts, every other look at the wall clock finds it an hour on: whoever times by it gives himself away."""
    real_s, real_ns = time.time, time.time_ns
    looks = iter(range(1_000_000_000))

    def off() -> float:
        return step_s * (next(looks) % 2)

    with (
        patch("time.time", lambda: real_s() + off()),
        patch("time.time_ns", lambda: real_ns() + int(off() * 1e9)),
    ):
        yield
