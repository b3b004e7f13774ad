"""What may stand behind the question mark where recordings are asked for.

Knows shapes and limits only.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field
from starlette.requests import Request

MOST_RUNS = 200
"""In one page of the list, and in one table."""
MOST_NAMED = 70
"""In one address, which has its own limit."""
MOST_OFFSET = 1_000_000
MOST_PARTS = 1000
_ID_PATTERN = r"[0-9a-f]{24}"

Words = Annotated[str, Field(max_length=200)]
Format = Literal["json", "csv", "latex"]


class Asked(BaseModel):
    """All of them."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class ListAsked(Asked):
    """Which recordings."""

    text: Words = ""
    """Words that all stand in a name, an entry, a session, a file's name or a source."""
    session: Words = ""
    """A session's id."""
    entry: Words = ""
    state: Literal["", "recording", "finished", "cut", "damaged"] = ""
    pinned: bool | None = None
    offset: Annotated[int, Field(ge=0, le=MOST_OFFSET)] = 0
    limit: Annotated[int, Field(ge=1, le=MOST_RUNS)] = 50


class LapsAsked(Asked):
    """In which form, and of what."""

    format: Format = "json"
    what: Literal["laps", "passes", "incidents"] = "laps"
    """Passes and incidents are to be had as CSV."""


class TableAsked(Asked):
    """Over which runs, and how."""

    runs: Annotated[str, Field(pattern=rf"^{_ID_PATTERN}(,{_ID_PATTERN}){{0,{MOST_NAMED - 1}}}$")] | None = None
    """Their ids with commas between them. Either this or `session`."""
    session: Annotated[str, Field(pattern=rf"^{_ID_PATTERN}$")] | None = None
    """All finished runs of the session with this id."""
    format: Format = "json"
    by: Literal["entry", "run"] = "entry"
    """One row for each."""


class FileAsked(Asked):
    """Which file of a run."""

    part: Annotated[int, Field(ge=1, le=MOST_PARTS)] | None = None
    """From 1, the oldest; the last one where it is not said."""


class ZipAsked(Asked):
    """What goes into a zip."""

    pictures: bool = False
    """With the pictures that lie beside the recordings."""


def wants_page(request: Request) -> bool:
    """Whether a browser asks, which shows what it gets."""
    return "text/html" in request.headers.get("accept", "")
