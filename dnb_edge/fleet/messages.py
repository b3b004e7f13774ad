"""What boxes and the hub tell each other over a broker: the topics, and the JSON on each of them.

Knows topics and values; knows no broker, no file and no clock. docs/fleet.md has the same as a table.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any, TypeVar

from dnb_edge import wire
from dnb_edge.errors import InputError, WorkError

T = TypeVar("T")

MOST_BYTES = 64 * 1024
"""Of a message; a longer one is none of ours."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,47}")
_PREFIX = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,47}(/[A-Za-z0-9._-]{1,48}){0,3}")

LASTING = frozenset({"lap", "score", "incident", "run"})
"""The events that are queued and delivered exactly once; of standings the final ones, too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """The topics below `prefix`."""

    prefix: str

    def status(self, box: str) -> str:
        """Retained `Status`; the box's last will is one, too."""
        return f"{self.prefix}/box/{box}/status"

    def state(self, box: str) -> str:
        """Retained `BoxState`, every few seconds and whenever what the box does changes."""
        return f"{self.prefix}/box/{box}/state"

    def parcel(self, box: str) -> str:
        """A `Parcel`, each again and again until the hub has stored it."""
        return f"{self.prefix}/box/{box}/parcel"

    def stored(self, box: str) -> str:
        """Retained `Stored`, by the hub."""
        return f"{self.prefix}/hub/stored/{box}"

    @property
    def hub(self) -> str:
        """Retained `HubStatus`; the hub's last will is one, too."""
        return f"{self.prefix}/hub/status"

    @property
    def of_boxes(self) -> tuple[str, ...]:
        """What the hub listens to."""
        return tuple(f"{self.prefix}/box/+/{kind}" for kind in ("status", "state", "parcel"))

    def box_of(self, topic: str) -> tuple[str, str] | None:
        """The box and the last level of a box's topic; None where it is none of them, or the name is no box's."""
        head = f"{self.prefix}/box/"
        name, _, kind = topic.removeprefix(head).partition("/")
        if not topic.startswith(head) or not _NAME.fullmatch(name):
            return None
        return name, kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """Whether a box is there."""

    online: bool
    reason: str | None = None
    """Why not: `stopped`, or None where the broker says it for a box that has gone."""
    queue: str = ""
    """Whose word it is: two boxes of one name have two queues."""
    version: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxState:
    """What a box does now; the newest replaces all before it."""

    phase: str | None
    """As the live socket has it: racing, setup ...; None where the box's own dnb-edge does not answer."""
    reason: str | None = None
    run: str | None = None
    track: str | None = None
    source: str | None = None
    laps_wanted: int | None = None
    health: dict[str, Any] | None = None
    """The last `health` event as `run --json` prints it; None before the first."""
    standings: dict[str, Any] | None = None
    queued: int = 0
    """Messages that wait for the hub to store them."""
    thrown_away: int = 0
    """Messages that there was no room for in the queue, since it was made."""
    wall_s: float = 0.0
    """The box's own wall clock, seconds since 1970: a box without a network may have it wrong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parcel:
    """One event on its way to the hub."""

    queue: str
    """Random name of the queue's file: numbers of two queues have nothing to do with each other."""
    number: int
    """From 1, without gaps."""
    first: int
    """Number of the oldest parcel that the box still has, when this one was sent: none before it comes any more."""
    run: str | None
    """Name of the recording; None where none is made."""
    track: str | None
    wall_s: float
    """The box's wall clock when it heard the event."""
    event: dict[str, Any]
    """As `run --json` prints it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stored:
    """The hub has all parcels of `queue` up to number `stored` on its disk; the box forgets them."""

    queue: str
    stored: int


@dataclass(frozen=True, slots=True, kw_only=True)
class HubStatus:
    """Whether the hub is there."""

    online: bool
    connection: str = ""
    """Another one for each of the hub's connections: what was under way before may never have come."""
    version: str = ""


def encode(message: Status | BoxState | Parcel | Stored | HubStatus) -> bytes:
    """The message as it goes over the broker."""
    return json.dumps(wire.to_dict(message), allow_nan=False, separators=(",", ":")).encode()


def decode(kind: type[T], payload: bytes) -> T:
    """The message in `payload`. Raises `WorkError` where it is none of this kind."""
    if len(payload) > MOST_BYTES:
        raise WorkError(f"a message of {len(payload)} bytes, {MOST_BYTES} at most")
    try:
        found = wire.from_json(kind, payload)
        # Python's reader takes Infinity, which no JSON has, and halves of characters, which no file has.
        json.dumps(wire.to_dict(found), allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        raise WorkError(f"no {kind.__name__}: {error}") from error
    return found


def is_lasting(event: dict[str, Any]) -> bool:
    """Whether the event is one to deliver, however late."""
    name = event.get("event")
    return name in LASTING or (name == "standings" and event.get("final") is True)


def box_name(text: str) -> str:
    """`text`, the name of a box. Raises `InputError` where it is none."""
    if not _NAME.fullmatch(text):
        raise InputError(f"--box {text}: letters, digits and . _ - only, 48 at most, beginning with a letter or digit")
    return text


def topics(prefix: str) -> Topics:
    """The topics below `prefix`. Raises `InputError` where it is none."""
    if not _PREFIX.fullmatch(prefix):
        raise InputError(f"--prefix {prefix}: letters, digits and . _ - only, up to four levels with / between them")
    return Topics(prefix=prefix)
