"""Every key of the configuration with its type, default and meaning.

Knows which values make sense on their own; how they fit together (does the start line cross the route?) is found out
when the rooms are built from them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from dnb_edge.config.cars import CarConfig, told_apart
from dnb_edge.config.devices import CaptureConfig, DisplayConfig, RecordConfig
from dnb_edge.config.paths import ConfigPath, DataPath, resolve_rules
from dnb_edge.config.sections import STRICT, Name, Number, Text, Whole, section, to_settings
from dnb_edge.config.web import WebConfig
from dnb_edge.motion.settings import MOST_CARS, MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import FormatRules, LapRules, PenaltyRules, StartRules, check_together
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.values import EntryInfo

Positive = Annotated[Number, Field(gt=0)]
Pixel = tuple[Number, Number]
LaneHsv = tuple[
    Annotated[Number, Field(ge=0, le=360)],
    Annotated[Number, Field(ge=0, le=100)],
    Annotated[Number, Field(ge=0, le=100)],
]


class _Section(BaseModel):
    model_config = STRICT


class MeasuredLength(_Section):
    """One length measured on the floor, and where it lies on the twin."""

    from_px: Pixel
    """One end, twin px (u, v)."""
    to_px: Pixel
    """Other end, twin px (u, v)."""
    length_m: Positive
    """The distance on the floor, metres."""


class TrackConfig(_Section):
    """The route: from the twin's picture, or from a track file that was made of one."""

    name: str = "track"
    """What the track is called in results."""
    file: DataPath | None = None
    """A track file that `dnb-edge track build --out` wrote, instead of everything below."""
    image: DataPath | None = None
    """The twin: a picture of the track from above."""
    lane_hsv: LaneHsv | None = None
    """Colour of the lane: hue in degrees, saturation and value in percent."""
    lane: LaneShade | None = None
    """Instead: dark or light against the floor, auto for either, or between-lines."""
    measured: MeasuredLength | None = None
    """One measured length, which fixes the scale."""
    metres_per_px: Positive | None = None
    """The scale directly, metres per twin px, where it is known."""
    close_gap_px: Positive | None = None
    """The widest seam across the lane that is drawing and not road, twin px; none for 0.4 % of the picture's longest side."""
    closed: bool = True
    """false: the route goes from the first waypoint to the last."""
    waypoints_px: tuple[Pixel, ...] = ()
    """Points on the lane that the route passes, in their order, twin px; none for the only loop, or the outer one of several
    that hang together."""
    start_line_px: tuple[Pixel, Pixel] | None = None
    """The start line from -> to, twin px. Standing at `from` and looking to `to`, cars drive to the left."""
    start_at_px: Pixel | None = None
    """Instead: a place on the route, twin px; the line is drawn across the lane there. A closed route is then driven
    anticlockwise, or in the order of three waypoints or more."""
    finish_line_px: tuple[Pixel, Pixel] | None = None
    """The line where a lap ends, twin px; none for the start line, or for one near the end of a route that is not closed."""
    finish_at_px: Pixel | None = None
    """Instead: a place on the route, twin px."""
    sector_lines_px: tuple[tuple[Pixel, Pixel], ...] = ()
    """More lines whose crossings are told, twin px."""
    sectors_at_px: tuple[Pixel, ...] = ()
    """More such lines, each across the lane at a place on the route, twin px."""

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if self.file is not None:
            fields = type(self).model_fields
            given = [
                name for name in fields if name not in ("name", "file") and getattr(self, name) != fields[name].default
            ]
            if given:
                raise ValueError(f"give file or {given[0]}, not both")
            return self
        if self.lane is not None and self.lane_hsv is not None:
            raise ValueError("give lane_hsv or lane, not both")
        needed: dict[str, object] = {"image": self.image, "lane_hsv": self.lane_hsv or self.lane}
        if self.closed:
            # Which way a closed route is driven is nothing to guess at.
            needed["start_line_px"] = self.start_line_px if self.start_at_px is None else self.start_at_px
        elif len(self.waypoints_px) < 2:
            raise ValueError("closed: false needs waypoints_px: at least two, the route's first and last")
        missing = [name for name, value in needed.items() if value is None]
        if missing:
            raise ValueError(
                f"{missing[0]} is missing: add it (a track needs {', '.join(needed)} and a scale, or a file)"
            )
        if (self.measured is None) == (self.metres_per_px is None):
            raise ValueError("give either measured (from_px, to_px, length_m) or metres_per_px")
        return self


