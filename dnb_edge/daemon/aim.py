"""Pictures only: a camera is open and nothing is raced, so that people can aim it and set up the track.

Knows sources, the feed that opens a lost camera again, and who wants pictures. Knows no configuration and no race.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon.camera import SameCamera
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.progress import Progress
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.state import BoardState
from dnb_edge.live.server import LiveServer

log = logging.getLogger(__name__)

TICK_S = 0.25
WATCHED_S = 0.03
UNWATCHED_S = 0.25
"""Time between two frames of a file or the simulator while somebody looks, and while nobody does: a camera's cost nothing,
theirs are made."""


class Board:
    """What displays show meanwhile: `state`, and a notice while there is one."""

    def __init__(self, displays: Sequence[Display], state: BoardState, notices: Notices, *, logs: bool) -> None:
        """`logs`: whether notices are logged, since no terminal prints them."""
        self._displays = displays
        self._logs = logs
        self._state = state
        self._notices = notices
        self._told: BoardState | None = None

    def show(self) -> None:
        """Posts what has changed."""
        state = self._state.noting(self._notices.text)
        if state is not self._told and state != self._told:
            if self._logs and state.notice is not None:
                log.warning("notice: %s", state.notice)
            self._told = state
            for display in self._displays:
                display.post(state)


def give_pictures(
    source: FrameSource,
    reopen: Callable[[str], FrameSource],
    server: LiveServer,
    notifier: ServiceNotifier,
    board: Board,
    *,
    until: Callable[[], bool],
) -> bool:
    """Offers the frames of `source` to whoever watches; True once `until()` holds, False where the source has ended.

    Raises `InputError` where a file turns out to be unusable. A camera that goes away is opened again by `reopen(uri)`.
    """
    live = source.info.live
    progress = Progress(notifier, None)
    with FrameFeed(source, SameCamera(source.info, reopen)) as feed:
        notifier.ready()
        while not until():
            if feed.ended:
                return False
            frame = feed.take(TICK_S)
            if frame is not None:
                server.offer(frame)
                if not live:
                    time.sleep(WATCHED_S if server.watched else UNWATCHED_S)
            board.show()
            progress.stepped(captured=feed.progress)
    return True
