"""The judge's page and its part of the API: passes with pictures, laps as they count, decisions with preview and undo.

A decision is what `dnb-edge judge` makes, by the same code, in the same file beside the recording, which itself never changes.
Knows requests; what a decision means `archive` knows.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from dnb_edge.archive import decisions
from dnb_edge.archive.case import Case, Judge, decide, open_case, passes_of
from dnb_edge.errors import InputError
from dnb_edge.values import Incident
from dnb_edge.web import judge_sheet
from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import API, Access, Endpoint, Refused
from dnb_edge.web.judge_models import (
    AddWish,
    AnyWish,
    Decided,
    ForgiveWish,
    Judged,
    JudgeWish,
    MergeWish,
    NoteWish,
    Passes,
    PenaltyWish,
    RemoveWish,
    UndoWish,
)
from dnb_edge.web.judge_raced import RacedRuns
from dnb_edge.web.runs_index import find_run

MOST_DIGITS = 9
RUN = f"{API}/runs/{{run_id}}"
JPEG = ("image/jpeg",)

T = TypeVar("T")


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """All that a judge needs. To look takes the set-up code as well: it shows camera pictures, and races whole runs again."""
    judge = _Judge(box)
    change = Access.CHANGE
    return (
        Endpoint(
            method="GET",
            path="/runs/{run_id}/judge",
            access=change,
            handler=judge.page,
            summary="The judge's page",
        ),
        Endpoint(
            method="GET",
            path=f"{RUN}/edits",
            access=change,
            handler=judge.look,
            summary="Laps as they count, incidents, and every decision so far",
            answer=Judged,
        ),
        Endpoint(
            method="POST",
            path=f"{RUN}/edits",
            access=change,
            handler=judge.decide,
            summary="Make a decision, or with dry_run see what it would do",
            body=JudgeWish,
            answer=Decided,
        ),
        Endpoint(
            method="GET",
            path=f"{RUN}/passes",
            access=change,
            handler=judge.passes,
            summary="Every crossing of a line",
            answer=Passes,
        ),
        Endpoint(
            method="GET",
            path=f"{RUN}/passes/{{number}}.jpg",
            access=change,
            handler=judge.pass_picture,
            summary="The car at a crossing",
            answer_types=JPEG,
        ),
        Endpoint(
            method="GET",
            path=f"{RUN}/incidents/{{car}}/{{number}}.jpg",
            access=change,
            handler=judge.incident_picture,
            summary="The car at an incident's worst moment",
            answer_types=JPEG,
        ),
    )


class _Judge:
    """The handlers."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._runs = RacedRuns()

    async def page(self, request: Request) -> Response:
        """The page itself, which takes all else from the API."""
        run_id, path = await self._found(request)
        return self._box.pages.page(request, "judge.html", run_id=run_id, file=path.name)

    async def look(self, request: Request) -> Response:
        """The run as it stands."""
        run_id, path = await self._found(request)

        def work() -> Judged:
            run = self._runs.of(path)
            case = open_case(path, raced=run.raced)
            return judge_sheet.judged(run_id, case, unfinished=run.unfinished)

        return _json(await _worked(path, work))

    async def passes(self, request: Request) -> Response:
        """Every crossing."""
        run_id, path = await self._found(request)

        def work() -> Passes:
            return judge_sheet.passes(run_id, passes_of(self._runs.of(path).raced))

        return _json(await _worked(path, work))

    async def decide(self, request: Request) -> Response:
        """Makes one decision."""
        wish: AnyWish = request.state.body.root
        _, path = await self._found(request)
        answer = await _worked(path, lambda: self._decide(path, wish))
        return _json(answer, status=201 if answer.saved else 200)

    def _decide(self, path: Path, wish: AnyWish) -> Decided:
        run = self._runs.of(path)
        if run.unfinished and not wish.dry_run:
            raise Refused(
                409,
                "unfinished",
                "this run is still being recorded, or was cut short: decide when it is finished, or recover it first",
            )
        what = _what(wish)

        def fresh(case: Case) -> dict[str, Any]:
            there = len(case.log.edits)
            if wish.seen is not None and wish.seen != there:
                raise Refused(
                    409, "stale", f"somebody decided meanwhile: there are {there} edits, not {wish.seen}: look again"
                )
            return what(case)

        judge = Judge(name=wish.author, reason=wish.reason)
        done = decide(path, judge, fresh, dry_run=wish.dry_run, raced=run.raced)
        return judge_sheet.decided(done, saved=not wish.dry_run)

    async def pass_picture(self, request: Request) -> Response:
        """The car at a crossing."""
        _, path = await self._found(request)
        number = _number(request, "number")

        def work() -> bytes | None:
            passes = passes_of(self._runs.of(path).raced)
            if not 1 <= number <= len(passes):
                raise Refused(404, "not-found", f"there is no pass {number}: there are {len(passes)}")
            one = passes[number - 1]
            return self._runs.picture(path, one.t_ns, car=one.car, track_m=one.track_m, target_id=one.target_id)

        return _jpeg(await _worked(path, work))

    async def incident_picture(self, request: Request) -> Response:
        """The car at an incident's worst moment."""
        _, path = await self._found(request)
        car, number = _number(request, "car"), _number(request, "number")

        def work() -> bytes | None:
            events = self._runs.of(path).raced.events
            incidents = (event for event in events if isinstance(event, Incident))
            one = next((one for one in incidents if (one.car, one.number) == (car, number)), None)
            if one is None:
                raise Refused(404, "not-found", f"car {car} has no incident {number}")
            return self._runs.picture(path, one.worst_t_ns, car=car, track_m=one.track_m, target_id=one.target_id)

        return _jpeg(await _worked(path, work))

    async def _found(self, request: Request) -> tuple[str, Path]:
        """(the run's id, its file)."""
        run_id = str(request.path_params["run_id"])
        return run_id, await run_in_threadpool(find_run, self._box, run_id)


