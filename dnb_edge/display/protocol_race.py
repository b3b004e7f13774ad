"""The line protocol's messages about starts, penalties, the running lap and several cars; see `dnb_edge.display.protocol`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar, Self

from dnb_edge.display.protocol_words import INT, NUMBER, SECONDS, TENTHS, TEXT, maybe_float, plain, seconds, tenths


@dataclass(frozen=True, slots=True, kw_only=True)
class Penalty:
    """Seconds added to a lap; its `LAP` line has the time without them."""

    PATTERN: ClassVar = re.compile(rf"PENALTY {INT} {SECONDS} {TEXT}")
    lap: int
    seconds: float
    text: str

    def body(self) -> str:
        """`PENALTY 3 2.000 the car left the lane for 0.8 s`."""
        return f"PENALTY {self.lap} {seconds(self.seconds)} {plain(self.text)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(lap=int(found[1]), seconds=float(found[2]), text=found[3])


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What is awaited before the countdown."""

    PATTERN: ClassVar = re.compile(rf"GRID {TEXT}")
    text: str

    def body(self) -> str:
        """`GRID waiting for 2 cars to stand on the grid`."""
        return f"GRID {plain(self.text)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(text=found[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """A countdown runs."""

    PATTERN: ClassVar = re.compile(rf"COUNT {TENTHS}")
    left_s: float | None
    """Seconds to the start; None where nobody may know."""

    def body(self) -> str:
        """`COUNT 3.0`, `COUNT -`."""
        return f"COUNT {tenths(self.left_s)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(left_s=maybe_float(found[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Go:
    """The race is on: show green on the first of these after `COUNT`."""

    PATTERN: ClassVar = re.compile(rf"GO {TENTHS}")
    remaining_s: float | None
    """Seconds of racing left when it was told; None where there is no limit."""

    def body(self) -> str:
        """`GO 300.0`, `GO -`."""
        return f"GO {tenths(self.remaining_s)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(remaining_s=maybe_float(found[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """The running lap against the best one at the same place, and its path similarity so far."""

    PATTERN: ClassVar = re.compile(rf"LIVE ([+-]{NUMBER}|-) {TENTHS}")
    delta_s: float | None
    """Behind (positive) or ahead of the best lap; None before there is one."""
    similarity_percent: float | None

    def body(self) -> str:
        """`LIVE +0.214 95.8`, `LIVE - -`."""
        sign = "-" if self.delta_s is not None and self.delta_s < 0 else "+"
        delta = "-" if self.delta_s is None else f"{sign}{seconds(abs(self.delta_s))}"
        return f"LIVE {delta} {tenths(self.similarity_percent)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(delta_s=maybe_float(found[1]), similarity_percent=maybe_float(found[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """With several cars: which one the lines from `STATE` to `LIVE` are about."""

    PATTERN: ClassVar = re.compile(rf"CAR {INT} {TEXT}")
    car: int
    name: str

    def body(self) -> str:
        """`CAR 2 Anna`."""
        return f"CAR {self.car} {plain(self.name)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(car=int(found[1]), name=found[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class CarLap:
    """With several cars: a complete lap of another one than `CAR`, penalties included."""

    PATTERN: ClassVar = re.compile(rf"CARLAP {INT} {INT} {SECONDS} (OK|BAD)")
    car: int
    lap: int
    time_s: float
    valid: bool

    def body(self) -> str:
        """`CARLAP 2 4 12.904 OK`."""
        return f"CARLAP {self.car} {self.lap} {seconds(self.time_s)} {'OK' if self.valid else 'BAD'}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(car=int(found[1]), lap=int(found[2]), time_s=float(found[3]), valid=found[4] == "OK")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """With several cars: one line of the standings."""

    PATTERN: ClassVar = re.compile(rf"PLACE {INT}(=?) {INT} {INT} ({NUMBER}|-) ({NUMBER}|-) (IN|OUT) {TEXT}")
    place: int
    tied: bool
    """True where it cannot be told who of two neighbours is better."""
    car: int
    laps: int
    value: float | None
    """What is ranked by: seconds, or whatever the rules say."""
    gap: float | None
    """Behind the first, likewise."""
    out: bool
    """True where the car's race is over without a result."""
    name: str

    def body(self) -> str:
        """`PLACE 1= 2 5 12.483 - IN Anna`."""
        value, gap = ("-" if one is None else seconds(one) for one in (self.value, self.gap))
        place = f"{self.place}{'=' if self.tied else ''}"
        return f"PLACE {place} {self.car} {self.laps} {value} {gap} {'OUT' if self.out else 'IN'} {plain(self.name)}"

    @classmethod
    def read(cls, found: re.Match[str]) -> Self:
        """The message of a match."""
        return cls(
            place=int(found[1]),
            tied=found[2] == "=",
            car=int(found[3]),
            laps=int(found[4]),
            value=maybe_float(found[5]),
            gap=maybe_float(found[6]),
            out=found[7] == "OUT",
            name=found[8],
        )
