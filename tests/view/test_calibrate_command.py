"""`dnb-edge calibrate keypoints`, as a shell sees it."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from keypoint_samples import HEIGHT, SCALE, TWIN, WIDTH, seen

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.cli.main import main
from dnb_edge.config.calibration_file import load_calibration, reference_picture
from dnb_edge.config.lens_file import LensFile, lens_file
from dnb_edge.sim.rig import Rig
from dnb_edge.view.boards import parse_board
from dnb_edge.view.fit import fit_keypoints
from dnb_edge.view.homography import calibration_error
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.lens import Lens, LensModel

CAMERA = seen(TWIN)


@pytest.fixture
def shell(monkeypatch, capsys):
    """Runs the command with arguments; gives exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", "calibrate", "keypoints", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


def saved(tmp_path, camera=CAMERA, twin=TWIN):
    np.save(tmp_path / "camera.npy", camera)
    np.save(tmp_path / "twin.npy", twin)
    return ("--camera", tmp_path / "camera.npy", "--twin", tmp_path / "twin.npy")


def test_the_papers_figure_as_json_and_picture(shell, real_dir, tmp_path):
    """All known answers to 0.01 px, JSON alone on stdout, and the plot in either format."""
    folder = real_dir / "drivenetbench"
    files = ("--camera", folder / "keypoints_from_camera.npy", "--twin", folder / "keypoints_from_diagram.npy")
    code, out, err = shell(*files, "--json", "--plot", tmp_path / "figure.png")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert [row["points"] for row in facts["by_count"]] == [4, 5, 6, 7, 8, 9]
    means = [row["mean_px"] for row in facts["by_count"]]
    sums = [row["sum_px"] for row in facts["by_count"]]
    assert means == pytest.approx([1244.73, 34.96, 32.56, 39.91, 36.73, 26.69], abs=0.01)
    assert sums == pytest.approx([11202.58, 314.62, 293.07, 359.16, 330.55, 240.23], abs=0.01)
    assert facts["mean_px"] == pytest.approx(26.69, abs=0.01)
    assert facts["sum_px"] == pytest.approx(240.23, abs=0.01)
    assert facts["leave_one_out_mean_px"] == pytest.approx(57.96, abs=0.01)
    assert "mean_m" not in facts
    assert cv2.imread(str(tmp_path / "figure.png")) is not None
    assert shell(*files, "--plot", tmp_path / "figure.svg")[0] == 0
    assert (tmp_path / "figure.svg").read_bytes().startswith(b"<?xml")


def test_a_table_for_people(shell, tmp_path):
    """Without --json the same numbers stand in tables, in millimetres too where the scale is given."""
    code, out, _ = shell(*saved(tmp_path, CAMERA + 0.5 * np.sign(np.sin(np.arange(14)).reshape(7, 2))))
    assert code == 0
    assert "left out in turn" in out
    assert "fitted to the first" in out
    assert " mm" not in out
    assert " mm" in shell(*saved(tmp_path), "--metres-per-px", "0.002")[1]


def test_metres_in_json(shell, tmp_path):
    """With the scale, errors are in metres beside pixels; with four pairs there is no leave-one-out."""
    code, out, _ = shell(*saved(tmp_path, CAMERA[:4], TWIN[:4]), "--metres-per-px", "0.002", "--json")
    assert code == 0
    facts = json.loads(out)
    assert facts["mean_m"] == pytest.approx(0.002 * facts["mean_px"])
    assert facts["leave_one_out_mean_px"] is facts["leave_one_out_mean_m"] is None
    assert len(facts["by_count"]) == 1


def test_yaml_pairs(shell, tmp_path):
    """A YAML file serves like two arrays, and its names stand in the table, brackets and all."""
    lines = [f"  - {{name: 'p [{k}]', camera_px: [{u}, {v}], twin_px: [{x}, {y}]}}" for k, ((u, v), (x, y)) in
             enumerate(zip(CAMERA, TWIN, strict=True))]  # fmt: skip
    path = tmp_path / "pairs.yaml"
    path.write_text("pairs:\n" + "\n".join(lines) + "\n")
    code, out, _ = shell("--keypoints", path)
    assert code == 0
    assert "p [3]" in out
    assert shell("--keypoints", path, *saved(tmp_path))[0] == 2


