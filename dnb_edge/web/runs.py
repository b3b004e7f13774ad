"""The recordings: their pages, their list, their names and pins, and the room that is left for them.

Knows requests and the index; what a run's results are `runs_results` knows, and `downloads` its files.
"""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path
from typing import cast

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge.archive.index import RunIndex
from dnb_edge.archive.label import whole_text, write_label
from dnb_edge.archive.removal import remove_run
from dnb_edge.archive.stored import StoredRecording
from dnb_edge.config.devices import RecordConfig
from dnb_edge.config.load import load_config
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.retention import Limits, has_own_name, next_removal, pin, stored_runs, unpin
from dnb_edge.record.room import Room, room_of
from dnb_edge.web import runs_results
from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import API, Access, Endpoint, Refused
from dnb_edge.web.runs_asked import ListAsked
from dnb_edge.web.runs_index import found_run, index_of
from dnb_edge.web.runs_lines import (
    best_lap_s,
    entries_of,
    is_current,
    passes_filter,
    run_detail,
    run_line,
    sessions_of,
)
from dnb_edge.web.runs_models import Confirm, Deleted, Disk, NextGone, RunChange, RunDetail, RunLine, RunList

CONFIG_NAME = "dnb-edge.yaml"
SEEN_LATELY_S = 0.5
"""Many look at the list at once: it is read no more often than this."""
DISK_SEEN_S = 3.0


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The pages and the API of the recordings, but for their files."""
    runs = _Runs(box)
    one = f"{API}/runs/{{run_id}}"
    return (
        Endpoint(method="GET", path="/runs", access=Access.ALL, handler=runs.list_page, summary="All recordings"),
        Endpoint(
            method="GET", path="/runs/{run_id}", access=Access.ALL, handler=runs.run_page, summary="One recording"
        ),
        Endpoint(
            method="GET",
            path=f"{API}/runs",
            access=Access.ALL,
            handler=runs.list,
            summary="The recordings, the latest first",
            query=ListAsked,
            answer=RunList,
        ),
        Endpoint(
            method="GET", path=one, access=Access.ALL, handler=runs.show, summary="One recording", answer=RunDetail
        ),
        Endpoint(
            method="PATCH",
            path=one,
            access=Access.CHANGE,
            handler=runs.change,
            summary="Name a recording, keep it for ever or let it go again",
            body=RunChange,
            answer=RunDetail,
        ),
        Endpoint(
            method="DELETE",
            path=one,
            access=Access.CHANGE,
            handler=runs.delete,
            summary="Delete a recording, a judge's edits and its pictures for good",
            body=Confirm,
            answer=Deleted,
        ),
        Endpoint(
            method="GET",
            path=f"{API}/disk",
            access=Access.ALL,
            handler=runs.disk,
            summary="The room for recordings, and what would go first",
            answer=Disk,
        ),
        *runs_results.endpoints(box),
    )


class _Runs:
    """The handlers."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._disk_seen: tuple[float, Disk] | None = None
        # A thousand recordings take seconds at the first look: nobody has to wait for that.
        threading.Thread(target=self._warm_up, name="runs", daemon=True).start()

    def _warm_up(self) -> None:
        with contextlib.suppress(InputError):
            # Whoever asks is told.
            self._index.runs()
            # It is the reading that is wanted: what has come since is nobody's to miss.
            self._index.changed()

    @property
    def _index(self) -> RunIndex:
        return index_of(self._box.settings.runs)

    @property
    def _current(self) -> str | None:
        state = self._box.daemon.state
        return None if state is None else state.run

    async def list_page(self, request: Request) -> Response:
        """The page of the list, which takes all else from the API."""
        return self._box.pages.page(request, "runs.html")

    async def run_page(self, request: Request) -> Response:
        """The page of one run."""
        run = await run_in_threadpool(found_run, self._box, str(request.path_params["run_id"]))
        return self._box.pages.page(request, "runs_one.html", run_id=run.id, file=run.last.path.name)

    async def list(self, request: Request) -> Response:
        """A page of the list."""
        asked = cast("ListAsked", request.state.query)

        def work() -> RunList:
            runs = self._index.runs(within_s=SEEN_LATELY_S)
            shown = [run for run in runs if passes_filter(run, asked)]
            return RunList(
                runs=[self._line(run) for run in shown[asked.offset : asked.offset + asked.limit]],
                total=len(shown),
                offset=asked.offset,
                limit=asked.limit,
                sessions=sessions_of(runs),
                entries=entries_of(runs),
            )

        return JSONResponse((await run_in_threadpool(work)).model_dump())

    async def show(self, request: Request) -> Response:
        """One run."""
        run_id = str(request.path_params["run_id"])
        return JSONResponse((await run_in_threadpool(self._detail, run_id)).model_dump())

    async def change(self, request: Request) -> Response:
        """Its name or its pin."""
        run_id, wish = str(request.path_params["run_id"]), cast("RunChange", request.state.body)

        def work() -> RunDetail:
            run = found_run(self._box, run_id)
            if wish.name is not None:
                _name(run, wish.name)
            if wish.pinned is not None:
                _pin(run, pinned=wish.pinned)
            self._index.changed()
            return self._detail(run_id)

        return JSONResponse((await run_in_threadpool(work)).model_dump())

    async def delete(self, request: Request) -> Response:
        """For good, once its name was said."""
        run_id, wish = str(request.path_params["run_id"]), cast("Confirm", request.state.body)

        def work() -> Deleted:
            run = found_run(self._box, run_id)
            if is_current(run, self._current):
                raise Refused(409, "current", "This is being recorded just now: finish the run first.")
            if run.pinned:
                raise Refused(409, "pinned", "This is pinned: unpin it first, then delete it.")
            name = whole_text(run.last.path.name)
            if wish.confirm != name:
                raise Refused(422, "not-confirmed", f"confirm: must be the file's name, {name}")
            try:
                removals = remove_run(run)
            except InputError as error:
                raise Refused(409, "in-use", _without_folder(error, run)) from error
            self._index.changed()
            self._disk_seen = None
            names = [path.name for removal in removals for path in removal.files]
            return Deleted(id=run.id, files=names, size_bytes=sum(removal.size_bytes for removal in removals))

        return JSONResponse((await run_in_threadpool(work)).model_dump())

    async def disk(self, _request: Request) -> Response:
        """The room there is."""
        known, now_s = self._disk_seen, time.monotonic()
        if known is None or now_s - known[0] > DISK_SEEN_S:
            known = self._disk_seen = (now_s, await run_in_threadpool(self._disk))
        return JSONResponse(known[1].model_dump())

    def _line(self, run: StoredRecording) -> RunLine:
        return run_line(run, current=self._current, best_lap_s=self._best(run))

    def _detail(self, run_id: str) -> RunDetail:
        run = found_run(self._box, run_id)
        return run_detail(run, current=self._current, best_lap_s=self._best(run))

    def _best(self, run: StoredRecording) -> float | None:
        try:
            return best_lap_s(self._index.marshalled(run))
        except InputError:
            # The run's own page says what is wrong with it.
            return None

    def _disk(self) -> Disk:
        folder = self._box.settings.runs
        record = _record_config(self._box.settings.setup / CONFIG_NAME)
        try:
            room = room_of(folder)
        except OSError as error:
            raise WorkError(f"the recordings' disk cannot be asked: {error.strerror}") from error
        runs = self._index.runs()
        stored = stored_runs(folder)
        limits = Limits(
            keep_free_bytes=round(record.keep_free_mb * 1e6),
            max_total_bytes=None if record.max_total_gb is None else round(record.max_total_gb * 1e9),
        )
        now = next_removal(stored, limits, room)
        first = next_removal(stored, Limits(keep_free_bytes=1), Room(free_bytes=0, total_bytes=room.total_bytes))
        run = next((run for run in runs if first and any(file.stem == first.name for file in run.files)), None)
        return Disk(
            total_bytes=room.total_bytes,
            free_bytes=room.free_bytes,
            kept_free_bytes=room.kept_free(limits.keep_free_bytes),
            recordings_bytes=sum(run.size_bytes for run in runs),
            pictures_bytes=sum(run.pictures_bytes for run in runs),
            most_recordings_bytes=limits.max_total_bytes,
            delete_oldest=record.delete_oldest,
            short=None if now is None else now.why,
            next=None
            if first is None
            else NextGone(
                file=first.files[0].name if run is None else run.last.path.name,
                id=None if run is None else run.id,
                pictures_only=first.pictures_only,
                size_bytes=first.size_bytes,
            ),
        )


def _name(run: StoredRecording, name: str) -> None:
    """Beside the first file; nothing beside the others, which may have had one when they were the first."""
    write_label(run.files[0].path, name)
    for file in run.files[1:]:
        write_label(file.path, None)


def _pin(run: StoredRecording, *, pinned: bool) -> None:
    if pinned and not run.pinnable:
        raise Refused(409, "no-need", "Its file has been renamed, and so is never deleted by itself: it needs no pin.")
    for file in run.files:
        if has_own_name(file.path):
            (pin if pinned else unpin)(file.path)


def _record_config(path: Path) -> RecordConfig:
    """What is configured about recordings, or the defaults where the box's own configuration cannot be read."""
    try:
        return load_config(path).record
    except InputError:
        return RecordConfig()


def _without_folder(error: InputError, run: StoredRecording) -> str:
    return str(error).replace(f"{run.last.path.parent}/", "")
