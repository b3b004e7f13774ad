"""`dnb-edge track`, as a shell sees it."""

import json
import sys

import cv2
import numpy as np
import pytest
from twin_pictures import SIZE, painted, ring, theta

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


def test_the_papers_twin(shell, real_dir):
    """The command on the paper's own drawing."""
    image = real_dir / "drivenetbench" / "digital-twin.jpg"
    code, out, _ = shell("track", "build", "--image", image, *PINK, "--json")
    assert code == 0
    assert json.loads(out)["length_px"] == pytest.approx(8076, rel=0.01)
