"""Rule sets in a configuration: what wins over what, and one clear line for whatever does not fit."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge import wire
from dnb_edge.config.load import load_config
from dnb_edge.config.rules import PRESETS, SECTIONS, load_rule_set
from dnb_edge.config.schema import Config
from dnb_edge.config.sections import to_settings
from dnb_edge.errors import InputError
from dnb_edge.race.rules import (
    Effect,
    FormatRules,
    LapRules,
    PenaltyRules,
    Ranking,
    StartMode,
    StartRules,
    check_together,
    rules_digest,
)
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.values import IncidentKind

BASE = """\
track: {image: twin.png, lane_hsv: [330, 23, 84], metres_per_px: 0.001, start_line_px: [[1, 2], [3, 4]]}
view: {keypoints_camera: a.npy, keypoints_twin: b.npy}
"""
"""Two lines, so that what a test adds begins in line 3."""

KINDS = {
    "race": LapRules,
    "start": StartRules,
    "format": FormatRules,
    "penalties": PenaltyRules,
    "score": ScoreSettings,
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "race.yaml"


def load(path: Path, more: str, *overrides: str) -> Config:
    path.write_text(BASE + more)
    return load_config(path, overrides)


def penalties(config: Config) -> PenaltyRules:
    return to_settings(PenaltyRules, config.penalties)


def settings(config: Config) -> dict[str, Any]:
    return {section: to_settings(kind, getattr(config, section)) for section, kind in KINDS.items()}


# The rule sets of the package -----------------------------------------------------------------------------------------


def test_without_a_word_the_rules_are_the_defaults(path: Path) -> None:
    """The rule set `practice` is what the settings are by themselves."""
    config = load(path, "")
    assert config.rules == "practice"
    assert settings(config) == {section: kind() for section, kind in KINDS.items()}
    assert load(path, "rules: practice\n") == config


@pytest.mark.parametrize("name", PRESETS)
def test_each_rule_set_fits_together_and_names_every_kind(path: Path, name: str) -> None:
    """It loads, it says what it is for in a line, its name is its file's, and no price is left to guess."""
    load(path, f"rules: {name}\n")
    rules = load_rule_set(name)
    assert rules.name == name
    first = rules.about.splitlines()[0]
    assert 10 < len(first) < 120
    assert first.endswith(".")
    assert set(rules.sections["penalties"]) == {kind.value for kind in IncidentKind}
    assert rules.text.isascii()


def test_every_file_of_the_package_is_listed() -> None:
    """None is forgotten, and none is listed that is not there."""
    folder = Path(load_rule_set.__code__.co_filename).parent / "rule_sets"
    assert sorted(file.stem for file in folder.iterdir()) == sorted(PRESETS)


def test_a_rule_set_that_is_printed_can_be_edited_and_used_by_path(path: Path, tmp_path: Path) -> None:
    """As `config rules laps > mine.yaml` does; paths are relative to the configuration, with --set to where one is."""
    text = load_rule_set("laps").text.replace("name: laps", "name: mine").replace("laps: 10", "laps: 4")
    (tmp_path / "mine.yaml").write_text(text)
    config = load(path, "rules: mine.yaml\n")
    assert (config.race.laps, config.rules) == (4, str(tmp_path / "mine.yaml"))
    assert load_rule_set(config.rules).name == "mine"
    with pytest.raises(InputError, match=r"mine\.yaml: cannot read the rule set: No such file"):
        load(path, "", "rules=mine.yaml")


# What wins over what --------------------------------------------------------------------------------------------------


def test_own_keys_win_over_the_rule_set_and_the_command_line_over_both(path: Path) -> None:
    """Key by key; what nobody gives is the rule set's."""
    config = load(path, "rules: laps\nrace: {laps: 5, min_lap_s: 1.0}\n", "race.laps=7", "format.warm_up_laps=1")
    assert (config.race.laps, config.race.min_lap_s) == (7, 1.0)
    assert (config.format.rank_by, config.format.warm_up_laps) == (Ranking.TOTAL_TIME, 1)
    assert config.start.random_s == 2.0


