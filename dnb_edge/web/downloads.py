"""Taking recordings home: one file, resumable and also while it is still being recorded, or a whole session as a zip.

Knows runs and requests. A recording that is being written is handed out as a copy that is a whole file: what is there so far
and an end for it, which is kept for those who go on with that copy later.
"""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from dataclasses import dataclass
from email.utils import formatdate
from typing import cast

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from dnb_edge.archive.label import label_path, whole_text
from dnb_edge.archive.stored import FileState, SeenFile, StoredRecording, session_id
from dnb_edge.errors import InputError
from dnb_edge.record.edits import edits_path
from dnb_edge.record.names import pictures_directory, pictures_files
from dnb_edge.web.box import Box
from dnb_edge.web.downloads_parts import (
    Member,
    Part,
    Span,
    Unsatisfiable,
    disposition,
    known_already,
    pieces,
    still_same,
    wanted_span,
    zipped,
)
from dnb_edge.web.downloads_send import Lanes, Sending
from dnb_edge.web.endpoint import API, Access, Endpoint, Refused
from dnb_edge.web.runs_asked import FileAsked, ZipAsked
from dnb_edge.web.runs_index import found_run, index_of
from dnb_edge.web.runs_jobs import Job, Jobs, done
from dnb_edge.web.runs_lines import file_name

COPY_WITHIN_S = 60.0
SAME_COPY_S = 10.0
"""So long a client that asked for the head of a copy gets that one."""
FRESH_COPY_S = 1.0
"""A copy this young is as good as a new one."""
LATE_COPY_S = 120.0
"""So long after its end a copy that was late is given to whoever asks again."""
MOST_COPIES = 32
_UNFINISHED = (FileState.RECORDING, FileState.CUT)
_TRIES = 3


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The files themselves."""
    downloads = _Downloads(box)
    return (
        Endpoint(
            method="GET",
            path=f"{API}/runs/{{run_id}}/recording.mcap",
            access=Access.ALL,
            handler=downloads.recording,
            summary="Its file, whole or a range of it; a whole copy while it is being recorded",
            query=FileAsked,
            answer_types=("application/octet-stream",),
        ),
        Endpoint(
            method="GET",
            path=f"{API}/runs/{{run_id}}/recording.zip",
            access=Access.ALL,
            handler=downloads.run_zip,
            summary="All its files with a judge's edits",
            query=ZipAsked,
            answer_types=("application/zip",),
        ),
        Endpoint(
            method="GET",
            path=f"{API}/sessions/{{session_id}}.zip",
            access=Access.ALL,
            handler=downloads.session_zip,
            summary="All recordings of a session",
            query=ZipAsked,
            answer_types=("application/zip",),
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Content:
    """What is sent of one file."""

    parts: tuple[Part, ...]
    tag: str
    """Strong ETag, with its quotes."""
    modified: str | None
    """Last-Modified; None for a copy."""
    made_s: float = 0.0
    for_head: bool = False

    @property
    def size_bytes(self) -> int:
        return sum(part.size_bytes for part in self.parts)

    @property
    def is_there(self) -> bool:
        return all(part.path.exists() for part in self.parts)


class _Downloads:
    """The handlers."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._jobs = Jobs(box.settings.cache / "copies")
        self._lanes = Lanes(box.settings.most_downloads, box.settings.download_mb_per_s * 1e6)
        self._copies: OrderedDict[tuple[str, int], list[_Content]] = OrderedDict()
        self._late: dict[tuple[str, int], Job] = {}

    async def recording(self, request: Request) -> Response:
        """One file of a run, or a part of it."""
        part = cast("FileAsked", request.state.query).part
        run_id = str(request.path_params["run_id"])
        for left in reversed(range(_TRIES)):
            run = await run_in_threadpool(found_run, self._box, run_id)
            if part is not None and part > len(run.files):
                raise Refused(404, "not-found", f"This recording has {len(run.files)} files.")
            file = run.files[-1 if part is None else part - 1]
            try:
                content = await self._content(file, request)
                return _answer(request, content, file_name(file), self._lanes)
            except (FileNotFoundError, InputError):
                # Finished and renamed just now, perhaps.
                if left == 0:
                    raise
        raise AssertionError("the last try returns or raises")

    async def run_zip(self, request: Request) -> Response:
        """All files of one run."""
        run = await run_in_threadpool(found_run, self._box, str(request.path_params["run_id"]))
        return await self._zip(request, [run], run.files[0].stem)

    async def session_zip(self, request: Request) -> Response:
        """All files of a session."""
        wanted = str(request.path_params["session_id"])
        runs = [
            run
            for run in await run_in_threadpool(index_of(self._box.settings.runs).runs)
            if run.session and session_id(run.session) == wanted
        ]
        if not runs:
            raise Refused(404, "not-found", "There is no such session: look at the list of recordings.")
        return await self._zip(request, runs, runs[0].session or "session")

    async def _zip(self, request: Request, runs: list[StoredRecording], name: str) -> Response:
        with_pictures = cast("ZipAsked", request.state.query).pictures
        headers = {
            "Content-Type": "application/zip",
            "Content-Disposition": disposition(f"{whole_text(name)}.zip"),
            "Cache-Control": "no-cache, no-transform",
        }
        if request.method == "HEAD":
            return Response(headers=headers)
        members: list[Member] = []
        for run in runs:
            for file in run.files:
                content = await self._content(file, request)
                members.append(Member(name=file_name(file), parts=content.parts, modified_ns=file.modified_ns))
                members += await run_in_threadpool(_beside, file, with_pictures=with_pictures)
        return Sending(zipped(members), lanes=self._lanes, status_code=200, headers=headers)

    async def _content(self, file: SeenFile, request: Request) -> _Content:
        """What is to be sent of `file`: itself, or a copy with an end where it has none yet."""
        if file.state not in _UNFINISHED:
            found = await run_in_threadpool(file.path.stat)
            return _Content(
                parts=(Part(path=file.path, size_bytes=found.st_size),),
                tag=_tag(file.stem, found.st_ino, found.st_size, found.st_mtime_ns),
                modified=formatdate(found.st_mtime_ns / 1e9, usegmt=True),
            )
        found = await run_in_threadpool(file.path.stat)
        kept = self._copies.setdefault((file.stem, found.st_ino), [])
        self._copies.move_to_end((file.stem, found.st_ino))
        while len(self._copies) > MOST_COPIES:
            self._copies.popitem(last=False)
        kept[:] = [copy for copy in kept if copy.is_there]
        again = _copy_again(kept, request)
        if again is not None:
            return again
        job = self._late_copy(file.stem, found.st_ino)
        if job is None:
            spec = {"path": str(file.path), "growing": file.state is FileState.RECORDING}
            stamp = f"{found.st_ino} {found.st_size} {found.st_mtime_ns}"
            job = self._jobs.ask("copy", spec, stamp=stamp, suffix=".end")
        if not await done(job, within_s=COPY_WITHIN_S):
            self._late[file.stem, found.st_ino] = job
            while len(self._late) > MOST_COPIES:
                del self._late[next(iter(self._late))]
            raise Refused(503, "busy", "The copy is still being made: try again.", retry_after_s=5.0)
        end_bytes = (await run_in_threadpool(job.file.stat)).st_size
        copy = _Content(
            parts=(
                Part(path=file.path, size_bytes=int(job.told["data_bytes"])),
                Part(path=job.file, size_bytes=end_bytes),
            ),
            tag=_tag(job.file.name, found.st_ino, int(job.told["data_bytes"]), end_bytes),
            modified=None,
            made_s=time.monotonic(),
            for_head=request.method == "HEAD",
        )
        self._late.pop((file.stem, found.st_ino), None)
        kept.append(copy)
        del kept[:-MOST_COPIES]
        return copy

    def _late_copy(self, stem: str, inode: int) -> Job | None:
        """The copy that took longer than somebody waited for it. A long recording has grown by the time that he asks again:
        another copy would be as late.
        """
        job = self._late.pop((stem, inode), None)
        if job is None or job.error is not None:
            return None
        too_old = job.ended_s is not None and time.monotonic() - job.ended_s > LATE_COPY_S
        return None if too_old or (job.ended_s is not None and not job.file.exists()) else job


