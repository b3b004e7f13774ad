"""The line protocol of serial displays, version 1: messages to ASCII lines and back; see `docs/display-protocol.md`.

A line is words parted by single spaces, then ` *` and a checksum of two hexadecimal digits (the exclusive-or of every
byte before that space), then CR LF: at most 80 bytes in all, printable ASCII only. A person may leave the checksum out.
Each message stands here with both halves of its grammar: `body` writes it, `PATTERN` and `read` take it back.

Knows messages and lines. Knows no port, no thread and no board. Seconds have three decimals and percentages one, on the
wire and so in what `parse_line` returns.
"""

from __future__ import annotations

import functools
import operator
import re
from dataclasses import dataclass
from typing import ClassVar, Protocol, Self

from dnb_edge.display.protocol_race import Car, CarLap, Count, Go, Grid, Live, Penalty, Place
from dnb_edge.display.protocol_words import (
    INT,
    SECONDS,
    TENTHS,
    TEXT,
    maybe_float,
    maybe_int,
    plain,
    seconds,
    tenths,
)
from dnb_edge.errors import InputError

VERSION = 1
BAUD = 115200
MAX_LINE_BYTES = 80
"""Longest line, checksum and CR LF included."""
MAX_BODY_CHARS = MAX_LINE_BYTES - len(" *00\r\n")


