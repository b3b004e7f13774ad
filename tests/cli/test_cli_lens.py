"""`dnb-edge calibrate lens`, as a shell sees it: photographs, a clip, Ctrl-C, and every mistake in one line."""

import json
import shutil
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from dnb_edge.cli import lens_views
from dnb_edge.cli.main import main
from dnb_edge.config.lens_file import load_lens
from dnb_edge.errors import InputError
from dnb_edge.values import Clock, Frame, SourceInfo, StampSource

BOARD = "chessboard:7x5:25mm"
SIZE = (640, 360)
FOCAL_PX = 500.0


def board_picture(pose, seed=0):
    """A grey picture of the board, drawn through a pinhole without distortion."""
    side, across, down = 50, 8, 6
    rows, columns = np.indices((down * side, across * side)) // side
    paper = cv2.copyMakeBorder(
        np.where((rows + columns) % 2, 235, 20).astype(np.uint8), side, side, side, side, cv2.BORDER_CONSTANT, value=245
    )
    rvec, tvec = pose
    rotation, _ = cv2.Rodrigues(np.array(rvec, float))
    matrix = np.array([[FOCAL_PX, 0, 319.5], [0, FOCAL_PX, 179.5], [0, 0, 1]])
    metres = np.array(
        [[0.025 / side, 0, -0.05 + 0.5 * 0.025 / side], [0, 0.025 / side, -0.05 + 0.5 * 0.025 / side], [0, 0, 1]]
    )
    to_picture = matrix @ np.column_stack((rotation[:, 0], rotation[:, 1], tvec)) @ metres
    fine = np.diag([2.0, 2.0, 1.0]) @ to_picture
    drawn = cv2.warpPerspective(paper, fine, (1280, 720), flags=cv2.INTER_LINEAR, borderValue=110)
    small = cv2.resize(drawn, SIZE, interpolation=cv2.INTER_AREA).astype(float)
    return np.clip(small + np.random.default_rng(seed).normal(0, 2, small.shape), 0, 255).astype(np.uint8)


def poses(count, *, tilt=0.6):
    """Boards all over the picture, tilted all ways."""
    random = np.random.default_rng(4)
    shown = []
    for i in range(count):
        way = 2.4 * i
        rvec = tilt * np.array([np.cos(way), np.sin(way), 0.0]) * random.uniform(0.5, 1.0)
        far = random.uniform(0.36, 0.5)
        shown.append((rvec, np.array([*(random.uniform(-1, 1, 2) * (0.14, 0.06) - (0.075, 0.05)), far])))
    return shown


@pytest.fixture(scope="session")
def drawn_photographs(tmp_path_factory):
    """Twelve photographs of the board; for reading only."""
    folder = tmp_path_factory.mktemp("boards")
    for i, pose in enumerate(poses(12)):
        cv2.imwrite(str(folder / f"photo-{i:02d}.png"), board_picture(pose, seed=i))
    return folder


@pytest.fixture
def photographs(drawn_photographs, tmp_path):
    """The same, for the test's own use."""
    return shutil.copytree(drawn_photographs, tmp_path / "photographs")


