"""The messages on the daemon's local socket, both ways, and their bytes.

A message is one line of JSON, which `nc -U` shows; a picture's bytes follow its line, which says how many. Knows bytes and
values; knows no socket, no thread and no clock.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeAlias

from dnb_edge import wire
from dnb_edge.errors import WorkError
from dnb_edge.live.vehicle_word import VehicleWord

PROTOCOL = 1
"""Grows when a message changes so that an older reader misunderstands it; new members and messages are no such change."""
MOST_LINE_BYTES = 1 << 20
MOST_BLOB_BYTES = 32 << 20


class Phase(StrEnum):
    """What the daemon is doing."""

    STARTING = "starting"
    RACING = "racing"
    """A run is on: frames are raced and recorded."""
    SETUP = "setup"
    """There is a camera and no track to race on yet, or somebody aims: pictures only."""
    FINISHED = "finished"
    """The run came to its end and another one is awaited: pictures only."""
    FAULT = "fault"
    """It cannot start, and tries again by itself; `reason` says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """The daemon's first message on a connection."""

    protocol: int
    version: str
    epoch: str
    """Random text that is another one for each process: sequence numbers of two epochs have nothing to do with each other."""
    next_sequence: int
    """The number of the event that comes next."""
    first_sequence: int
    """From this number on all lasting events are kept; where it is later than what a client has, the client begins anew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneryLine:
    """A start, finish or sector line, crossed forward towards its left. Metres on the track plane."""

    name: str
    start_m: tuple[float, float]
    end_m: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenery:
    """The things that stand still in a race, for whoever draws it. Metres on the track plane, camera px where it says so."""

    centreline_m: tuple[tuple[float, float], ...]
    """(x, y) along the route, a point every centimetre or two at most a thousand of them."""
    closed: bool
    lane_width_m: float | None
    lines: tuple[SceneryLine, ...]
    length_m: float
    camera_from_track: tuple[tuple[float, float, float], ...]
    """Homography 3x3 from metres (x, y, 1) to camera px of an ideal lens, rows first."""
    frame_px: tuple[int, int]
    """Width and height of the frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What the daemon is doing; sent after `Hello` and whenever it changes."""

    phase: Phase
    reason: str | None = None
    """In one line, where there is something to mend."""
    run: str | None = None
    """Name of the recording's file, without folder and suffix; None where none is recorded."""
    source: str | None = None
    track: str | None = None
    """The track's name; None where there is none yet."""
    laps_wanted: int | None = None
    scenery: Scenery | None = None
    """What a board needs to draw the race; None outside a race."""
    first_sequence: int = 0
    """Number of the latest run's first event: those before it are of runs before, which nobody keeps here."""
    start: str | None = None
    """How the race begins: `rolling`, so that cars may drive at once, or `grid`, with a countdown; None outside one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """An event, as the command line's JSON lines have it, with its number in this epoch."""

    sequence: int
    event: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A camera picture for people, as JPEG: the camera's own bytes where it gives such."""

    t_ns: int
    """The frame's stamp."""
    frame: int
    width_px: int
    height_px: int
    jpeg: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The end of what was asked in the message numbered `ask`."""

    ask: int
    done: bool
    reason: str | None = None
    """Why not, in one line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Follow:
    """Asks for events from number `since` on; None for those from now on. Answered by the events themselves."""

    ask: int
    since: int | None = None
    epoch: str | None = None
    """What `since` belongs to; where it is another one all kept events come."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchPictures:
    """Asks for pictures, as long as the connection lives."""

    ask: int
    every_s: float | None
    """At most one in so many seconds; None for no more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewRun:
    """Asks to finish this run's recording and to begin another run, with the configuration as it is then."""

    ask: int
    entry: str | None = None
    """Who or what drives; None for the configuration's own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AimCamera:
    """Asks to finish the run and to give pictures only (`aim` true), or to race again."""

    ask: int
    aim: bool
    camera: dict[str, Any] | None = None
    """What to ask of the camera meanwhile, so that people see what it does: keys of the configuration's section `capture`, over
    those that it has; None for those alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShowText:
    """Asks to show people at the box a line of text on its displays, such as the set-up code."""

    ask: int
    text: str
    for_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSays:
    """Hands over what vehicles said of themselves, for the recording and for whoever watches. No race is changed by it."""

    ask: int
    words: tuple[VehicleWord, ...]


FromDaemon: TypeAlias = Hello | State | Told | Picture | Answer
ToDaemon: TypeAlias = Follow | WatchPictures | NewRun | AimCamera | ShowText | VehicleSays
Message: TypeAlias = FromDaemon | ToDaemon

_NAMES: dict[type, str] = {
    Hello: "hello",
    State: "state",
    Told: "event",
    Picture: "picture",
    Answer: "answer",
    Follow: "follow",
    WatchPictures: "pictures",
    NewRun: "new-run",
    AimCamera: "aim",
    ShowText: "show",
    VehicleSays: "vehicle",
}
_KINDS = {name: kind for kind, name in _NAMES.items()}


def encode(message: Message) -> bytes:
    """The message's line, and its picture behind it."""
    body = {"say": _NAMES[type(message)], **wire.to_dict(message)}
    blob = b""
    if isinstance(message, Picture):
        blob = body.pop("jpeg")
        body["blob_bytes"] = len(blob)
    return json.dumps(body, allow_nan=False).encode() + b"\n" + blob


def blob_bytes(line: bytes) -> int:
    """How many bytes belong to the message behind its `line`. Raises `WorkError` where the line is no message."""
    count = _object(line).get("blob_bytes", 0)
    if not isinstance(count, int) or not 0 <= count <= MOST_BLOB_BYTES:
        raise WorkError(f"live socket: a message with {count!r} bytes behind it")
    return count


def decode(line: bytes, blob: bytes = b"") -> Message | None:
    """The message in `line`; None for one of a kind that we do not know. Raises `WorkError` where it is none at all."""
    found = _object(line)
    kind = _KINDS.get(str(found.get("say")))
    if kind is None:
        return None
    try:
        message: Message = wire.from_dict(kind, {**found, "jpeg": blob} if kind is Picture else found)
    except ValueError as error:
        raise WorkError(f"live socket: no {found['say']} message: {error}") from error
    return message


def _object(line: bytes) -> dict[str, Any]:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise WorkError("live socket: a line that is no JSON") from error
    if not isinstance(found, dict):
        raise WorkError("live socket: a line that is no JSON object")
    return found