class ViewConfig(_Section):
    """How the camera's pixels map to the twin."""

    keypoints_camera: DataPath | None = None
    """NumPy file (.npy), shape (n, 2): points in the camera's picture, px."""
    keypoints_twin: DataPath | None = None
    """NumPy file (.npy), shape (n, 2): the same points on the twin, px."""
    keypoints: DataPath | None = None
    """YAML file with both, instead of the two NumPy files."""
    calibration: DataPath | None = None
    """A calibration file that `dnb-edge calibrate ... --out` wrote, instead of keypoints: it brings the lens, the camera's
    place and the error at every point with it."""
    image_size_px: tuple[Whole, Whole] | None = None
    """Width and height of the picture on which the camera's points were clicked, where frames are of another size."""
    camera_height_m: Positive | None = None
    """Measured height of the lens above the floor, metres. Only wanted where something above the floor is looked at (markers on
    roofs, detector.point_height_m), and only where the camera looks so steeply down (over 80 degrees) that the keypoints do
    not tell it and the lens is not calibrated."""
    max_mean_error_px: Positive | None = None
    """Mean calibration error above which laps are not scored, twin px; give this or max_mean_error_m."""
    max_mean_error_m: Positive | None = None
    """Mean calibration error above which laps are not scored, metres; give this or max_mean_error_px."""

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        pair = (self.keypoints_camera, self.keypoints_twin)
        if self.calibration is not None:
            given = {"keypoints": self.keypoints, "keypoints_camera": pair[0], "keypoints_twin": pair[1],
                     "image_size_px": self.image_size_px}  # fmt: skip
            for name, value in given.items():
                if value is not None:
                    raise ValueError(f"give calibration or {name}, not both")
            return self
        if self.keypoints is None and None in pair:
            raise ValueError(
                "give calibration (.yaml), keypoints_camera and keypoints_twin (.npy), or keypoints (.yaml)"
            )
        if self.keypoints is not None and pair != (None, None):
            raise ValueError("give keypoints (.yaml) or keypoints_camera and keypoints_twin (.npy), not both")
        return self


class FurtherCameraConfig(_Section):
    """Another camera over the same track: its own source, and its own map to the same twin."""

    view: ViewConfig
    """How its pixels map to the twin."""
    capture: CaptureConfig
    """Where its frames come from; it must name a source."""

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.capture.source is None:
            raise ValueError("capture.source is missing: say which camera it is, such as v4l2:/dev/v4l/by-id/...")
        return self


class MarkersConfig(_Section):
    """The markers on the cars' roofs, for the detector `markers`."""

    dictionary: str = "4X4_50"
    """Family of the markers: 4X4_50 to 7X7_1000, APRILTAG_16h5 to APRILTAG_36h11."""
    marker_size_m: Positive = 0.07
    """Side of the marker's black square, metres."""
    marker_height_m: Positive = 0.1
    """Height of the marker above the floor, metres."""
    marker_ahead_m: Number = 0.0
    """How far the marker's centre lies ahead of the car's centre, towards the nose, metres."""
    car_length_m: Positive = 0.235
    """Length of the car, metres."""
    ids: tuple[Whole, ...] = ()
    """Numbers of the markers that are cars; none: all of the family."""
    full_look_every: Annotated[Whole, Field(ge=0)] = 15
    """While cars are followed, the whole frame is looked at every n-th frame too; 0: never."""
    missing_look_every: Annotated[Whole, Field(ge=0)] = 5
    """The same while one of `ids` is not seen; 0: never."""
    least_confidence: Annotated[Number, Field(gt=0, lt=1)] = 0.6
    """Share of a square's light and dark that the code must explain for it to count as read."""


class DetectorConfig(_Section):
    """What finds the car."""

    kind: Literal["auto", "centre", "ultralytics", "markers"] = "auto"
    """`centre`: our own network; `ultralytics`: a model that Ultralytics exported; `markers`: markers on the roofs; `auto`:
    the first or the second, as the model's file tells."""
    model: ConfigPath | None = None
    """An ONNX model: one of ours with its card (.json) beside it, or one exported by Ultralytics; none for the built-in one."""
    threads: Annotated[Whole, Field(ge=1, le=16)] = 1
    """Processor threads that the detector may use."""
    classes: tuple[str | Whole, ...] | None = None
    """Ultralytics only: names or numbers of the classes that are cars; none for all."""
    min_confidence: Annotated[Number, Field(ge=0, le=1)] = 0.25
    """Ultralytics only: what is less sure is no car."""
    iou: Annotated[Number, Field(ge=0, le=1)] = 0.7
    """Ultralytics only: of boxes of one class that overlap by more the surest stays; idle where NMS is inside the model."""
    shift_ratio: Number = 0.0
    """Ultralytics only: the ground point lies as many box heights below the box's centre (0.5: its lower edge)."""
    point_height_m: Annotated[Number, Field(ge=0)] = 0.0
    """Ultralytics only: how far above the floor the point lies that counts as the car's place, metres. A box's centre lies
    about half the car's height above it; the camera's place then brings it down to the floor."""
    sigma_ratio: Positive = 0.05
    """Ultralytics only: one sigma of the ground point as a share of the box's longest side."""
    markers: MarkersConfig = MarkersConfig()
    """The markers on the roofs, where kind is `markers`."""


