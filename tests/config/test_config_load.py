"""The configuration: what is right is read as written, and each mistake is one line that names file, line and key."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from dnb_edge.config.load import check_config, load_config
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError

GOOD = """\
name: a car
track:
  image: twin.png
  lane_hsv: [330, 23, 84]
  metres_per_px: 0.001
  start_line_px: [[1, 2], [3, 4]]
view:
  keypoints_camera: a.npy
  keypoints_twin: b.npy
race:
  laps: 3
"""

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


@pytest.fixture
def good(tmp_path: Path) -> Path:
    path = tmp_path / "race.yaml"
    path.write_text(GOOD)
    return path


def test_defaults_fill_what_the_file_leaves_out(good: Path) -> None:
    """A short file is a whole configuration."""
    config = load_config(good)
    assert (config.race.laps, config.race.min_lap_s, config.score.metric, config.record.keep_free_mb) == (
        3,
        2.0,
        "dtw",
        200.0,
    )


@pytest.mark.parametrize("shade", ["dark", "light", "auto", "between-lines"])
def test_a_lane_may_be_told_by_its_shade(good: Path, shade: str) -> None:
    """Instead of a colour; with both it is not clear which counts, and another word is none."""
    text = GOOD.replace("lane_hsv: [330, 23, 84]", f"lane: {shade}")
    good.write_text(text)
    assert load_config(good).track.lane == shade
    good.write_text(GOOD.replace("lane_hsv:", f"lane: {shade}\n  lane_hsv:"))
    with pytest.raises(InputError, match="give lane_hsv or lane, not both"):
        load_config(good)
    good.write_text(text.replace(shade, "pinkish"))
    with pytest.raises(InputError, match="lane"):
        load_config(good)


def test_paths_are_relative_to_the_file_and_to_data_dir(good: Path, tmp_path: Path) -> None:
    """Input data lies beside the file, or in data_dir where that is given; recordings do not move with data_dir."""
    assert load_config(good).track.image == tmp_path / "twin.png"
    good.write_text("data_dir: lab\nrecord: {directory: runs}\n" + GOOD)
    config = load_config(good)
    assert config.track.image == tmp_path / "lab" / "twin.png"
    assert config.record.directory == tmp_path / "runs"


def test_paths_set_on_the_command_line_are_relative_to_the_working_directory(
    good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a user types means what the shell means."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert load_config(good, ["track.image=x/other.png"]).track.image == here / "x" / "other.png"
    assert load_config(good, ["data_dir=lab"]).track.image == here / "lab" / "twin.png"


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("race.laps=7", 7),
        ("race.laps=null", None),
        ("score.clamp_m=0.3", 0.3),
        ("score.clamp_m=3e-1", 0.3),
        ("score.metric=frechet", "frechet"),
    ],
)
def test_any_key_can_be_set_from_the_command_line(good: Path, override: str, value: object) -> None:
    """`--set` wins over the file, with YAML's own types."""
    section, key = override.split("=", maxsplit=1)[0].split(".")
    assert getattr(getattr(load_config(good, [override]), section), key) == value