def test_the_rule_set_can_be_set_on_the_command_line(path: Path) -> None:
    """In place of the file's; what else the file says still wins over it."""
    config = load(path, "rules: paper\nrace: {laps: 5}\n", "rules=laps")
    assert (config.rules, config.race.laps, config.format.rank_by) == ("laps", 5, Ranking.TOTAL_TIME)


def test_a_kind_of_penalty_is_one_key(path: Path) -> None:
    """Who gives {} has it told and free of charge; other kinds stay the rule set's, and none inherits a part."""
    config = load(path, "rules: laps\npenalties:\n  off_track: {}\n  short_cut: {invalid: true}\n")
    assert penalties(config).off_track == Effect()
    assert penalties(config).short_cut == Effect(invalid=True)
    assert penalties(config).jump_start == Effect(seconds=5.0)


def test_a_part_of_a_penalty_can_be_set_alone_on_the_command_line(path: Path) -> None:
    """`--set penalties.off_track.free=1` changes that and leaves its price."""
    config = load(path, "rules: laps\n", "penalties.off_track.free=1")
    assert penalties(config).off_track == Effect(seconds=3.0, free=1)
    assert penalties(load(path, "", "penalties.off_track.free=1")).off_track == Effect(invalid=True, free=1)
    assert penalties(load(path, "", "penalties.off_track={}")).off_track == Effect()


def test_another_mode_of_start_leaves_the_rule_sets_grid_behind(path: Path) -> None:
    """Or nobody could have its race with a rolling start: its countdown would contradict it."""
    for config in (
        load(path, "rules: laps\nstart: {mode: rolling}\n"),
        load(path, "rules: laps\n", "start.mode=rolling"),
    ):
        assert to_settings(StartRules, config.start) == StartRules()
    assert load(path, "", "rules=laps", "start.mode=grid").start.random_s == 2.0


@pytest.mark.parametrize("name", PRESETS)
def test_what_config_show_prints_is_the_same_configuration(path: Path, tmp_path: Path, name: str) -> None:
    """All in force, written out, read again."""
    config = load(path, f"rules: {name}\ncars: [{{name: A, colour: '#ff8000'}}, {{name: B}}]\n")
    again = tmp_path / "again.yaml"
    again.write_text(yaml.safe_dump(yaml.safe_load(config.model_dump_json())))
    assert load_config(again) == config


