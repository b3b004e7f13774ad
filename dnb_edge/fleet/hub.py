"""The hub on the line: hears all boxes, stores what they deliver, and says what it has stored.

Knows the store and the line; knows no page. What the pages show of the moment, they ask for (`glance`) from other threads.
"""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from dnb_edge import __version__
from dnb_edge.errors import InputError, WorkError
from dnb_edge.fleet.link import SETTLED_S, Line, Will
from dnb_edge.fleet.messages import BoxState, HubStatus, Parcel, Status, Stored, Topics, decode, encode
from dnb_edge.fleet.store import MOST_BOXES, KnownBox, Store

MOST_AT_ONCE = 500
"""Parcels in one transaction."""
SILENT_S = 20.0
"""A box tells its state every five seconds; one whose broker died with it is on the line for ever else."""
WARN_EVERY_S = 10.0
"""Whatever nonsense comes, the log has a line in so many seconds."""

log = logging.getLogger(__name__)


def client_id(topics: Topics) -> str:
    """The hub's name to the broker: another one for each process, so that two of them hear of each other."""
    return f"{topics.prefix}-hub-{secrets.token_hex(4)}"


def will(topics: Topics) -> Will:
    """What the broker says for a hub that has gone."""
    return Will(topic=topics.hub, payload=encode(HubStatus(online=False)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """A box as the hub sees it now."""

    box: KnownBox
    online: bool | None
    """None where nothing was heard of it since the hub is on the line."""
    gone: str | None
    """Why it is not online, where it said so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Glance:
    """All of it now."""

    trouble: str | None
    """Why the hub is not on the line."""
    boxes: tuple[Seen, ...]
    nonsense: int
    """Messages that were none, since the hub started."""


class Hub:
    """A `Peer`."""

    def __init__(
        self,
        *,
        topics: Topics,
        store: Store,
        say: Callable[[str], None],
        clock_s: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        """`say` takes lines for people, each time something is another way than before."""
        self._topics = topics
        self._store = store
        self._say = say
        self._clock_s = clock_s
        self._wall_s = wall_s
        self._lock = threading.Lock()
        self._statuses: dict[str, Status] = {}
        self._trouble: str | None = "not on the line yet"
        self._parcels: list[tuple[str, Parcel]] = []
        self._states: dict[str, BoxState] = {}
        self._nonsense = 0
        self._warned_s = -WARN_EVERY_S
        self._connection = ""
        self._greeted_s = 0.0

    @property
    def topics(self) -> tuple[str, ...]:
        """As `Peer`."""
        return (*self._topics.of_boxes, self._topics.hub)

    def greeted(self, line: Line) -> None:
        """As `Peer`."""
        with self._lock:
            self._statuses.clear()
            self._trouble = None
        self._parcels.clear()
        for (box, queue), stored in self._store.queues().items():
            self._acknowledge(line, box, queue, stored)
        self._connection, self._greeted_s = secrets.token_hex(8), self._clock_s()
        self._say_status(line)
        self._say("on the line")

    def heard(self, line: Line, topic: str, payload: bytes, *, retained: bool) -> None:
        """As `Peer`. Raises `InputError` where another hub is there."""
        if topic == self._topics.hub and not retained:
            self._met_namesake(line, payload)
        found = self._topics.box_of(topic)
        if found is None or not payload:
            # Empty: somebody has taken a retained message away.
            return
        box, kind = found
        try:
            match kind:
                case "status":
                    self._met(box, decode(Status, payload))
                case "state":
                    self._states[box] = decode(BoxState, payload)
                case "parcel":
                    self._parcels.append((box, decode(Parcel, payload)))
        except WorkError as error:
            self._passed_over(topic, error)
        if len(self._parcels) >= MOST_AT_ONCE:
            self._keep(line)

    def turn(self, line: Line | None) -> None:
        """As `Peer`."""
        if line is not None:
            self._keep(line)

    def broken(self, why: str) -> None:
        """As `Peer`."""
        if why != self._trouble:
            self._say(f"{why}: tried again")
        with self._lock:
            self._trouble = why
            self._statuses.clear()

    def farewell(self, line: Line) -> None:
        """As `Peer`."""
        line.publish(self._topics.hub, encode(HubStatus(online=False, version=__version__)), retain=True)

    def glance(self) -> Glance:
        """What there is to see now; from any thread. Raises `WorkError`."""
        boxes, wall_s = self._store.boxes(), self._wall_s()
        with self._lock:
            statuses, trouble = dict(self._statuses), self._trouble
        seen = tuple(_seen(box, statuses.get(box.name), wall_s) for box in boxes)
        return Glance(trouble=trouble, boxes=seen, nonsense=self._nonsense)

    def _say_status(self, line: Line) -> None:
        status = HubStatus(online=True, connection=self._connection, version=__version__)
        line.publish(self._topics.hub, encode(status), retain=True)

    def _met_namesake(self, line: Line, payload: bytes) -> None:
        """Of two hubs the newcomer goes; the other one says again that it is there."""
        try:
            status = decode(HubStatus, payload)
        except WorkError as error:
            self._passed_over(self._topics.hub, error)
            return
        if status.online and status.connection == self._connection:
            return
        if not status.online or self._clock_s() - self._greeted_s > SETTLED_S:
            self._say_status(line)
        else:
            raise InputError(f"--prefix {self._topics.prefix}: another hub is on the line: one hub for each prefix")

    def _met(self, box: str, status: Status) -> None:
        with self._lock:
            if box in self._statuses or len(self._statuses) < MOST_BOXES:
                self._statuses[box] = status

    def _keep(self, line: Line) -> None:
        """Stores what has come, and then says so."""
        if self._states:
            self._store.show(self._states, wall_s=self._wall_s())
            self._states.clear()
        if self._parcels:
            stored = self._store.take(self._parcels, wall_s=self._wall_s())
            self._parcels.clear()
            for (box, queue), number in stored.items():
                self._acknowledge(line, box, queue, number)

    def _acknowledge(self, line: Line, box: str, queue: str, stored: int) -> None:
        line.publish(self._topics.stored(box), encode(Stored(queue=queue, stored=stored)), retain=True)

    def _passed_over(self, topic: str, error: WorkError) -> None:
        self._nonsense += 1
        now_s = self._clock_s()
        if now_s - self._warned_s >= WARN_EVERY_S:
            self._warned_s = now_s
            log.warning("%s: passed over: %s (%d so far)", topic, error, self._nonsense)


def _seen(box: KnownBox, status: Status | None, wall_s: float) -> Seen:
    if status is None or not status.online:
        return Seen(box=box, online=None if status is None else False, gone=None if status is None else status.reason)
    if box.state_wall_s is not None and wall_s - box.state_wall_s > SILENT_S:
        return Seen(box=box, online=False, gone="silent")
    return Seen(box=box, online=True, gone=None)
