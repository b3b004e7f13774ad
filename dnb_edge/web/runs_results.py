"""What came of a run: its laps, its report, its picture; and the table of entries over several.

Knows requests and which work is long: that is done in a process of its own, and whoever asks is told to ask again. Knows
nothing of how results are made.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import cast

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from dnb_edge import wire
from dnb_edge.archive.index import RunIndex
from dnb_edge.archive.label import whole_text
from dnb_edge.archive.run_csv import incidents_csv, laps_csv, passes_csv
from dnb_edge.archive.run_latex import laps_latex
from dnb_edge.archive.stored import FileState, StoredRecording, session_id
from dnb_edge.archive.thumbnail import track_picture
from dnb_edge.errors import InputError
from dnb_edge.race.marshal import Marshalled
from dnb_edge.race.standings import official_s
from dnb_edge.record.chain import read_head
from dnb_edge.report.run import lap_paths
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Incident, Observation, Points
from dnb_edge.web.box import Box
from dnb_edge.web.downloads_parts import disposition
from dnb_edge.web.endpoint import API, Access, Endpoint, Refused
from dnb_edge.web.runs_asked import MOST_RUNS, LapsAsked, TableAsked, wants_page
from dnb_edge.web.runs_index import found_run, index_of
from dnb_edge.web.runs_jobs import RETRY_AFTER_S, Job, Jobs, done
from dnb_edge.web.runs_lines import file_name, lap_lines
from dnb_edge.web.runs_models import EntryTable, LapAnswer, LapList, TableAnswer, Working

PICTURE_OF_S = 0.5
"""So old what a picture is made of may be."""
KEPT_PICTURES = 500
"""Some 15 kB each."""
SOON_S = 4.0
"""So long somebody waits for what is being made before he is told to ask again."""
CSV = "text/csv; charset=utf-8"
LATEX = "application/x-latex; charset=utf-8"

REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox allow-popups"
)
"""A report holds its own style and pictures, runs nothing and asks nobody for anything."""


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The part of the API that is about results."""
    results = _Results(box)
    one = f"{API}/runs/{{run_id}}"
    return (
        Endpoint(
            method="GET",
            path=f"{one}/laps",
            access=Access.ALL,
            handler=results.laps,
            summary="Its laps after a judge's edits",
            query=LapsAsked,
            answer=LapAnswer,
            answer_types=("text/csv", "application/x-latex"),
        ),
        Endpoint(
            method="GET",
            path=f"{one}/report.html",
            access=Access.ALL,
            handler=results.report,
            summary="Its report; 202 while that is being made",
            answer=Working,
            answer_types=("text/html; charset=utf-8",),
        ),
        Endpoint(
            method="GET",
            path=f"{one}/picture.jpg",
            access=Access.ALL,
            handler=results.picture,
            summary="A small drawing of its track and its best lap",
            answer_types=("image/jpeg",),
        ),
        Endpoint(
            method="GET",
            path=f"{API}/table",
            access=Access.ALL,
            handler=results.table,
            summary="The table of entries over some runs; 202 while it is being made",
            query=TableAsked,
            answer=TableAnswer,
            answer_types=("text/csv", "application/x-latex"),
        ),
    )