# What does not fit ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("rules: lapz\n", "line 3: rules: no rule set is called 'lapz': did you mean laps?"),
        ("rules: qqqq\n", "line 3: rules: no rule set is called 'qqqq': there are practice, laps"),
        ("rules: 3\n", "line 3: rules: input should be a valid string"),
        ("rules: none.yaml\n", "none.yaml: cannot read the rule set: No such file or directory"),
        ("penalties: {off_trakc: {}}\n", "line 3: penalties.off_trakc: unknown key, did you mean off_track?"),
        ("penalties:\n  off_track: {second: 3}\n",
         "line 4: penalties.off_track.second: unknown key, did you mean seconds?"),
        ("penalties:\n  off_track:\n    seconds: '3'\n", "line 5: penalties.off_track.seconds: input should be a valid number"),
        ("penalties:\n  off_track:\n    seconds: true\n", "line 5: penalties.off_track.seconds: input should be"),
        ("penalties:\n  off_track:\n    free: 1.5\n", "line 5: penalties.off_track.free: input should be a valid integer"),
        ("penalties:\n  off_track:\n    invalid: 1\n", "line 5: penalties.off_track.invalid: input should be a valid boolean"),
        ("penalties:\n  off_track:\n    seconds: -3\n", "line 5: penalties.off_track.seconds: -3.0 must not be negative"),
        ("penalties:\n  off_track:\n    factor: 1.5\n", "line 5: penalties.off_track.factor: 1.5 must lie between 0 and 1"),
        ("penalties:\n  off_track:\n    seconds: .inf\n", "line 5: penalties.off_track.seconds: input should be a finite"),
        ("penalties:\n  off_track: 5\n", "line 4: penalties.off_track: must be a mapping of keys"),
        ("penalties:\n  off_track:\n", "line 4: penalties.off_track: must be a mapping of keys"),
        ("penalties: 5\n", "line 3: penalties: must be a mapping of keys"),
        ("start: {mode: flying}\n", "line 3: start.mode: input should be 'rolling' or 'grid'"),
        ("format: {rank_by: fastest}\n", "line 3: format.rank_by: input should be 'best_lap'"),
        ("format: {rank_by: total_time}\n", "line 3: format.rank_by: total_time needs an end to the race"),
        ("format: {rank_by: most_laps}\n", "line 3: format.rank_by: most_laps needs an end to the race"),
        ("format: {rank_by: driving_score}\n", "line 3: format.rank_by: driving_score is a share of the wanted laps"),
        ("format: {rank_by: survival}\n", "line 3: format.rank_by: survival needs something to survive"),
        ("rules: aido\nrace: {laps: 2}\n", "line 4: race.laps: the slowest would be longest at them and win by survival"),
        ("race: {laps: 2}\nformat: {rank_by: best_consecutive}\n", "line 4: format.best_of: only 2 laps are ranked"),
        ("race: {laps: 3}\nformat:\n  warm_up_laps: 1\n  rank_by: best_average\n", "format.best_of: only 2 laps are ranked"),
        ("race: {laps: 3}\nformat: {warm_up_laps: 3}\n", "line 4: format.warm_up_laps: 3 leaves none of race.laps, 3"),
        ("start: {countdown_s: 5}\n", "line 3: start.countdown_s: a rolling start has no grid and no countdown"),
        ("start: {random_s: 5}\n", "line 3: start.random_s: a rolling start"),
        ("rules: laps\nrace: {laps: null}\n", "rule set laps, line 17: format.rank_by: total_time needs an end"),
        ("format: {time_limit_s: 0}\n", "line 3: format.time_limit_s: 0.0 must be positive"),
        ("format: {time_limit_s: 1.0e+300}\n", "line 3: format.time_limit_s: 1e+300 is too much, at most 1e+06"),
        ("race: {max_lap_s: 1.0e+300}\n", "line 3: race.max_lap_s: 1e+300 is too much"),
        ("race: {laps: 1000000000000}\n", "line 3: race.laps: 1000000000000 is too much"),
        ("race: {stalled_s: 0}\n", "line 3: race.stalled_s: 0.0 must be positive"),
        ("race: {off_lane_s: -1}\n", "line 3: race.off_lane_s: -1.0 must not be negative"),
        ("race: {wrong_way_m: -1}\n", "line 3: race.wrong_way_m: -1.0 must be positive"),
        ("race: {short_cut_m: 0}\n", "line 3: race.short_cut_m: 0.0 must be positive"),
        ("race: {lifted_m: 0}\n", "line 3: race.lifted_m: 0.0 must be positive"),
        ("race: {off_lane: any_wheel, car_length_m: -0.2, car_width_m: 0.1}\n", "race.car_length_m: -0.2 must be positive"),
        ("race: {off_lane_margin_m: 1.0e+300}\n", "line 3: race.off_lane_margin_m: 1e+300 is more than"),
        ("race: {min_lap_s: -1}\n", "line 3: race.min_lap_s: -1.0 must not be negative"),
        ("start: {mode: grid, countdown_s: 1.0e+300}\n", "line 3: start.countdown_s: 1e+300 is too much"),
        ("start: {mode: grid, random_s: -1}\n", "line 3: start.random_s: -1.0 must not be negative"),
        ("format: {best_of: 0}\n", "line 3: format.best_of: 0 must be positive"),
        ("format: {warm_up_laps: -1}\n", "line 3: format.warm_up_laps: -1 must not be negative"),
        ("penalties: {off_track: {seconds: 1.0e+308}}\n", "penalties.off_track.seconds: 1e+308 is too much"),
        ("score: {points: 1000000}\n", "line 3: score.points: 1000000 is too many, at most 10000"),
        ("cars: [{marker: 3}]\n", "line 3: cars.0.name: is missing"),
        ("cars: [{name: ''}]\n", "line 3: cars.0.name: is blank"),
        ("cars: [{name: ' '}]\n", "line 3: cars.0.name: is blank"),
        ('cars: [{name: "A\\nB"}]\n', "line 3: cars.0.name: 'A\\nB' has characters that no board can show"),
        ("cars:\n- {name: A}\n- {name: A}\n", "line 5: cars.1.name: the same as of car 1"),
        ("cars:\n- {name: A, colour: '#00ff00'}\n- {name: B, colour: [0, 255, 0]}\n", "line 5: cars.1.colour: the same as"),
        ("detector: {kind: markers}\ncars:\n- {name: A, marker: 3}\n- {name: B, marker: 3}\n",
         "line 6: cars.1.marker: the same as"),
        ("cars:\n- {name: A, marker: 3}\n", "line 4: cars.0.marker: only the detector `markers` reads it"),
        ("detector: {kind: markers, markers: {ids: [1, 2]}}\ncars: [{name: A, marker: 3}]\n",
         "line 4: cars.0.marker: 3 is none of"),
        ("cars: [{name: A}, {name: B}]\nmotion: {cars: 1}\n", "line 4: motion.cars: 1 is too few for 2 cars"),
        ("cars:\n" + "".join(f"- {{name: c{k}}}\n" for k in range(9)), "line 3: cars: 9 are too many: 8 at most"),
        ("cars:\n- {name: A, colour: orange}\n", "line 4: cars.0.colour: 'orange' is no colour: give '#rrggbb'"),
        ("cars:\n- {name: A, colour: [0, 0, 256]}\n", "line 4: cars.0.colour.2: input should be less than or equal to 255"),
        ("cars:\n- {name: A, number: 3}\n", "line 4: cars.0.number: unknown key"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line_that_names_file_line_and_key(path: Path, more: str, says: str) -> None:
    """What is wrong by itself, and what contradicts something else."""
    with pytest.raises(InputError) as caught:
        load(path, more)
    text = str(caught.value)
    assert says in text
    assert "\n" not in text
    assert text.startswith((str(path.parent), "rule set laps"))


def test_an_override_that_contradicts_is_blamed_itself(path: Path) -> None:
    """Not the file's line of the section."""
    with pytest.raises(InputError, match=r"--set format\.rank_by=survival: format\.rank_by: survival needs"):
        load(path, "format: {best_of: 2}\n", "format.rank_by=survival")
    with pytest.raises(InputError, match=r"--set rules=lapz: rules: no rule set"):
        load(path, "rules: paper\n", "rules=lapz")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("version: 1\n", "mine.yaml: name: is missing"),
        ("name: x\nversion: 1.5\n", "mine.yaml, line 2: version"),
        ("name: x\ntrack: {}\n", "mine.yaml, line 2: track: unknown key"),
        ("name: x\nformat:\n  rank_bi: best_lap\n", "mine.yaml, line 3: format.rank_bi: unknown key, did you mean rank_by?"),
        ("name: x\npenalties:\n  lost: {factor: 2}\n", "mine.yaml, line 3: penalties.lost.factor: 2.0 must lie between"),
        ("name: x\nname: y\n", "mine.yaml, line 2: name is given twice"),
        ("name: x\nformat: [\n", "mine.yaml, line 3: not valid YAML"),
        ("name: x\nformat: 5\n", "mine.yaml, line 2: format: must be a mapping"),
        ("", "mine.yaml: the rule set must be a mapping"),
    ],
)  # fmt: skip
def test_a_wrong_rule_set_is_refused_in_its_own_file(path: Path, tmp_path: Path, text: str, says: str) -> None:
    """With its own path and line, not the configuration's."""
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        load(path, "rules: mine.yaml\n")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