class Message(Protocol):
    """One message of the protocol."""

    PATTERN: ClassVar[re.Pattern[str]]
    """What a body of this kind looks like."""

    def body(self) -> str:
        """The line without checksum and line end."""
        ...

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match of `PATTERN`."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """First line of every repaint: who speaks, and in which version of the protocol."""

    PATTERN: ClassVar = re.compile(rf"HELLO DNB-EDGE {INT}")
    version: int = VERSION

    def body(self) -> str:
        """`HELLO DNB-EDGE 1`."""
        return f"HELLO DNB-EDGE {self.version}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(version=int(found[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Where the run stands."""

    PATTERN: ClassVar = re.compile(rf"STATE (?:(WAITING|OUT-LAP|FINISHED)|(LAP) {INT}(?: OF {INT})?)")
    word: str
    """WAITING, OUT-LAP, LAP or FINISHED."""
    lap: int | None = None
    """The running lap where `word` is LAP, else None."""
    laps_wanted: int | None = None

    def body(self) -> str:
        """`STATE WAITING`, `STATE LAP 2 OF 3`."""
        lap = "" if self.lap is None else f" {self.lap}"
        wanted = "" if self.laps_wanted is None else f" OF {self.laps_wanted}"
        return f"STATE {self.word}{lap}{wanted}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(word=found[1] or found[2], lap=maybe_int(found[3]), laps_wanted=maybe_int(found[4]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The running lap and its time so far; both None where no lap is running."""

    PATTERN: ClassVar = re.compile(rf"RUN (?:- -|{INT} {SECONDS})")
    lap: int | None = None
    elapsed_s: float | None = None

    def body(self) -> str:
        """`RUN 3 4.200`, `RUN - -`."""
        if self.lap is None or self.elapsed_s is None:
            return "RUN - -"
        return f"RUN {self.lap} {seconds(self.elapsed_s)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(lap=maybe_int(found[1]), elapsed_s=maybe_float(found[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cross:
    """The car has just crossed the start line. Told once, never repeated: flash on it."""

    PATTERN: ClassVar = re.compile(rf"CROSS {SECONDS}")
    t_s: float
    """Seconds from the run's first frame."""

    def body(self) -> str:
        """`CROSS 31.250`."""
        return f"CROSS {seconds(self.t_s)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(t_s=float(found[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Lap:
    """A complete lap."""

    PATTERN: ClassVar = re.compile(rf"LAP {INT} {SECONDS} \+-{SECONDS} (OK|BAD) {TENTHS}")
    lap: int
    time_s: float
    sigma_s: float
    valid: bool
    similarity_percent: float | None

    def body(self) -> str:
        """`LAP 2 12.483 +-0.002 OK 95.8`."""
        verdict = "OK" if self.valid else "BAD"
        similarity = tenths(self.similarity_percent)
        return f"LAP {self.lap} {seconds(self.time_s)} +-{seconds(self.sigma_s)} {verdict} {similarity}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(
            lap=int(found[1]),
            time_s=float(found[2]),
            sigma_s=float(found[3]),
            valid=found[4] == "OK",
            similarity_percent=maybe_float(found[5]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Why:
    """One reason why a lap is not valid."""

    PATTERN: ClassVar = re.compile(rf"WHY {INT} {TEXT}")
    lap: int
    text: str

    def body(self) -> str:
        """`WHY 3 off the lane for 0.8 s`."""
        return f"WHY {self.lap} {plain(self.text)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(lap=int(found[1]), text=found[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """Why a lap's numbers may be wrong though it is valid: the camera had moved."""

    PATTERN: ClassVar = re.compile(rf"SUSPECT {INT} {TEXT}")
    lap: int
    text: str

    def body(self) -> str:
        """`SUSPECT 3 the camera had moved by 12 mm since it was calibrated`."""
        return f"SUSPECT {self.lap} {plain(self.text)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(lap=int(found[1]), text=found[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Best:
    """The fastest valid lap."""

    PATTERN: ClassVar = re.compile(rf"BEST {INT} {SECONDS}")
    lap: int
    time_s: float

    def body(self) -> str:
        """`BEST 2 12.483`."""
        return f"BEST {self.lap} {seconds(self.time_s)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(lap=int(found[1]), time_s=float(found[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Saved:
    """How many laps of the race, of all cars, are safe on a disk."""

    PATTERN: ClassVar = re.compile(rf"SAVED {INT}")
    laps: int

    def body(self) -> str:
        """`SAVED 2`."""
        return f"SAVED {self.laps}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(laps=int(found[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """How the appliance is doing."""

    PATTERN: ClassVar = re.compile(rf"HEALTH FPS {TENTHS} REC (NONE|RECORDING|FAILED) WARNINGS {INT}")
    fps: float | None
    recording: str
    """NONE, RECORDING or FAILED."""
    warnings: int
    """How many WARN lines follow."""

    def body(self) -> str:
        """`HEALTH FPS 29.9 REC RECORDING WARNINGS 1`."""
        return f"HEALTH FPS {tenths(self.fps)} REC {self.recording} WARNINGS {self.warnings}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(fps=maybe_float(found[1]), recording=found[2], warnings=int(found[3]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Warn:
    """One warning, counted from 1."""

    PATTERN: ClassVar = re.compile(rf"WARN {INT} {TEXT}")
    number: int
    text: str

    def body(self) -> str:
        """`WARN 1 camera gap of 2.1 s`."""
        return f"WARN {self.number} {plain(self.text)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(number=int(found[1]), text=found[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A line for people at the box, such as the set-up code; it stands until a repaint without it."""

    PATTERN: ClassVar = re.compile(rf"NOTE {TEXT}")
    text: str

    def body(self) -> str:
        """`NOTE set-up code 4711 0815`."""
        return f"NOTE {plain(self.text)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(text=found[1])


MESSAGES: tuple[type[Message], ...] = (
    Hello,
    Car,
    State,
    Grid,
    Count,
    Go,
    Run,
    Cross,
    Lap,
    Penalty,
    Why,
    Suspect,
    Best,
    CarLap,
    Place,
    Live,
    Saved,
    Health,
    Warn,
    Note,
)
"""Every kind of message of this version."""


def encode_line(message: Message) -> bytes:
    """The line of `message` with checksum and CR LF; free text that is too long for the line is cut."""
    body = message.body()[:MAX_BODY_CHARS].rstrip().encode("ascii")
    return body + b" *%02X\r\n" % checksum(body)


def parse_line(line: bytes) -> Message:
    """The message of one `line`, CR LF and checksum optional; `InputError` says what is wrong with any other line."""
    if len(line) > MAX_LINE_BYTES:
        raise InputError(f"display line of {len(line)} bytes: at most {MAX_LINE_BYTES} are allowed")
    try:
        text = line.removesuffix(b"\n").removesuffix(b"\r").decode("ascii")
    except UnicodeDecodeError as error:
        raise InputError(f"display line {line!r}: not ASCII") from error
    if body_and_sum := re.fullmatch(r"(.*) \*([0-9A-F]{2})", text):
        text = body_and_sum[1]
        expected = checksum(text.encode("ascii"))
        if int(body_and_sum[2], 16) != expected:
            raise InputError(f"display line {line!r}: its checksum should be {expected:02X}")
    for kind in MESSAGES:
        if found := kind.PATTERN.fullmatch(text):
            return kind.read(found)
    raise InputError(f"display line {line!r}: no line of version {VERSION} of the protocol looks like this")


def checksum(body: bytes) -> int:
    """Exclusive-or of all bytes of `body`, 0..255."""
    return functools.reduce(operator.xor, body, 0)
