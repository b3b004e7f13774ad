"""The track file: a whole track as text that a person can read and mend."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.config.track_file import MadeOf, load_track, load_track_file, track_file
from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.layout import NamedLine, laid_out
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale


def make_track(
    *,
    closed: bool = True,
    radius: float = 1.0,
    squash: float = 0.7,
    half: float = 0.1,
    name: str = "oval",
    metres_per_px: float = 0.01,
    sector_name: str | None = None,
) -> Track:
    """An oval, whole or for three quarters, with every kind of line."""
    angles = np.linspace(0, 2 * math.pi if closed else 4.7, 60, endpoint=not closed)
    count = len(angles)
    route = Centreline(
        points_m=np.column_stack((2 + radius * np.cos(angles), 2 + squash * radius * np.sin(angles))),
        half_left_m=half * (1 + 0.1 * np.cos(angles)),
        half_right_m=np.full(count, half),
        closed=closed,
    )
    finish = line_across(route, 0.8 * route.length_m, name="finish")
    sector = line_across(route, 0.4 * route.length_m, name="sector 1")
    return laid_out(
        route,
        name=name,
        scale=TwinScale(metres_per_px=metres_per_px, height_px=400.0),
        start=line_across(route, 0.1 * route.length_m, name="start"),
        finish=finish,
        sectors=[NamedLine(line=sector, name=sector_name)],
        source="test",
    )


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@given(
    closed=st.booleans(),
    radius=st.floats(1e-4, 1e4),
    squash=st.floats(0.3, 1.0),
    share=st.floats(0.001, 0.05),
    name=st.text(st.characters(exclude_categories=["Cs"]), max_size=30),
    metres_per_px=st.floats(1e-6, 1e3),
)
def test_what_is_written_is_read_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory,
    closed: bool,
    radius: float,
    squash: float,
    share: float,
    name: str,
    metres_per_px: float,
) -> None:
    """Any size, scale and name: the file holds the track itself, and what it was made of."""
    track = make_track(
        closed=closed, radius=radius, squash=squash, half=share * radius, name=name, metres_per_px=metres_per_px
    )
    made_of = MadeOf(picture=name, sha256="ab" * 32, waypoints_px=((radius, squash), (0.1, 1e-7)))
    path = written(tmp_path_factory.mktemp("t") / "track.yaml", track_file(track, made_of))
    again = load_track_file(path)
    assert again.track == track
    assert again.made_of == made_of
    assert track_file(again.track, again.made_of) == path.read_bytes()
    # Any reader of YAML 1.1 finds numbers in it, not text.
    plain = yaml.load(path.read_bytes(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    assert (
        plain["points"]
        == np.column_stack(
            (track.centreline.points_m, track.centreline.half_left_m, track.centreline.half_right_m)
        ).tolist()
    )


def test_its_head_is_for_people(tmp_path: Path) -> None:
    """Name, scale, whether it is closed, length, origin and lines, in metres and twin px, come before the points."""
    text = track_file(make_track(), MadeOf(picture="twin.png", sha256="ab" * 32, waypoints_px=((3.5, 4.0),))).decode()
    head = text[: text.index("points:")].splitlines()
    assert len(head) < 20
    keys = list(yaml.safe_load("\n".join(head)))
    assert keys == ["format", "version", "name", "closed", "length_m", "scale", "made_of", "lines"]
    lines = yaml.safe_load("\n".join(head))["lines"]
    assert list(lines) == ["start", "finish", "sectors"]
    for line in (lines["start"], lines["finish"], *lines["sectors"]):
        for (u, v), (x, y) in zip(line["px"], line["m"], strict=True):
            assert (u * 0.01, (400 - v) * 0.01) == pytest.approx((x, y), abs=1e-4)
    assert max(map(len, head)) < 180


def test_files_of_version_1_are_read(tmp_path: Path) -> None:
    """JSON as `track build --out` wrote it before: closed, without a finish line, exact to the last bit, 1e-05 and all."""
    route = make_track(radius=1e-4, half=1e-5).centreline
    scale = {"metres_per_px": 0.0001, "height_px": 40000.0}
    document = {
        "format": "dnb-edge track", "version": 1,
        "track": {
            "name": "old", "scale": scale, "sector_lines": [],
            "centreline": {"points_m": route.points_m.tolist(), "half_left_m": route.half_left_m.tolist(),
                           "half_right_m": route.half_right_m.tolist()},
            "start_line": {"name": "start", "start_m": [2.0, 2.0], "end_m": [2.1, 2.0]},
        },
    }  # fmt: skip
    assert "e-05" in json.dumps(document)
    track = load_track(written(tmp_path / "track.json", json.dumps(document)))
    assert track.centreline == route
    assert track.finish_line is None
    assert track.start_line == DirectedLine(name="start", start_m=(2.0, 2.0), end_m=(2.1, 2.0))


def edited(pattern: str, new: str) -> str:
    text, count = re.subn(pattern, new, track_file(make_track(sector_name="last bend")).decode(), count=1)
    assert count == 1
    return text


def test_a_line_moved_by_hand_is_where_it_was_moved(tmp_path: Path) -> None:
    """New ends in twin px and no metres: the start line is there, and a lap begins there."""
    before = make_track()
    moved = edited(r"start: \{.*\}", "start: {px: [[200, 280], [200, 255]]}")
    after = load_track(written(tmp_path / "t.yaml", moved))
    x, y = after.centreline.point_at(0.0)
    assert (x, y) == pytest.approx((2.0, 1.3), abs=2e-3)
    assert after.centreline.length_m == pytest.approx(before.centreline.length_m, rel=1e-3)
    assert [line.name for line in after.sector_lines] == ["last bend"]
    taken_off = load_track(written(tmp_path / "t.yaml", edited(r"  finish: .*\n", "")))
    assert taken_off.finish_line is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (edited("version: 2", "version: 3"), "of version 3, known are 1 and 2: build it anew"),
        (edited("name: ", "nmae: "), "name: is missing"),
        (edited("closed: true", "closed: true\nlanes: 2"), "lanes: unknown key"),
        (edited("closed: true", "closed: often"), "closed: "),
        (edited(r"closed: true((.|\n)*)  finish: .*\n", r"closed: false\1"), "an open route needs a finish line"),
        (edited(r"\n- \[[^,]*,", "\n- [oops,"), "points.0.0: "),
        (edited(r"\n- \[[^,]*,", "\n- [.inf,"), "points.0.0: "),
        (edited(r"\n- \[.*\]", "\n- [1.0, 2.0]"), "points.0.2: is missing"),
        (edited(r"points:(.|\n)*", "points: []"), "needs at least three finite points"),
        (edited(r"start: \{px: \[\[", "start: {px: [[1"), "'start' has other ends in px than in m: delete m to take px"),
        (edited(r"start: \{.*\}", "start: {}"), "'start' has no ends: give px"),
        (edited(r"start: \{.*\}", "start: {px: [[1, 2], [3, 4]]}"), "line 'start' .* crosses the route 0 times"),
        (edited(r"metres_per_px: 0.01", "metres_per_px: -1"), "metres_per_px must be a positive number"),
        ("format: dnb-edge track\nname: [", ", line \\d: not a track file"),
        ("just text", "not a track file: make one"),
        ("{", "not a track file: make one"),
        ("[" * 3000, "not a track file"),
        (b"\xff\xfe", "not a track file"),
        ("", "not a track file"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_one_line_that_names_it(tmp_path: Path, text: str | bytes, message: str) -> None:
    """Whatever was broken by hand: file, key and remedy."""
    path = written(tmp_path / "track.yaml", text)
    with pytest.raises(InputError, match=message) as caught:
        load_track(path)
    assert str(caught.value).startswith(f"{path}")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """No file, no traceback."""
    with pytest.raises(InputError, match="cannot read the track file"):
        load_track(tmp_path / "none.yaml")
