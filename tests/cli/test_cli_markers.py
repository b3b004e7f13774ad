"""`dnb-edge calibrate markers` as a shell runs it: sheets, pose, calibration, rectified floor, and what it refuses."""

import json

import cv2
import numpy as np
import pytest
from edge_command import edge
from typer.testing import CliRunner

from dnb_edge.cli.main import app
from dnb_edge.config.calibration_file import load_calibration, reference_picture
from dnb_edge.errors import InputError
from dnb_edge.sim.camera import mast_camera

MM = 2
"""Floor px a millimetre is 1 / MM."""
PLACES = ((0.3, 0.7, 0.2), (2.1, 0.8, 1.0), (0.5, 2.0, -0.5), (1.9, 2.1, 2.2), (1.2, 1.3, 0.0))
"""x and y, world m, and angle, rad, of each sheet's middle."""
HEIGHT_M, PITCH_DEG = 2.2, 58.0
CAMERA = mast_camera(
    position_m=(1.2, 0.0, HEIGHT_M), pitch_deg=PITCH_DEG, roll_deg=3.0, hfov_deg=66.0, size_px=(1280, 720)
)


def floor(size_mm=150.0, numbers=(0, 1, 2, 3, 4)):
    """The floor from above, 2.4 x 2.8 m, y upwards, with the sheets on it."""
    height, width = 2800 // MM, 2400 // MM
    rng = np.random.default_rng(2)
    grey = 90 + cv2.GaussianBlur(rng.normal(0, 60, (height, width)).astype(np.float32), (0, 0), 3)
    codes = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for number in numbers:
        sheet = np.full((210, 210), 235, np.uint8)
        sheet[30:180, 30:180] = cv2.aruco.generateImageMarker(codes, number, 150)
        x, y, angle = PLACES[number]
        # Sheet px are size_mm / 150 mm; about the middle of the sheet, turned anticlockwise, v down.
        step = size_mm / 150.0 / MM
        c, s = np.cos(angle) * step, np.sin(angle) * step
        u, v = x * 1000 / MM - 0.5, height - y * 1000 / MM - 0.5
        matrix = np.array([[c, s, u - 104.5 * (c + s)], [-s, c, v - 104.5 * (c - s)]])
        covered = cv2.warpAffine(np.full_like(sheet, 255), matrix, (width, height), flags=cv2.INTER_AREA)
        laid = cv2.warpAffine(sheet, matrix, (width, height), flags=cv2.INTER_AREA)
        grey = np.where(covered > 127, laid, grey)
    return grey.astype(np.float32)


def photograph(**changes):
    """What the camera sees of it, (720, 1280, 3)."""
    seen = floor(**changes)
    finer = 3
    to_world = np.array([[MM / 1000, 0, MM / 2000], [0, -MM / 1000, (len(seen) - 0.5) * MM / 1000], [0, 0, 1]])
    to_fine = np.array([[finer, 0, (finer - 1) / 2], [0, finer, (finer - 1) / 2], [0, 0, 1]])
    matrix = to_fine @ CAMERA.floor_homography() @ to_world
    fine = cv2.warpPerspective(seen, matrix, (1280 * finer, 720 * finer), flags=cv2.INTER_LINEAR, borderValue=90)
    picture = cv2.resize(fine, (1280, 720), interpolation=cv2.INTER_AREA)
    picture = cv2.GaussianBlur(picture, (0, 0), 0.5) + np.random.default_rng(1).normal(0, 2, picture.shape)
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """A picture of five sheets on the floor."""
    path = tmp_path_factory.mktemp("markers") / "photo.png"
    cv2.imwrite(str(path), photograph())
    return path


LENS = f"""\
format: dnb-edge lens
version: 1
made_at: '2026-01-01T00:00:00+00:00'
notes: []
camera: {{id: null, width_px: 1280, height_px: 720}}
board: chessboard:7x10:15mm
rms_px: 0.2
lens: {{model: pinhole, fx_px: {CAMERA.matrix[0, 0]}, fy_px: {CAMERA.matrix[1, 1]}, cx_px: 639.5, cy_px: 359.5,
  distortion: [0.0, 0.0, 0.0, 0.0, 0.0]}}
sigmas: {{fx_px: 1.0, fy_px: 1.0, cx_px: 1.0, cy_px: 1.0}}
views: []
"""


@pytest.fixture(scope="module")
def lens(picture):
    """The camera's lens file."""
    path = picture.with_name("lens.yaml")
    path.write_text(LENS)
    return path


