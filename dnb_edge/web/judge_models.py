"""What the judge's part of the API takes and gives, as JSON.

Knows shapes and limits only; whether a decision makes sense for its run is found out there.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, RootModel

from dnb_edge.race.edit import Edit
from dnb_edge.values import Crossing, Incident, IncidentKind, Lap, Standings

MOST_AUTHOR = 80
MOST_REASON = 500
MOST_NUMBER = 10**9


def _one_line(text: str) -> str:
    if not text.strip():
        raise ValueError("is blank")
    if not text.isprintable():
        raise ValueError("must be one line of plain text")
    return text.strip()


Author = Annotated[str, Field(max_length=MOST_AUTHOR), AfterValidator(_one_line)]
Reason = Annotated[str, Field(max_length=MOST_REASON), AfterValidator(_one_line)]
Number = Annotated[int, Field(ge=1, le=MOST_NUMBER)]
Moment = Annotated[float, Field(ge=0)] | Annotated[str, Field(pattern=r"^pass:[1-9][0-9]{0,8}$")]
"""Seconds from the first frame, or `pass:N` with the number that the list of passes gives."""


class Wish(BaseModel):
    """What every decision says."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    author: Author
    """Who decides."""
    reason: Reason
    """Why, for those who read the results."""
    seen: Annotated[int, Field(ge=0, le=MOST_NUMBER)] | None = None
    """How many edits there were when the judge looked; where it is another number now, 409. None: whatever is."""
    dry_run: bool = False
    """True to answer what would be, and save nothing."""


class LapWish(Wish):
    """A decision about a lap."""

    lap: Number
    car: Number = 1


class AddWish(Wish):
    """A lap that the race missed."""

    action: Literal["add"]
    start: Moment
    end: Moment
    car: Number = 1


class RemoveWish(LapWish):
    """A lap that was none."""

    action: Literal["remove"]


class MergeWish(LapWish):
    """The lap and the car's next were one."""

    action: Literal["merge"]


class PenaltyWish(LapWish):
    """A penalty; it must cost something."""

    action: Literal["penalty"]
    seconds: float = 0.0
    """Added to the lap's time."""
    factor: float = 1.0
    """By which the score is multiplied, 0..1."""
    invalid: bool = False
    """True where the lap does not count."""
    dnf: bool = False
    """True where the car's race ends with this lap."""


class ForgiveWish(LapWish):
    """Takes away what the rules gave the lap."""

    action: Literal["forgive"]
    offence: IncidentKind | None = None
    """Only what was given for this; None for all of it."""


class NoteWish(Wish):
    """A note; its text is the reason."""

    action: Literal["note"]
    lap: Number | None = None
    """None for the whole run."""
    car: Number = 1


class UndoWish(Wish):
    """Takes an edit back."""

    action: Literal["undo"]
    edit: Number


AnyWish = AddWish | RemoveWish | MergeWish | PenaltyWish | ForgiveWish | NoteWish | UndoWish


class JudgeWish(RootModel[Annotated[AnyWish, Field(discriminator="action")]]):
    """One decision of a judge."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)


class _Answer(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class JudgedLap(_Answer):
    """A lap as it counts now, or was removed."""

    lap: Lap
    counts: bool
    """False where a judge removed it."""
    edits: tuple[int, ...]
    """Numbers of the edits about it."""
    raw: tuple[Lap, ...]
    """The race's own laps in it: two or more where they were merged, none where a judge added it."""


class JudgedEdit(_Answer):
    """One decision so far."""

    edit: Edit
    subject: str
    """What it is about, such as `lap 3`."""
    undone: bool
    without_effect: str | None
    """Why it changes nothing any more; None where it does."""


class JudgedIncident(_Answer):
    """An incident, and where its picture is."""

    incident: Incident
    picture: str
    """Address of a JPEG; 404 where no picture was kept near it."""


class Judged(_Answer):
    """A run as a judge finds it."""

    run: str
    """Its id."""
    name: str
    """Who or what drives."""
    unfinished: bool
    """True while it is recorded: what is there can be looked at and tried, and decided when it is finished."""
    lasts_s: float
    """From the first frame to the last."""
    edits_so_far: int
    """Send it back as `seen`."""
    laps: tuple[JudgedLap, ...]
    edits: tuple[JudgedEdit, ...]
    incidents: tuple[JudgedIncident, ...]
    standings: Standings | None
    warnings: tuple[str, ...]


class JudgedPass(_Answer):
    """A crossing of a line."""

    number: int
    """From 1, in the order of time: what `pass:N` means."""
    crossing: Crossing
    picture: str
    """Address of a JPEG; 404 where no picture was kept near it."""


class Passes(_Answer):
    """All crossings of lines of a run."""

    run: str
    passes: tuple[JudgedPass, ...]


class LapChange(_Answer):
    """What a decision does to one lap; None where there is none."""

    car: int
    number: int
    before: JudgedLap | None
    after: JudgedLap | None


class Totals(_Answer):
    """A run in three figures."""

    laps: int
    valid: int
    best_s: float | None
    """The best official time of a valid lap."""


class BeforeAfter(_Answer):
    """One side of a comparison."""

    totals: Totals
    standings: Standings | None


class Decided(_Answer):
    """What a decision does."""

    saved: bool
    """False for a dry run."""
    edit: Edit
    """As it is, or would be, in the file of edits."""
    subject: str
    edits_so_far: int
    changes: tuple[LapChange, ...]
    before: BeforeAfter
    after: BeforeAfter
    warnings: tuple[str, ...]
