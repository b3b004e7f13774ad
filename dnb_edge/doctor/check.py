"""One check: its name, what it looks at, the gatherer of its facts and the rule that judges them.

Knows how both halves are joined and what becomes of their faults: no check ever keeps another one from being made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

from dnb_edge.doctor.box import Box
from dnb_edge.doctor.verdict import CannotTell, Verdict, skip
from dnb_edge.errors import DnbEdgeError

F = TypeVar("F")


class Group(StrEnum):
    """What a check is about; in the order in which they are told."""

    SETUP = "Set-up"
    CAMERA = "Camera"
    PICTURE = "Picture"
    DETECTOR = "Detector"
    DISK = "Disk"
    MACHINE = "Machine"
    DISPLAY = "Display"
    SERVICE = "Service"


@dataclass(frozen=True, slots=True, kw_only=True)
class Check(Generic[F]):
    """A check; `F` is the type of its facts."""

    name: str
    """As `--only` has it."""
    group: Group
    looks_at: str
    """What it looks at, for people who read the list."""
    amiss: str
    """When it warns or fails, and for which figures."""
    remedy: str
    """What to do then, in general; the verdict itself names files and commands."""
    gather: Callable[[Box], F]
    judge: Callable[[F], Verdict]

    def make(self, box: Box) -> Verdict:
        """The verdict on `box`. Why facts cannot be had is told in it."""
        try:
            return self.judge(self.gather(box))
        except (CannotTell, DnbEdgeError) as reason:
            return skip(str(reason))
        except PermissionError as error:
            return skip(f"{error.filename}: you may not look there: run this with sudo")
        except OSError as error:
            return skip(f"{error.filename}: {error.strerror}" if error.filename else str(error))
        except Exception as error:  # noqa: BLE001 told in its own line: the other checks are worth having all the same
            return skip(f"this check itself failed, please report it: {type(error).__name__}: {error}")