LINE = np.array([[10.0 * k, 20.0 * k + 5] for k in range(7)])


@pytest.mark.parametrize(
    ("camera", "twin", "options", "message"),
    [
        (CAMERA, TWIN[:6], (), "7 camera points but 6 twin points"),
        (CAMERA[:3], TWIN[:3], (), "3 pairs of keypoints: a homography needs at least 4"),
        (LINE, TWIN, (), "camera keypoints lie on one line"),
        (CAMERA, LINE, (), "twin keypoints lie on one line"),
        (CAMERA[[0, 0, 2, 3, 4]], TWIN[:5], (), "keypoints 1 and 2 are the same point"),
        (CAMERA, TWIN.ravel(), (), "keypoints of shape (14,)"),
        (CAMERA, TWIN, ("--metres-per-px", "-1"), "--metres-per-px -1: must be a positive number"),
        (CAMERA, TWIN, ("--plot", "figure.pdf"), "must end in .png or .svg"),
        (CAMERA, TWIN, ("--plot", "nowhere/figure.png"), "make it first"),
    ],
)
def test_bad_input_is_one_line_and_code_2(shell, tmp_path, monkeypatch, camera, twin, options, message):
    """Every mistake: exit code 2, one line, no traceback, nothing on stdout."""
    monkeypatch.chdir(tmp_path)
    code, out, err = shell(*saved(tmp_path, camera, twin), *options, "--json")
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("dnb-edge: ")
    assert err.count("\n") == 1


def test_missing_files_and_options(shell, tmp_path):
    """A file that is not there, and one side without the other."""
    good = saved(tmp_path)
    assert "cannot read the keypoints" in shell("--camera", tmp_path / "none.npy", *good[2:])[2]
    code, _, err = shell(*good[:2])
    assert code == 2
    assert "give --camera and --twin" in err


MANY = np.vstack((TWIN, [[100.0, 350], [900, 600], [600, 120], [380, 930], [720, 820]]))
NOISY = np.clip(seen(MANY) + np.random.default_rng(7).normal(0, 1.0, MANY.shape), 0, (WIDTH - 1, HEIGHT - 1))


def pictures(tmp_path):
    """A twin and a camera's picture, grey, of the right sizes."""
    cv2.imwrite(str(tmp_path / "twin.png"), np.full((1000, 1000, 3), 200, np.uint8))
    cv2.imwrite(str(tmp_path / "photo.png"), np.full((HEIGHT, WIDTH, 3), 120, np.uint8))
    return ("--metres-per-px", "0.002", "--twin-image", tmp_path / "twin.png", "--picture", tmp_path / "photo.png")


def test_the_calibration_file(shell, tmp_path):
    """--out writes what a run can load: the weighted map with sigma, pose, inputs and the picture of the view; the JSON's
    contract stays that of plain least squares."""
    files = saved(tmp_path, NOISY, MANY)
    code, out, err = shell(
        *files, *pictures(tmp_path), "--camera-id", "usb-7", "--out", tmp_path / "view.yaml", "--json"
    )
    assert (code, err) == (0, "")
    kept, facts = load_calibration(tmp_path / "view.yaml"), json.loads(out)
    pairs = KeypointPairs.from_arrays(NOISY, MANY, source="k")
    fit = fit_keypoints(pairs, SCALE, width_px=WIDTH, height_px=HEIGHT)
    assert kept.ground == fit.calibration.ground
    assert kept.covariance == fit.calibration.covariance
    assert kept.pose.pitch_deg == pytest.approx(40, abs=1.5)
    assert kept.camera_id == "usb-7"
    assert [file.name for file in kept.inputs] == ["camera.npy", "twin.npy", "twin.png"]
    assert reference_picture(tmp_path / "view.yaml", kept).shape == (HEIGHT, WIDTH, 3)
    plain = calibration_error(pairs)
    assert facts["mean_px"] == plain.mean_px != facts["fitted"]["mean_px"] == kept.error.mean_px
    assert facts["leave_one_out_mean_px"] == plain.leave_one_out_mean_px
    assert facts["sigma_mm"]["p50"] < facts["sigma_mm"]["p95"] < facts["sigma_mm"]["max"] < 15
    assert facts["outliers"] == facts["suspects"] == facts["notes"] == []
    assert 1 <= len(facts["advice"]) <= 3
    assert 0.6 < facts["click_sigma_px"] < 1.6


