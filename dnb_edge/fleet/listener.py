"""The box's own race, heard on the live socket and put into the queue; the newest of what only the moment wants beside it.

A thread of its own: the queue fills whether there is a network or not. Knows the live socket and the queue; knows no broker.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from dnb_edge.errors import DnbEdgeError, TemporaryFault, WorkError
from dnb_edge.fleet.messages import MOST_BYTES, BoxState, is_lasting
from dnb_edge.fleet.outbox import Heard, Outbox
from dnb_edge.live.caller import Caller, Silence
from dnb_edge.live.messages import Follow, State, Told

AGAIN_S = 2.0
"""Between two tries to reach the daemon."""
LISTEN_S = 0.5
"""So long at most until it is seen that it is to end."""
LIVE_SCHEMES = ("v4l2:", "libcamera:")
"""Sources whose stamps come once in a boot, and whose races may go on after their process was killed."""

ENVELOPE_BYTES = 2048

log = logging.getLogger(__name__)


class Listener:
    """Hears the daemon at `socket` until it is closed."""

    def __init__(self, socket: Path, outbox: Outbox, *, wall_s: Callable[[], float] = time.time) -> None:
        self._socket = socket
        self._outbox = outbox
        self._wall_s = wall_s
        self._lock = threading.Lock()
        self._state = BoxState(phase=None, reason="not heard yet")
        self._closing = threading.Event()
        self._failed: DnbEdgeError | None = None
        self._thread = threading.Thread(target=self._run, name="fleet-listener", daemon=True)

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def close(self) -> None:
        """Ends it. Safe to repeat."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(5 * LISTEN_S)

    @property
    def state(self) -> BoxState:
        """What the box does now, as far as it was heard; queue and clock are filled in by whoever tells it."""
        return self._state

    def check(self) -> None:
        """Raises what has ended it: a queue that cannot be written, say."""
        if self._failed is not None:
            raise self._failed

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._follow()
            except TemporaryFault as fault:
                self._state = replace(self._state, phase=None, reason=str(fault), health=None)
            except DnbEdgeError as error:
                self._failed = error
                return
            self._closing.wait(AGAIN_S)

    def _follow(self) -> None:
        """Hears one process of the daemon to its end. Raises `TemporaryFault` then."""
        try:
            caller = Caller(self._socket)
        except WorkError as error:
            # An upgrade may be under way: the other half of it comes later.
            raise TemporaryFault(str(error)) from error
        with caller:
            epoch = caller.hello.epoch
            heard = self._outbox.heard
            since = heard.sequence if heard.epoch == epoch else 0
            caller.say(Follow, since=since, epoch=epoch)
            while not self._closing.is_set():
                try:
                    message = caller.hear(deadline_s=time.monotonic() + LISTEN_S)
                except Silence:
                    continue
                except WorkError as error:
                    raise TemporaryFault(str(error)) from error
                match message:
                    case State():
                        self._show(message)
                    case Told():
                        self._told(message, epoch)

    def _show(self, state: State) -> None:
        known = self._state
        same = known.run == state.run and known.phase is not None
        self._state = BoxState(
            phase=state.phase.value,
            reason=state.reason,
            run=state.run,
            track=state.track,
            source=state.source,
            laps_wanted=state.laps_wanted,
            health=known.health if same else None,
            standings=known.standings if same else None,
        )

    def _told(self, told: Told, epoch: str) -> None:
        event = told.event
        match event.get("event"):
            case "health":
                self._state = replace(self._state, health=event)
            case "standings":
                self._state = replace(self._state, standings=event)
        if is_lasting(event) and _fits(event):
            self._outbox.add(
                event,
                Heard(epoch=epoch, sequence=told.sequence + 1),
                run=self._state.run,
                track=self._state.track,
                wall_s=self._wall_s(),
                key=self._key(event),
            )

    def _key(self, event: dict[str, Any]) -> str | None:
        """What the same event has again where a killed race goes on and tells again what it had not saved; None where no race
        goes on, and two events may be alike."""
        run, source = self._state.run, self._state.source
        if run is None or source is None or not source.startswith(LIVE_SCHEMES):
            return None
        boot = run.rpartition("-")[0]
        return hashlib.sha256(f"{boot} {json.dumps(event, sort_keys=True)}".encode()).hexdigest()


def _fits(event: dict[str, Any]) -> bool:
    """Whether a parcel may be so large: one that the hub does not take would hold up all behind it."""
    size = len(json.dumps(event))
    if size > MOST_BYTES - ENVELOPE_BYTES:
        log.warning("%s: an event of %d bytes is left out: the recording has it", event.get("event"), size)
        return False
    return True