@pytest.fixture
def shell(monkeypatch, capsys, tmp_path):
    """Runs the command with arguments; gives exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", "calibrate", "lens", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


def test_photographs_as_json_file_and_picture(shell, photographs, tmp_path):
    """The contract's fields and more as one JSON object, the lens file with each photograph's SHA-256, and the picture."""
    cv2.imwrite(str(photographs / "z-nothing.png"), np.full((360, 640), 120, np.uint8))
    wanted = ("--out", tmp_path / "lens.yaml", "--plot", tmp_path / "lens.png", "--camera-id", "cam 1")
    code, out, err = shell("--images", photographs, "--board", BOARD, "--json", *wanted)
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["rms_px"] < 0.3
    assert facts["camera_matrix"][0][0] == pytest.approx(FOCAL_PX, rel=0.01)
    assert 2 <= len(facts["distortion"]) <= 5
    assert [view["name"] for view in facts["views"]] == [f"photo-{i:02d}.png" for i in range(12)]
    assert facts["without_board"] == ["z-nothing.png"]
    assert facts["looked_at"] == 13
    assert np.shape(facts["coverage"]["counts"]) == (3, 3)
    assert facts["sigmas"]["fx_px"] > 0
    assert cv2.imread(str(tmp_path / "lens.png")) is not None
    kept = load_lens(tmp_path / "lens.yaml")
    assert kept.lens.matrix.tolist() == facts["camera_matrix"]
    assert list(kept.lens.distortion) == facts["distortion"]
    assert kept.camera_id == "cam 1"
    assert all(len(view.sha256) == 64 for view in kept.views)


def test_a_table_for_people_and_a_picture_as_svg(shell, photographs, tmp_path):
    """Without --json: each view's error, the numbers with their sigmas, coverage and advice."""
    code, out, _ = shell("--images", photographs, "--board", BOARD, "--plot", tmp_path / "lens.svg")
    assert code == 0
    for said in ("photo-03.png", "fx_px", "sigma", "12 views", "15 or more", "RMS"):
        assert said in out
    assert (tmp_path / "lens.svg").read_bytes().startswith(b"<?xml")


def test_a_spoilt_photograph_is_named_and_can_be_left_out(shell, photographs):
    """A photograph that was stretched is named as the bad view; left out, nothing is bad any more."""
    spoilt = photographs / "photo-04.png"
    picture = cv2.imread(str(spoilt), cv2.IMREAD_GRAYSCALE)
    bend = np.float32([[1, 0.0, 0], [0.0, 1, 0], [3e-4, 0, 1]])
    cv2.imwrite(
        str(spoilt), cv2.warpPerspective(cv2.resize(picture, None, fx=0.85, fy=1.0), bend, SIZE, borderValue=110)
    )
    facts = json.loads(shell("--images", photographs, "--board", BOARD, "--json")[1])
    assert facts["bad_views"] == ["photo-04.png"]
    assert facts["rms_without_bad_px"] < facts["rms_px"]
    again = json.loads(shell("--images", photographs, "--board", BOARD, "--json", "--leave-out", "photo-04.png")[1])
    assert again["bad_views"] == []
    assert again["looked_at"] == 11