class _Results:
    """The handlers."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._jobs = Jobs(box.settings.cache / "made")
        self._pictures: OrderedDict[tuple[str, str], bytes] = OrderedDict()

    @property
    def _index(self) -> RunIndex:
        return index_of(self._box.settings.runs)

    async def _found(self, request: Request) -> StoredRecording:
        return await run_in_threadpool(found_run, self._box, str(request.path_params["run_id"]))

    async def laps(self, request: Request) -> Response:
        """Laps, passes or incidents."""
        asked = cast("LapsAsked", request.state.query)
        form, what = asked.format, asked.what
        if what != "laps" and form != "csv":
            raise Refused(422, "bad-query", "what: passes and incidents are to be had with format=csv")
        run = await self._found(request)
        try:
            return await self._lap_answer(run, form, what)
        except InputError as error:
            raise InputError(str(error).replace(f"{run.last.path.parent}/", "")) from error

    async def _lap_answer(self, run: StoredRecording, form: str, what: str) -> Response:
        if what != "laps":
            text = await run_in_threadpool(self._others, run, what)
            return _text(text, CSV, f"{run.last.stem}-{what}.csv")
        marshalled = await run_in_threadpool(self._index.marshalled, run)
        if any(len(one.raw) != 1 for one in marshalled.laps) and run.state is FileState.FINISHED:
            # A judge made a lap, which nobody has scored yet.
            job = self._jobs.ask("laps", {"path": str(run.last.path)}, stamp=run.stamp, suffix=".json")
            if not await done(job, within_s=SOON_S):
                return _working(job)
            marshalled = await run_in_threadpool(_read_marshalled, job.file)
        match form:
            case "csv":
                return _text(laps_csv(run.entry or "", marshalled), CSV, f"{run.last.stem}-laps.csv")
            case "latex":
                return _text(laps_latex(run.entry or "", marshalled), LATEX, f"{run.last.stem}-laps.tex")
            case _:
                return JSONResponse(LapList(id=run.id, laps=lap_lines(marshalled)).model_dump())

    async def report(self, request: Request) -> Response:
        """The report, or that it is being made."""
        run = await self._found(request)
        _check_finished(run, "The report")
        job = self._jobs.ask("report", {"path": str(run.last.path)}, stamp=run.stamp, suffix=".html")
        if not await done(job, within_s=SOON_S):
            if wants_page(request):
                page = self._box.pages.page(
                    request, "runs_wait.html", status=202, text=job.text, file=file_name(run.last)
                )
                page.headers["Retry-After"] = str(round(RETRY_AFTER_S))
                return page
            return _working(job)
        headers = {"Content-Security-Policy": REPORT_POLICY, "Cache-Control": "no-cache"}
        return FileResponse(job.file, media_type="text/html; charset=utf-8", headers=headers)

    async def picture(self, request: Request) -> Response:
        """The track with the best lap, as far as they are known."""
        # A list has fifty of them: they are one look at the folder, not fifty.
        run_id = str(request.path_params["run_id"])
        run = await run_in_threadpool(lambda: found_run(self._box, run_id, within_s=PICTURE_OF_S))
        laps = -1 if run.laps is None else run.laps
        # While it is recorded the picture changes with each lap, not with each byte.
        key = (run.id, str(laps) if run.state is FileState.RECORDING else run.stamp)
        tag = f'"{run.id}-{key[1]}"'
        headers = {"ETag": tag, "Cache-Control": "no-cache"}
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        jpeg = self._pictures.get(key)
        if jpeg is None:
            jpeg = self._pictures[key] = await run_in_threadpool(self._drawn, run)
            while len(self._pictures) > KEPT_PICTURES:
                self._pictures.popitem(last=False)
        return Response(jpeg, media_type="image/jpeg", headers=headers)

    async def table(self, request: Request) -> Response:
        """The table over the chosen runs, or that it is being made."""
        asked = cast("TableAsked", request.state.query)
        runs = await run_in_threadpool(self._chosen, asked)
        # The order of choice changes nothing in the table.
        runs.sort(key=lambda run: run.last.path.name)
        spec = {"paths": [str(run.last.path) for run in runs], "by": asked.by}
        job = self._jobs.ask("table", spec, stamp=" ".join(run.stamp for run in runs), suffix=".json")
        if not await done(job, within_s=SOON_S):
            return _working(job)
        made = json.loads(await run_in_threadpool(job.file.read_text, "utf-8"))
        match asked.format:
            case "csv":
                return _text(made["csv"], CSV, "table.csv")
            case "latex":
                return _text(made["latex"], LATEX, "table.tex")
            case _:
                table = EntryTable(rows=made["rows"], notes=made["notes"], warnings=made["warnings"])
                return JSONResponse(table.model_dump())

    def _chosen(self, asked: TableAsked) -> list[StoredRecording]:
        runs = self._index.runs()
        if (asked.runs is None) == (asked.session is None):
            raise Refused(422, "bad-query", "runs: say either which runs, or which session")
        if asked.runs is None:
            of_session = [run for run in runs if run.session and session_id(run.session) == asked.session]
            found = [run for run in of_session if run.state is FileState.FINISHED]
            if not found:
                raise Refused(404, "not-found", "This session has no finished recording: look at the list.")
            if len(found) > MOST_RUNS:
                raise Refused(422, "bad-query", f"session: it has {len(found)} runs, {MOST_RUNS} at most")
            return found
        ids = set(asked.runs.split(","))
        found = [run for run in runs if run.id in ids]
        if len(found) != len(ids):
            raise Refused(404, "not-found", "One of these recordings is not there any more: look at the list.")
        for run in found:
            _check_finished(run, "The table")
        return found

    def _others(self, run: StoredRecording, what: str) -> str:
        makers: dict[str, Callable[[], str]] = {
            "passes": lambda: passes_csv(run.entry or "", self._index.events(run, Crossing)),
            "incidents": lambda: incidents_csv(run.entry or "", self._index.events(run, Incident)),
        }
        return makers[what]()

    def _drawn(self, run: StoredRecording) -> bytes:
        track, path_m = None, None
        try:
            track = Track.from_dict(read_head(run.last.path).header.setup["core"]["track"])
            path_m = self._best_path(run)
        except (InputError, KeyError, TypeError):
            # What can be drawn is drawn; the run's page says what is the matter.
            pass
        return track_picture(track, path_m)

    def _best_path(self, run: StoredRecording) -> Points | None:
        laps = [one.lap for one in self._index.marshalled(run).laps]
        best = min([lap for lap in laps if lap.valid] or laps, key=official_s, default=None)
        if best is None:
            return None
        within = {"from_ns": best.start_t_ns, "to_ns": best.end_t_ns}
        seen = tuple(self._index.events(run, Observation, **within))
        crossings = tuple(self._index.events(run, Crossing, **within))
        return lap_paths((best,), seen, [one for one in crossings if one.car == best.car])[0]


def _read_marshalled(file: Path) -> Marshalled:
    return wire.from_dict(Marshalled, json.loads(file.read_text("utf-8")))


def _check_finished(run: StoredRecording, what: str) -> None:
    if run.state is FileState.RECORDING:
        raise Refused(409, "recording", f"{what} can be made when the recording is finished: end the run first.")
    if run.state is not FileState.FINISHED:
        raise Refused(409, "not-whole", f"{run.last.path.name} is not whole: run `dnb-edge runs recover` on it first.")


def _working(job: Job) -> Response:
    told = Working(text=job.text, share=job.share, retry_after_s=RETRY_AFTER_S)
    return JSONResponse(told.model_dump(), 202, headers={"Retry-After": str(round(RETRY_AFTER_S))})


def _text(text: str, media_type: str, name: str) -> Response:
    headers = {"Content-Disposition": disposition(whole_text(name))}
    return Response(text.encode(errors="replace"), media_type=media_type, headers=headers)