# Cars -----------------------------------------------------------------------------------------------------------------


def test_cars_say_how_many_are_followed(path: Path) -> None:
    """Unless motion.cars says more."""
    assert load(path, "cars: [{name: A}, {name: B}]\n").motion.cars == 2
    assert load(path, "cars: [{name: A}, {name: B}]\nmotion: {cars: 4}\n").motion.cars == 4
    assert load(path, "").motion.cars == 1


@pytest.mark.parametrize("colour", ["'#ff8001'", "'FF8001'", "[1, 128, 255]"])
def test_a_colour_may_be_written_as_on_the_web(path: Path, colour: str) -> None:
    """Red, green, blue in hexadecimal; or a list in the order of pictures: blue, green, red."""
    (car,) = load(path, f"cars: [{{name: A, colour: {colour}}}]\n").cars
    assert car.colour == (1, 128, 255)


# The digest -----------------------------------------------------------------------------------------------------------


def plain(config: Config) -> dict[str, dict[str, Any]]:
    return {section: wire.to_dict(value) for section, value in settings(config).items()}


def test_rule_sets_have_digests_of_their_own(path: Path) -> None:
    """Equal rules, equal digests, whatever they are called; any other rule changes it."""
    digests = {name: rules_digest(plain(load(path, f"rules: {name}\n"))) for name in PRESETS}
    assert len(set(digests.values())) == len(PRESETS)
    assert all(len(digest) == 12 for digest in digests.values())
    assert rules_digest(plain(load(path, "rules: paper\n", "score.clamp_m=0.5"))) == digests["paper"]
    assert rules_digest(plain(load(path, "rules: paper\n", "score.clamp_m=0.4"))) != digests["paper"]


