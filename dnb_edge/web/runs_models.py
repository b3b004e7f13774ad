"""What the recordings' part of the API takes and gives, as JSON.

Knows shapes and limits only.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, RootModel, model_validator

from dnb_edge.archive.label import MOST_LETTERS, whole_text


class Model(BaseModel):
    """All of them."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @model_validator(mode="before")
    @classmethod
    def _sendable(cls, data: Any) -> Any:
        """One file with an odd name, or of an odd maker, is not to keep all others out of the list."""
        return _whole(data)


def _whole(data: Any) -> Any:
    match data:
        case str():
            return whole_text(data)
        case dict():
            return {_whole(key): _whole(value) for key, value in data.items()}
        case list():
            return [_whole(one) for one in data]
        case _:
            return data


class RunFile(Model):
    """One file of a run."""

    name: str
    """As a download is called."""
    part: int
    """From 1; for `recording.mcap?part=N`."""
    size_bytes: int
    state: Literal["recording", "finished", "cut", "damaged"]


class RunLine(Model):
    """A run in the list."""

    id: str
    file: str
    """Name of its last file: what `DELETE` wants to hear."""
    files: list[RunFile]
    """Oldest first; several where one goes on from another."""
    name: str | None
    """What people call it."""
    entry: str | None
    """Who drives; null where the file cannot be read."""
    entry_version: str | None
    session: str | None
    session_id: str | None
    source: str | None
    state: Literal["recording", "finished", "cut", "damaged"]
    """`cut`: cut short, and not finished yet."""
    started: str | None
    """When it began, UTC by the box's clock then; null for a source without one."""
    written: str
    """When its last file was last written to, UTC."""
    duration_s: float | None
    laps: int | None
    """As the race counted them."""
    best_lap_s: float | None
    """Of the valid laps, with penalties, after a judge's edits."""
    size_bytes: int
    pictures_bytes: int
    """Of the pictures beside it."""
    pinned: bool
    pinnable: bool
    """False where it is never deleted by itself anyway, since somebody renamed its file."""
    edited: bool
    """A judge has decided something about it."""
    current: bool
    """It is being recorded, or goes on: not to be deleted."""
    notes: list[str]
    """What is the matter with it."""


class Choice(Model):
    """Something to filter by."""

    id: str | None = None
    name: str
    runs: int


class RunList(Model):
    """A page of the list, the latest first."""

    runs: list[RunLine]
    total: int
    """Of all that the filter lets through."""
    offset: int
    limit: int
    sessions: list[Choice]
    entries: list[Choice]


class LapLine(Model):
    """A lap as it counts."""

    number: int
    car: int
    start_s: float
    time_s: float
    sigma_s: float
    official_time_s: float | None
    """With penalties."""
    penalty_s: float
    valid: bool
    reasons: list[str]
    suspect: list[str]
    similarity_percent: float | None
    observed_fraction: float
    estimated: bool
    sectors_s: list[float | None]
    removed: bool
    """A judge took it away."""
    edits: list[str]
    """A judge's decisions about it."""


class LapList(Model):
    """The laps of a run, those that a judge took away last."""

    id: str
    laps: list[LapLine]


class RunDetail(RunLine):
    """A run by itself."""

    identity: dict[str, str]
    """Digests of track, calibration and rules, as the recording says them."""
    versions: dict[str, str]
    """Software that took part."""


class RunChange(Model):
    """What of a run can be changed; what is left out stays."""

    name: Annotated[str, Field(max_length=MOST_LETTERS)] | None = None
    """Blank for none. The file's name stays."""
    pinned: bool | None = None
    """Whether it is kept however short room gets."""


class Confirm(Model):
    """That it is meant."""

    confirm: Annotated[str, Field(max_length=255)]
    """The run's `file`."""


class Deleted(Model):
    """What went."""

    id: str
    files: list[str]
    size_bytes: int


class Working(Model):
    """It is being made: ask again."""

    text: str
    share: float | None
    """How much of it is done, 0..1, where that is known."""
    retry_after_s: float


class EntryTable(Model):
    """The table of entries."""

    rows: list[dict[str, Any]]
    """As `dnb-edge table --json` has them."""
    notes: list[str]
    warnings: list[str]


class LapAnswer(RootModel[LapList | Working]):
    """The laps; while a judge's own are being scored, with status 202, how far that is."""


class TableAnswer(RootModel[EntryTable | Working]):
    """The table; while it is being made, with status 202, how far it is."""


class NextGone(Model):
    """What would be deleted first if room got short."""

    file: str
    id: str | None
    pictures_only: bool
    size_bytes: int


class Disk(Model):
    """The room for recordings, bytes."""

    total_bytes: int
    free_bytes: int
    kept_free_bytes: int
    """Below it pictures are no longer recorded."""
    recordings_bytes: int
    pictures_bytes: int
    """Of the pictures beside the recordings; not in `recordings_bytes`."""
    most_recordings_bytes: int | None
    """Most that both may take together; null for no limit."""
    delete_oldest: bool
    """Whether old recordings go by themselves while a camera races."""
    short: str | None
    """Why something goes now; null where there is room."""
    next: NextGone | None
