"""What a running service says of itself, and the pictures of the camera that it has.

Knows the live socket and a clock. Asks for nothing that changes anything.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

from dnb_edge import wire
from dnb_edge.doctor.footage import Footage, made_of
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import TemporaryFault
from dnb_edge.live.caller import Caller
from dnb_edge.live.messages import Follow, Picture, State, Told, WatchPictures
from dnb_edge.values import Clock, Frame, Health, SourceInfo, StampSource

EVERY_S = 0.02
"""All pictures of cameras up to 50 frames a second."""
CONNECT_S = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Service:
    """A running service."""

    state: State
    health: Health | None
    """The latest; None where no race is on."""
    pictures: tuple[Picture, ...]

    def footage(self) -> Footage:
        """Its pictures and what it says of the camera. Raises `CannotTell` where it gives none."""
        if not self.pictures:
            reason = self.state.reason or "it gives no pictures at present"
            raise CannotTell(f"the running service has the camera: {reason}")
        first, uri = self.pictures[0], self.state.source or "the service's camera"
        info = SourceInfo(
            uri=uri, width_px=first.width_px, height_px=first.height_px, nominal_fps=None, clock=Clock.MONOTONIC,
            live=not uri.startswith(("sim:", "loop:", "file:", "mcap:")),
        )  # fmt: skip
        frames = [_frame(picture) for picture in self.pictures]
        made = made_of(info, frames, [None] * len(frames), lost=())
        told = replace(made, from_service=True, lost=None, stamps=frozenset(), delay_s=None)
        if self.health is None:
            return told
        fps = made.fps if self.health.fps is None else self.health.fps
        return replace(told, fps=fps, frames=self.health.frames, lost=self.health.lost)


def ask_service(path: Path, *, seconds: float) -> Service | None:
    """The service at the live socket, listened to for `seconds`; None where none answers.

    Raises `WorkError` where what answers is another version, `CannotTell` where we may not ask.
    """
    try:
        if not path.exists():
            return None
        allowed = os.access(path, os.R_OK | os.W_OK, effective_ids=True)
    except PermissionError:
        allowed = False
    if not allowed:
        # Not to be taken for none: its camera would be opened.
        raise CannotTell(f"{path}: only the service's group may ask it: run this with sudo")
    try:
        caller = Caller(path, timeout_s=CONNECT_S)
    except TemporaryFault:
        return None
    with caller:
        caller.say(Follow)
        caller.say(WatchPictures, every_s=EVERY_S)
        return _listen(caller, time.monotonic() + seconds)


def _listen(caller: Caller, deadline_s: float) -> Service | None:
    state: State | None = None
    health: Health | None = None
    pictures: list[Picture] = []
    while time.monotonic() < deadline_s:
        try:
            heard = caller.hear(deadline_s=deadline_s)
        except TemporaryFault:
            break  # the time is over, or it has gone: what it said until then counts
        if isinstance(heard, State):
            state = heard
        elif isinstance(heard, Picture):
            pictures.append(heard)
        elif isinstance(heard, Told) and heard.event.get("event") == "health":
            health = wire.from_dict(Health, heard.event)
    if state is None:
        return None
    return Service(state=state, health=health, pictures=tuple(pictures))


def _frame(picture: Picture) -> Frame:
    return Frame(
        sequence=picture.frame, t_ns=picture.t_ns, stamp_source=StampSource.ARRIVAL, width_px=picture.width_px,
        height_px=picture.height_px, jpeg=picture.jpeg,
    )  # fmt: skip
