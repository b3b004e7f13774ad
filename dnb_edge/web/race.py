"""What the daemon does now and has a picture of, and asking it for another run or for the camera alone.

Knows the daemon's line; knows nothing of laps.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge import __version__
from dnb_edge.live.messages import State
from dnb_edge.web.box import Box
from dnb_edge.web.endpoint import API, Access, Endpoint
from dnb_edge.web.setup_draft import CameraChoice

PICTURE_WAIT_S = 5.0

_STRICT = ConfigDict(extra="forbid", strict=True)


class StateAnswer(BaseModel):
    """What there is to know at once; the live stream tells how it goes on."""

    version: str = Field(description="Of dnb-edge.")
    epoch: str | None = Field(description="The timing service's process; null before the first.")
    next: int = Field(
        description="The number after that of the last event that is kept: live?since= goes on from there."
    )
    state: State | None = Field(description="What the timing service does; null while it is down.")


class NewRunBody(BaseModel):
    """Another run."""

    model_config = _STRICT

    entry: Annotated[str, Field(min_length=1, max_length=100, pattern=r"\S")] | None = Field(
        default=None, description="Who or what drives; null for the configuration's own."
    )


class AimBody(BaseModel):
    """The camera alone, or a race."""

    model_config = _STRICT

    aim: bool = Field(description="True for pictures only, false to race again.")
    camera: CameraChoice | None = Field(
        default=None, description="What to ask of the camera meanwhile, to see what it does; races take what is saved."
    )


class DoneAnswer(BaseModel):
    """It is done."""

    done: bool


class PictureQuery(BaseModel):
    """Which picture."""

    model_config = ConfigDict(extra="forbid")

    after: int | None = Field(
        default=None,
        ge=0,
        lt=2**63,
        description="t_ns of the picture that is there already: the answer waits for another one.",
    )


class Race:
    """The handlers."""

    def __init__(self, box: Box) -> None:
        self._daemon = box.daemon

    async def state(self, _request: Request) -> Response:
        """GET /api/v1/state."""
        state, events = self._daemon.state, self._daemon.events()
        following = events[-1].sequence + 1 if events else 0 if state is None else state.first_sequence
        answer = StateAnswer(version=__version__, epoch=self._daemon.epoch, next=following, state=state)
        return JSONResponse(answer.model_dump(mode="json"))

    async def new(self, request: Request) -> Response:
        """POST /api/v1/race/new."""
        await self._daemon.ask(new_run=True, entry=request.state.body.entry)
        return _done()

    async def aim(self, request: Request) -> Response:
        """POST /api/v1/race/aim."""
        body: AimBody = request.state.body
        camera = None if body.camera is None or not body.aim else body.camera.model_dump(exclude_none=True)
        await self._daemon.ask(aim=body.aim, camera=camera)
        return _done()

    async def picture(self, request: Request) -> Response:
        """GET /api/v1/picture.jpg."""
        picture = await self._daemon.picture(newer_than_ns=request.state.query.after, timeout_s=PICTURE_WAIT_S)
        headers = {
            "X-Picture-T-Ns": str(picture.t_ns),
            "X-Picture-Frame": str(picture.frame),
            "X-Picture-Size": f"{picture.width_px}x{picture.height_px}",
        }
        return Response(picture.jpeg, media_type="image/jpeg", headers=headers)


def endpoints(box: Box) -> tuple[Endpoint, ...]:
    """The daemon's part of the API."""
    race = Race(box)
    return (
        Endpoint(
            method="GET",
            path=f"{API}/state",
            access=Access.ALL,
            handler=race.state,
            summary="What the timing service does now",
            answer=StateAnswer,
        ),
        Endpoint(
            method="POST",
            path=f"{API}/race/new",
            access=Access.CHANGE,
            handler=race.new,
            summary="Finish this run's recording and begin another run",
            body=NewRunBody,
            answer=DoneAnswer,
        ),
        Endpoint(
            method="POST",
            path=f"{API}/race/aim",
            access=Access.CHANGE,
            handler=race.aim,
            summary="Finish the run and give pictures only, or race again",
            body=AimBody,
            answer=DoneAnswer,
        ),
        Endpoint(
            method="GET",
            path=f"{API}/picture.jpg",
            access=Access.CHANGE,
            handler=race.picture,
            summary="A camera picture, or the next one after another",
            query=PictureQuery,
            answer_types=("image/jpeg",),
        ),
    )


def _done() -> Response:
    return JSONResponse(DoneAnswer(done=True).model_dump())
