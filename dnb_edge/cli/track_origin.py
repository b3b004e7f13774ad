"""The options of `track build` that say what the track is taken from, and which of the others go with each."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from dnb_edge.archive import coordinates
from dnb_edge.cli.track_drive import from_drive
from dnb_edge.cli.track_from import (
    Made,
    ShowLoops,
    from_photos,
    from_recordings,
    load_photos,
    made_of_files,
    pictures_of,
)
from dnb_edge.cli.track_lane import USUAL_TOLERANCE, LaneOptions
from dnb_edge.config.schema import DetectorConfig
from dnb_edge.config.track_file import MadeOf
from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings
from dnb_edge.view.rectify import Extent


class WhichDetector(StrEnum):
    """What finds the car that is driven to define the track."""

    AUTO = "auto"
    MARKERS = "markers"


Photos: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option(help="A photograph of the empty track from the calibrated camera; of several the median is taken."),
]
Source: TypeAlias = Annotated[
    str | None, typer.Option(help="Instead: a clip or camera, such as file:clip.mp4; the median forgets what moves.")
]
Laps: TypeAlias = Annotated[
    list[Path] | None, typer.Option(help="A recording (MCAP) whose laps define the track; repeat it for several.")
]
Drive: TypeAlias = Annotated[
    str | None,
    typer.Option(help="A clip or camera before which a car is driven or pushed round: it learns the track from that."),
]
CalibrationFile: TypeAlias = Annotated[
    Path | None, typer.Option(help="The calibration of the camera, for --photo, --source and --drive.")
]
Area: TypeAlias = Annotated[
    str | None,
    typer.Option(help="The floor on which the lane is sought: x0,y0,x1,y1, track m. None: all that is seen."),
]
LaneWidth: TypeAlias = Annotated[
    float | None, typer.Option(help="The lane's width for --laps and --drive, m. None: as wide as the laps and a car.")
]
Rounds: TypeAlias = Annotated[int | None, typer.Option(min=1, help="With --drive: end after so many rounds. None: 3.")]
DetectorKind: TypeAlias = Annotated[
    WhichDetector | None,
    typer.Option(help="With --drive: what finds the car, the network (auto) or markers on its roof."),
]
Model: TypeAlias = Annotated[Path | None, typer.Option(help="With --drive: another detector model (.onnx).")]
TwinOut: TypeAlias = Annotated[
    Path | None, typer.Option(help="Write the twin made of photographs, recording or drive (PNG) here.")
]

_USUAL_ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """What the options say the track is taken from."""

    image: Path | None
    photos: tuple[Path, ...]
    source: str | None
    laps: tuple[Path, ...]
    drive: str | None
    calibration: Path | None
    lane: LaneOptions
    area: str | None
    lane_width_m: float | None
    rounds: int | None
    detector: WhichDetector | None
    model: Path | None
    other: dict[str, object]
    """Options of the drawing and of the route through a picture, by name; None or empty where not given."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that are read; a source's `file:` too."""
        uris = [uri for uri in (self.source, self.drive) if uri is not None and uri.startswith(("file:", "mcap:"))]
        given = (self.image, *self.photos, *self.laps, self.calibration, self.model)
        return (*(path for path in given if path is not None), *(Path(uri.split(":", 1)[1]) for uri in uris))

    @property
    def name(self) -> str:
        """What the track is called where nobody says."""
        files = [path for path in (self.image, *self.photos, *self.laps) if path is not None]
        return files[0].stem if files else "track"

    @property
    def source_name(self) -> str:
        """As errors name the origin."""
        files = [str(path) for path in (self.image, *self.photos, *self.laps) if path is not None]
        return ", ".join(files) if files else str(self.source or self.drive)

    def check(self) -> None:
        """Raises `InputError` where there is no origin, or several, or an option that goes with another."""
        given = [name for name, value in self._origins().items() if value]
        if not given:
            raise InputError("nothing to build a track from: give --image, --photo, --source, --laps or --drive")
        if len(given) > 1:
            raise InputError(f"{given[0]} and {given[1]}: a track is built from one of them: leave the other out")
        (origin,) = given
        for name, value in self._options().items():
            if value and origin not in _GOES_WITH[name]:
                raise InputError(f"{name}: goes with {' or '.join(_GOES_WITH[name])}, not with {origin}: leave it out")
        if origin in _GOES_WITH["--calibration"] and self.calibration is None:
            raise InputError(f"{origin}: needs the camera's calibration: give --calibration FILE")
        if self.lane_width_m is not None and not 0 < self.lane_width_m < float("inf"):
            raise InputError(f"--lane-width-m {self.lane_width_m:g}: must be a positive number of metres")

    def made(self, settings: TrackSettings, show_loops: ShowLoops) -> Made:
        """The route from anything but a drawing. Raises `InputError` as its origin does."""
        if self.laps:
            return from_recordings(self.laps, settings, lane_width_m=self.lane_width_m)
        assert self.calibration is not None, "checked"
        if self.drive is not None:
            detector = DetectorConfig(kind="auto" if self.detector is None else self.detector.value, model=self.model)
            return from_drive(
                self.drive,
                self.calibration,
                detector,
                settings,
                rounds=_USUAL_ROUNDS if self.rounds is None else self.rounds,
                lane_width_m=self.lane_width_m,
            )
        photos = load_photos(self.photos) if self.source is None else pictures_of(self.source)
        made_of = (
            made_of_files(self.photos, settings.waypoints_px)
            if self.photos
            else MadeOf(waypoints_px=settings.waypoints_px)
        )
        return from_photos(
            photos, self.calibration, self.lane, settings, area_m=self._area_m(), made_of=made_of, show_loops=show_loops
        )

    def _area_m(self) -> Extent | None:
        if self.area is None:
            return None
        x0, y0, x1, y1 = coordinates.numbers("--area", self.area, 4)
        if not (x0 < x1 and y0 < y1):
            raise InputError(f"--area {self.area}: must be two opposite corners, the lesser x and y first, track m")
        return x0, y0, x1, y1

    def _origins(self) -> dict[str, object]:
        return {
            "--image": self.image,
            "--photo": self.photos,
            "--source": self.source,
            "--laps": self.laps,
            "--drive": self.drive,
        }

    def _options(self) -> dict[str, object]:
        lane = self.lane
        return {
            "--calibration": self.calibration,
            "--area": self.area,
            "--lane": lane.shade,
            "--lane-hsv": lane.hsv,
            "--lane-hex": lane.hex_colour,
            "--lane-pixel": lane.pixel,
            "--lane-tolerance": lane.tolerance if lane.tolerance != USUAL_TOLERANCE else None,
            "--lane-width-m": self.lane_width_m,
            "--rounds": self.rounds,
            "--detector": self.detector,
            "--model": self.model,
            **self.other,
        }


_PHOTO, _DRIVEN = ("--photo", "--source"), ("--laps", "--drive")
_PICTURE = ("--image", *_PHOTO)
_GOES_WITH: dict[str, tuple[str, ...]] = {
    "--calibration": (*_PHOTO, "--drive"),
    "--area": _PHOTO,
    "--lane": _PICTURE,
    "--lane-hsv": _PICTURE,
    "--lane-hex": _PICTURE,
    "--lane-pixel": _PICTURE,
    "--lane-tolerance": _PICTURE,
    "--lane-width-m": _DRIVEN,
    "--rounds": ("--drive",),
    "--detector": ("--drive",),
    "--model": ("--drive",),
    "--length-m": ("--image",),
    "--measured": ("--image",),
    "--metres-per-px": ("--image",),
    "--twin-out": (*_PHOTO, *_DRIVEN),
    "--waypoint": _PICTURE,
    "--open": _PICTURE,
    "--close-gap-px": _PICTURE,
}