def write_clip(path: Path) -> Path:
    """A clip in which the board is held still for four frames in each of 14 places."""
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 30, SIZE)
    assert writer.isOpened()
    for i, pose in enumerate(poses(14)):
        for k in range(4):
            writer.write(cv2.cvtColor(board_picture(pose, seed=4 * i + k), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def test_a_clip_to_the_end(shell, tmp_path):
    """From a clip: as many views as asked for, kept as pictures from which the same lens comes again."""
    clip, kept = write_clip(tmp_path / "clip.mp4"), tmp_path / "views"
    words = ("--source", f"file:{clip}", "--board", BOARD, "--views", 10, "--save-views", kept)
    code, out, err = shell(*words, "--json", "--out", tmp_path / "lens.yaml")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert len(facts["views"]) == 10
    assert facts["looked_at"] == 56
    assert facts["camera_matrix"][0][0] == pytest.approx(FOCAL_PX, rel=0.02)
    assert sorted(path.name for path in kept.iterdir()) == [f"view-{i:02d}.png" for i in range(1, 11)]
    assert all(view.sha256 is not None for view in load_lens(tmp_path / "lens.yaml").views)
    again = json.loads(shell("--images", kept, "--board", BOARD, "--json")[1])
    assert again["camera_matrix"][0][0] == pytest.approx(facts["camera_matrix"][0][0], rel=0.002)
    assert "is not empty" in shell(*words)[2]


class HeldBoard:
    """A camera before which the board is moved; Ctrl-C comes after `until` frames."""

    def __init__(self, until):
        self._until, self.closed = until, False
        self.info = SourceInfo(
            uri="v4l2:/dev/video0", width_px=SIZE[0], height_px=SIZE[1], nominal_fps=30.0, clock=Clock.MONOTONIC, live=True,
            camera_id="usb-cam",
        )  # fmt: skip

    def frames(self):
        for i, pose in enumerate(poses(60)):
            picture = cv2.cvtColor(board_picture(pose), cv2.COLOR_GRAY2BGR)
            for k in range(2):
                if 2 * i + k == self._until:
                    raise KeyboardInterrupt
                yield Frame(
                    sequence=2 * i + k, t_ns=(2 * i + k) * 10**8, stamp_source=StampSource.ARRIVAL,
                    width_px=SIZE[0], height_px=SIZE[1], bgr=picture,
                )  # fmt: skip

    def close(self):
        self.closed = True


@pytest.fixture
def camera(monkeypatch):
    """Puts a held board before the camera."""

    def hold(until=None):
        held = HeldBoard(until)
        monkeypatch.setattr(lens_views, "make_source", lambda uri, config: held)
        return held

    return hold


LIVE = ("--source", "v4l2:/dev/video0", "--board", BOARD, "--json")


def test_a_camera_until_there_is_enough(shell, camera, tmp_path):
    """A live source is left as soon as there are enough views, and its identity goes into the lens file."""
    held = camera()
    code, out, err = shell(*LIVE, "--views", 9, "--out", tmp_path / "lens.yaml")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert len(facts["views"]) == 9
    assert facts["looked_at"] < 60
    assert facts["camera_id"] == load_lens(tmp_path / "lens.yaml").camera_id == "usb-cam"
    assert held.closed


def test_ctrl_c_calibrates_from_what_there_is(shell, camera):
    """Ctrl-C ends the search, not the work; with too few views it says how many more."""
    camera(until=30)
    code, out, _ = shell(*LIVE, "--views", 40)
    assert code == 0
    assert 8 <= len(json.loads(out)["views"]) <= 15
    camera(until=6)
    code, out, err = shell(*LIVE)
    assert (code, out) == (2, "")
    assert "found in 3 pictures, 6 are the least and 15 good: take 3 more" in err


def test_a_board_never_still(shell, camera):
    """A board that is seen but always moves is told from one that is not seen."""
    camera(until=1)
    assert "seen in 1 of 1 pictures of v4l2:/dev/video0, but never still" in shell(*LIVE)[2]
    camera(until=2)
    words = ("--source", "v4l2:/dev/video0", "--board", "chessboard:9x5:25mm")
    assert "no chessboard of 9x5 inner corners in any of 2 pictures" in shell(*words)[2]


def other_size(folder):
    cv2.imwrite(str(folder / "photo-05.png"), np.zeros((480, 640), np.uint8))


def few(folder):
    for path in sorted(folder.iterdir())[4:]:
        path.unlink()


def one_pose(folder):
    first = (folder / "photo-00.png").read_bytes()
    for path in folder.iterdir():
        path.write_bytes(first)


def cut(folder):
    whole = cv2.imencode(".jpg", np.full((360, 640), 90, np.uint8))[1].tobytes()
    (folder / "photo-99.jpg").write_bytes(whole[: len(whole) // 2])


NOTHING = lambda folder: None  # noqa: E731


@pytest.mark.parametrize(
    ("spoil", "words", "said"),
    [
        (few, ("--board", "chessboard:8x6:25mm"), "is it --board chessboard:7x5:25mm?"),
        (few, ("--board", "chessboard:11x4:25mm"), "no chessboard of 11x4 inner corners in any of 4 pictures in"),
        (
            NOTHING,
            ("--board", "charuco:5x7:30mm:22mm"),
            "no ChArUco board charuco:5x7:30mm:22mm:DICT_5X5_100 in any of 12",
        ),
        (NOTHING, ("--board", "chessboard:7x5:25"), "'25' is no length"),
        (NOTHING, ("--board", BOARD, "--source", "sim:"), "give --images FOLDER or --source URI, one of them"),
        (NOTHING, ("--board", BOARD, "--plot", "a.pdf"), "must end in .png or .svg"),
        (NOTHING, ("--board", BOARD, "--plot", "gone/a.png"), "there is no directory gone"),
        (NOTHING, ("--board", BOARD, "--out", "a.json"), "must end in .yaml"),
        (NOTHING, ("--board", BOARD, "--save-views", "v"), "they go with --source"),
        (NOTHING, ("--board", BOARD, "--leave-out", "no.png"), "there is no such picture"),
        (NOTHING, ("--board", BOARD, "--coefficients", "6"), "a pinhole has 4, 5 or 8"),
        (NOTHING, ("--board", BOARD, "--coefficients", "4", "--model", "fisheye"), "a fisheye always 4"),
        (other_size, ("--board", BOARD), "photo-05.png: 640x480, but photo-00.png is 640x360"),
        (few, ("--board", BOARD), "found in 4 pictures, 6 are the least and 15 good: take 2 more"),
        (one_pose, ("--board", BOARD), "tilt the board by 30 to 45 degrees"),
        (
            lambda folder: (folder / "photo-03.png").write_bytes(b"text"),
            ("--board", BOARD),
            "photo-03.png: not a readable",
        ),
        (lambda folder: (folder / "photo-03.png").write_bytes(b""), ("--board", BOARD), "photo-03.png: not a readable"),
        (cut, ("--board", BOARD), "photo-99.jpg: cut off"),
        (shutil.rmtree, ("--board", BOARD), "not a folder"),
    ],
)
def test_bad_input_is_one_line_and_code_2(shell, photographs, spoil, words, said):
    """Every mistake: exit code 2, one line that says what to do, nothing on stdout."""
    spoil(photographs)
    code, out, err = shell("--images", photographs, *words, "--json")
    assert (code, out) == (2, "")
    assert said in err
    assert err.startswith("dnb-edge: ")
    assert err.count("\n") == 1


def test_a_board_to_print(shell, tmp_path):
    """`--print` writes a PDF and nothing else; a wrong name, paper or a board that is too large is one line."""
    sheet = tmp_path / "board.pdf"
    code, out, err = shell("--print", sheet, "--board", "charuco:5x7:30mm:22mm", "--paper", "letter")
    assert (code, out) == (0, "")
    assert "measure its bar of 100 mm" in err
    assert sheet.read_bytes().startswith(b"%PDF")
    for words, said in (
        (("--print", "a.png", "--board", BOARD), "must end in .pdf"),
        (("--print", sheet, "--board", BOARD, "--paper", "a9"), "must be one of a4, a3, letter"),
        (("--print", sheet, "--board", "chessboard:9x9:40mm"), "do not fit on a4 paper"),
    ):
        code, _, err = shell(*words)
        assert code == 2
        assert said in err
        assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("format: dnb-edge lens", "format: something", "not a lens file"),
        ("version: 1", "version: 2", "of version 2, known is 1"),
        ("rms_px:", "rms:", "rms_px: is missing"),
        ("fx_px: ", "fx_px: x", "lens.fx_px"),
        ("distortion: [", "distortion: [9.0, ", "distortion"),
        ("board: chessboard:7x5:25mm", "board: a board", "board 'a board'"),
        ("made_at", "colour: red\nmade_at", "colour: unknown key"),
    ],
)
def test_a_lens_file_that_was_spoilt(shell, photographs, tmp_path, old, new, said):
    """Every fault names the file and the key."""
    path = tmp_path / "lens.yaml"
    assert shell("--images", photographs, "--board", BOARD, "--out", path)[0] == 0
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_lens(path)
    assert str(path) in str(caught.value)
    assert said in str(caught.value)


def test_a_lens_for_other_pictures(shell, photographs, tmp_path):
    """Scaled pictures of the same shape are served, another shape and another camera are refused."""
    path = tmp_path / "lens.yaml"
    assert shell("--images", photographs, "--board", BOARD, "--out", path, "--camera-id", "left")[0] == 0
    kept = load_lens(path)
    assert kept.lens_for(*SIZE, camera_id="left") == kept.lens_for(*SIZE) == kept.lens
    assert kept.lens_for(1280, 720).fx_px == pytest.approx(2 * kept.lens.fx_px)
    with pytest.raises(InputError, match="another shape"):
        kept.lens_for(640, 480)
    with pytest.raises(InputError, match="of the camera left, not of right"):
        kept.lens_for(*SIZE, camera_id="right")
    with pytest.raises(InputError, match="cannot read the lens file"):
        load_lens(tmp_path / "none.yaml")
