"""The board's three pages: for phones and desks, for a projector, over a stream. All that they show comes by the live stream.

Knows templates' names; knows nothing of a race.
"""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import Access, Endpoint, Handler

PAGES = (
    ("/", "board.html", "The board"),
    ("/projector", "projector.html", "The board for a projector"),
    ("/overlay", "overlay.html", "The board over a stream: transparent; ?corner=, ?scale= and ?map=off"),
)


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The pages; everybody may watch."""
    return tuple(
        Endpoint(method="GET", path=path, access=Access.ALL, handler=_page(box, template), summary=summary)
        for path, template, summary in PAGES
    )


def _page(box: Box, template: str) -> Handler:
    async def page(request: Request) -> Response:
        return box.pages.page(request, template)

    return page
