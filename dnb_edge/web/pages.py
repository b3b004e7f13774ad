"""The templates, and what each of them knows.

Knows Jinja2 and sessions; knows no page's content.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from dnb_edge import __version__
from dnb_edge.web.sessions import COOKIE, Session, keep_cookie
from dnb_edge.web.static_files import StaticFiles

FOLDER = Path(__file__).parent / "templates"


class TemplatePages:
    """Implements `box.Pages`. Whatever a template is given is escaped, and a name that it is not given is an error."""

    def __init__(self, files: StaticFiles) -> None:
        self._jinja = Environment(
            loader=FileSystemLoader(FOLDER),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        self._jinja.globals.update(static=files.address, version=__version__)

    def page(self, request: Request, name: str, *, status: int = 200, **values: Any) -> Response:
        """The page of template `name`, which also knows `csrf`, `may_change`, `path`, `version` and `static("file.css")`."""
        session: Session | None = getattr(request.state, "session", None)
        known = {"csrf": session.csrf if session else None, "may_change": session is not None, "path": request.url.path}
        text = self._jinja.get_template(name).render(known | values)
        # A file's name may be no UTF-8.
        answer = HTMLResponse(text.encode(errors="replace"), status)
        cookie = request.cookies.get(COOKIE)
        if session is not None and cookie is not None:
            # Who goes on using it stays logged in: the browser would forget it some hours after the log-in.
            keep_cookie(answer, request, cookie)
        return answer
