"""The JSON of the set-up's part of the API: what its bodies must be and what it answers.

Knows pydantic and the draft's own parts.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from dnb_edge.config.sections import Name, Number
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.web.setup_draft import (
    MOST_PAIRS,
    MOST_SECTORS,
    Draft,
    EndsPx,
    Pair,
    Part,
    Positive,
    Px,
    RouteChoice,
    ScaleChoice,
)

StepState = Literal["done", "wrong", "open"]


class LaneBody(Part):
    """What the lane looks like: the twin's colour at a place, or a shade. Give one."""

    at_px: Px | None = None
    shade: LaneShade | None = None


class RouteBody(RouteChoice):
    """Which way through the lanes, and the scale; both are replaced."""

    name: Annotated[Name, Field(max_length=80)] | None = None
    """The track's name; none leaves it."""
    scale: ScaleChoice | None = None


class KeypointsBody(Part):
    """All keypoints, in their order."""

    pairs: Annotated[tuple[Pair, ...], Field(max_length=MOST_PAIRS)]
    limit_mm: Positive | None = None
    """Mean error above which laps are not scored, mm; none leaves it."""


class LineBody(Part):
    """One line: its ends, or a place on the route across whose lane it is drawn. Give one."""

    ends_px: EndsPx | None = None
    at_px: Px | None = None
    flipped: bool = False
    """With at_px: crossed against the way that the track is driven now."""


class LinesBody(Part):
    """All lines across the route; none of a kind removes it."""

    start: LineBody | None = None
    finish: LineBody | None = None
    sectors: Annotated[tuple[LineBody, ...], Field(max_length=MOST_SECTORS)] = ()


class FlattenBody(Part):
    """A rectangle on the floor, by which the camera's picture is made a twin."""

    corners_px: tuple[Px, Px, Px, Px]
    """In the camera's picture: top left, top right, bottom right, bottom left as they are to lie on the twin."""
    width_m: Annotated[Number, Field(gt=0, le=100)]
    height_m: Annotated[Number, Field(gt=0, le=100)]


class LookQuery(BaseModel):
    """Which picture."""

    model_config = ConfigDict(extra="forbid")

    after: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    """t_ns of the picture that was looked at already: the answer waits for another one."""


class VersionQuery(BaseModel):
    """Which version of a picture: for the browser, whose copy it tells from another."""

    model_config = ConfigDict(extra="forbid")

    v: Annotated[str, Field(max_length=64)] | None = None
    """Any text."""


class Answered(BaseModel):
    """What every answer obeys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class StepSaid(Answered):
    """How far one step of the set-up is."""

    key: str
    title: str
    state: StepState
    text: str
    """What is done, what is wrong, or what to do."""
    needs: list[str]
    """Keys of the steps that come first: without them this one has nothing to show."""


class LoopSaid(Answered):
    """One of several loops that the route may be."""

    letter: str
    points_px: list[tuple[float, float]]
    waypoints_px: list[tuple[float, float]]
    length_px: float


class LineSaid(Answered):
    """A line across the route, twin px."""

    name: str
    ends_px: tuple[tuple[float, float], tuple[float, float]]
    s_m: float | None = None


class TrackSaid(Answered):
    """The track as it is understood, for drawing on the twin; twin px."""

    middle_px: list[tuple[float, float]]
    left_px: list[tuple[float, float]]
    right_px: list[tuple[float, float]]
    closed: bool
    lines: list[LineSaid]
    """The start line first: where nobody has drawn one, a proposal."""
    length_px: float
    lane_width_px: float
    metres_per_px: float | None
    length_m: float | None
    lane_width_m: float | None


class PointSaid(Answered):
    """One keypoint that is clicked on both sides."""

    name: str
    state: Literal["good", "wrong", "suspect", "swapped"]
    error_px: float | None
    """Of plain least squares, twin px, as the command line tells it."""
    error_mm: float | None
    put_px: tuple[float, float] | None
    """Where the map puts the click, twin px."""


class KeypointsSaid(Answered):
    """What the keypoints tell."""

    points: list[PointSaid]
    fault: str | None
    swapped: list[str]
    mean_px: float | None = None
    max_px: float | None = None
    leave_one_out_px: float | None = None
    mean_mm: float | None = None
    leave_one_out_mm: float | None = None
    likely_mean_mm: float | None = None
    """Of the most likely map, which the limit is for."""
    sigma_p50: float | None = None
    sigma_p95: float | None = None
    sigma_unit: str = "mm"
    over_limit: str | None = None
    notes: list[str] = []
    advice: list[str] = []
    camera_to_twin: list[float] | None = None
    """The map: homography 3x3, camera px to twin px, row by row."""
    lane_camera_px: list[list[tuple[float, float]]] = []
    """The lane's middle and edges in the camera's picture, polylines."""


class SetupAnswer(Answered):
    """The draft and all that follows from it."""

    draft: Draft
    steps: list[StepSaid]
    track: TrackSaid | None
    loops: list[LoopSaid]
    keypoints: KeypointsSaid
    configured: bool
    """Whether a configuration is in place."""


class LookAnswer(Answered):
    """How good the camera's picture is now."""

    t_ns: int
    width_px: int
    height_px: int
    sharpness: dict[str, float]
    """By part of the picture (middle, top left, ...): the more the sharper; only good to compare with itself."""
    dark_share: float
    """Share of px without any light left in them."""
    bright_share: float
    """Share of px without any shade left in them."""
    fault: str | None
    """What is wrong with the picture, in words."""
    flicker: str | None = None
    """What to do about lamps that flicker in the pictures of the last seconds; null where none do, or too few were seen."""


class SaveAnswer(Answered):
    """What became of saving."""

    draft: Draft
    files: list[str]
    """What was written, in the set-up's directory."""
    run: Literal["new", "later"]
    """Whether the daemon races with it already."""
    text: str


class TeachAnswer(Answered):
    """How to teach the detector one's own car."""

    recording: str | None
    """The newest recording's name, from which to teach; None where there is none."""
    text: str
    commands: list[str]