def test_an_outlier_is_named_and_left_out_only_by_hand(shell, tmp_path):
    """A wrong click is in the printed result, the JSON and the file; --without leaves it out, which is noted too."""
    wrong = NOISY.copy()
    wrong[6] += (40, 0)
    files, more = saved(tmp_path, wrong, MANY), pictures(tmp_path)
    code, out, _ = shell(*files, *more, "--out", tmp_path / "view.yaml")
    assert code == 0
    assert "Keypoint 7 lies 4" in out
    assert "put it: click it anew, or leave it out with --without 7." in out
    assert "keypoint 7 lies" in load_calibration(tmp_path / "view.yaml").notes[0]
    facts = json.loads(shell(*files, "--json")[1])
    assert [outlier["name"] for outlier in facts["outliers"]] == ["7"]
    assert len(facts["by_keypoint"]) == 12
    facts = json.loads(shell(*files, *more, "--without", "7", "--out", tmp_path / "view.yaml", "--json")[1])
    assert facts["outliers"] == []
    assert len(facts["by_keypoint"]) == 11
    assert facts["notes"] == ["left out by hand: 7"] == list(load_calibration(tmp_path / "view.yaml").notes)


def test_the_sigma_map(shell, tmp_path):
    """Over the twin alone and over the picture too, as PNG and SVG; keypoints' names and the unit stand in it."""
    files = saved(tmp_path, NOISY, MANY)
    assert shell(*files, "--image-size", "1280x720", "--sigma-map", tmp_path / "one.png")[0] == 0
    assert shell(*files, *pictures(tmp_path), "--sigma-map", tmp_path / "two.png")[0] == 0
    one, two = (cv2.imread(str(tmp_path / name)) for name in ("one.png", "two.png"))
    assert two.shape[1] > 1.5 * one.shape[1]
    for picture in (one, two):
        hue = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
        assert (hue[..., 1] > 60).mean() > 0.15
    assert shell(*files, *pictures(tmp_path), "--sigma-map", tmp_path / "two.svg")[0] == 0
    assert (tmp_path / "two.svg").read_bytes().startswith(b"<?xml")


def test_a_runs_configuration_brings_everything(shell, real_dir, tmp_path):
    """--config gives pairs, scale, track and size of picture: the paper's, with sigma over its lane and all known answers."""
    config = Path(__file__).parents[2] / "configs" / "drivenetbench.yaml"
    folder = real_dir / "drivenetbench"
    code, out, err = shell("--config", config, "--set", f"data_dir={folder}", "--out", tmp_path / "view.yaml", "--json")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["mean_px"] == pytest.approx(26.69, abs=0.005)
    assert facts["mean_m"] == pytest.approx(0.0015 * facts["mean_px"])
    assert facts["sigma_over"] == "the lane"
    assert facts["sigma_mm"]["max"] > 100
    assert "the twin is not true to the track" in facts["notes"][0]
    kept = load_calibration(tmp_path / "view.yaml")
    assert (kept.ground.width_px, kept.ground.height_px) == (3840, 2160)
    assert kept.ground.scale.height_px == 2540


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--without", "77"), "no keypoint is called 77: there are 1, 2, 3"),
        (("--without", "1", *(f"--without={k}" for k in range(2, 10))), "3 pairs of keypoints: a homography needs"),
        (("--out", "view.yaml"), "--out: give --image-size WxH"),
        (("--out", "view.yaml", "--image-size", "1280x720"), "--out: give --metres-per-px"),
        (("--out", "view.yaml", "--image-size", "1280x720", "--metres-per-px", "1"), "--out: give --twin-image"),
        (("--out", "view.json"), "must end in .yaml"),
        (("--sigma-map", "sigma.png"), "--sigma-map: give --image-size WxH"),
        (("--sigma-map", "sigma.pdf"), "must end in .png or .svg"),
        (("--image-size", "1280"), "--image-size 1280: must be WIDTHxHEIGHT"),
        (("--image-size", "640x360"), "outside the picture of 640x360 px"),
        (("--image-size", "1920x1080", "--picture", "photo.png"), "points were clicked on one of 1920x1080: give that picture"),
        (("--picture", "camera.npy"), "camera.npy: not a picture"),
        (("--picture", "none.png"), "none.png: cannot be read"),
        (("--click-sigma-px", "0"), "--click-sigma-px 0: must be a positive number"),
        (("--lens", "none.yaml"), "none.yaml"),
        (("--config", "none.yaml"), "none.yaml"),
    ],
)  # fmt: skip
def test_options_that_cannot_be_heeded(shell, tmp_path, monkeypatch, options, message):
    """Every mistake in an option: exit code 2, one line that says what to do."""
    monkeypatch.chdir(tmp_path)
    pictures(tmp_path)
    code, out, err = shell(*saved(tmp_path, NOISY, MANY), *options, "--json")
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_keypoints_in_the_wrong_order(shell, tmp_path):
    """Exchanged, mirrored and folded pairs: exit code 2, one line that names them."""
    swapped = shell(*saved(tmp_path, NOISY, MANY[[0, 1, 4, 3, 2, *range(5, 12)]]))
    assert swapped[0] == 2
    assert "keypoints 3 and 5 seem swapped: exchanging them takes the mean error from" in swapped[2]
    mirrored = shell(*saved(tmp_path, NOISY, MANY * (-1, 1) + (1000, 0)))
    assert mirrored[0] == 2
    assert "mirrored" in mirrored[2]