def test_the_calibration_is_of_the_lens_camera(picture, tmp_path):
    """A picture from a file has no camera's identity, its lens has: it goes into the calibration, so another one is refused."""
    lens = tmp_path / "lens.yaml"
    lens.write_text(LENS.replace("id: null", "id: usb-9"))
    out = tmp_path / "view.yaml"
    ran = edge("calibrate", "markers", "--picture", picture, "--lens", lens, "--out", out)
    assert ran.code == 0, ran.err
    assert load_calibration(out).camera_id == "usb-9"
    with pytest.raises(InputError, match="usb-9"):
        load_calibration(out).for_camera(width_px=1280, height_px=720, camera_id="usb-1")


def test_nothing_that_is_read_is_written_over(picture, tmp_path):
    """The photograph is never drawn over, and two pictures do not go to one file."""
    photo = tmp_path / "photo.png"
    photo.write_bytes(picture.read_bytes())
    for words in (("--plot", photo), ("--rectify", tmp_path / "a.png", "--plot", tmp_path / "a.png")):
        ran = edge("calibrate", "markers", "--picture", photo, "--out", tmp_path / "view.yaml", *words)
        assert ran.code == 2
        assert "name another file" in ran.complaint()
    assert [file.name for file in tmp_path.iterdir()] == ["photo.png"]
    assert photo.read_bytes() == picture.read_bytes()
    ran = edge("calibrate", "markers", "--print", tmp_path / "s.pdf", "--picture", photo)
    assert (ran.code, ran.complaint().startswith("dnb-edge: --print: only writes the sheets")) == (2, True)


def test_sheets_are_printed(tmp_path):
    """`--print` writes the PDF and says what it holds and how to print it."""
    ran = edge(
        "calibrate", "markers", "--print", tmp_path / "s.pdf", "--paper", "letter", "--count", 4, "--first-id", 6
    )
    assert ran.code == 0, ran.err
    assert "markers 6 to 9" in ran.out
    assert (tmp_path / "s.pdf").read_bytes().startswith(b"%PDF")


