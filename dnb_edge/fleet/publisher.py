"""A box on the line: says that it is there and what it does, and hands its queue to the hub until the hub has stored all of it.

Knows the queue, the listener and the line; knows no socket, no process.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace

from dnb_edge import __version__
from dnb_edge.errors import InputError, WorkError
from dnb_edge.fleet.link import SETTLED_S, Line, Will
from dnb_edge.fleet.listener import Listener
from dnb_edge.fleet.messages import MOST_BYTES, BoxState, HubStatus, Status, Stored, Topics, decode, encode
from dnb_edge.fleet.outbox import Outbox

WINDOW = 100
"""Parcels under way that the hub has not stored yet."""
RESEND_S = 5.0
"""Where the hub has stored nothing of what is under way for so long, it is sent again: a broker may have lost it."""
HUB_S = 2.0
"""So soon after the greeting at the latest the broker has said whether there is a hub."""
STATE_S = 5.0
"""Between two tellings of an unchanged state."""
CHANGED_S = 1.0
"""Between two tellings of a changing one."""

log = logging.getLogger(__name__)


def client_id(topics: Topics, box: str, queue: str) -> str:
    """The box's name to the broker: another one for another box of the same name, so that either hears of the other."""
    return f"{topics.prefix}-box-{box}-{queue}"


def will(topics: Topics, box: str, queue: str) -> Will:
    """What the broker says for a box that has gone."""
    return Will(topic=topics.status(box), payload=encode(Status(online=False, queue=queue)))


class Publisher:
    """The box named `box`; a `Peer`."""

    def __init__(
        self,
        *,
        box: str,
        topics: Topics,
        outbox: Outbox,
        listener: Listener,
        say: Callable[[str], None],
        clock_s: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        """`say` takes lines for people, each time something is another way than before."""
        self._box = box
        self._topics = topics
        self._outbox = outbox
        self._listener = listener
        self._say = say
        self._clock_s = clock_s
        self._wall_s = wall_s
        self._hub = HubStatus(online=False)
        self._greeted_s = 0.0
        self._sent = 0
        """Number of the last parcel that was sent on this line, or that the hub has."""
        self._moved_s = 0.0
        """When the first of what is under way was sent, or something was stored since."""
        self._told: BoxState | None = None
        self._told_s = -STATE_S
        self._words = ""

    @property
    def topics(self) -> tuple[str, ...]:
        """As `Peer`."""
        return (self._topics.hub, self._topics.stored(self._box), self._topics.status(self._box))

    def greeted(self, line: Line) -> None:
        """As `Peer`."""
        self._hub, self._told, self._greeted_s = HubStatus(online=False), None, self._clock_s()
        self._say_status(line, online=True)

    def heard(self, line: Line, topic: str, payload: bytes, *, retained: bool) -> None:
        """As `Peer`. Raises `InputError` where another box of this name is there, or the queue is a copy."""
        try:
            if topic == self._topics.hub:
                self._meet(decode(HubStatus, payload))
            elif topic == self._topics.stored(self._box):
                self._acknowledged(decode(Stored, payload))
            elif not retained:
                self._met_namesake(line, decode(Status, payload))
        except WorkError as error:
            log.warning("%s: passed over: %s", topic, error)

    def turn(self, line: Line | None) -> None:
        """As `Peer`. Raises what has ended the listener."""
        self._listener.check()
        if line is None:
            return
        self._announce(line)
        if self._hub.online:
            self._send(line)
            self._tell(
                "the hub listens" if self._outbox.waiting <= WINDOW else "the hub listens; a long queue is under way"
            )
        elif self._clock_s() - self._greeted_s > HUB_S:
            self._tell("no hub is there: the queue waits")

    def broken(self, why: str) -> None:
        """As `Peer`."""
        self._tell(f"{why}: tried again; the queue waits")

    def farewell(self, line: Line) -> None:
        """As `Peer`."""
        self._say_status(line, online=False, reason="stopped")

    def _say_status(self, line: Line, *, online: bool, reason: str | None = None) -> None:
        status = Status(online=online, reason=reason, queue=self._outbox.name, version=__version__)
        line.publish(self._topics.status(self._box), encode(status), retain=True)

    def _met_namesake(self, line: Line, status: Status) -> None:
        """Of two boxes of one name the newcomer goes; the other one says again that it is there."""
        if status.online and status.queue == self._outbox.name:
            return
        if not status.online or self._clock_s() - self._greeted_s > SETTLED_S:
            self._say_status(line, online=True)
        else:
            raise InputError(f"--box {self._box}: another box of this name is on the line: give each its own")

    def _meet(self, hub: HubStatus) -> None:
        if hub.online and hub.connection != self._hub.connection:
            # What was under way to the one before may never have come.
            self._rewind()
        self._hub = hub

    def _acknowledged(self, stored: Stored) -> None:
        if stored.queue != self._outbox.name:
            return
        if stored.stored > self._outbox.last - self._outbox.waiting:
            self._outbox.stored(stored.stored)
            self._moved_s = self._clock_s()
        self._sent = max(self._sent, stored.stored)

    def _send(self, line: Line) -> None:
        done = self._outbox.last - self._outbox.waiting
        if self._sent > done and self._clock_s() - self._moved_s > RESEND_S:
            self._rewind()
        room = WINDOW - (max(self._sent, done) - done)
        if room <= 0 or self._sent >= self._outbox.last:
            return
        if self._sent <= done:
            # The first under way; those behind it do not put off its being sent again.
            self._moved_s = self._clock_s()
        for parcel in self._outbox.after(self._sent, most=room):
            line.publish(self._topics.parcel(self._box), encode(parcel))
            self._sent = parcel.number

    def _rewind(self) -> None:
        self._sent = self._outbox.last - self._outbox.waiting
        self._moved_s = self._clock_s()

    def _announce(self, line: Line) -> None:
        """Tells the state where it changed, or some seconds have passed."""
        now_s = self._clock_s()
        state = replace(self._listener.state, queued=self._outbox.waiting, thrown_away=self._outbox.thrown_away)
        within_s = STATE_S if self._told is not None and _alike(state, self._told) else CHANGED_S
        if self._told is not None and now_s - self._told_s < within_s:
            return
        self._told, self._told_s = state, now_s
        payload = encode(replace(state, wall_s=self._wall_s()))
        if len(payload) > MOST_BYTES:
            payload = encode(replace(state, wall_s=self._wall_s(), standings=None))
        # Told again in seconds: not worth a place in the queue for what must come.
        line.publish(self._topics.state(self._box), payload, retain=True, qos=0)

    def _tell(self, words: str) -> None:
        if words != self._words:
            self._words = words
            self._say(words)


def _alike(state: BoxState, other: BoxState) -> bool:
    """But for what changes all the time."""
    return replace(state, health=None, queued=0) == replace(other, health=None, queued=0)