def test_a_lens_file(shell, tmp_path):
    """With --lens the errors are those of the straightened points, and the lens goes into the calibration."""
    lens = Lens(
        model=LensModel.PINHOLE, fx_px=900.0, fy_px=900.0, cx_px=639.5, cy_px=359.5, distortion=(-0.3, 0.1, 0.0, 0.0),
        width_px=WIDTH, height_px=HEIGHT,
    )  # fmt: skip
    kept = LensFile(
        lens=lens, camera_id="usb-9", board=parse_board("chessboard:7x10:15mm"), made_at="2026-01-01T00:00:00+00:00",
        rms_px=0.3, sigmas={}, views=(), notes=(),
    )  # fmt: skip
    (tmp_path / "lens.yaml").write_bytes(lens_file(kept))
    files, more = saved(tmp_path, lens.to_camera_px(seen(MANY)), MANY), pictures(tmp_path)
    bent = json.loads(shell(*files, "--json")[1])
    out = tmp_path / "view.yaml"
    straight = json.loads(shell(*files, *more, "--lens", tmp_path / "lens.yaml", "--out", out, "--json")[1])
    assert straight["max_px"] < 0.01
    assert bent["max_px"] > 5.0
    assert load_calibration(out).ground.lens == lens
    assert load_calibration(out).camera_id == "usb-9"
    code, _, err = shell(*files, "--lens", tmp_path / "lens.yaml", "--camera-id", "usb-1")
    assert code == 2
    assert "lens.yaml: " in err


def pairs_file(path, *, names=(), size=None, camera=NOISY):
    """A YAML file of the twelve pairs."""
    pairs = [
        {"name": names[k] if k < len(names) else f"p{k}", "camera_px": here.tolist(), "twin_px": there.tolist()}
        for k, (here, there) in enumerate(zip(camera, MANY, strict=True))
    ]
    path.write_text(
        yaml.safe_dump(({} if size is None else {"image_size": size}) | {"pairs": pairs}, allow_unicode=True)
    )
    return path


@pytest.mark.parametrize("name", ["$x^{$", "[/bold]", "\\frac{", "日本"])
@pytest.mark.parametrize("form", ["png", "svg"])
def test_names_are_words_and_no_formulas(shell, tmp_path, name, form):
    """Names with the signs of TeX, of markup or of another script are told and drawn as they stand, even that of an outlier."""
    wrong = NOISY.copy()
    wrong[0] += (40, 0)
    path = pairs_file(tmp_path / "pairs.yaml", names=(name,), camera=wrong)
    code, out, err = shell("--keypoints", path, *pictures(tmp_path), "--sigma-map", tmp_path / f"map.{form}")
    assert (code, err) == (0, "")
    assert f"Keypoint {name} lies" in out
    assert (tmp_path / f"map.{form}").stat().st_size > 10_000


