"""Who drives, and in which session: the keys `entry`, `name` and `session`, and a line for each mistake."""

from pathlib import Path

import pytest

from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.values import EntryInfo

REST = """
track: {image: twin.png, lane_hsv: [0, 0, 25], metres_per_px: 0.0025, start_line_px: [[6, 3], [6, 8]]}
view: {keypoints: pairs.yaml}
"""


def load(tmp_path: Path, text: str, *overrides: str) -> Config:
    path = tmp_path / "mine.yaml"
    path.write_text(text + REST)
    return load_config(path, overrides)


@pytest.mark.parametrize(
    ("text", "driver"),
    [
        ("", EntryInfo(name="run")),
        ("name: me", EntryInfo(name="me")),
        ("entry: {name: net}", EntryInfo(name="net")),
        ("name: net\nentry: {name: net}", EntryInfo(name="net")),
        ("name: net\nentry: {version: v2, notes: rain}", EntryInfo(name="net", version="v2", notes="rain")),
        ("entry: {name: net, version: '1.10'}", EntryInfo(name="net", version="1.10")),
    ],
)
def test_who_drives(tmp_path: Path, text: str, driver: EntryInfo) -> None:
    """The section says it, the top-level name is its short form, and nobody has to say anything."""
    assert load(tmp_path, text).driver == driver


def test_a_configuration_as_it_is_shown_means_the_same(tmp_path: Path) -> None:
    """Every key written out, the default name among them, still names the section's entry."""
    config = load(tmp_path, "entry: {name: net, version: v2}")
    again = Config.model_validate(config.model_dump(), context={"base": tmp_path})
    assert again.driver == config.driver


def test_a_session_and_a_checkpoint(tmp_path: Path) -> None:
    """The checkpoint's path is relative to the file; the session is a name."""
    config = load(tmp_path, "session: monday\nentry: {name: net, checkpoint: net.pt}")
    assert (config.session, config.entry.checkpoint) == ("monday", tmp_path / "net.pt")
    assert load(tmp_path, "").session is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("entry: {name: ''}", "line 1: entry.name: is blank"),
        ("name: a\nentry:\n  name: '  '", "line 3: entry.name: is blank"),
        ("name: ' '", "line 1: name: is blank"),
        ("entry: {version: v2}", "entry has no name"),
        ("name: a\nentry: {name: b}", "name is 'a' and entry.name is 'b': give one of the two"),
        ("entry: {name: net, version: 1.10}", "line 1: entry.version: must be text: write it in quotes"),
        ("session: ' '", "line 1: session: is blank"),
        ("entry: {nmae: b}", "line 1: entry.nmae: unknown key, did you mean name?"),
    ],
)
def test_mistakes_are_one_line(tmp_path: Path, text: str, said: str) -> None:
    """An entry without a name, two names, a version that YAML takes for a number: file, line and key."""
    with pytest.raises(InputError) as told:
        load(tmp_path, text)
    assert str(told.value).startswith(f"{tmp_path / 'mine.yaml'}")
    assert said in str(told.value)
    assert "\n" not in str(told.value)
