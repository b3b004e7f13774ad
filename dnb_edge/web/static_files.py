"""The files that pages are made of, under addresses that change with their content.

Knows the folder `static`; knows no page.
"""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from dnb_edge.web.endpoint import Access, Endpoint, Refused

FOLDER = Path(__file__).parent / "static"
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".woff2": "font/woff2",
    ".mp3": "audio/mpeg",
    ".wav": "audio/wav",
    ".json": "application/json",
    ".webmanifest": "application/manifest+json",
}
_TEXT = frozenset({".css", ".js", ".svg", ".json", ".webmanifest"})


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticFile:
    """One file as it is now."""

    content: bytes
    gzipped: bytes | None
    digest: str
    modified_ns: int


class StaticFiles:
    """The folder's files, each read again when it has changed."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self._folder = folder
        self._read: dict[str, StaticFile] = {}

    def file(self, name: str) -> StaticFile | None:
        """The file of that name; None where the folder has none. Nothing but the folder's own names is looked for."""
        path = next((path for path in self._folder.iterdir() if path.name == name and path.suffix in TYPES), None)
        if path is None or not path.is_file():
            return None
        modified_ns = path.stat().st_mtime_ns
        known = self._read.get(name)
        if known is None or known.modified_ns != modified_ns:
            content = path.read_bytes()
            packed = gzip.compress(content, 6, mtime=0) if path.suffix in _TEXT else None
            digest = hashlib.sha256(content).hexdigest()[:12]
            known = StaticFile(content=content, gzipped=packed, digest=digest, modified_ns=modified_ns)
            self._read[name] = known
        return known

    def address(self, name: str) -> str:
        """The file's address, for a template."""
        found = self.file(name)
        return f"/static/{name}" if found is None else f"/static/{name}?v={found.digest}"

    async def serve(self, request: Request) -> Response:
        """GET /static/{name}."""
        name = request.path_params["name"]
        found = await run_in_threadpool(self.file, name)
        if found is None:
            raise Refused(404, "not-found", "There is nothing under this address.")
        fixed = request.query_params.get("v") == found.digest
        headers = {
            "ETag": f'"{found.digest}"',
            "Cache-Control": "public, max-age=31536000, immutable" if fixed else "no-cache",
            "Vary": "Accept-Encoding",
            "Content-Type": TYPES[Path(name).suffix],
        }
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        if found.gzipped is not None and "gzip" in request.headers.get("accept-encoding", ""):
            return Response(found.gzipped, headers=headers | {"Content-Encoding": "gzip"})
        return Response(found.content, headers=headers)


def endpoints(files: StaticFiles) -> tuple[Endpoint, ...]:
    """The files' one address."""
    return (
        Endpoint(
            method="GET",
            path="/static/{name}",
            access=Access.ALL,
            handler=files.serve,
            summary="A file that pages are made of",
            answer_types=tuple(sorted(set(TYPES.values()))),
        ),
    )
