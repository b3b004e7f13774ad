"""The set-up draft: all that a user has told so far of camera, twin, route, keypoints and lines, as one immutable value.

It lies in `setup/draft/` as draft.json with the pictures that it names, each under a name with its content's hash, so that it
survives a reload, a restart and a power cut. Knows what a draft holds and where; knows no route and no map (`setup_track`,
`setup_keypoints`).
"""

from __future__ import annotations

import hashlib
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, Field, ValidationError, model_validator

from dnb_edge.config.devices import CaptureConfig
from dnb_edge.config.document import first_fault
from dnb_edge.config.sections import STRICT, Name, Number, Whole
from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import write_whole
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.track.scale import TwinScale
from dnb_edge.web.setup_upload import Upload

MOST_PAIRS = 60
MOST_WAYPOINTS = 100
MOST_SECTORS = 20

_Coordinate = Annotated[Number, Field(ge=-1e6, le=1e6)]
Px = tuple[_Coordinate, _Coordinate]
"""A place in a picture, px (u, v)."""
EndsPx = tuple[Px, Px]
"""A line's ends, twin px; crossed forward towards its left."""
Positive = Annotated[Number, Field(gt=0, le=1e6)]


class Part(BaseModel):
    """A part of the draft: no unknown keys, no infinities, no change."""

    model_config = STRICT


class StoredPicture(Part):
    """A picture in the draft's directory."""

    file: Annotated[str, Field(pattern=r"^[a-z]+-[0-9a-f]{16}\.(png|jpg)$")]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    width_px: Whole
    height_px: Whole
    from_camera: bool = False
    """Whether the box's own camera took it; then frames have its size."""


class StoredModel(Part):
    """A detector's model in the draft's directory."""

    file: Annotated[str, Field(pattern=r"^model-[0-9a-f]{16}\.onnx$")]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    with_card: bool
    """Whether its card lies beside it, under the same name with .json: our own networks have one."""

    @property
    def files(self) -> tuple[str, ...]:
        """The names of all its files."""
        return (self.file, *((f"{self.file.removesuffix('.onnx')}.json",) if self.with_card else ()))


class CameraChoice(Part):
    """What is asked of the camera; None leaves it as it is."""

    source: Annotated[str, Field(max_length=300)] | None = None
    fps: Annotated[Number, Field(gt=0, le=1000)] | None = None
    exposure_us: Literal["auto"] | Positive | None = None
    gain: Annotated[Number, Field(ge=0, le=1e6)] | None = None
    white_balance_k: Literal["auto"] | Positive | None = None
    focus: Literal["auto"] | Annotated[Number, Field(ge=0, le=1e6)] | None = None
    power_line_hz: Literal["off", "auto", 50, 60] | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """Raises where the configuration would not take it."""
        scheme = None if self.source is None else self.source.partition(":")[0]
        if scheme not in (None, "v4l2", "libcamera", "sim"):
            raise ValueError(
                "source: must be a camera, such as v4l2:/dev/video0 or libcamera:0, or sim: for the simulator"
            )
        CaptureConfig.model_validate(self.model_dump(exclude_none=True))
        return self


class LaneChoice(Part):
    """What tells the lane from the floor: its colour at a place of the twin, or its shade."""

    at_px: Px | None = None
    hsv: tuple[Number, Number, Number] | None = None
    """The colour there: hue in degrees, saturation and value in percent."""
    shade: LaneShade | None = None


class RouteChoice(Part):
    """Which way through the lanes."""

    closed: bool = True
    waypoints_px: Annotated[tuple[Px, ...], Field(max_length=MOST_WAYPOINTS)] = ()
    """Twin px, in the order of driving; none for the only loop."""
    close_gap_px: Positive | None = None
    """The widest seam across the lane that is closed, such as the start line's tape, twin px; none for a little."""


class Measured(Part):
    """A line on the twin of which the length on the floor was measured."""

    from_px: Px
    to_px: Px
    length_m: Positive


class ScaleChoice(Part):
    """One of three ways to tell the twin's scale."""

    measured: Measured | None = None
    lap_m: Positive | None = None
    """Length of one lap, down the middle of the lane."""
    metres_per_px: Positive | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if [self.measured, self.lap_m, self.metres_per_px].count(None) != 2:
            raise ValueError("give one of measured, lap_m and metres_per_px")
        if self.measured is not None:
            try:
                TwinScale.from_measured_length(**self.measured.model_dump(), height_px=1.0)
            except InputError as error:
                raise ValueError(str(error).removeprefix("twin scale: ")) from error
        return self


