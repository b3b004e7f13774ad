"""`dnb-edge track`, as a shell sees it."""

import hashlib
import json
import re
import sys

import cv2
import numpy as np
import pytest
from twin_pictures import SIZE, painted, ring, theta, two_rings, winding

from dnb_edge.cli.main import main
from dnb_edge.config.track_file import load_track

PINK = ("--lane-hsv", "330,23,84")


@pytest.fixture
def shell(monkeypatch, capsys):
    """Runs the command with arguments; gives exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


@pytest.fixture
def twin(tmp_path):
    path = tmp_path / "twin.png"
    cv2.imwrite(str(path), painted(theta()))
    return path


def test_build_says_what_it_found_as_json(shell, twin):
    """The contract's four members, alone on stdout; no scale, no metres."""
    code, out, err = shell("track", "build", "--image", twin, *PINK, "--json")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["length_px"] == pytest.approx(1080, rel=0.01)
    assert facts["length_m"] is None
    assert facts["closed"] is True
    assert facts["points"] > 100


@pytest.mark.parametrize(
    ("options", "metres"),
    [
        (("--length-m", "10.8"), 10.8),
        (("--length-m", "1", "--measured", "0,0,60,80"), 10.8),
        (("--metres-per-px", "0.01"), 10.8),
    ],
)
def test_the_scale_in_three_ways(shell, twin, options, metres):
    """From the lap's length, from one measured line, or plainly."""
    code, out, _ = shell("track", "build", "--image", twin, *PINK, *options, "--json")
    assert code == 0
    assert json.loads(out)["length_m"] == pytest.approx(metres, rel=0.01)


