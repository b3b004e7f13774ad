"""`dnb-edge print` as a shell runs it: sheets and the files beside them, and one line where it cannot be."""

import pytest
from edge_command import edge


def test_roof_markers_are_printed_with_their_configuration(tmp_path):
    """One PDF, and the lines for the configuration."""
    ran = edge("print", "markers", "--ids", "7,12-14", "--size-mm", 50, "--paper", "Letter", cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert (tmp_path / "markers.pdf").read_bytes().startswith(b"%PDF")
    assert "ids: [7, 12, 13, 14]" in ran.out
    assert "marker_size_m: 0.05" in ran.out


def test_floor_markers_are_printed_with_their_layout(tmp_path):
    """The layout lies beside the sheets; as SVG each sheet is a file of its own."""
    ran = edge("print", "floor", "--count", 4, "--out", "f.svg", cwd=tmp_path)
    assert ran.code == 0, ran.err
    names = ["f-0.svg", "f-1.svg", "f-2.svg", "f-3.svg", "f-plan.svg", "f.layout.yaml"]
    assert sorted(file.name for file in tmp_path.iterdir()) == names


def test_a_board_is_printed_with_what_to_type(tmp_path):
    """One page, and the command that looks for it."""
    ran = edge("print", "board", "--board", "chessboard:7x10:15mm", "--out", "b.svg", cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert (tmp_path / "b.svg").read_text().startswith("<?xml")
    assert "calibrate lens --source v4l2:/dev/video0 --board chessboard:7x10:15mm" in ran.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("markers", "--dictionary", "QR"), "unknown family"),
        (("markers", "--ids", "49,50"), "4X4_50 has the markers 0 to 49, not 50"),
        (("markers", "--ids", "nose"), "'nose' is no number"),
        (("markers", "--ids", "9-2"), "write the lower number first"),
        (("markers", "--ids", "0-999"), "200 at most"),
        (("markers", "--size-mm", "190"), "--size-mm 190: with its white border"),
        (("markers", "--size-mm", "nan"), "--size-mm nan: must be a positive number"),
        (("markers", "--size-mm", "3"), "--size-mm 3: no camera reads so small a marker: 10 mm is the least"),
        (("track", "--marker-mm", "3"), "--marker-mm 3: no camera reads so small a marker"),
        (("markers", "--paper", "a5"), "--paper a5: must be one of a4, a3, letter"),
        (("markers", "--out", "markers.png"), "the name must end in .pdf or .svg"),
        (("markers", "--out", "nowhere/markers.pdf"), "there is no directory nowhere"),
        (("floor", "--family", "4X4_51"), "unknown family"),
        (("floor", "--first-id", "47"), "4X4_50 has the markers 0 to 49, not 50"),
        (("floor", "--size-mm", "200"), "--size-mm 200: with its white border"),
        (("floor", "--area", "2"), "--area 2: must be two lengths"),
        (("floor", "--area", "0.1x3"), "--area 0.1x3: must be two lengths"),
        (("board", "--board", "chessboard:7x10:40mm"), "do not fit on a4 paper"),
        (("board", "--board", "charuco:9x9"), "charuco:9x9"),
        (("track", "none.yaml"), "none.yaml: cannot read the track file"),
        (("track", "--paper", "b4"), "--paper b4: must be one of a4, a3, letter"),
        (("track", "--overlap-mm", "120"), "--overlap-mm 120: must be from 0 to"),
        (("track", "--marker-mm", "160"), "--marker-mm 160: only 0 floor markers"),
        (("track", "--markers", "2"), "--markers 2: must be 0, or 4 and more"),
        (("track", "--first-id", "48"), "4X4_50 has the markers 0 to 49, not 50"),
        (("track", "--dictionary", "x"), "unknown family"),
        (("track", "--out", "track.txt"), "the name must end in .pdf or .svg"),
        (("track", "--out", "nowhere/track.pdf"), "there is no directory nowhere"),
    ],
)
def test_what_cannot_be_printed_is_one_line_and_2(words, said, tmp_path):
    """Unknown families, numbers beyond them, sizes that paper does not hold: one line, exit code 2, and no file."""
    ran = edge("print", *words, cwd=tmp_path)
    assert ran.code == 2
    assert said in ran.complaint()
    assert list(tmp_path.iterdir()) == []


def test_nothing_of_the_users_own_is_written_over(tmp_path):
    """A track of another making keeps its file; a configuration that was changed by hand stays; sheets are made anew."""
    words = ("print", "track", "--paper", "poster", "--markers", 0)
    assert edge(*words, cwd=tmp_path).code == 0
    race = tmp_path / "track.race.yaml"
    mine = race.read_text().replace("my car", "the red one")
    race.write_text(mine)
    ran = edge(*words, cwd=tmp_path)
    assert (ran.code, race.read_text()) == (0, mine)
    assert "left as it is" in ran.out
    (tmp_path / "track.yaml").write_text("format: dnb-edge track\nname: mine\n")
    (tmp_path / "track.pdf").unlink()
    ran = edge(*words, cwd=tmp_path)
    assert ran.code == 2
    assert "track.yaml is there, a track that was not made here" in ran.complaint()
    assert not (tmp_path / "track.pdf").exists()
    assert (tmp_path / "track.yaml").read_text().endswith("mine\n")