@given(st.dictionaries(st.text(), st.integers(-(2**50), 2**50)))
def test_the_digest_knows_no_order_and_no_spelling_of_numbers(section: dict[str, int]) -> None:
    """3 and 3.0 are one number."""
    other = {key: float(section[key]) for key in reversed(list(section))}
    assert rules_digest({"race": section}) == rules_digest({"race": other})


def test_rules_that_fit_one_by_one_are_checked_together_without_a_configuration() -> None:
    """For recordings that are scored again under other rules."""
    with pytest.raises(ValueError, match=r"^format\.rank_by: driving_score"):
        check_together(LapRules(), StartRules(), FormatRules(rank_by=Ranking.DRIVING_SCORE), PenaltyRules())
    check_together(
        LapRules(laps=3), StartRules(mode=StartMode.GRID, random_s=2.0), FormatRules(rank_by=Ranking.DRIVING_SCORE),
        PenaltyRules(),
    )  # fmt: skip


def test_the_schema_for_editors_knows_the_sections() -> None:
    """Every section of rules, cars with both forms of a colour, and a penalty's parts."""
    schema = Config.model_json_schema()
    assert {"rules", "cars", *SECTIONS} <= set(schema["properties"])
    assert set(schema["$defs"]["Effect"]["properties"]) == {"seconds", "factor", "invalid", "dnf", "free"}
    assert schema["$defs"]["Effect"]["additionalProperties"] is False
    forms = schema["$defs"]["CarConfig"]["properties"]["colour"]["anyOf"]
    assert [form["type"] for form in forms] == ["string", "array", "null"]


DOCS = Path(__file__).resolve().parents[2] / "docs" / "rules.md"


def test_every_key_and_rule_set_stands_in_the_docs() -> None:
    """A new rule is not done before docs/rules.md tells it."""
    text = DOCS.read_text()
    keys = [field.name for kind in (*KINDS.values(), Effect) if kind is not ScoreSettings for field in fields(kind)]
    words = [*keys, *Ranking, *PRESETS, *SECTIONS, "cars", "marker", "colour"]
    assert [word for word in words if f"`{word}`" not in text] == []


def test_the_docs_examples_are_right(path: Path, tmp_path: Path) -> None:
    """The configuration and the rule set in docs/rules.md can be copied."""
    config, rules = re.findall(r"```yaml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    assert load(path, config).race.laps == 5
    (tmp_path / "club.yaml").write_text(rules)
    assert penalties(load(path, "rules: club.yaml\n")).off_track == Effect(seconds=3.0)
