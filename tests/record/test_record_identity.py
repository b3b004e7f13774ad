"""What makes two runs' conditions the same: the digests of track, calibration and rules, and the header that tells them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from record_samples import HEADER

from dnb_edge.core import CoreSetup
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import Effect, FormatRules, LapRules, Obstacle, PenaltyRules, StartMode, StartRules
from dnb_edge.record.header import header_from_json
from dnb_edge.record.identity import identity_of, rules_of
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import EntryInfo
from dnb_edge.view.ground import GroundMap

SCALE = TwinScale(metres_per_px=0.01, height_px=400.0)
GROUND = GroundMap(camera_to_twin=(0.4, 0, 0, 0, 0.4, 0, 0, 0, 1.0), scale=SCALE, width_px=1000, height_px=1000)


def ring(*, step: int = 1, name: str = "ring", noise_m: float = 0.0, sectors: bool = False, at_m: float = 0.0) -> Track:
    angles = np.linspace(0, 2 * np.pi, 100, endpoint=False) * step
    points = 2 + np.column_stack((np.cos(angles), np.sin(angles))) * (1 + noise_m)
    half = np.full(100, 0.15)
    centreline = Centreline(points_m=points, half_left_m=half, half_right_m=half)
    lines = (line_across(centreline, 2.0, name="sector 1", margin_m=0.05),) if sectors else ()
    start = line_across(centreline, at_m, name="start", margin_m=0.05)
    return Track(name=name, scale=SCALE, centreline=centreline, start_line=start, sector_lines=lines)


SETUP = CoreSetup(
    track=ring(),
    ground=GROUND,
    motion=MotionSettings(),
    crossing=CrossingSettings(),
    laps=LapRules(),
    score=ScoreSettings(),
)
SAME = identity_of(SETUP)


@pytest.mark.parametrize(
    ("changes", "different"),
    [
        ({"track": ring(step=-1)}, "track"),
        ({"track": ring(noise_m=1e-3)}, "track"),
        ({"track": ring(sectors=True)}, "track"),
        ({"track": ring(at_m=0.5)}, "track"),
        ({"ground": replace(GROUND, camera_to_twin=(0.4001, 0, 0, 0, 0.4, 0, 0, 0, 1.0))}, "calibration"),
        ({"laps": LapRules(min_lap_s=3.0)}, "rules"),
        ({"start": StartRules(mode=StartMode.GRID)}, "rules"),
        ({"format": FormatRules(time_limit_s=60.0)}, "rules"),
        ({"penalties": PenaltyRules(off_track=Effect(seconds=3.0))}, "rules"),
        ({"score": ScoreSettings(baseline_m=0.4)}, "rules"),
        ({"laps": LapRules(laps=5)}, "rules"),
    ],
)
def test_each_condition_has_its_digest(changes: dict, different: str) -> None:
    """A change of track, direction, line, map or rule changes the digest that it belongs to and no other."""
    other = identity_of(replace(SETUP, **changes)).to_dict()
    assert [name for name, digest in SAME.to_dict().items() if other[name] != digest] == [different]


@pytest.mark.parametrize(
    "changes",
    [
        {"track": ring(name="another name")},
        {"track": ring(noise_m=1e-14)},
        {"motion": MotionSettings(gate=9.0)},
        {"rules": "another name"},
        {"not_scored_because": "the calibration is wrong"},
    ],
)
def test_what_is_no_condition_changes_no_digest(changes: dict) -> None:
    """Names, the last bits of a number, and how a car is followed."""
    assert identity_of(replace(SETUP, **changes)) == SAME


def test_a_digest_is_of_what_was_recorded() -> None:
    """Twelve hexadecimal digits that survive the recording, also one from before a rule existed."""
    stored = json.loads(json.dumps(SETUP.to_dict()))
    assert identity_of(CoreSetup.from_dict(stored)) == SAME
    for name in ("start", "format", "penalties", "cars", "rules"):
        del stored[name]
    assert identity_of(CoreSetup.from_dict(stored)) == SAME
    assert all(len(digest) == 12 and int(digest, 16) >= 0 for digest in SAME.to_dict().values())


def test_rules_are_told_by_section_and_key_where_they_are_not_usual() -> None:
    """What a message names: only what somebody changed, as a configuration calls it; no run's length and no dice."""
    changed = replace(
        SETUP,
        laps=LapRules(min_lap_s=3.0, laps=5),
        start=StartRules(seed=7),
        score=ScoreSettings(baseline_m=0.4),
        crossing=CrossingSettings(hysteresis_m=0.07),
    )
    told = {"race": {"min_lap_s": 3.0}, "score": {"baseline_m": 0.4}, "crossing": {"hysteresis_m": 0.07}}
    assert rules_of(changed) == told
    assert rules_of(SETUP) == {}


def test_where_obstacles_stand_parts_no_runs_but_how_many_there_are_does() -> None:
    """Each seed of a task stands them elsewhere, and its runs are compared with those of others."""

    def rules(*places: tuple[float, float]) -> object:
        obstacles = tuple(Obstacle(at_m=place, radius_m=0.03) for place in places)
        return rules_of(replace(SETUP, laps=LapRules(obstacles=obstacles, car_length_m=0.2, car_width_m=0.1)))

    assert rules((1.0, 1.0), (2.0, 1.0)) == rules((0.5, 0.5), (2.0, 2.0))
    assert rules((1.0, 1.0)) != rules((1.0, 1.0), (2.0, 1.0)) != rules()


def test_entry_session_and_digests_survive_the_header() -> None:
    """They come back as they were written, and any viewer shows them."""
    entry = EntryInfo(name="net", version="v2", checkpoint_sha256="ab" * 32, notes="trained in rain")
    header = replace(HEADER, name="net", entry=entry, session="monday", identity=SAME.to_dict())
    assert header_from_json(header.to_json()) == header
    assert header.driver == entry
    told = header.metadata()
    assert (told["entry_version"], told["session"], told["track"]) == ("v2", "monday", SAME.track)


def test_an_old_header_has_an_entry_by_its_name() -> None:
    """Recordings from before there were entries name one without a version, in no session."""
    data = json.loads(HEADER.to_json())
    for name in ("entry", "session", "identity"):
        del data[name]
    old = header_from_json(json.dumps(data))
    assert (old.driver, old.session, old.identity) == (EntryInfo(name=HEADER.name), None, {})
    assert set(old.metadata()) <= {"format", "version", "name", "source", "clock", "wall_offset_ns"}