class EntryConfig(_Section):
    """Who or what drives: a network under test, or a person."""

    name: Name | None = None
    """Name of the entry in tables; none for the top-level `name`."""
    version: Text = ""
    """Version of the network; entries of one name and several versions are compared."""
    checkpoint: ConfigPath | None = None
    """File of the network's weights: its SHA-256 goes into the recording, the file does not."""
    notes: str = ""
    """Anything else worth knowing; goes into the recording."""


Motion = section(MotionSettings)
Crossing = section(CrossingSettings)
Laps = section(LapRules)
Scoring = section(ScoreSettings)
Start = section(StartRules)
Format = section(FormatRules)
Penalties = section(PenaltyRules)

DEFAULT_RULES = "practice"

MOST_FURTHER = 3
"""Cameras besides the first: a board's USB has no room for more."""


class Config(_Section):
    """Everything that a run can be told."""

    version: Literal[1] = 1
    """Version of this format."""
    name: Name = "run"
    """Who or what is driving: short for `entry.name`."""
    entry: EntryConfig = EntryConfig()
    """Who or what is driving, with version and checkpoint."""
    session: Name | None = None
    """Name of the session: the runs under one track, calibration and set of rules, which are to be compared."""
    data_dir: ConfigPath | None = None
    """Folder of the input data (twin, keypoints); none for the config file's own."""
    rules: Annotated[str, BeforeValidator(resolve_rules)] = DEFAULT_RULES
    """The rule set: one of those that `dnb-edge config rules` lists, or the path of a YAML file. Keys that this configuration
    gives itself in race, start, format, penalties and score win over it."""
    track: TrackConfig
    view: ViewConfig
    detector: DetectorConfig = DetectorConfig()
    capture: CaptureConfig = CaptureConfig()
    further_cameras: Annotated[tuple[FurtherCameraConfig, ...], Field(max_length=MOST_FURTHER)] = ()
    """Cameras over the same track besides the one of `view` and `capture`, where that does not see all of it."""
    motion: Motion = Motion()  # type: ignore[valid-type]
    crossing: Crossing = Crossing()  # type: ignore[valid-type]
    race: Laps = Laps()  # type: ignore[valid-type]
    start: Start = Start()  # type: ignore[valid-type]
    format: Format = Format()  # type: ignore[valid-type]
    penalties: Penalties = Penalties()  # type: ignore[valid-type]
    score: Scoring = Scoring()  # type: ignore[valid-type]
    cars: Annotated[tuple[CarConfig, ...], Field(max_length=MOST_CARS), AfterValidator(told_apart)] = ()
    """The cars that take part, in the order of their numbers; none: numbered as they first cross the start line. With cars,
    motion.cars is their number."""
    record: RecordConfig = RecordConfig()
    display: DisplayConfig = DisplayConfig()
    web: WebConfig = WebConfig()

    @model_validator(mode="after")
    def _one_driver(self) -> Self:
        own, short = self.entry.name, self.name if "name" in self.model_fields_set else None
        # A configuration as `config show` prints it has every key, the default name too.
        if own is not None and short not in {None, own, type(self).model_fields["name"].default}:
            raise ValueError(f"name is {short!r} and entry.name is {own!r}: give one of the two")
        if own is None and short is None and self.entry != EntryConfig():
            raise ValueError("entry has no name: say in entry.name who or what drives")
        return self

    @property
    def driver(self) -> EntryInfo:
        """The entry as far as the configuration tells it: without its checkpoint's hash."""
        name = self.name if self.entry.name is None else self.entry.name
        return EntryInfo(name=name, version=self.entry.version, notes=self.entry.notes)

    @model_validator(mode="before")
    @classmethod
    def _as_many_as_cars(cls, data: Any) -> Any:
        """`motion.cars` is the number of the cars, unless it is given."""
        if not isinstance(data, dict) or not isinstance(data.get("cars"), list) or not data["cars"]:
            return data
        motion = data.get("motion", {})
        if not isinstance(motion, dict):
            return data
        return data | {"motion": {"cars": min(len(data["cars"]), MOST_CARS)} | motion}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        check_together(
            to_settings(LapRules, self.race),
            to_settings(StartRules, self.start),
            to_settings(FormatRules, self.format),
            to_settings(PenaltyRules, self.penalties),
        )
        followed = to_settings(MotionSettings, self.motion).cars
        if len(self.cars) > followed:
            raise ValueError(f"motion.cars: {followed} is too few for {len(self.cars)} cars: raise it, or leave it out")
        for k, car in enumerate(self.cars):
            ids = self.detector.markers.ids
            if car.marker is not None and self.detector.kind != "markers":
                raise ValueError(f"cars.{k}.marker: only the detector `markers` reads it: set detector.kind: markers")
            if car.marker is not None and ids and car.marker not in ids:
                raise ValueError(f"cars.{k}.marker: {car.marker} is none of detector.markers.ids: add it there")
        return self
