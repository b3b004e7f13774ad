"""The set-up's page and its part of the API: from a camera that is aimed to a configuration that is in place.

Knows requests, the draft and the line to the daemon; what a draft comes to is `setup_steps`' knowledge, what saving does
`setup_save`'s. Everything that takes time runs in a thread, one thing at a time, so that a small box keeps racing.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge.errors import InputError, WorkError
from dnb_edge.track.twin import load_twin
from dnb_edge.view.photograph import SEAM_M
from dnb_edge.web import setup_look, setup_save, setup_steps, setup_track, setup_upload
from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import API, SMALL_BODY_BYTES, Access, Endpoint, Handler, Method, Refused
from dnb_edge.web.setup_draft import (
    CameraChoice,
    Draft,
    DraftStore,
    EndsPx,
    LaneChoice,
    Lines,
    Pair,
    RouteChoice,
    ScaleChoice,
    StoredPicture,
)
from dnb_edge.web.setup_keypoints import sigma_picture
from dnb_edge.web.setup_models import (
    FlattenBody,
    KeypointsBody,
    LaneBody,
    LineBody,
    LinesBody,
    LookAnswer,
    LookQuery,
    RouteBody,
    SaveAnswer,
    SetupAnswer,
    VersionQuery,
)
from dnb_edge.web.setup_teach import Teacher

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
        return await self._answer(partial(self._keep_photo, picture.jpeg, from_camera=True))

    async def upload_photo(self, request: Request) -> Response:
        """PUT /api/v1/setup/photo: a picture from elsewhere instead."""
        data = await request.body()
        return await self._answer(partial(self._keep_photo, data, from_camera=False))

    async def upload_twin(self, request: Request) -> Response:
        """PUT /api/v1/setup/twin."""
        data = await request.body()
        return await self._answer(partial(self._keep_twin, data))

    async def flatten(self, request: Request) -> Response:
        """POST /api/v1/setup/twin: makes one of the camera's picture."""
        return await self._answer(partial(self._flatten, request.state.body))

    async def lane(self, request: Request) -> Response:
        """PUT /api/v1/setup/lane."""
        return await self._answer(partial(self._set_lane, request.state.body))

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
        return await self._answer(partial(self._set_lines, request.state.body))

    async def save(self, request: Request) -> Response:
        """POST /api/v1/setup/save."""
        del request
        state = self._box.daemon.state
        source = None if state is None else state.source
        saved, draft = await self._alone(partial(self._save, source))
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
        found = await run_in_threadpool(self._looked, picture.jpeg)
        return _json(
            LookAnswer(
                t_ns=picture.t_ns,
                width_px=picture.width_px,
                height_px=picture.height_px,
                sharpness=found.sharpness,
                dark_share=found.dark_share,
                bright_share=found.bright_share,
                fault=found.fault,
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
        return Response(await self._alone(self._sigma), media_type="image/png")

    def _keep_photo(self, data: bytes, *, from_camera: bool) -> Draft:
        upload = setup_upload.checked(data, what="the camera's picture", upright=True)
        fault = setup_look.fault_of(setup_upload.decoded(data, what="the camera's picture"))
        if fault is not None:
            raise InputError(f"the picture cannot be used, {fault}")

        def changed(draft: Draft) -> Draft:
            stored = self._store.keep("photo", upload, from_camera=from_camera)
            return draft.model_copy(update={"photo": stored, "pairs": _moved(draft.pairs, draft.photo, stored)})

        return self._store.change(changed)

    def _keep_twin(self, data: bytes) -> Draft:
        upload = setup_upload.checked(data, what="the twin")
        stored = self._store.keep("twin", upload)

        def changed(draft: Draft) -> Draft:
            if draft.twin is not None and draft.twin.sha256 == stored.sha256:
                return draft
            # All that was clicked on another picture means nothing on this one.
            return draft.model_copy(
                update={
                    "twin": stored,
                    "lane": None,
                    "route": RouteChoice(closed=draft.route.closed),
                    "scale": None,
                    "lines": Lines(),
                    "pairs": _only_camera(draft.pairs),
                }
            )

        return self._store.change(changed)

    def _flatten(self, body: FlattenBody) -> Draft:
        photo = self._store.load().photo
        if photo is None:
            raise InputError("there is no picture to make a twin of: take the camera's picture first")
        picture = setup_upload.decoded(self._store.path(photo).read_bytes(), what="the camera's picture")
        upload, metres_per_px, corners = setup_track.flattened(picture, body.corners_px, body.width_m, body.height_m)
        stored = self._store.keep("twin", upload)
        pairs = tuple(
            Pair(name=str(k), camera_px=camera_px, twin_px=twin_px)
            for k, (camera_px, twin_px) in enumerate(zip(body.corners_px, corners, strict=True), start=1)
        )

        def changed(draft: Draft) -> Draft:
            return draft.model_copy(
                update={
                    "twin": stored,
                    "lane": None,
                    # Tape across the lane is no end of it.
                    "route": RouteChoice(closed=draft.route.closed, close_gap_px=round(SEAM_M / metres_per_px, 1)),
                    "scale": ScaleChoice(metres_per_px=metres_per_px),
                    "lines": Lines(),
                    "pairs": pairs,
                }
            )

        return self._store.change(changed)

    def _set_lane(self, body: LaneBody) -> Draft:
        if (body.at_px is None) == (body.shade is None):
            raise InputError("the lane: give a place on it, or its shade, one of the two")
        twin = self._store.load().twin
        if twin is None:
            raise InputError("the lane: give the twin first")
        lane = LaneChoice(shade=body.shade)
        if body.at_px is not None:
            lane = setup_track.lane_at(self._store.path(twin), body.at_px)
        return self._store.change(lambda draft: draft.model_copy(update={"lane": lane}))

    def _set_lines(self, body: LinesBody) -> Draft:
        found = setup_steps.understood(self._store.load(), self._store.folder).track

        def ends(line: LineBody | None, name: str) -> EndsPx | None:
            if line is None:
                return None
            if (line.ends_px is None) == (line.at_px is None):
                raise InputError(f"the line {name!r}: give its ends, or a place on the route, one of the two")
            if line.at_px is None:
                return line.ends_px
            return setup_track.snapped(found, line.at_px, name=name, flipped=line.flipped)

        sectors = tuple(ends(line, f"sector {k}") for k, line in enumerate(body.sectors, start=1))
        lines = Lines(
            start_px=ends(body.start, "start"),
            finish_px=ends(body.finish, "finish"),
            sectors_px=tuple(line for line in sectors if line is not None),
        )
        return self._store.change(lambda draft: draft.model_copy(update={"lines": lines}))

    def _save(self, source: str | None) -> tuple[setup_save.Saved, Draft]:
        draft = self._store.load()
        known = setup_steps.understood(draft, self._store.folder)
        saved = setup_save.save(known, self._folder, self._store, source=source)
        return saved, self._store.saved(draft.revision)

    def _sigma(self) -> bytes:
        draft = self._store.load()
        known = setup_steps.understood(draft, self._store.folder)
        if draft.twin is None or draft.photo is None:
            raise InputError("the sigma map: give the twin and take the picture first")
        photo = setup_upload.decoded(self._store.path(draft.photo).read_bytes(), what="the camera's picture")
        return sigma_picture(known.keypoints, known.metric_track, load_twin(self._store.path(draft.twin)), photo)

    def _looked(self, jpeg: bytes) -> setup_look.PictureLook:
        return setup_look.look_at(setup_upload.decoded(jpeg, what="the camera's picture"))

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
        data = await run_in_threadpool(self._stored, stored)
        kind = "image/png" if stored.file.endswith(".png") else "image/jpeg"
        return Response(data, media_type=kind, headers=headers)

    def _stored(self, stored: StoredPicture) -> bytes:
        try:
            data = self._store.path(stored).read_bytes()
        except OSError as error:
            raise WorkError(
                f"{stored.file}: cannot be read: {error.strerror or error}: give the picture anew"
            ) from error
        if hashlib.sha256(data).hexdigest() != stored.sha256:
            raise WorkError(f"{stored.file}: is damaged: give the picture anew")
        return data


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The set-up's page and its part of the API."""
    setup = Setup(box)
    teacher = Teacher(box.settings)
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
        *teacher.endpoints(SETUP),
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


def _only_camera(pairs: tuple[Pair, ...]) -> tuple[Pair, ...]:
    """The pairs without their twin's points, for another twin."""
    return tuple(Pair(name=pair.name, camera_px=pair.camera_px) for pair in pairs if pair.camera_px is not None)


def _moved(pairs: tuple[Pair, ...], old: StoredPicture | None, new: StoredPicture) -> tuple[Pair, ...]:
    """The pairs for a new picture: a smaller or larger one of one shape moves the clicks, another shape drops them."""
    if old is None or (old.width_px, old.height_px) == (new.width_px, new.height_px):
        return pairs
    across, down = new.width_px / old.width_px, new.height_px / old.height_px
    alike = abs(across - down) * max(new.width_px, new.height_px) < 2.0 * max(across, down)
    return tuple(
        Pair(
            name=pair.name,
            camera_px=None
            if pair.camera_px is None or not alike
            else (pair.camera_px[0] * across, pair.camera_px[1] * down),
            twin_px=pair.twin_px,
        )
        for pair in pairs
        if alike or pair.twin_px is not None
    )
