"""What vehicles told of themselves during a run, in a few figures each, and as a table of the run's page.

Knows `VehicleReport`s; everything is escaped by `report.markup`. Nobody has checked what vehicles tell.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.report.markup import number, plain_table
from dnb_edge.values import VehicleReport

QUANTILES = (50.0, 95.0, 99.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleTold:
    """One car's vehicle."""

    car: int
    lines: int
    """That were recorded."""
    missing: int
    """That never came or were over the limit, by its own count."""
    inference_ms: tuple[float, float, float] | None
    """50th, 95th and 99th percentile of the times that it told; None where it told none."""
    rate_hz: float | None
    """Median of its lines a second; None where it told too few."""


class _Fold:
    def __init__(self) -> None:
        self.lines = 0
        self.missing = 0
        self.inference_ms = array("d")
        self.rate_hz = array("d")


def vehicles_told(reports: Iterable[VehicleReport]) -> tuple[VehicleTold, ...]:
    """What each car's vehicle told, in the order of their numbers."""
    cars: dict[int, _Fold] = {}
    for report in reports:
        car = cars.setdefault(report.car, _Fold())
        car.lines += 1
        car.missing = max(car.missing, report.missing)
        if report.inference_ms is not None:
            car.inference_ms.append(report.inference_ms)
        if report.rate_hz is not None:
            car.rate_hz.append(report.rate_hz)
    return tuple(_told(number, cars[number]) for number in sorted(cars))


def _told(number: int, car: _Fold) -> VehicleTold:
    times = None
    if car.inference_ms:
        p50, p95, p99 = (float(one) for one in np.percentile(car.inference_ms, QUANTILES))
        times = (p50, p95, p99)
    rate_hz = float(np.median(car.rate_hz)) if car.rate_hz else None
    return VehicleTold(car=number, lines=car.lines, missing=car.missing, inference_ms=times, rate_hz=rate_hz)


def vehicle_section(vehicles: Sequence[VehicleTold]) -> str:
    """The section; empty where no vehicle spoke."""
    if not vehicles:
        return ""
    rows = [_row(one) for one in vehicles]
    headings = ("Car", "Inference p50 (ms)", "p95 (ms)", "p99 (ms)", "Lines a second", "Lines", "Missing")
    table = plain_table("As the vehicles told it themselves; no lap depends on it", headings, rows)
    return f"<section>\n<h2>Vehicles</h2>\n{table}\n</section>"


def _row(one: VehicleTold) -> tuple[str, ...]:
    times = (None, None, None) if one.inference_ms is None else one.inference_ms
    shown = (number(time_ms, "{:.1f}") for time_ms in times)
    return (str(one.car), *shown, number(one.rate_hz, "{:.1f}"), str(one.lines), str(one.missing))
