"""Several cars on one lane: each drives as it likes, but none comes too near to the one ahead.

Knows the circuit, seeds and the distance that cars keep along the lane. Knows no camera. The lane is one car wide, so nobody
overtakes; who is faster than the one ahead follows it. Where a circuit crosses itself, cars take no notice of each other.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.driver import RUN_OUT_M, Drive, Style, crossing_s, pace_at, speed_mps, wander_of

MOST_CARS = 8
CLOSEST_M = 0.40
"""Distance along the lane, from ground point to ground point, that no car goes below: a car is 0.235 m long."""
EASE_M = 0.50
"""A car begins to slow down for the one ahead this much before it is as near as that."""

_STEP_S = 0.01
_TABLE = 2048


def drives(
    circuit: Circuit, *, cars: int, laps: int, seed: int, style: Style | None = None, closest_m: float = CLOSEST_M
) -> tuple[Drive, ...]:
    """The drives of so many cars, the foremost first, all of one duration: until each has driven `laps` complete laps.

    They start spread along the lap. Who is done before the others drives on, so that its drive may have a lap more. Raises
    `ValueError` for cars that do not fit on the lane.
    """
    style = style or Style()
    length = circuit.centreline.length_m
    apart_m = length / (cars + 1)
    if not 1 <= cars <= MOST_CARS or apart_m <= closest_m:
        raise ValueError(f"{cars} cars do not fit: 1 to {MOST_CARS}, {closest_m:g} m apart on a lap of {length:.2f} m")
    if laps < 1:
        raise ValueError(f"laps must be at least 1, not {laps}")
    randoms = [np.random.default_rng([seed, 1, car]) for car in range(cars)]
    wanders = [wander_of(style, random) for random in randoms]
    paces = [random.uniform(*style.pace, laps + 4) for random in randoms]
    starts = [-min(style.run_up_m, apart_m) - car * apart_m for car in range(cars)]
    t, along = _followed(circuit, style, starts, paces, laps=laps, closest_m=closest_m)
    return tuple(
        _with_crossings(
            Drive(
                circuit=circuit,
                laps=laps,
                crossings_s=(),
                duration_s=float(t[-1]),
                table_t_s=t,
                table_s_m=along[:, car],
                wander=wanders[car],
            )
        )
        for car in range(cars)
    )


def _followed(
    circuit: Circuit,
    style: Style,
    starts_m: list[float],
    paces: list[NDArray[np.float64]],
    *,
    laps: int,
    closest_m: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n,) instants and (n, cars) distances from the start line, step by step: each car as fast as it likes and may."""
    length = circuit.centreline.length_m
    cell_m = length / _TABLE
    free = speed_mps(circuit, (np.arange(_TABLE, dtype=np.float64) + 0.5) * cell_m, style).tolist()
    # Pace by cells too, from one lap before the start line on.
    wanted = [pace_at((np.arange((len(pace) - 1) * _TABLE) + 0.5) / _TABLE - 1.0, pace).tolist() for pace in paces]
    at = list(starts_m)
    table = [list(at)]
    end_m = laps * length + RUN_OUT_M
    while min(at) < end_m:
        ahead_m = [at[-1] + length, *at[:-1]]
        moved = []
        for car, s in enumerate(at):
            cell = math.floor(s / cell_m)
            pace = wanted[car][min(cell + _TABLE, len(wanted[car]) - 1)]
            share = min(1.0, max(0.0, (ahead_m[car] - s - closest_m) / EASE_M))
            moved.append(s + free[cell % _TABLE] * pace * share * _STEP_S)
        at = moved
        table.append(at)
    return np.arange(len(table), dtype=np.float64) * _STEP_S, np.array(table, dtype=np.float64)


def _with_crossings(driven: Drive) -> Drive:
    """The drive with its crossings and the laps between them, as many as it has."""
    length = driven.circuit.centreline.length_m
    count = math.floor(float(driven.table_s_m[-1]) / length) + 1
    crossings = tuple(crossing_s(driven, k * length) for k in range(count))
    assert all(a < b for a, b in itertools.pairwise(crossings))
    return replace(driven, laps=count - 1, crossings_s=crossings)
