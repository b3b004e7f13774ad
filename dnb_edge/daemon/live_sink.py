"""The listener that passes a race on to the live socket. Where nobody is connected it costs next to nothing.

Knows which events a page needs how often. Knows no socket: the server has threads of its own, and nothing here waits for it.
"""

from __future__ import annotations

from dnb_edge.live.server import LiveServer
from dnb_edge.values import Event, Frame, FrameDetections, Observation, Target, TargetState, VehicleReport

LEAST_APART_NS = 60_000_000
"""Time between two frames of which it is told where the cars are: about 15 a second of 30, whatever the jitter."""
VEHICLE_APART_NS = 90_000_000
"""Time between two lines of one vehicle that are told: nobody reads more than ten figures a second."""


class LiveSink:
    """Hands frames and events to `server`; of where the cars are, not every frame's."""

    warnings: tuple[str, ...] = ()
    """None: who watches is no part of the race."""

    def __init__(self, server: LiveServer) -> None:
        self._server = server
        self._told_t_ns: int | None = None
        self._tells = False
        self._vehicles_ns: dict[int, int] = {}
        """When a line of each car's vehicle was last told, CLOCK_MONOTONIC."""

    def frame(self, frame: Frame, found: FrameDetections) -> None:  # noqa: ARG002 what was found comes as events
        """Offers the picture, and decides whether it is told where the cars are in this frame. Of several cameras people
        watch the first."""
        if frame.camera == 0:
            self._server.offer(frame)
        self._tells = self._told_t_ns is None or frame.t_ns - self._told_t_ns >= LEAST_APART_NS
        if self._tells:
            self._told_t_ns = frame.t_ns

    def event(self, event: Event) -> None:
        """Hands the event over."""
        if isinstance(event, VehicleReport):
            self._vehicle(event)
        elif self._tells or not isinstance(event, Observation | Target) or _is_lost(event):
            self._server.tell(event)

    def _vehicle(self, report: VehicleReport) -> None:
        last_ns = self._vehicles_ns.get(report.car)
        if last_ns is None or report.came_ns - last_ns >= VEHICLE_APART_NS:
            self._vehicles_ns[report.car] = report.came_ns
            self._server.tell(report)


def _is_lost(event: Observation | Target) -> bool:
    """Whether it is the last word of a target, without which it would stand on the board for ever."""
    return isinstance(event, Target) and event.state is TargetState.LOST