def _copy_again(kept: list[_Content], request: Request) -> _Content | None:
    """The copy that a client goes on with, or has just asked the head of; None for a new one."""
    if not kept:
        return None
    if_range = request.headers.get("if-range")
    if if_range is not None:
        return next((copy for copy in kept if copy.tag == if_range.strip()), None)
    span = request.headers.get("range", "").replace(" ", "").lower()
    if span and not span.startswith("bytes=0-"):
        # It does not say of which copy: of the last one, as long as there is only one client.
        return kept[-1]
    fresh_s = SAME_COPY_S if kept[-1].for_head else FRESH_COPY_S
    return kept[-1] if time.monotonic() - kept[-1].made_s < fresh_s else None


def _answer(request: Request, content: _Content, name: str, lanes: Lanes) -> Response:
    headers = {
        "ETag": content.tag,
        "Accept-Ranges": "bytes",
        "Content-Type": "application/octet-stream",
        "Content-Disposition": disposition(name),
        # Whoever resumes may ask whether it is still the same; nobody may pack it.
        "Cache-Control": "no-cache, no-transform",
    }
    if content.modified is not None:
        headers["Last-Modified"] = content.modified
    if known_already(request.headers.get("if-none-match"), content.tag):
        return Response(status_code=304, headers=headers)
    span, size_bytes = None, content.size_bytes
    if still_same(request.headers.get("if-range"), tag=content.tag, modified=content.modified):
        try:
            span = wanted_span(request.headers.get("range"), size_bytes)
        except Unsatisfiable:
            return Response(status_code=416, headers={**headers, "Content-Range": f"bytes */{size_bytes}"})
    status = 200
    if span is not None:
        status, headers["Content-Range"] = 206, f"bytes {span.start}-{span.stop - 1}/{size_bytes}"
    else:
        span = Span(start=0, stop=size_bytes)
    headers["Content-Length"] = str(span.stop - span.start)
    if request.method == "HEAD":
        return Response(status_code=status, headers=headers)
    return Sending(pieces(content.parts, span), lanes=lanes, status_code=status, headers=headers)


def _beside(file: SeenFile, *, with_pictures: bool) -> list[Member]:
    """What lies beside a recording and belongs to it."""
    path = file.path
    found = [(one.name, one) for one in (edits_path(path), label_path(path)) if one.is_file()]
    if with_pictures:
        place = pictures_directory(path).name
        found += [(f"{place}/{one.name}", one) for one in pictures_files(path) if one.suffix == ".mcap"]
    members = []
    for name, one in ((whole_text(name), one) for name, one in found):
        stat = one.stat()
        parts = (Part(path=one, size_bytes=stat.st_size),)
        members.append(Member(name=name, parts=parts, modified_ns=stat.st_mtime_ns))
    return members


def _tag(*parts: object) -> str:
    text = " ".join(map(str, parts))
    return f'"{hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=16).hexdigest()}"'