@pytest.mark.parametrize(
    ("find", "replace", "says"),
    [
        ("  laps: 3", "  lapz: 3", "line 11: race.lapz: unknown key, did you mean laps?"),
        ("  laps: 3", "  laps: three", "line 11: race.laps: input should be a valid integer"),
        ("  laps: 3", "  laps: '3'", "line 11: race.laps: input should be a valid integer"),
        ("  laps: 3", "  laps: true", "line 11: race.laps: input should be a valid integer"),
        ("name: a car", "colour: red", "line 1: colour: unknown key"),
        (
            "  lane_hsv: [330, 23, 84]",
            "  lane_hsv: [400, 23, 84]",
            "line 4: track.lane_hsv.0: input should be less than",
        ),
        ("  lane_hsv: [330, 23, 84]\n", "", "line 2: track: lane_hsv is missing"),
        ("  metres_per_px: 0.001\n", "", "line 2: track: give either measured"),
        ("track:", "track:\n  file: a.json", "line 2: track: give file or image, not both"),
        (
            "  keypoints_twin: b.npy\n",
            "",
            "line 7: view: give calibration (.yaml), keypoints_camera and keypoints_twin",
        ),
        ("  metres_per_px: 0.001", "  metres_per_px: .inf", "line 5: track.metres_per_px: input should be"),
        ("race:\n", "race:\n  laps: 4\n", "line 12: race.laps is given twice"),
        ("race:", "race: [", "not valid YAML"),
        ("name: a car", "name: 2024-13-45\ncolour: red", "line 2: colour: unknown key"),
        ("name: a car", "? [a, b]\n: 1", "line 1: a key must be a word"),
        (
            "name: a car",
            "capture: {fps: 30, exposure_us: 50000}",
            "line 1: capture.exposure_us: 50000 is longer than a frame lasts at 30 a second (33333): lower exposure_us or fps",
        ),
        (
            "name: a car",
            "capture: {row_us: 33000}",
            "line 1: capture.row_us: 720 rows of 33000 take longer than a frame lasts",
        ),
        ("name: a car", "capture: {gain: 3, controls: {gain: 4}}", "capture: give gain or controls.gain, not both"),
        (
            "name: a car",
            "capture: {exposure_us: auto, controls: {auto_exposure: 1}}",
            "capture: give exposure_us or controls.auto_exposure, not both",
        ),
        ("name: a car", "name: &x [*x]", "nested too deeply, or within itself"),
        ("name: a car", "name: " + "[" * 200_000, "line 1: not valid YAML: nested too deeply"),
        (
            "name: a car",
            "a: &a [0, 0, 0, 0, 0, 0, 0, 0]\n"
            + "\n".join(
                f"{b}: &{b} [*{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}]" for a, b in pairwise("abcdefghij")
            ),
            "not valid YAML: more than 100000 values",
        ),
        (
            "name: a car",
            "a: &a {x: 0}\n"
            + "\n".join(f"{b}: &{b} {{<<: [*{a}, *{a}, *{a}, *{a}]}}" for a, b in pairwise("abcdefghijklm")),
            "not valid YAML: more than 100000 values",
        ),
        ("name: a car", "name: " + "x" * 4_000_000, "not valid YAML: longer than 4000000 characters"),
        ("name: a car", "name: 0x" + "f" * 5000, "line 1: not valid YAML: a whole number of more than 64 bits"),
        ("name: a car", "name: !!int x", "not valid YAML: a value is not what its tag or its form says it is"),
        ("name: a car", "name: !!bool x", "not valid YAML: a value is not what its tag or its form says it is"),
        ("name: a car", "name: !!timestamp x", "not valid YAML: a value is not what its tag or its form says it is"),
        ("name: a car", "name: " + "1" * 5000, "not valid YAML: a value is not what its tag or its form says it is"),
    ],
)
def test_each_mistake_names_file_line_and_key(good: Path, find: str, replace: str, says: str) -> None:
    """One line tells where the mistake is and what is wrong."""
    good.write_text(GOOD.replace(find, replace))
    with pytest.raises(InputError) as caught:
        load_config(good)
    text = str(caught.value)
    assert text.startswith(str(good))
    assert says in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("race.lapz=3", "--set race.lapz=3: race.lapz: unknown key, did you mean laps?"),
        ("race.laps=x", "--set race.laps=x: race.laps: input should be a valid integer"),
        ("race.laps.deep=1", "laps is a value and has no keys of its own"),
        ("race.laps", "must have the form key.path=value"),
        ("=3", "must have the form key.path=value"),
        ("race.laps=[", "not valid YAML"),
    ],
)
def test_each_mistake_on_the_command_line_names_the_override(good: Path, override: str, says: str) -> None:
    """A wrong `--set` is blamed, not the file."""
    with pytest.raises(InputError, match="--set") as caught:
        load_config(good, [override])
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("content", "says"), [(b"", "must be a mapping"), (b"- 1", "must be a mapping"), (b"\xff", "UTF-8")]
)
def test_files_that_are_no_configuration_are_refused(tmp_path: Path, content: bytes, says: str) -> None:
    """Empty, listed or binary: one line each."""
    path = tmp_path / "c.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=says):
        load_config(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """The path stands in the error."""
    with pytest.raises(InputError, match=r"none\.yaml: cannot read"):
        load_config(tmp_path / "none.yaml")


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_the_shipped_examples_are_right(path: Path) -> None:
    """Every file in configs/ loads."""
    load_config(path)


def test_every_key_is_described_in_the_schema() -> None:
    """Editors show a text for every key, those made from the core's settings included."""
    schema = Config.model_json_schema()
    for name, model in schema["$defs"].items():
        for key, entry in model.get("properties", {}).items():
            if model.get("type") == "object" and name not in ("Metric",):
                assert entry.get("description") or key in _SELF_EVIDENT, f"{name}.{key} has no description"


_SELF_EVIDENT = {"tentative_lost_after_s", "metric", "detector", "capture", "view", "track"}


def test_a_dictionary_is_checked_like_a_file(tmp_path: Path) -> None:
    """Without a file the same checks hold."""
    with pytest.raises(InputError, match="configuration: track: is missing"):
        check_config({}, base=tmp_path)
