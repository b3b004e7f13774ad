"""The set-up's page and its part of the API: from a camera that is aimed to a configuration that is in place.

Knows requests and the line to the daemon; what they do to the draft is `setup_changes`' knowledge, what a draft comes to
`setup_steps`'. Everything that takes time runs in a thread, one thing at a time, so that a small box keeps racing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge.web import setup_changes, setup_save, setup_steps, setup_teach, setup_upload
from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import API, SMALL_BODY_BYTES, Access, Endpoint, Handler, Method, Refused
from dnb_edge.web.setup_draft import (
    CameraChoice,
    Draft,
    DraftStore,
    RouteChoice,
    StoredPicture,
)
from dnb_edge.web.setup_flicker import FlickerWatch
from dnb_edge.web.setup_models import (
    FlattenBody,
    KeypointsBody,
    LaneBody,
    LinesBody,
    LookAnswer,
    LookQuery,
    RouteBody,
    SaveAnswer,
    SetupAnswer,
    TeachAnswer,
    VersionQuery,
)

SETUP = f"{API}/setup"
_IMAGES = ("image/png", "image/jpeg")
T = TypeVar("T")


class Setup:
    """The handlers. One for the whole process."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._folder = box.settings.setup
        self._store = DraftStore(box.settings.setup)
        self._one_at_a_time = asyncio.Lock()
        self._flicker = FlickerWatch()

    async def page(self, request: Request) -> Response:
        """GET /setup."""
        return self._box.pages.page(request, "setup.html", steps=setup_steps.STEPS)

    async def get(self, request: Request) -> Response:
        """GET /api/v1/setup."""
        del request
        return await self._answer(self._store.load)

    async def discard(self, request: Request) -> Response:
        """DELETE /api/v1/setup."""
        del request
        return await self._answer(self._store.discard)

    async def camera(self, request: Request) -> Response:
        """PUT /api/v1/setup/camera."""
        body: CameraChoice = request.state.body
        return await self._change(lambda draft: draft.model_copy(update={"camera": body}))

    async def take(self, request: Request) -> Response:
        """POST /api/v1/setup/photo: keeps the camera's picture of this moment."""
        del request
        picture = await self._box.daemon.picture()
        return await self._answer(partial(setup_changes.keep_photo, self._store, picture.jpeg, from_camera=True))

    async def upload_photo(self, request: Request) -> Response:
        """PUT /api/v1/setup/photo: a picture from elsewhere instead."""
        data = await request.body()
        return await self._answer(partial(setup_changes.keep_photo, self._store, data, from_camera=False))

    async def upload_twin(self, request: Request) -> Response:
        """PUT /api/v1/setup/twin."""
        data = await request.body()
        return await self._answer(partial(setup_changes.keep_twin, self._store, data))

    async def flatten(self, request: Request) -> Response:
        """POST /api/v1/setup/twin: makes one of the camera's picture."""
        return await self._answer(partial(setup_changes.flatten, self._store, request.state.body))

    async def lane(self, request: Request) -> Response:
        """PUT /api/v1/setup/lane."""
        return await self._answer(partial(setup_changes.set_lane, self._store, request.state.body))

    async def route(self, request: Request) -> Response:
        """PUT /api/v1/setup/route."""
        body: RouteBody = request.state.body

        def changed(draft: Draft) -> Draft:
            return draft.model_copy(
                update={
                    "route": RouteChoice(**{name: getattr(body, name) for name in RouteChoice.model_fields}),
                    "scale": body.scale,
                    "name": draft.name if body.name is None else body.name,
                }
            )

        return await self._change(changed)

    async def keypoints(self, request: Request) -> Response:
        """PUT /api/v1/setup/keypoints."""
        body: KeypointsBody = request.state.body
        names = [pair.name for pair in body.pairs]
        if len(set(names)) < len(names):
            raise Refused(422, "bad-body", "pairs: two keypoints have one name: give each its own")

        def changed(draft: Draft) -> Draft:
            limit_mm = draft.limit_mm if body.limit_mm is None else body.limit_mm
            return draft.model_copy(update={"pairs": body.pairs, "limit_mm": limit_mm})

        return await self._change(changed)

    async def lines(self, request: Request) -> Response:
        """PUT /api/v1/setup/lines."""
        return await self._answer(partial(setup_changes.set_lines, self._store, request.state.body))

    async def teach(self, request: Request) -> Response:
        """GET /api/v1/setup/teach."""
        del request
        return _json(await run_in_threadpool(setup_teach.how, self._box.settings.runs, self._folder))

    async def upload_card(self, request: Request) -> Response:
        """PUT /api/v1/setup/model/card: what `dnb-edge teach` wrote beside the model, before the model."""
        data = await request.body()
        return await self._answer(partial(setup_teach.keep_card, self._store, data))

    async def upload_model(self, request: Request) -> Response:
        """PUT /api/v1/setup/model."""
        data = await request.body()
        return await self._answer(partial(setup_teach.keep_model, self._store, data))

    async def forget_model(self, request: Request) -> Response:
        """DELETE /api/v1/setup/model."""
        del request
        return await self._answer(partial(setup_teach.forget_model, self._store))

    async def save(self, request: Request) -> Response:
        """POST /api/v1/setup/save."""
        del request
        state = self._box.daemon.state
        source = None if state is None else state.source
        saved, draft = await self._alone(partial(setup_changes.save, self._store, self._folder, source))
        note = "" if saved.note is None else f" {saved.note}"
        try:
            await self._box.daemon.ask(new_run=True)
        except Refused as refused:
            text = f"Saved. {refused.text} The new set-up is used by the next race.{note}"
            answer = SaveAnswer(draft=draft, files=list(saved.files), run="later", text=text)
        else:
            answer = SaveAnswer(
                draft=draft, files=list(saved.files), run="new", text=f"Saved. The box races with it from now on.{note}"
            )
        return _json(answer)

    async def look(self, request: Request) -> Response:
        """GET /api/v1/setup/look?after=T_NS."""
        picture = await self._box.daemon.picture(newer_than_ns=request.state.query.after)
        found, flicker = await run_in_threadpool(setup_changes.looked, picture, self._flicker)
        return _json(
            LookAnswer(
                t_ns=picture.t_ns,
                width_px=picture.width_px,
                height_px=picture.height_px,
                sharpness=found.sharpness,
                dark_share=found.dark_share,
                bright_share=found.bright_share,
                fault=found.fault,
                flicker=flicker,
            )
        )

    async def twin_picture(self, request: Request) -> Response:
        """GET /api/v1/setup/twin.png: the twin as it was given."""
        return await self._picture(request, lambda draft: draft.twin, "The twin is not given yet.")

    async def photo_picture(self, request: Request) -> Response:
        """GET /api/v1/setup/picture.jpg: the picture on which keypoints are clicked."""
        return await self._picture(request, lambda draft: draft.photo, "The picture is not taken yet.")

    async def sigma(self, request: Request) -> Response:
        """GET /api/v1/setup/sigma.png."""
        del request
        return Response(await self._alone(partial(setup_changes.sigma, self._store)), media_type="image/png")

    async def _change(self, change: Callable[[Draft], Draft]) -> Response:
        return await self._answer(partial(self._store.change, change))

    async def _answer(self, work: Callable[[], Draft]) -> Response:
        """Does `work` and answers with the draft and all that follows from it."""

        def told() -> SetupAnswer:
            known = setup_steps.understood(work(), self._store.folder)
            return setup_steps.answer(known, configured=(self._folder / setup_save.CONFIG).is_file())

        return _json(await self._alone(told))

    async def _alone(self, work: Callable[[], T]) -> T:
        """What `work` gives, in a thread, with nothing else of the set-up at work: who waits holds no thread."""
        async with self._one_at_a_time:
            return await run_in_threadpool(work)

    async def _picture(
        self, request: Request, which: Callable[[Draft], StoredPicture | None], missing: str
    ) -> Response:
        stored = which(await run_in_threadpool(self._store.load))
        if stored is None:
            raise Refused(404, "not-found", missing)
        etag = f'"{stored.sha256[:16]}"'
        headers = {"ETag": etag, "Cache-Control": "private, no-cache"}
        if request.headers.get("if-none-match") == etag:
            return Response(status_code=304, headers=headers)
        data = await run_in_threadpool(setup_changes.stored_bytes, self._store, stored)
        kind = "image/png" if stored.file.endswith(".png") else "image/jpeg"
        return Response(data, media_type=kind, headers=headers)


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The set-up's page and its part of the API."""
    setup = Setup(box)
    upload = partial(_api, body_types=_IMAGES)
    picture = partial(_api, answer=None, query=VersionQuery)
    return (
        Endpoint(method="GET", path="/setup", access=Access.CHANGE, handler=setup.page, summary="The set-up's page"),
        _api("GET", "", setup.get, "The draft of the set-up and how far it is"),
        _api("DELETE", "", setup.discard, "Forget the draft; what is in place stays"),
        _api("PUT", "/camera", setup.camera, "What is asked of the camera", body=CameraChoice),
        _api(
            "GET",
            "/look",
            setup.look,
            "How sharp and how well exposed the picture is",
            answer=LookAnswer,
            query=LookQuery,
        ),
        _api("POST", "/photo", setup.take, "Keep the camera's picture to click keypoints on"),
        upload("PUT", "/photo", setup.upload_photo, "Give a picture of the camera's view instead"),
        picture("GET", "/picture.jpg", setup.photo_picture, "The kept picture"),
        upload("PUT", "/twin", setup.upload_twin, "Give the twin: the track from straight above"),
        _api("POST", "/twin", setup.flatten, "Make a twin of the camera's picture", body=FlattenBody),
        picture("GET", "/twin.png", setup.twin_picture, "The twin"),
        _api("PUT", "/lane", setup.lane, "What the lane looks like", body=LaneBody),
        _api("PUT", "/route", setup.route, "Which way through the lanes, and the scale", body=RouteBody),
        _api("PUT", "/keypoints", setup.keypoints, "All keypoints", body=KeypointsBody),
        picture("GET", "/sigma.png", setup.sigma, "How sure a position is, over twin and picture"),
        _api("PUT", "/lines", setup.lines, "The start, finish and sector lines", body=LinesBody),
        _api("POST", "/save", setup.save, "Put the set-up in place and race with it", answer=SaveAnswer),
        _api("GET", "/teach", setup.teach, "How to teach the detector one's own car", answer=TeachAnswer),
        _api(
            "PUT",
            "/model/card",
            setup.upload_card,
            "Give the card of a taught model, before the model itself",
            body_types=("application/octet-stream",),
        ),
        _api(
            "PUT",
            "/model",
            setup.upload_model,
            "Give a model (ONNX) that finds the car",
            body_types=("application/octet-stream",),
        ),
        _api("DELETE", "/model", setup.forget_model, "Back to the model that came with the box"),
    )


def _api(
    method: Method,
    path: str,
    handler: Handler,
    summary: str,
    *,
    body: type[BaseModel] | None = None,
    body_types: tuple[str, ...] = (),
    answer: type[BaseModel] | None = SetupAnswer,
    query: type[BaseModel] | None = None,
) -> Endpoint:
    return Endpoint(
        method=method,
        path=f"{SETUP}{path}",
        access=Access.CHANGE,
        handler=handler,
        summary=summary,
        body=body,
        body_types=body_types,
        answer=answer,
        answer_types=_IMAGES if answer is None else (),
        query=query,
        most_body_bytes=setup_upload.MOST_BYTES if body_types else SMALL_BODY_BYTES,
    )


def _json(answer: BaseModel) -> Response:
    return JSONResponse(answer.model_dump(mode="json"))