def test_the_size_of_the_picture_stands_beside_the_points(shell, tmp_path):
    """Pairs given beside a configuration keep their own picture's size; an option that says another size is refused."""
    demo = write_demo_config(tmp_path, Rig(seed=1))
    config = yaml.safe_load(demo.read_text())
    twin = np.load(tmp_path / config["view"]["keypoints_twin"])
    camera = np.load(tmp_path / config["view"]["keypoints_camera"]) * 3
    pairs = [{"camera_px": here.tolist(), "twin_px": there.tolist()} for here, there in zip(camera, twin, strict=True)]
    path = tmp_path / "pairs.yaml"
    path.write_text(yaml.safe_dump({"image_size": [3840, 2160], "pairs": pairs}))
    assert shell("--config", demo, "--keypoints", path, "--out", tmp_path / "view.yaml")[0] == 0
    ground = load_calibration(tmp_path / "view.yaml").ground
    assert (ground.width_px, ground.height_px) == (3840, 2160)
    for words in (("--keypoints", path), ("--config", demo)):
        code, _, err = shell(*words, "--image-size", "1920x1080")
        assert code == 2
        assert "--image-size 1920x1080: the points were clicked on " in err
    assert shell("--keypoints", path, "--image-size", "3840x2160")[0] == 0


def test_a_picture_that_viewers_turn_is_refused(shell, tmp_path):
    """Clicks on a picture turned by its EXIF note are not the frames' px; a note that turns nothing does no harm."""
    files, more = saved(tmp_path, NOISY, MANY), pictures(tmp_path)
    picture = cv2.imread(str(tmp_path / "photo.png"))
    picture[:200, :300] = 40
    for turn, code in ((1, 0), (3, 2), (6, 2)):
        path = tmp_path / "phone.jpg"
        path.write_bytes(jpeg_to_turn(picture, turn))
        code_now, _, err = shell(*files, *more, "--picture", path, "--out", tmp_path / f"{turn}.yaml")
        assert code_now == code, turn
        assert (f"--picture {path}: shown turned" in err) == (code == 2)
        assert (tmp_path / f"{turn}.yaml").exists() == (code == 0)


def jpeg_to_turn(picture, turn):
    """A JPEG whose EXIF orientation is `turn`."""
    data = cv2.imencode(".jpg", picture)[1].tobytes()
    note = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0" + bytes([turn, 0]) + bytes(6)
    return data[:2] + b"\xff\xe1" + (len(note) + 2).to_bytes(2, "big") + note + data[2:]


def test_nothing_that_is_read_is_written_over(shell, tmp_path, monkeypatch):
    """An output in the place of an input or of another output is refused before anything is written; so is a directory."""
    monkeypatch.chdir(tmp_path)
    path, more = pairs_file(tmp_path / "pairs.yaml"), pictures(tmp_path)
    (tmp_path / "folder.yaml").mkdir()
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()}
    for words, said in (
        (("--out", "pairs.yaml"), "--out pairs.yaml: is read, too, and would be lost"),
        (("--sigma-map", "photo.png"), "--sigma-map photo.png: is read, too"),
        (("--plot", "../" + tmp_path.name + "/twin.png"), "is read, too"),
        (("--plot", "a.png", "--sigma-map", "a.png"), "--plot a.png: --sigma-map goes there, too"),
        (
            ("--out", "v.yaml", "--plot", "v.reference.png"),
            "--plot v.reference.png: --out's picture of the view goes there",
        ),
        (("--out", "folder.yaml"), "--out folder.yaml: is a directory: name a file"),
        (("--set", "race.laps=2"), "--set: sets keys of --config: give that, too"),
    ):
        code, _, err = shell("--keypoints", path, *more, *words)
        assert code == 2, words
        assert said in err
        assert {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()} == before
    assert shell("--keypoints", path, *more, "--out", "v.yaml")[0] == 0
    again = (*more[: more.index("--picture")], "--picture", "v.reference.png")
    assert shell("--keypoints", path, *again, "--out", "v.yaml")[0] == 0


def test_a_twin_of_another_size_is_refused(shell, tmp_path):
    """Points clicked on a larger picture of the twin lie outside the one given: without a word every y would be off."""
    files, more = saved(tmp_path, NOISY, MANY), pictures(tmp_path)
    cv2.imwrite(str(tmp_path / "twin.png"), np.full((500, 500, 3), 200, np.uint8))
    code, _, err = shell(*files, *more, "--out", tmp_path / "view.yaml")
    assert code == 2
    assert "twin.png (500x500 px): give the picture of the twin on which they were clicked" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "view.yaml").exists()
