"""What is answered where something is refused or goes wrong: JSON in the API, a page elsewhere, never a stack trace.

Knows errors and answers; knows no endpoint.
"""

from __future__ import annotations

import logging
import math
from http import HTTPStatus

from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from dnb_edge.errors import InputError, TemporaryFault, WorkError
from dnb_edge.web.box import Pages
from dnb_edge.web.endpoint import Refused

_log = logging.getLogger(__name__)

_ENDS_CONNECTION = frozenset({408, 413, 421})
"""The rest of what is being sent is not wanted."""


class ErrorBody(BaseModel):
    """What went wrong."""

    code: str
    """For programs, such as not-found."""
    text: str
    """For people: one line with what to do."""


class ErrorAnswer(BaseModel):
    """The answer to whatever fails."""

    error: ErrorBody


def as_refused(error: Exception) -> Refused:
    """`error`, whatever it is, in the words of the API."""
    match error:
        case Refused():
            return error
        case HTTPException(status_code=404):
            return Refused(404, "not-found", "There is nothing under this address.")
        case HTTPException(status_code=405):
            return Refused(405, "wrong-method", "This address has no such method.")
        case HTTPException():
            return Refused(error.status_code, "refused", HTTPStatus(error.status_code).phrase)
        case ClientDisconnect():
            return Refused(400, "gone", "The connection was closed before the body had come.")
        case InputError():
            return Refused(422, "input", str(error))
        case TemporaryFault():
            return Refused(503, "away", str(error), retry_after_s=1.0)
        case WorkError():
            return Refused(500, "failed", str(error))
        case _:
            return Refused(500, "internal", "Something went wrong inside: the log has the details.")


class Answers:
    """Makes answers of errors."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages

    async def answer(self, request: Request, error: Exception) -> Response:
        """As Starlette calls it for an exception."""
        refused = as_refused(error)
        if isinstance(error, WorkError):
            _log.warning("%s %s: %s", request.method, request.url.path, error)
        response = self._of(request, refused)
        if isinstance(error, HTTPException) and error.headers:
            response.headers.update(error.headers)
        if refused.retry_after_s is not None:
            response.headers["Retry-After"] = str(math.ceil(refused.retry_after_s))
        if refused.status in _ENDS_CONNECTION:
            response.headers["Connection"] = "close"
        return response

    def _of(self, request: Request, refused: Refused) -> Response:
        if request.url.path.startswith("/api"):
            body = ErrorAnswer(error=ErrorBody(code=refused.code, text=refused.text.encode(errors="replace").decode()))
            return JSONResponse(body.model_dump(), refused.status)
        return self._pages.page(
            request, "error.html", status=refused.status, refused=refused, phrase=HTTPStatus(refused.status).phrase
        )
