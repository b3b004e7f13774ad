"""What the endpoints' modules share: the settings, the line to the daemon, the sessions, the pages' templates.

Each module of endpoints has `endpoints(box) -> tuple[Endpoint, ...]`; the app joins them. Knows the rooms' interfaces only.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from starlette.requests import Request
from starlette.responses import Response

from dnb_edge.live.messages import Picture, State, Told


@dataclass(frozen=True, slots=True, kw_only=True)
class WebSettings:
    """Where things are and who may reach them."""

    socket: Path
    """The daemon's live socket."""
    runs: Path
    """The directory with the recordings."""
    setup: Path
    """The directory that the wizard writes: dnb-edge.yaml and the pictures, calibrations and models that it names."""
    cache: Path
    """For what is made on the way to a browser; all of it may be deleted."""
    host: str = "::"
    port: int = 8080
    names: tuple[str, ...] = ()
    """Host names by which the box may be called, besides its own name, NAME.local, localhost and its addresses."""
    most_viewers: int = 100
    most_downloads: int = 8
    """Recordings that are taken at once; others are told to come again."""
    download_mb_per_s: float = 24.0
    """Of all downloads together, megabytes a second: the race writes to the same disk."""


class Daemon(Protocol):
    """The line to the daemon, which may be down: it comes back by itself."""

    @property
    def state(self) -> State | None:
        """What the daemon says of itself; None while it is down."""

    @property
    def epoch(self) -> str | None:
        """The daemon's process, as `Hello` names it; None before the first."""

    @property
    def first(self) -> int:
        """From this number on no event is missing of those that last; who lacks earlier ones cannot go on where he was."""

    def events(self, since: int | None = None) -> tuple[Told, ...]:
        """The kept events from number `since` on, oldest first; all kept ones for None."""

    def follow(self) -> AsyncIterator[Told | State | None]:
        """Whatever comes from now on; None when the daemon has gone. Ends with `asyncio.CancelledError` only."""

    async def picture(self, *, newer_than_ns: int | None = None, timeout_s: float = 5.0) -> Picture:
        """A camera picture. Raises `Refused` (503) where there is none."""

    async def ask(self, **what: Any) -> None:
        """Has the daemon do something: `new_run=True, entry=...`, `aim=True|False`, `show="text", for_s=60.0`.

        Raises `Refused` with its reason: 503 where the daemon is down, 409 where it will not.
        """


class Pages(Protocol):
    """The templates under `web/templates`."""

    def page(self, request: Request, name: str, *, status: int = 200, **values: Any) -> Response:
        """The page of template `name`, which knows `csrf` (the session's token or None), `may_change` and `values`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """All of it."""

    settings: WebSettings
    daemon: Daemon
    pages: Pages