class Pair(Part):
    """One place, clicked in the camera's picture and on the twin; None where it is not clicked yet."""

    name: Annotated[Name, Field(max_length=20)]
    camera_px: Px | None = None
    twin_px: Px | None = None


class Lines(Part):
    """The lines across the route, twin px."""

    start_px: EndsPx | None = None
    finish_px: EndsPx | None = None
    sectors_px: Annotated[tuple[EndsPx, ...], Field(max_length=MOST_SECTORS)] = ()


class Draft(Part):
    """All of it."""

    version: Literal[1] = 1
    revision: Whole = 0
    """Grows by one with every change."""
    name: Annotated[Name, Field(max_length=80)] = "track"
    """The track's name."""
    camera: CameraChoice = CameraChoice()
    photo: StoredPicture | None = None
    """The camera's picture on which keypoints are clicked."""
    twin: StoredPicture | None = None
    lane: LaneChoice | None = None
    route: RouteChoice = RouteChoice()
    scale: ScaleChoice | None = None
    pairs: Annotated[tuple[Pair, ...], Field(max_length=MOST_PAIRS)] = ()
    limit_mm: Positive = 20.0
    """Mean error of the keypoints above which laps are not scored, mm on the floor."""
    lines: Lines = Lines()
    model: StoredModel | None = None
    """What finds the car; None for the model that came with the box."""
    saved_revision: Whole | None = None
    """The revision that was last put in place; None before the first time."""


class DraftStore:
    """The draft on the disk. Safe for several threads of one process."""

    def __init__(self, setup: Path) -> None:
        """`setup`: the directory that holds the saved configuration, made where it is missing."""
        self.folder = setup / "draft"
        self._path = self.folder / "draft.json"
        self._lock = threading.Lock()

    def load(self) -> Draft:
        """The draft; an empty one where there is none. Raises `InputError` for one that is damaged."""
        try:
            text = self._path.read_bytes()
        except FileNotFoundError:
            return Draft()
        except OSError as error:
            raise WorkError(f"the draft cannot be read ({error.strerror or error}): look at the box's disk") from error
        try:
            return Draft.model_validate_json(text)
        except ValidationError as error:
            raise InputError(f"the draft is damaged ({first_fault(error)}): begin anew") from error

    def change(self, change: Callable[[Draft], Draft]) -> Draft:
        """Puts what `change` makes of the draft in its place and returns it. Raises `WorkError` where the disk refuses."""
        with self._lock:
            old = self.load()
            new = change(old)
            if new == old:
                return old
            new = new.model_copy(update={"revision": old.revision + 1})
            self._write(new)
            return new

    def saved(self, revision: int) -> Draft:
        """Notes that `revision` was put in place."""
        with self._lock:
            new = self.load().model_copy(update={"saved_revision": revision})
            self._write(new)
            return new

    def discard(self) -> Draft:
        """Forgets everything, the pictures, too; what was saved stays. Raises `WorkError` where the disk refuses."""
        with self._lock:
            try:
                if self.folder.exists():
                    shutil.rmtree(self.folder)
            except OSError as error:
                raise WorkError(f"the draft cannot be deleted: {error.strerror or error}") from error
            return Draft()

    def keep(self, kind: str, upload: Upload, *, from_camera: bool = False) -> StoredPicture:
        """Stores a checked picture. Raises `WorkError` where the disk refuses."""
        sha256 = hashlib.sha256(upload.data).hexdigest()
        stored = StoredPicture(
            file=f"{kind}-{sha256[:16]}{upload.suffix}",
            sha256=sha256,
            width_px=upload.width_px,
            height_px=upload.height_px,
            from_camera=from_camera,
        )
        self.write(stored.file, upload.data)
        return stored

    def write(self, name: str, data: bytes) -> None:
        """Stores a file that a later change of the draft may name. Raises `WorkError` where the disk refuses."""
        self._make_folder()
        _written(self.folder / name, data)

    def path(self, picture: StoredPicture) -> Path:
        """Where the picture lies."""
        return self.folder / picture.file

    def _write(self, draft: Draft) -> None:
        self._make_folder()
        _written(self._path, draft.model_dump_json(indent=1).encode())
        named = {picture.file for picture in (draft.photo, draft.twin) if picture is not None}
        named |= set() if draft.model is None else set(draft.model.files)
        for path in self.folder.glob("*-????????????????.*"):
            if path.name not in named:
                path.unlink(missing_ok=True)

    def _make_folder(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WorkError(f"{self.folder}: cannot be made: {error.strerror or error}") from error


def _written(path: Path, data: bytes) -> None:
    """As `write_whole`; what the user cannot mend from a page is the box's fault, not the input's."""
    try:
        write_whole(path, data)
    except InputError as error:
        raise WorkError(str(error)) from error