async def _worked(path: Path, work: Callable[[], T]) -> T:
    """What `work`, which blocks, gives. Its complaints name the run's file without the folders in which it lies."""
    try:
        return await run_in_threadpool(work)
    except InputError as error:
        raise InputError(str(error).replace(f"{path.parent}/", "")) from error


def _what(wish: AnyWish) -> decisions.What:
    """What the wish means. Raises `InputError` where it makes no sense for any run."""
    match wish:
        case AddWish():
            return decisions.adding(str(wish.start), str(wish.end), wish.car)
        case RemoveWish():
            return decisions.removing(wish.lap, wish.car)
        case MergeWish():
            return decisions.merging(wish.lap, wish.car)
        case PenaltyWish():
            penalty = decisions.judges_penalty(
                seconds=wish.seconds, factor=wish.factor, invalid=wish.invalid, dnf=wish.dnf, reason=wish.reason
            )
            return decisions.penalising(wish.lap, wish.car, penalty)
        case ForgiveWish():
            return decisions.forgiving(wish.lap, wish.car, wish.offence)
        case NoteWish():
            return decisions.noting(wish.lap, wish.car)
        case UndoWish():
            return decisions.undoing(wish.edit)


def _number(request: Request, name: str) -> int:
    """A whole number in the address. Raises `Refused` (404) where it is none."""
    text = str(request.path_params[name])
    if not (text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS):
        raise Refused(404, "not-found", f"{name}: must be a whole number")
    return int(text)


def _json(answer: BaseModel, status: int = 200) -> Response:
    return Response(answer.model_dump_json(), status_code=status, media_type="application/json")


def _jpeg(found: bytes | None) -> Response:
    if found is None:
        raise Refused(404, "no-picture", "no picture was kept near that moment")
    return Response(found, media_type=JPEG[0], headers={"Cache-Control": "private, max-age=300"})
