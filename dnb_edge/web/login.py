"""Logging in with the set-up code, and out again.

Knows the code, the sessions and their cookie; knows nothing of what they are good for.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from pydantic import BaseModel, ConfigDict, Field
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import API, Access, Endpoint, Refused
from dnb_edge.web.guard_rates import Buckets, Failures, Limits, counted_as
from dnb_edge.web.sessions import COOKIE, Sessions, SetupCode, keep_cookie, spaced

_log = logging.getLogger(__name__)

SHOWN_S = 120.0
"""How long the box's displays show the code."""
SHOWN_AGAIN_S = 10.0
"""Not before so many seconds, however often the page is opened."""
SHOWN_TO = ((3, 600.0),)
"""So often for one address in so many seconds: nobody is to cover the laps on a display from afar for long."""
LOGGED = (0.1, 60)
"""Lines a second in the log, and at once: nobody is to fill a disk from afar."""


class LoginBody(BaseModel):
    """The set-up code."""

    model_config = ConfigDict(extra="forbid", strict=True)

    code: str = Field(max_length=64, description="Eight digits; spaces and hyphens do not count.")


class LoginAnswer(BaseModel):
    """The session has begun: its cookie comes with this answer."""

    csrf: str = Field(description="Send it as X-CSRF-Token with whatever changes something.")


class LogoutAnswer(BaseModel):
    """The session is over."""

    done: bool


class Login:
    """The handlers."""

    def __init__(self, box: Box, sessions: Sessions, limits: Limits, clock_s: Callable[[], float]) -> None:
        self._box = box
        self._sessions = sessions
        self._clock_s = clock_s
        self._code = SetupCode()
        self._failures = Failures(limits.wrong_codes)
        self._all_failures = Failures(limits.wrong_codes_of_all)
        self._openings = Failures(SHOWN_TO)
        self._logged = Buckets(*LOGGED)
        self._shown: tuple[str, float] | None = None
        """The code that the displays show, and since when."""

    async def page(self, request: Request) -> Response:
        """GET /login: has the box show the code."""
        # Who has logged in needs no code.
        shown = getattr(request.state, "session", None) is not None or await self._show(counted_as(request.client))
        return self._box.pages.page(
            request, "login.html", next=safe_next(request.query_params.get("next")), shown=shown
        )

    async def login(self, request: Request) -> Response:
        """POST /api/v1/login."""
        address, now_s = counted_as(request.client), self._clock_s()
        waits_s = (self._failures.wait_s(address, now_s), self._all_failures.wait_s("", now_s))
        wait_s = max((one for one in waits_s if one is not None), default=None)
        if wait_s is not None:
            # Not even the right one is looked at: it could be a guess.
            raise Refused(429, "too-many", f"Too many wrong codes: wait {_waiting(wait_s)}.", retry_after_s=wait_s)
        if not self._code.accepts(request.state.body.code, now_s):
            self._failures.failed(address, now_s)
            self._all_failures.failed("", now_s)
            _log.warning("wrong set-up code from %s", address)
            raise Refused(
                401, "wrong-code", "This is not the code. Look at the box's display or its log: eight digits."
            )
        session, cookie = self._sessions.begin(now_s)
        _log.info("logged in from %s", address)
        answer = JSONResponse(LoginAnswer(csrf=session.csrf).model_dump())
        keep_cookie(answer, request, cookie)
        return answer

    async def logout(self, request: Request) -> Response:
        """POST /api/v1/logout."""
        self._sessions.end(request.state.session)
        answer = JSONResponse(LogoutAnswer(done=True).model_dump())
        answer.delete_cookie(COOKIE, httponly=True, samesite="strict", secure=request.url.scheme == "https")
        return answer

    async def _show(self, address: str) -> bool:
        """Has the displays and the log say the code; True where the displays do."""
        now_s = self._clock_s()
        code = self._code.now(now_s)
        if self._logged.take("", now_s) is None:
            _log.warning("set-up code %s (asked for by %s)", spaced(code), address)
        age_s = now_s - self._shown[1] if self._shown is not None and self._shown[0] == code else SHOWN_S
        if age_s < SHOWN_AGAIN_S:
            return True
        if self._openings.wait_s(address, now_s) is not None:
            return age_s < SHOWN_S
        self._openings.failed(address, now_s)
        try:
            await self._box.daemon.ask(show=f"set-up code {spaced(code)}", for_s=SHOWN_S)
        except Refused:
            # It covered no display: whoever tries while the box starts up is not to wait for the code afterwards.
            self._openings.forgiven(address)
            return False
        self._shown = (code, now_s)
        return True


def endpoints(box: Box, sessions: Sessions, *, limits: Limits, clock_s: Callable[[], float]) -> tuple[Endpoint, ...]:
    """The login page and what it sends."""
    login = Login(box, sessions, limits, clock_s)
    return (
        Endpoint(method="GET", path="/login", access=Access.ALL, handler=login.page, summary="The page to log in"),
        Endpoint(
            method="POST",
            path=f"{API}/login",
            access=Access.ALL,
            handler=login.login,
            summary="Begin a session with the set-up code that the box shows",
            body=LoginBody,
            answer=LoginAnswer,
        ),
        Endpoint(
            method="POST",
            path=f"{API}/logout",
            access=Access.CHANGE,
            handler=login.logout,
            summary="End the session",
            answer=LogoutAnswer,
        ),
    )


def safe_next(address: str | None) -> str:
    """Where to go after logging in: a page of this box and of nobody else."""
    plain = address is not None and address.startswith("/") and not address.startswith(("//", "/\\", "/login"))
    return address if plain and address is not None and address.isprintable() else "/"


def _waiting(wait_s: float) -> str:
    return f"{wait_s:.0f} s" if wait_s < 120 else f"{wait_s / 60:.0f} minutes"
