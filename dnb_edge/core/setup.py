"""Everything that decides what the core makes of detections, as one value that goes into the recording.

Knows the settings of all rooms and their stored form; decides nothing itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

from dnb_edge import wire
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import CarSetup, FormatRules, LapRules, PenaltyRules, StartRules, rules_digest
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.model import Track
from dnb_edge.view.calibration import Covariance9
from dnb_edge.view.ground import GroundMap

_BEFORE = {"regain_s": 0.0}
"""Settings of recordings from before these settings existed: what the core did then."""

_OLDER: dict[str, Any] = {
    "start": {}, "format": {}, "penalties": {}, "rules": "practice", "rules_version": "1", "cars": [],
    "map_covariance": None, "row_s": 0.0, "further": [],
}  # fmt: skip
"""Members that recordings from before them lack."""

_OF_OBSTACLES = (("race", "obstacles"), ("race", "collision_m"), ("penalties", "collision"))
"""Rules that say nothing where no obstacle stands: section and key."""

CAMERA_GAP_S = 1.0
"""A camera that sends nothing for so long was away, or nobody took its frames; the slowest source has a frame a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraView:
    """What the core knows of one camera over the track."""

    ground: GroundMap
    map_covariance: Covariance9 | None = None
    """Covariance of the map's homography, as in `Calibration`, for frames of `ground`'s size; None where it is not known."""
    row_s: float = 0.0
    """Time from one row of the picture to the next (rolling shutter), seconds; 0 where all are seen at once or nobody knows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreSetup:
    """Everything that decides what the core makes of detections."""

    track: Track
    ground: GroundMap
    motion: MotionSettings
    crossing: CrossingSettings
    laps: LapRules
    score: ScoreSettings
    not_scored_because: str | None = None
    """Why laps get no similarity (the calibration is too wrong, say); None where they get one."""
    birth_margin_m: float = 0.1
    """How far beyond the lane's edge an observation still counts as on the lane, metres."""
    start: StartRules = field(default_factory=StartRules)
    format: FormatRules = field(default_factory=FormatRules)
    penalties: PenaltyRules = field(default_factory=PenaltyRules)
    rules: str = "practice"
    """Name of the rule set."""
    rules_version: str = "1"
    """Version of the rule set."""
    cars: tuple[CarSetup, ...] = ()
    """The cars that take part, in the order of their numbers; empty: numbered as they first cross the start line."""
    map_covariance: Covariance9 | None = None
    """Covariance of the map's homography, as in `Calibration`, for frames of `ground`'s size; None where it is not known."""
    row_s: float = 0.0
    """Time from one row of the picture to the next (rolling shutter), seconds; 0 where all are seen at once or nobody knows."""

    camera_gap_s: float | None = CAMERA_GAP_S
    """The longest time between two frames after which a lap is not marked, seconds; None: laps are never marked for it."""

    further: tuple[CameraView, ...] = ()
    """The cameras after the first, which `ground`, `map_covariance` and `row_s` are of; all maps lead to one track plane."""

    @property
    def views(self) -> tuple[CameraView, ...]:
        """Every camera's, by its number."""
        first = CameraView(ground=self.ground, map_covariance=self.map_covariance, row_s=self.row_s)
        return (first, *self.further)

    @property
    def rules_digest(self) -> str:
        """Stands for all rules in force, whatever their set is called; results under another digest are not comparable."""
        settings = {
            "race": self.laps,
            "start": self.start,
            "format": self.format,
            "penalties": self.penalties,
            "score": self.score,
        }
        sections = {name: wire.to_dict(section) for name, section in settings.items()}
        if not self.laps.obstacles:
            # Nothing can be hit, so its price is none of the rules: those of older recordings have the digest that they had.
            for section, key in _OF_OBSTACLES:
                del sections[section][key]
        return rules_digest(sections)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal setup, bit for bit."""
        return {
            "track": self.track.to_dict(),
            "ground": self.ground.to_dict(),
            "motion": wire.to_dict(self.motion),
            "crossing": wire.to_dict(self.crossing),
            "laps": wire.to_dict(self.laps),
            "score": wire.to_dict(self.score),
            "not_scored_because": self.not_scored_because,
            "birth_margin_m": self.birth_margin_m,
            "start": wire.to_dict(self.start),
            "format": wire.to_dict(self.format),
            "penalties": wire.to_dict(self.penalties),
            "rules": self.rules,
            "rules_version": self.rules_version,
            "cars": [wire.to_dict(car) for car in self.cars],
            "map_covariance": self.map_covariance,
            "row_s": self.row_s,
            "camera_gap_s": self.camera_gap_s,
            "further": [wire.to_dict(view) for view in self.further],
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The setup that `to_dict` wrote. Raises `InputError` or `ValueError` where a member is missing or wrong."""
        data = _OLDER | data
        try:
            return cls(
                track=Track.from_dict(data["track"]),
                ground=GroundMap.from_dict(data["ground"]),
                motion=wire.from_dict(MotionSettings, _BEFORE | data["motion"]),
                crossing=wire.from_dict(CrossingSettings, data["crossing"]),
                laps=wire.from_dict(LapRules, data["laps"]),
                score=wire.from_dict(ScoreSettings, data["score"]),
                not_scored_because=wire.member(str | None, data, "not_scored_because"),
                birth_margin_m=wire.member(float, data, "birth_margin_m"),
                start=wire.from_dict(StartRules, data["start"]),
                format=wire.from_dict(FormatRules, data["format"]),
                penalties=wire.from_dict(PenaltyRules, data["penalties"]),
                rules=wire.member(str, data, "rules"),
                rules_version=wire.member(str, data, "rules_version"),
                cars=wire.member(tuple[CarSetup, ...], data, "cars"),
                map_covariance=wire.member(Covariance9 | None, data, "map_covariance"),
                row_s=wire.member(float, data, "row_s"),
                # Laps of recordings from before this setting existed were not marked.
                camera_gap_s=data.get("camera_gap_s"),
                further=wire.member(tuple[CameraView, ...], data, "further"),
            )
        except KeyError as error:
            raise ValueError(f"the setup has no member {error}") from error