def test_the_track_file_and_its_pictures(shell, twin, tmp_path):
    """What build writes, show reads and draws, on the twin or on paper; nothing else is left behind."""
    out, overlay, shown = (tmp_path / name for name in ("track.json", "overlay.png", "shown.png"))
    code, text, _ = shell(
        "track", "build", "--image", twin, *PINK, "--metres-per-px", "0.01", "--name", "square", "--out", out,
        "--overlay", overlay, "--waypoint", "200,200", "--waypoint", "350,200", "--start-line", "320,180,380,180",
    )  # fmt: skip
    assert code == 0
    assert text.startswith("square: a closed route of ")
    track = load_track(out)
    assert track.name == "square"
    assert track.centreline.direction_at(0)[1] > 0.9
    assert cv2.imread(str(overlay)).shape == (SIZE, SIZE, 3)
    for image in ((), ("--image", twin)):
        code, text, _ = shell("track", "show", out, "--overlay", shown, *image)
        assert code == 0
        assert text.startswith(f"square: {track.centreline.length_m:.3f} m")
    assert np.array_equal(cv2.imread(str(shown)), cv2.imread(str(overlay)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["overlay.png", "shown.png", "track.json", "twin.png"]


def test_the_picture_lies_beside_the_track_file(shell, twin, tmp_path):
    """Without --overlay it has the track file's name; and never overwrites the twin or the track file itself."""
    before = twin.read_bytes()
    for out, picture in (
        ("track.yaml", "track.png"),
        ("twin.yaml", "twin-overlay.png"),
        ("odd.png", "odd-overlay.png"),
    ):
        code, _, _ = shell("track", "build", "--image", twin, *PINK, "--metres-per-px", "0.01", "--out", tmp_path / out)
        assert code == 0
        assert cv2.imread(str(tmp_path / picture)).shape == (SIZE, SIZE, 3)
        assert load_track(tmp_path / out).name == "twin"
    assert twin.read_bytes() == before


def test_show_is_a_table_and_draws_only_where_asked(shell, twin, tmp_path):
    """Length, bend, widths, scale, lines with their places, and what the track was made of."""
    out = tmp_path / "track.yaml"
    options = (
        "--start-at",
        "350,200",
        "--finish-at",
        "200,350",
        "--sector-at",
        "200,50",
        "--sector-line",
        "20,200,80,200",
    )
    code, _, err = shell("track", "build", "--image", twin, *PINK, "--length-m", "10.8", "--out", out, *options)
    assert (code, err) == (0, "")
    code, text, _ = shell("track", "show", out)
    assert code == 0
    rows = dict(re.split(r"  +", row.strip(), maxsplit=1) for row in text.splitlines()[1:])
    assert rows["route"].startswith("closed, 10.800 m, ")
    assert float(rows["tightest bend"].split()[1]) == pytest.approx(0.7, abs=0.05)
    assert rows["line start"].startswith("s 0.000 m; ")
    places = [float(rows[f"line {name}"].split()[1]) for name in ("sector 1", "sector 2", "finish")]
    assert places == sorted(places)
    assert rows["made of"].startswith(f"twin.png, SHA-256 {hashlib.sha256(twin.read_bytes()).hexdigest()}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["track.png", "track.yaml", "twin.png"]
    code, _, err = shell("track", "show", out, "--image", twin)
    assert code == 2
    assert "say where the picture goes with --overlay" in err


def test_a_route_from_point_to_point(shell, tmp_path):
    """`--open` with two waypoints: the contract's members say that it is not closed, and the file is read again."""
    mask, drawn = winding()
    image, out = tmp_path / "twin.png", tmp_path / "t.yaml"
    cv2.imwrite(str(image), painted(mask))
    ends = [f"{u:.0f},{v:.0f}" for u, v in (drawn[0], drawn[-1])]
    code, text, _ = shell(
        "track", "build", "--image", image, *PINK, "--open", "--waypoint", ends[0], "--waypoint", ends[1], "--out", out,
        "--metres-per-px", "0.01", "--json",
    )  # fmt: skip
    assert code == 0
    facts = json.loads(text)
    assert facts["closed"] is False
    drawn_px = float(np.hypot(*np.diff(drawn, axis=0).T).sum())
    assert facts["length_px"] == pytest.approx(drawn_px, rel=0.02)
    assert facts["length_m"] == pytest.approx(drawn_px / 100, rel=0.02)
    assert facts["min_radius_m"] == pytest.approx(facts["min_radius_px"] / 100)
    assert facts["min_radius_m"] == pytest.approx(0.25, rel=0.2)
    assert not load_track(out).centreline.closed
    _, text, _ = shell("track", "show", out)
    assert "from point to point, 4." in text
    assert "line finish" in text


def test_several_loops_are_shown_and_asked_about(shell, tmp_path):
    """Exit code 2, one line with a waypoint for each, and a picture with their letters where one was asked for."""
    image, overlay = tmp_path / "twin.png", tmp_path / "loops.png"
    cv2.imwrite(str(image), painted(two_rings()))
    code, out, err = shell(
        "track", "build", "--image", image, *PINK, "--overlay", overlay, "--out", tmp_path / "t.yaml"
    )
    assert (code, out) == (2, "")
    waypoints = re.findall(r"[AB] \(about \d+ px long, waypoint (\d+,\d+)\)", err)
    assert len(waypoints) == 2
    assert err.count("\n") == 1
    assert cv2.imread(str(overlay)).shape == (SIZE, SIZE, 3)
    assert not (tmp_path / "t.yaml").exists()
    for waypoint in waypoints:
        code, out, _ = shell("track", "build", "--image", image, *PINK, "--waypoint", waypoint, "--json")
        assert code == 0
        assert json.loads(out)["length_px"] == pytest.approx(377, rel=0.01)


def gap():
    mask = ring()
    mask[185:215, :120] = False
    return mask


@pytest.mark.parametrize(
    ("mask", "options", "message"),
    [
        (None, PINK, "cannot read the twin's image (No such file or directory): check the path"),
        (b"text", PINK, "not an image that OpenCV can read"),
        (ring(), ("--lane-hsv", "120,80,60"), "no pixel of the picture within hue 120"),
        (gap(), PINK, "the lane is not closed: it ends at ("),
        (two_rings(), PINK, "the lanes form 2 loops"),
        (gap(), (*PINK, "--open"), "needs at least two waypoints, its two ends; the lane ends at ("),
        (ring(), (*PINK, "--start-at", "200"), "--start-at 200: must be 2 numbers"),
        (ring(), (*PINK, "--sector-line", "200,100"), "--sector-line 200,100: must be 4 numbers"),
        (ring(), (*PINK, "--start-at", "200,200"), "(200, 200) twin px of the line 'start' is 1"),
        (ring(), (*PINK, "--waypoint", "200,200"), "waypoint (200, 200) twin px is 1"),
        (ring(), (*PINK, "--waypoint", "200"), "--waypoint 200: must be 2 numbers with commas between them"),
        (ring(), ("--lane-hsv", "330,x,84"), "--lane-hsv 330,x,84: must be 3 numbers"),
        (ring(), ("--lane-hsv", "400,23,84"), "hue_deg must lie between 0 and 360"),
        (ring(), (*PINK, "--start-line", "0,200,400,200"), "crosses the route 2 times"),
        (ring(), (*PINK, "--out", "OUT"), "a track file needs the scale"),
        (ring(), (*PINK, "--measured", "0,0,9,9"), "give its length on the floor with --length-m"),
        (ring(), (*PINK, "--length-m", "-1"), "--length-m -1: must be a positive number"),
        (ring(), (*PINK, "--length-m", "1", "--metres-per-px", "1"), "give it or --length-m, not both"),
        (ring(), (*PINK, "--metres-per-px", "0"), "metres_per_px must be a positive number"),
        (ring(), (*PINK, "--metres-per-px", "1", "--out", "nowhere/OUT"), "make it first"),
        (ring(), (*PINK, "--metres-per-px", "1", "--out", "twin.png"), "--out twin.png: that file is read, and would"),
        (ring(), (*PINK, "--overlay", "twin.png"), "--overlay twin.png: that file is read, and would be lost"),
        (
            ring(),
            (*PINK, "--metres-per-px", "1", "--out", "t", "--overlay", "t"),
            "that is where --out goes: name another",
        ),
        (
            ring(),
            (*PINK, "--close-gap-px", "nan"),
            "must lie between 0 and 100 twin px, a quarter of the picture, not nan",
        ),
        (ring(), (*PINK, "--close-gap-px", "1e9"), "not 1e+09"),
        (ring(), (*PINK, "--close-gap-px", "-3"), "not -3"),
    ],
)
def test_bad_input_is_one_line_and_code_2(shell, tmp_path, monkeypatch, mask, options, message):
    """Every mistake: exit code 2, one line, no traceback, nothing on stdout, no file written."""
    monkeypatch.chdir(tmp_path)
    twin = tmp_path / "twin.png"
    if isinstance(mask, bytes):
        twin.write_bytes(mask)
    elif mask is not None:
        cv2.imwrite(str(twin), painted(mask))
    before = sorted(tmp_path.rglob("*"))
    code, out, err = shell("track", "build", "--image", twin, *options)
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("dnb-edge: ")
    assert err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot read the track file"),
        ("{", "not a track file"),
        ("[]", "not a track file"),
        ('{"format": "dnb-edge track", "version": 9, "track": {}}', "of version 9, known are 1 and 2"),
        ('{"format": "dnb-edge track", "version": 1, "track": {}}', "build the track file anew"),
    ],
)
def test_damaged_track_files(shell, tmp_path, content, message):
    """A track file that is missing, cut, foreign, newer or empty is one line and code 2."""
    path = tmp_path / "track.json"
    if content is not None:
        path.write_text(content)
    code, _, err = shell("track", "show", path, "--overlay", tmp_path / "x.png")
    assert code == 2
    assert f"{path}: " in err
    assert message in err
    assert not (tmp_path / "x.png").exists()


def test_show_does_not_draw_over_what_it_reads(shell, twin, tmp_path):
    """Neither over the track file nor over the twin's picture."""
    out = tmp_path / "t.yaml"
    assert shell("track", "build", "--image", twin, *PINK, "--metres-per-px", "0.01", "--out", out)[0] == 0
    before = out.read_bytes(), twin.read_bytes()
    for overlay in (out, twin):
        code, _, err = shell("track", "show", out, "--image", twin, "--overlay", overlay)
        assert (code, "that file is read, and would be lost" in err) == (2, True)
    assert (out.read_bytes(), twin.read_bytes()) == before


def test_the_papers_twin(shell, real_dir):
    """The command on the paper's own drawing."""
    image = real_dir / "drivenetbench" / "digital-twin.jpg"
    code, out, _ = shell("track", "build", "--image", image, *PINK, "--json")
    assert code == 0
    assert json.loads(out)["length_px"] == pytest.approx(8076, rel=0.01)
