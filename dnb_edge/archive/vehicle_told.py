"""What vehicles told of their networks' speed during a run. Nobody has checked it; the laps know nothing of it."""

from __future__ import annotations

from collections.abc import Mapping

from dnb_edge.record.channels import EVENT_TOPICS
from dnb_edge.record.reader import RecordedRun
from dnb_edge.values import VehicleReport


def told_inference_ms(run: RecordedRun) -> Mapping[int, tuple[float, ...]]:
    """For each car the times that it told, ms, in order; empty where no vehicle spoke. Raises `InputError` where the file
    is malformed.
    """
    told: dict[int, list[float]] = {}
    # Most recordings hold none, and to look through all events takes its time.
    if run.counts.get(EVENT_TOPICS[VehicleReport], 0):
        for event in run.events():
            if isinstance(event, VehicleReport) and event.inference_ms is not None:
                told.setdefault(event.car, []).append(event.inference_ms)
    return {car: tuple(times_ms) for car, times_ms in told.items()}
