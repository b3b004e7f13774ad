"""Who may change something: the set-up code that the box shows, and the sessions of those who have typed it.

Knows codes, sessions, their cookie and instants; knows no page. All of it is in memory: a restart logs everybody out.
"""

from __future__ import annotations

import hashlib
import secrets
from collections import OrderedDict
from dataclasses import dataclass

from starlette.requests import Request
from starlette.responses import Response

COOKIE = "dnb-edge-session"
IDLE_S = 12 * 3600.0
"""A session that nobody used for so long is over; a code is as old at most."""
MOST_SESSIONS = 256
CODE_DIGITS = 8
CODE_USES = 20
"""Log-ins that one code is good for."""
MOST_WRONG = 100
"""Wrong guesses, of all addresses together, after which there is another code: 1 in a million of being hit by then. How fast
anybody may guess `guard_rates` says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """A browser whose user has typed the code."""

    key: bytes
    """SHA-256 of the cookie's text, which is kept nowhere."""
    csrf: str
    """Token that every change must carry."""


def keep_cookie(answer: Response, request: Request, text: str) -> None:
    """Has the browser keep the session's cookie as long from now as an unused session lasts."""
    secure = request.url.scheme == "https"
    answer.set_cookie(COOKIE, text, max_age=int(IDLE_S), httponly=True, samesite="strict", secure=secure)


class Sessions:
    """The sessions that are on."""

    def __init__(self) -> None:
        self._used: OrderedDict[bytes, tuple[Session, float]] = OrderedDict()

    def begin(self, now_s: float) -> tuple[Session, str]:
        """A new session, and its cookie's text."""
        cookie = secrets.token_urlsafe(32)
        session = Session(key=_key(cookie), csrf=secrets.token_urlsafe(32))
        self._used[session.key] = (session, now_s)
        if len(self._used) > MOST_SESSIONS:
            self._used.popitem(last=False)
        return session, cookie

    def find(self, cookie: str | None, now_s: float) -> Session | None:
        """The session of the cookie's text, which is used at `now_s`; None where there is none."""
        if not cookie:
            return None
        session, used_s = self._used.pop(_key(cookie), (None, 0.0))
        if session is None or now_s - used_s > IDLE_S:
            return None
        self._used[session.key] = (session, now_s)
        return session

    def end(self, session: Session) -> None:
        """`session` is over."""
        self._used.pop(session.key, None)


class SetupCode:
    """The code that the box shows; another one after so many uses, hours or wrong guesses."""

    def __init__(self) -> None:
        self._code: str | None = None
        self._since_s = 0.0
        self._uses = 0
        self._wrong = 0

    def now(self, now_s: float) -> str:
        """The code that is good at `now_s`: eight digits."""
        stale = now_s - self._since_s > IDLE_S or self._uses >= CODE_USES or self._wrong >= MOST_WRONG
        if self._code is None or stale:
            self._code = "".join(secrets.choice("0123456789") for _ in range(CODE_DIGITS))
            self._since_s, self._uses, self._wrong = now_s, 0, 0
        return self._code

    def accepts(self, typed: str, now_s: float) -> bool:
        """Whether `typed` is the code; spaces and hyphens in it do not count. The time it takes does not tell."""
        plain = "".join(letter for letter in typed if letter not in " -")
        right = secrets.compare_digest(plain.encode(), self.now(now_s).encode())
        self._uses += right
        self._wrong += not right
        return right


def spaced(code: str) -> str:
    """The code as people read it: 1234 5678."""
    return f"{code[:4]} {code[4:]}"


def _key(cookie: str) -> bytes:
    return hashlib.sha256(cookie.encode()).digest()
