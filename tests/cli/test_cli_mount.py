"""`dnb-edge mount plan`, as a shell sees it."""

import json
import sys

import cv2
import pytest

from dnb_edge.cli.main import main


@pytest.fixture
def shell(monkeypatch, capsys):
    """Runs the command with arguments; gives exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", "mount", "plan", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


PAPER = ("--track", "3.8x3.8", "--hfov", "85", "--size", "3840x2160", "--height", "2.15", "--pitch", "41")


def test_the_papers_place_as_json(shell):
    """One object on stdout and nothing on stderr; the given place is kept, the distance is chosen, every figure is there."""
    code, out, err = shell(*PAPER, "--json")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["stand"]["height_m"] == 2.15
    assert facts["stand"]["pitch_deg"] == 41.0
    assert facts["searched"] == ["distance_m"]
    assert facts["coverage"] == pytest.approx(1.0)
    assert facts["cut_off"] == []
    assert facts["blur_mm"] == pytest.approx(4.0)
    assert facts["near"]["worst_mm_per_px"] < facts["far"]["worst_mm_per_px"] < facts["worst"]["worst_mm_per_px"]
    assert 0.0005 < facts["crossing_sigma_s"] < 0.005
    assert facts["lap_sigma_s"] == pytest.approx(facts["crossing_sigma_s"] * 2**0.5)
    assert facts["better"]["worst"]["worst_mm_per_px"] < facts["worst"]["worst_mm_per_px"]
    assert any("Better" in sentence for sentence in facts["advice"])


def test_a_table_and_drawings_for_people(shell, tmp_path):
    """Without --json a table with units and advice, and the drawing in both formats."""
    svg, png = tmp_path / "plan.svg", tmp_path / "plan.png"
    code, out, err = shell("--track", "3.0x2.2", "--camera", "c920", "--out", svg, "--out", png)
    assert (code, err) == (0, "")
    for words in (
        "Logitech C920",
        "suggested",
        "mm a px along the view",
        "sigma of a crossing, ms",
        "track in the picture",
    ):
        assert words in out
    assert svg.read_bytes().startswith(b"<?xml")
    assert cv2.imread(str(png)) is not None


def test_a_camera_sets_what_is_not_given(shell):
    """The named camera's angle, size and rate hold, each unless it is given beside the name; no rows delay a global shutter."""
    facts = json.loads(shell("--track", "1x0.8", "--camera", "pi-gs-6mm", "--json")[1])
    assert (facts["size_px"], facts["fps"], facts["row_delay_s"]) == ([1456, 1088], 60.0, 0.0)
    facts = json.loads(shell("--track", "1x0.8", "--camera", "c920", "--size", "1280x720", "--fps", "25", "--json")[1])
    assert (facts["hfov_deg"], facts["size_px"], facts["fps"]) == (70.0, [1280, 720], 25.0)


def test_a_camera_over_the_track(shell):
    """A negative distance is a camera beyond the near edge; --sigma-px and --stamp-ms go into the sigma."""
    place = ("--track", "3x2.2", "--hfov", "66", "--height", "2.5", "--pitch", "80", "--distance", "-0.5", "--json")
    facts = json.loads(shell(*place)[1])
    assert facts["stand"]["distance_m"] == -0.5
    rough = json.loads(shell(*place, "--sigma-px", "10", "--stamp-ms", "1")[1])
    assert rough["near"]["sigma_px"] == 10
    assert rough["crossing_sigma_s"] > 2 * facts["crossing_sigma_s"]


USUAL = ("--track", "3x2.2", "--hfov", "66")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--track", "3.0", "--hfov", "66"), "--track 3.0"),
        (("--track", "3x-2", "--hfov", "66"), "--track 3x-2"),
        (("--track", "0x2", "--hfov", "66"), "--track 0"),
        (("--track", "3x2000", "--hfov", "66"), "--track 2000"),
        (("--track", "3x2"), "--hfov: give"),
        (("--track", "3x2", "--hfov", "0"), "--hfov 0"),
        (("--track", "3x2", "--hfov", "180"), "--hfov 180"),
        (("--track", "3x2", "--hfov", "nan"), "--hfov nan"),
        (("--track", "3x2", "--camera", "kodak"), "--camera kodak"),
        ((*USUAL, "--size", "1280"), "--size 1280"),
        ((*USUAL, "--size", "1280.5x720"), "--size 1280.5x720"),
        ((*USUAL, "--size", "0x720"), "--size 0x720"),
        ((*USUAL, "--fps", "2"), "--fps 2"),
        ((*USUAL, "--exposure-ms", "0"), "--exposure-ms 0"),
        ((*USUAL, "--height", "0"), "--height 0"),
        ((*USUAL, "--pitch", "91"), "--pitch 91: must be from 5 to 90 degrees"),
        ((*USUAL, "--pitch", "-10"), "--pitch -10"),
        ((*USUAL, "--speed", "0"), "--speed 0"),
        ((*USUAL, "--max-height", "0.1"), "--max-height 0.1"),
        ((*USUAL, "--max-height", "0.5", "--car-height", "0.6"), "--max-height 0.5"),
        ((*USUAL, "--max-height", "1.2"), "--max-height 1.2"),
        ((*USUAL, "--margin", "-1"), "--margin -1"),
        ((*USUAL, "--height", "0.2", "--pitch", "45", "--car-height", "0.3"), "--height 0.2"),
        ((*USUAL, "--height", "1", "--pitch", "90", "--distance", "20"), "--pitch 90"),
        ((*USUAL, "--out", "plan.pdf"), "--out plan.pdf"),
        ((*USUAL, "--out", "no-such-folder/plan.png"), "no-such-folder"),
    ],
)
def test_bad_input_is_one_line_that_names_the_option(shell, arguments, named):
    """Exit 2, nothing on stdout, one line on stderr."""
    code, out, err = shell(*arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert named in err


def test_help_teaches(shell):
    """The options, their units and an example."""
    code, out, _ = shell("--help")
    assert code == 0
    for words in ("--track", "3.0x2.2", "--pitch", "90 is straight down", "near edge", "mount plan"):
        assert words in " ".join(out.split())
