"""One thing that a browser or a script may ask for: its address, who may, what it takes and gives.

All endpoints stand in tables made of these, so that the app's routes, the guard before each, the OpenAPI document and the
authorisation test come from the same lines. Knows Starlette's requests and responses; knows nothing of what is asked for.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from pydantic import BaseModel
from starlette.requests import Request
from starlette.responses import Response

API = "/api/v1"
Method = Literal["GET", "POST", "PUT", "PATCH", "DELETE"]
Handler = Callable[[Request], Awaitable[Response]]

SMALL_BODY_BYTES = 64 * 1024


class Access(Enum):
    """Who may."""

    ALL = "all"
    """Everybody who reaches the box: watching."""
    CHANGE = "change"
    """Who has shown the set-up code, with the session's token where it changes something."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """One method of one address."""

    method: Method
    path: str
    """As Starlette has it, such as /api/v1/runs/{run_id}."""
    access: Access
    handler: Handler
    summary: str
    """What it does, in a line, for the OpenAPI document."""
    query: type[BaseModel] | None = None
    """What may stand behind the question mark; the guard checks it and leaves it in `request.state.query`. None: nothing is
    looked at."""
    body: type[BaseModel] | None = None
    """What a JSON body must be; the guard checks it and leaves it in `request.state.body`. None where it takes none, or
    bytes."""
    body_types: tuple[str, ...] = ()
    """Media types of a body that is bytes, such as image/png."""
    answer: type[BaseModel] | None = None
    """The JSON it answers with; None for anything else."""
    answer_types: tuple[str, ...] = ("text/html",)
    """Media types of an answer that is not `answer`."""
    most_body_bytes: int = SMALL_BODY_BYTES

    @property
    def in_api(self) -> bool:
        """Whether it belongs to the API, and so into the OpenAPI document."""
        return self.path.startswith(API)


class Refused(Exception):
    """What was asked for is not to be had; becomes the answer `{"error": {"code", "text"}}`, or a page that says so."""

    def __init__(self, status: int, code: str, text: str, *, retry_after_s: float | None = None) -> None:
        """`status`: the HTTP status. `code`: for programs, such as not-found. `text`: for people, one line with what to do."""
        super().__init__(text)
        self.status = status
        self.code = code
        self.text = text
        self.retry_after_s = retry_after_s