def test_pose_calibration_rectified_floor_and_overlay(picture, lens, tmp_path):
    """One command: height within 1 cm, pitch within 0.3 degrees, a calibration that loads with its pose, picture and hashes,
    the floor from straight above on which the sheets are square and where they should be, and the overlay."""
    out, twin, plot = tmp_path / "view.yaml", tmp_path / "twin.png", tmp_path / "seen.png"
    ran = edge(
        "calibrate", "markers", "--picture", picture, "--lens", lens, "--bar-mm", 100, "--out", out, "--rectify", twin,
        "--plot", plot, "--json",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert [one["number"] for one in facts["markers"]] == [0, 1, 2, 3, 4]
    assert facts["height_m"] == pytest.approx(HEIGHT_M, abs=0.01)
    assert facts["pitch_deg"] == pytest.approx(PITCH_DEG, abs=0.3)
    assert facts["lens"] == "given"
    calibration = load_calibration(out)
    assert calibration.pose.position_m == pytest.approx((*facts["centre_m"], facts["height_m"]))
    assert [one.name for one in calibration.inputs] == ["photo.png", "lens.yaml"]
    assert np.array_equal(reference_picture(out, calibration), cv2.imread(str(picture)))
    above = cv2.imread(str(twin), cv2.IMREAD_GRAYSCALE)
    assert above.shape == (facts["twin"]["height_px"], facts["twin"]["width_px"])
    codes = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    squares, numbers, _ = codes.detectMarkers(above)
    places = {one["number"]: one["track_m"] for one in facts["markers"]}
    assert sorted(numbers.ravel().tolist()) == [0, 1, 2, 3, 4]
    for square, number in zip(squares, numbers.ravel().tolist(), strict=True):
        sides = np.linalg.norm(square[0] - np.roll(square[0], 1, axis=0), axis=1)
        assert sides == pytest.approx(75.0, abs=2.0)
        u, v = square[0].mean(axis=0)
        assert (u * 0.002, (len(above) - v) * 0.002) == pytest.approx(places[number], abs=0.004)
    assert cv2.imread(str(plot)).shape == (720, 1280, 3)


def test_a_layout_ties_to_the_track(picture, tmp_path):
    """With measured places and no lens the map gives the track's own metres, and the words say what was found."""
    layout = tmp_path / "layout.yaml"
    rows = "".join(f"  - {{number: {k}, track_m: [{x + 1}, {y + 2}]}}\n" for k, (x, y, _) in enumerate(PLACES[:4]))
    layout.write_text(f"twin: {{metres_per_px: 0.002, height_px: 2500}}\nmarkers:\n{rows}")
    out = tmp_path / "view.yaml"
    ran = edge("calibrate", "markers", "--picture", picture, "--layout", layout, "--out", out)
    assert ran.code == 0, ran.err
    assert "lens (estimated)" in ran.out
    assert f"calibration: {out}" in ran.out.replace("\n", "")
    ground = load_calibration(out).ground
    middles = CAMERA.project(np.array([[x, y, 0.0] for x, y, _ in PLACES]))
    assert ground.to_track_m(middles) == pytest.approx(np.array(PLACES)[:, :2] + (1, 2), abs=0.006)
    for size_mm in (144, 156):
        ran = edge("calibrate", "markers", "--picture", picture, "--layout", layout, "--size-mm", size_mm)
        assert ran.code == 2
        assert f"printed at {150 / size_mm:.0%}" in ran.complaint()
    shorter = layout.read_text().replace("track_m: [1.3,", "track_m: [1.38,")
    layout.write_text(shorter)
    ran = edge("calibrate", "markers", "--picture", picture, "--layout", layout)
    assert ran.code == 2
    assert "marker" in ran.complaint()
    assert "apart by the layout" in ran.complaint()


def test_frames_of_a_clip_are_averaged(picture, lens, tmp_path):
    """From a source several frames count; somebody who stands before a marker in some of them is told."""
    whole = cv2.imread(str(picture))
    hidden = whole.copy()
    u, v = CAMERA.project(np.array([[1.2, 1.3, 0.0]]))[0].astype(int)
    hidden[v - 60 : v + 60, u - 60 : u + 60] = 60
    clip = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(clip), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"MJPG"), 10, (1280, 720))
    for k in range(10):
        writer.write(hidden if k >= 9 else whole)
    writer.release()
    ran = edge("calibrate", "markers", "--source", f"file:{clip}", "--lens", lens, "--frames", 4, "--json")
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert facts["height_m"] == pytest.approx(HEIGHT_M, abs=0.01)
    assert "marker 4 is placed in 3 of 4 pictures: does somebody stand in the view?" in facts["notes"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "give --print FILE.pdf, --picture FILE or --source URI"),
        (("--picture", "PICTURE", "--bar-mm", "97"), "printed at 97 %: print again at 100 %"),
        (("--picture", "PICTURE", "--bar-mm", "0"), "--bar-mm 0: must be a positive number"),
        (("--picture", "PICTURE", "--family", "5X5_50"), "0 floor markers placed|no floor markers placed"),
        (("--picture", "PICTURE", "--family", "5X5_51"), "unknown family"),
        (("--picture", "PICTURE", "--lens", "LENS", "--height", "2.5"), "--height 2.5: by the markers"),
        (("--picture", "PICTURE", "--lens", "PICTURE"), "not a lens file"),
        (("--picture", "PICTURE", "--layout", "LENS"), "unknown key|is missing"),
        (("--picture", "LENS"), "not a picture"),
        (("--picture", "no.png"), "cannot be read"),
        (("--picture", "PICTURE", "--out", "view.txt"), "must end in .yaml"),
        (("--picture", "PICTURE", "--rectify", "twin.jpg"), "--rectify twin.jpg: the name must end in .png"),
        (("--picture", "PICTURE", "--size-mm", "nan"), "--size-mm nan"),
        (("--print", "sheets.png"), "must end in .pdf"),
        (("--print", "sheets.pdf", "--paper", "a5"), "--paper a5: must be one of a4, a3, letter"),
        (("--print", "sheets.pdf", "--size-mm", "190"), "may be 15"),
        (("--print", "sheets.pdf", "--first-id", "48"), "0 to 49, not 50"),
    ],
)
def test_bad_input_is_one_line(picture, lens, monkeypatch, words, said):
    """Every wrong option, file and print is one line that says what to do; nothing is written."""
    monkeypatch.chdir(picture.parent)
    given = [str({"PICTURE": picture, "LENS": lens}.get(word, word)) for word in words]
    refused = CliRunner().invoke(app, ["calibrate", "markers", *given])
    assert isinstance(refused.exception, InputError)
    assert any(part in str(refused.exception) for part in said.split("|"))
    assert "\n" not in str(refused.exception)
    assert refused.stdout == ""
    assert not (picture.parent / "sheets.pdf").exists()


def test_too_few_markers(tmp_path):
    """Two sheets are not enough; the line says how many there are and how many to lay."""
    path = tmp_path / "two.png"
    cv2.imwrite(str(path), photograph(numbers=(0, 3)))
    ran = edge("calibrate", "markers", "--picture", path)
    assert ran.code == 2
    assert "2 floor markers placed, 3 are needed and 4 to 8 better" in ran.complaint()
