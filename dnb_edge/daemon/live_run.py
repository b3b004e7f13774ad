"""A run's side of the live socket: what the run is, told when it begins, and whether the process goes on behind it.

Knows a run's parts by their values, the server and the orders. Knows no race loop.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dnb_edge.core import CoreSetup
from dnb_edge.daemon.live_sink import LiveSink
from dnb_edge.daemon.loop import Stop
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.scenery import make_scenery
from dnb_edge.daemon.vehicle import VehicleInbox
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.state import BoardState
from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.values import SourceInfo


class LiveRun:
    """One run on `server`."""

    def __init__(
        self,
        server: LiveServer,
        *,
        stop: Stop,
        notices: Notices,
        goes_on: Callable[[], bool],
        on_begin: Callable[[], None],
        resumes: bool,
        vehicles: VehicleInbox | None = None,
    ) -> None:
        """`stop` ends the run once it is set; `goes_on` tells, at its end, whether the process lives on; `resumes`: whether it
        may go on with a run that was cut short."""
        self._server = server
        self._goes_on = goes_on
        self._on_begin = on_begin
        self.stop = stop
        self.resumes = resumes
        self.notices = notices
        self.vehicles = VehicleInbox() if vehicles is None else vehicles
        """What vehicles say, for the race."""
        self.sink = LiveSink(server)
        self.board = BoardState()
        """What displays showed last."""

    def starts(self, source_uri: str) -> None:
        """The run is being built."""
        self._server.show(State(phase=Phase.STARTING, source=source_uri))

    def races(self, setup: CoreSetup, info: SourceInfo, recording: Path | None) -> None:
        """The run begins; events from here on are its own."""
        self.vehicles.clear()
        self._server.begin_run()
        self._server.show(
            State(
                phase=Phase.RACING,
                run=None if recording is None else recording.name.removesuffix(PART_SUFFIX).removesuffix(".mcap"),
                source=info.uri,
                track=setup.track.name,
                laps_wanted=setup.laps.laps,
                scenery=make_scenery(setup),
                start=setup.start.mode.value,
            )
        )
        self._on_begin()

    def ends(self, notifier: ServiceNotifier, board: BoardState) -> None:
        """The race is over and its recording is being finished."""
        self.board = board
        if self._goes_on():
            notifier.feed_now()
        else:
            notifier.stopping()
