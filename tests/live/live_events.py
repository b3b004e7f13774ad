"""Events to tell, as small as they can be, and servers to tell them."""

import threading
from dataclasses import dataclass, field

from dnb_edge.live.server import Order, Reply
from dnb_edge.values import (
    Health,
    Incident,
    IncidentKind,
    Observation,
    RacePhase,
    RaceState,
    RunSummary,
    Standings,
)


def state(number: int) -> RaceState:
    """A lasting event; `number` is in its text."""
    return RaceState(t_ns=number, t_s=number * 1e-9, phase=RacePhase.RACING, text=str(number))


def long_incident(number: int) -> Incident:
    """A lasting event of some kilobytes."""
    return Incident(
        number=number,
        kind=IncidentKind.STALLED,
        car=1,
        target_id=1,
        lap=None,
        start_t_ns=number,
        end_t_ns=number,
        start_s=0.0,
        lasted_s=0.0,
        greatest_m=None,
        worst_t_ns=0,
        track_m=(0.0, 0.0),
        camera_px=None,
        s_m=None,
        text="stood " * 2000,
    )


def seen(number: int) -> Observation:
    """A fleeting event."""
    return Observation(
        t_ns=number,
        t_s=number * 1e-9,
        camera_px=(1.0, 2.0),
        track_m=(0.1, 0.2),
        covariance_m2=(1e-6, 0.0, 1e-6),
        confidence=0.9,
        length_px=80.0,
    )


def standings(number: int) -> Standings:
    """Of which the last one counts."""
    return Standings(t_ns=number, t_s=0.0, rank_by="best_lap", unit="s", final=False, rows=())


def health(number: int) -> Health:
    """Likewise."""
    return Health(
        t_ns=number,
        t_s=0.0,
        frames=number,
        detected_frames=0,
        dropped_frames=0,
        fps=None,
        latency_ms=None,
        display="none",
        recording="none",
        view_error_mean_px=None,
        view_error_mean_m=None,
    )


def summary() -> RunSummary:
    """A run's last word."""
    return RunSummary(frames=1, detected_frames=1, laps=0, recording=None)


@dataclass
class Desk:
    """Takes orders and keeps the replies for the test to give."""

    orders: list[Order] = field(default_factory=list)
    replies: list[Reply] = field(default_factory=list)
    came: threading.Event = field(default_factory=threading.Event)

    def __call__(self, order: Order, reply: Reply) -> None:
        self.orders.append(order)
        self.replies.append(reply)
        self.came.set()
