"""The paper's completion time: how long a run took until the route or circuit was finished, and what a failure makes of it.

"Completion time is the total time spent driving until the route or circuit is finished. If a model fails to stay on track or to
reach the endpoint, we record a failure event or large penalty" (DriveNetBench, section on completion time). Knows one run's
laps with their verdicts; knows no path, and decides nothing about what makes a lap invalid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.values import Lap


@dataclass(frozen=True, slots=True, kw_only=True)
class Completion:
    """What a run is worth by its time."""

    finished: bool
    """True where all laps that were wanted were completed and valid."""
    laps: int
    """Complete laps that were counted, valid or not."""
    failures: tuple[str, ...]
    """Each failure as a sentence: a lap that is not valid, with its reasons, or the end that was not reached. Empty where it
    finished."""
    time_s: float | None
    """Total time of the counted laps with the rule set's penalties, and the failures' price where they have one; None where a
    failure leaves no time: the run did not finish (DNF)."""
    sigma_s: float | None
    """One standard deviation of `time_s`; None where there is none."""
    lap_time_s: float | None
    """`time_s` for each lap that was wanted: the completion time of the circuit driven once."""


def completion(laps: Sequence[Lap], *, wanted: int | None = None, failure_s: float | None = None) -> Completion:
    """The completion of one run with the complete laps `laps`, in their order.

    The run is over with the lap number `wanted`; later ones are not counted. None: as many as were driven, at least one.
    `failure_s` is the price, seconds, of each counted lap that is not valid, on top of the time that it took, and of each lap
    that is missing, instead of that time, so it should be longer than any lap; None: a failure leaves no time at all. Raises
    `ValueError` where one of them makes no sense.
    """
    if wanted is not None and wanted < 1:
        raise ValueError(f"wanted: {wanted} is too few, at least 1 lap is needed")
    if failure_s is not None and not (failure_s >= 0 and math.isfinite(failure_s)):
        raise ValueError(f"failure_s: {failure_s} must not be negative")
    counted = laps[:wanted]
    of = max(len(counted), 1) if wanted is None else wanted
    failures = [f"lap {lap.number}: {'; '.join(lap.reasons) or 'not valid'}" for lap in counted if not lap.valid]
    priced = len(failures) + of - len(counted)
    if len(counted) < of:
        failures.append(f"the end was not reached: {len(counted)} of {of} laps were completed")
    if priced and failure_s is None:
        time_s = sigma_s = None
    else:
        time_s = math.fsum(_official_s(lap) for lap in counted) + priced * (failure_s or 0.0)
        sigma_s = _sigma_s(counted)
    return Completion(
        finished=not failures,
        laps=len(counted),
        failures=tuple(failures),
        time_s=time_s,
        sigma_s=sigma_s,
        lap_time_s=None if time_s is None else time_s / of,
    )


def _official_s(lap: Lap) -> float:
    return lap.time_s if lap.official_time_s is None else lap.official_time_s


def _sigma_s(laps: Sequence[Lap]) -> float:
    """One sigma of the laps' total time. Where a lap begins with the crossing that ended the one before, that crossing cancels:
    of such a chain only the first and the last lap count.
    """
    variance_s2 = 0.0
    for i, lap in enumerate(laps):
        begins = i == 0 or laps[i - 1].end_t_ns != lap.start_t_ns
        ends = i == len(laps) - 1 or laps[i + 1].start_t_ns != lap.end_t_ns
        variance_s2 += lap.sigma_s**2 if begins or ends else 0.0
    return math.sqrt(variance_s2)
