"""A configuration's rules and cars, in the core's setup and in the recording's header."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnb_edge.archive.rescore import Wanted
from dnb_edge.assembly import assemble, make_header
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.config.rules import load_rule_set
from dnb_edge.core import CoreSetup
from dnb_edge.errors import InputError
from dnb_edge.race.rules import CarSetup, Effect, FormatRules, Obstacle, Ranking, StartMode
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, SourceInfo

INFO = SourceInfo(uri="x:", width_px=1280, height_px=720, nominal_fps=30.0, clock=Clock.MEDIA, live=False)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's own configuration with its files."""
    return write_demo_config(tmp_path_factory.mktemp("demo"), Rig(seed=1, laps=1))


def test_rules_and_cars_reach_the_core(demo: Path) -> None:
    """All sections, the rule set's name and version, the cars in their order; and the recording holds all of it."""
    overrides = ["rules=laps", "race.laps=4", "format.warm_up_laps=1", "penalties.off_track.seconds=7"]
    overrides += ["cars=[{name: A, colour: '#ff8000'}, {name: B}]"]
    setup = assemble(load_config(demo, overrides), INFO).setup
    assert (setup.rules, setup.rules_version, setup.laps.laps, setup.motion.cars) == ("laps", "1", 4, 2)
    assert (setup.start.mode, setup.start.random_s) == (StartMode.GRID, 2.0)
    assert setup.format == FormatRules(rank_by=Ranking.TOTAL_TIME, warm_up_laps=1)
    assert (setup.penalties.off_track, setup.penalties.jump_start) == (Effect(seconds=7.0), Effect(seconds=5.0))
    assert setup.cars == (CarSetup(name="A", colour_bgr=(0.0, 128.0, 255.0)), CarSetup(name="B"))
    again = CoreSetup.from_dict(setup.to_dict())
    assert again == setup
    assert again.rules_digest == setup.rules_digest


def test_the_digest_is_of_the_rules_and_not_of_their_name(demo: Path, tmp_path: Path) -> None:
    """A copy of a rule set under another name is the same rules; a changed key is not, and neither name nor cars matter."""
    (tmp_path / "copy.yaml").write_text(load_rule_set("paper").text.replace("name: paper", "name: ours"))
    own = assemble(load_config(demo, ["rules=paper"]), INFO).setup
    copy = assemble(load_config(demo, [f"rules={tmp_path}/copy.yaml", "cars=[{name: A}]"]), INFO).setup
    assert (own.rules, copy.rules) == ("paper", "ours")
    assert own.rules_digest == copy.rules_digest
    other = assemble(load_config(demo, ["rules=paper", "race.off_lane_s=0.31"]), INFO).setup
    assert other.rules_digest != own.rules_digest


def test_a_rule_sets_file_is_one_of_the_runs_inputs(demo: Path, tmp_path: Path) -> None:
    """The header tells its checksum, as of every file that decides what the run measures."""
    (tmp_path / "ours.yaml").write_text(load_rule_set("paper").text)
    config = load_config(demo, [f"rules={tmp_path}/ours.yaml"])
    assert "ours.yaml" in make_header(config, assemble(config, INFO), INFO).setup["sha256"]


def test_obstacles_reach_the_core_and_the_recording(demo: Path) -> None:
    """Written as a list of places, each a value of its own."""
    obstacles = "race.obstacles=[{at_m: [1.5, 0.3], radius_m: 0.05}, {at_m: [2, 1.7], radius_m: 0.1}]"
    size = ["race.car_length_m=0.235", "race.car_width_m=0.165"]
    setup = assemble(load_config(demo, [obstacles, *size, "penalties.collision.seconds=3"]), INFO).setup
    assert setup.laps.obstacles == (
        Obstacle(at_m=(1.5, 0.3), radius_m=0.05),
        Obstacle(at_m=(2.0, 1.7), radius_m=0.1),
    )
    assert setup.penalties.collision == Effect(seconds=3.0, invalid=True)
    again = CoreSetup.from_dict(setup.to_dict())
    assert (again, again.rules_digest) == (setup, setup.rules_digest)


def test_another_rule_set_leaves_the_obstacles_and_prices_hits_as_it_does(demo: Path) -> None:
    """They belong to the run as the car's size does: `score --rules carla` judges the same hits by another price."""
    there = ["race.obstacles=[{at_m: [1.5, 0.3], radius_m: 0.05}]", "race.car_length_m=0.2", "race.car_width_m=0.1"]
    setup = assemble(load_config(demo, there), INFO).setup
    change = Wanted(rules="carla").change(Path("run.mcap"))
    assert change is not None
    other = change(setup)
    assert other.laps.obstacles == setup.laps.obstacles
    assert (setup.penalties.collision, other.penalties.collision) == (Effect(invalid=True), Effect(factor=0.65))


def test_rules_without_obstacles_have_the_digest_that_they_had_before_there_were_any(demo: Path) -> None:
    """What older recordings were driven under stays comparable; with an obstacle its price and its distance count."""
    assert assemble(load_config(demo, []), INFO).setup.rules_digest == "b5582eb4ad72"
    assert assemble(load_config(demo, ["rules=carla"]), INFO).setup.rules_digest == "4b778a7dfe03"
    there = ["race.obstacles=[{at_m: [1, 1], radius_m: 0.1}]", "race.car_length_m=0.2", "race.car_width_m=0.1"]
    digests = {
        assemble(load_config(demo, [*there, *more]), INFO).setup.rules_digest
        for more in ([], ["penalties.collision.seconds=3"], ["race.collision_m=0.02"])
    }
    assert len(digests) == 3


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("race.obstacles=[{at_m: [1, 1], radius_m: 0}]", r"race\.obstacles.*radius_m.*positive"),
        ("race.obstacles=[{at_m: [1], radius_m: 0.1}]", r"race\.obstacles\.0\.at_m"),
        ("race.obstacles=[{at_m: [1, 1], radius: 0.1}]", r"race\.obstacles\.0\.radius"),
        ("race.obstacles=[{at_m: [1, 1], radius_m: 0.1}]", r"race\.obstacles: .*car_length_m"),
    ],
)
def test_a_wrong_obstacle_is_refused_in_one_line(demo: Path, override: str, told: str) -> None:
    """With the key that is wrong."""
    with pytest.raises(InputError, match=told) as error:
        load_config(demo, [override])
    assert "\n" not in str(error.value)
