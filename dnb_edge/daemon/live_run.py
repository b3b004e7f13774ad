"""A run's side of the live socket: what the run is, told when it begins.

Knows a run's parts by their values and the server. Knows no race loop.
"""

from __future__ import annotations

from pathlib import Path

from dnb_edge.core import CoreSetup
from dnb_edge.daemon.live_sink import LiveSink
from dnb_edge.daemon.scenery import make_scenery
from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.values import SourceInfo


class LiveRun:
    """One run on `server`."""

    def __init__(self, server: LiveServer) -> None:
        self._server = server
        self.sink = LiveSink(server)

    def starts(self, source_uri: str) -> None:
        """The run is being built."""
        self._server.show(State(phase=Phase.STARTING, source=source_uri))

    def races(self, setup: CoreSetup, info: SourceInfo, recording: Path | None) -> None:
        """The run begins; events from here on are its own."""
        self._server.begin_run()
        self._server.show(
            State(
                phase=Phase.RACING,
                run=None if recording is None else recording.name.removesuffix(PART_SUFFIX).removesuffix(".mcap"),
                source=info.uri,
                track=setup.track.name,
                laps_wanted=setup.laps.laps,
                scenery=make_scenery(setup),
            )
        )
