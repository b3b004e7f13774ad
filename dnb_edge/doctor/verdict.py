"""What a check says: right, worth a look, wrong, or not to be told; and for whatever is amiss, what to type.

Knows words only; no check and no machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Status(StrEnum):
    """How a check ended."""

    OK = "ok"
    WARN = "warn"
    """A race can be run, and will be worse for it."""
    FAIL = "fail"
    """A race cannot be run, or its numbers cannot be trusted."""
    SKIP = "skip"
    """The check could not be made here; `Verdict.found` says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The end of one check."""

    status: Status
    found: str
    """What was found, in one line."""
    fix: str | None = None
    """One sentence on what to do, with the command to type; for what is amiss and nothing else."""

    def __post_init__(self) -> None:
        """Raises `ValueError` where a fault comes without its fix, or a fix without its fault."""
        if (self.status in (Status.WARN, Status.FAIL)) != (self.fix is not None):
            raise ValueError(
                f"a verdict of {self.status} {'needs a fix' if self.fix is None else 'has no fix'}: {self.found}"
            )


class CannotTell(Exception):
    """The facts of a check cannot be had here; the text says why. Raised by gatherers, and told as `Status.SKIP`."""


def ok(found: str) -> Verdict:
    """All is well."""
    return Verdict(status=Status.OK, found=found)


def warn(found: str, fix: str) -> Verdict:
    """A race can be run, and will be worse for it."""
    return Verdict(status=Status.WARN, found=found, fix=fix)


def fail(found: str, fix: str) -> Verdict:
    """A race cannot be run, or its numbers cannot be trusted."""
    return Verdict(status=Status.FAIL, found=found, fix=fix)


def skip(why: str) -> Verdict:
    """The check could not be made."""
    return Verdict(status=Status.SKIP, found=why)
