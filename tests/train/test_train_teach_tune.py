"""Fine-tuning: it learns, keeps what it is to keep, leaves whole files or none. Skipped where torch is not installed."""

import importlib
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from dnb_edge.detect.onnx import load_model
from dnb_edge.errors import InputError
from dnb_edge.train.card import file_sha256, write_card
from dnb_edge.train.teach import TeachSettings, still_material, teach
from dnb_edge.train.teach_labels import CarLabel, LabelledPicture

torch = pytest.importorskip("torch", reason="training needs the extra 'train' (torch)")
tune = importlib.import_module("dnb_edge.train.teach_tune")
windows = importlib.import_module("dnb_edge.train.teach_windows")
network_module = importlib.import_module("dnb_edge.train.network")
weights = importlib.import_module("dnb_edge.train.weights")
SCENE_PX = importlib.import_module("dnb_edge.train.scene").SCENE_PX

TINY = TeachSettings(minutes=5.0, iterations=2, seed=3, drawn=2)


def _picture(number, background=None, heading=None):
    """A grey floor with a red car whose place tells the number."""
    rng = np.random.default_rng(number)
    floor = rng.integers(100, 130, (200, 240, 3), dtype=np.uint8)
    bgr = floor.copy()
    at = (60.0 + 3 * number, 90.0)
    cv2.ellipse(bgr, (at, (30, 18), 0.0), (30, 30, 220), -1)
    car = CarLabel(ground_px=at, length_px=30.0, heading_rad=heading)
    return LabelledPicture(
        name=f"{number}.png", bgr=bgr, background=floor if background else None, cars=(car,), number=number
    )


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """A model of random weights with its weights and card beside it."""
    torch.manual_seed(7)
    path = tmp_path_factory.mktemp("base") / "random.onnx"
    network = network_module.CentreNet().eval()
    quantise = importlib.import_module("dnb_edge.train.quantise").quantise
    rng = np.random.default_rng(1)
    quantise(
        network, path, [rng.random((1, network_module.INPUT_CHANNELS, 64, 64), dtype=np.float32) for _ in range(2)]
    )
    weights.save_weights(weights.weights_path(path), network)
    write_card(path, {"name": "random", "sha256": file_sha256(path), "task": "a test"})
    return path


@pytest.fixture(scope="module")
def material():
    return still_material([_picture(n) for n in range(25)], 1, "pictures")


@pytest.mark.parametrize("background", [True, False])
def test_a_cut_sample_shows_the_car_where_its_label_says(background):
    """Wherever and however large the square is, the label lies on the red car."""
    picture = _picture(4, background=background)
    for centre, scale in (((70.0, 90.0), 1.0), ((10.0, 150.0), 1.0), ((90.0, 60.0), 0.5), ((120.0, 100.0), 0.8)):
        pictures, labels = windows.cut_sample(picture, centre, scale)
        assert pictures.shape == (2, SCENE_PX, SCENE_PX, 3)
        ((u, v, length, cosine, sine, sure),) = labels.tolist()
        red = (pictures[0][:, :, 2].astype(int) - pictures[0][:, :, 0]) > 100
        rows, columns = np.nonzero(red)
        assert (columns.mean(), rows.mean()) == pytest.approx((u, v), abs=1.5)
        assert length == pytest.approx(30 * SCENE_PX / max(16, round(SCENE_PX / scale)), rel=0.01)
        assert (cosine, sine, sure) == (0.0, 0.0, 1.0)
        assert bool(np.abs(pictures[0].astype(int) - pictures[1]).max() > 60) is background


def test_a_still_has_no_difference_and_a_drive_often_has_one():
    """The fourth channel of a still's window is all zero; a drive's shows the car in some windows and in others nothing."""
    rng = np.random.default_rng(1)
    assert not any(windows.user_window(_picture(1), (63.0, 90.0), 1.0, rng)[0][:, :, 3].any() for _ in range(20))
    drive = _picture(1, background=True)
    shown = sum(bool(windows.user_window(drive, (63.0, 90.0), 1.0, rng)[0][:, :, 3].max() > 60) for _ in range(40))
    assert 8 < shown < 36


def test_a_known_lean_is_told_turned_as_the_window_is():
    """A lean of (0.3, -0.5): in about two thirds of the windows the bytes say so, to the left in those that are mirrored."""
    rng = np.random.default_rng(1)
    leaning = replace(_picture(1, background=True), lean=lambda at: np.tile([0.3, -0.5], (len(at), 1)))
    made = [windows.user_window(leaning, (63.0, 90.0), 1.0, rng)[0][:, :, 4:] for _ in range(60)]
    told = [window for window in made if window.any()]
    assert 28 < len(told) < 50
    for window in told:
        assert len(np.unique(window.reshape(-1, 2), axis=0)) == 1
        u, v = (window[0, 0].astype(float) - 128) / 80
        assert np.hypot(u, v) == pytest.approx(np.hypot(0.3, 0.5), abs=0.02)
        assert (abs(u), v) == pytest.approx((0.3, -0.5), abs=0.15)
    assert {window[0, 0, 0] > 128 for window in told} == {True, False}


def test_a_batch_mixes_the_users_windows_with_drawn_ones():
    """Of ten windows six are the user's, and hard places are among them."""
    drawn = windows.drawn_samples(2, 1)
    hard = [windows.HardPlace(picture=0, centre_px=(200.0, 30.0), scale=1.0)]
    maker = windows.WindowMaker(pictures=[_picture(1)], drawn=drawn, hard=hard)
    batch = maker.batch(10, np.random.default_rng(1))
    assert batch.inputs.shape[0] == batch.targets.shape[0] == 10
    assert not batch.inputs[:6, :, :, 3].any()
    again = maker.batch(10, np.random.default_rng(1))
    assert np.array_equal(batch.inputs, again.inputs)


def test_a_heading_that_nobody_knows_teaches_nothing():
    """Where the target heading is all zero it becomes what the network says; elsewhere it stays."""
    channels = network_module.OUTPUT_CHANNELS["heading"]
    targets = torch.zeros(1, 6 + channels, 2, 2)
    targets[0, 5, 0, 0] = 1.0
    said = torch.full((1, channels, 2, 2), 0.5, requires_grad=True)
    filled = tune._with_unknown_headings(targets, said)
    assert filled[0, 5 : 5 + channels, 1, 1].tolist() == [0.5] * channels
    assert filled[0, 5, 0, 0] == 1.0
    assert not filled.requires_grad
    assert torch.equal(filled[:, :5], targets[:, :5])


def test_it_learns_and_leaves_the_statistics_alone(material):
    """A few steps lower the loss on the user's windows; the normalisation's running statistics do not move."""
    torch.manual_seed(2)
    before = network_module.CentreNet().eval()
    maker = windows.WindowMaker(pictures=material.learn, drawn=[])
    shares = []
    settings = tune.TuneSettings(minutes=5.0, iterations=12, batch=6, seed=1, rate=2e-3, ema=0.5)
    tuned = tune.fine_tune(before, maker, settings, shares.append)
    assert tuned.iterations == 12
    assert shares[-1] == 1.0
    batch = maker.batch(12, np.random.default_rng(5))
    losses = importlib.import_module("dnb_edge.train.learn").losses
    values = []
    for network in (before, tuned.network):
        with torch.no_grad():
            inputs = importlib.import_module("dnb_edge.train.network").to_input(torch.from_numpy(batch.inputs))
            values.append(float(losses(network(inputs), torch.from_numpy(batch.targets))["heat"]))
    assert values[1] < values[0]
    for name, value in before.state_dict().items():
        if "running" in name:
            assert torch.equal(value, tuned.network.state_dict()[name]), name


def test_ctrl_c_ends_the_learning_and_keeps_what_was_learnt(material):
    """Interrupted in its third step it returns at once, with two steps learnt."""
    steps = []

    def interrupt(share):
        steps.append(share)
        if len(steps) == 2:
            raise KeyboardInterrupt

    maker = windows.WindowMaker(pictures=material.learn, drawn=[])
    settings = tune.TuneSettings(minutes=5.0, iterations=50, batch=4)
    tuned = tune.fine_tune(network_module.CentreNet().eval(), maker, settings, interrupt)
    assert tuned.interrupted
    assert tuned.iterations == 2


def test_teaching_writes_a_model_with_card_and_weights(base, material, tmp_path):
    """The whole way in its smallest form, forced: a model that loads, a card with both figures and the base, and weights."""
    outcome = teach(material, base, tmp_path, name="mine", settings=TINY, command="dnb-edge teach pictures", force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.json", "mine.onnx", "mine.weights.npz"]
    assert outcome.model == tmp_path / "mine.onnx"
    load_model(outcome.model)
    weights.load_weights(tmp_path / "mine.weights.npz")
    card = json.loads((tmp_path / "mine.json").read_text())
    assert card["base"] == {"name": "random", "sha256": file_sha256(base)}
    assert card["task"] == "a test"
    assert (card["seed"], card["iterations"]) == (3, 2)
    assert card["data"]["pictures_learnt"] == 20
    assert card["metrics"]["before"]["cars"] == card["metrics"]["after"]["cars"] == 5
    assert str(tmp_path) not in json.dumps(card)


def test_a_worse_model_is_not_written(base, material, tmp_path, monkeypatch):
    """Where the comparison says worse nothing appears in the output folder, and the outcome says why."""
    monkeypatch.setattr("dnb_edge.train.teach.worse", lambda before, after: ["recall 1.000 -> 0.5"])
    outcome = teach(material, base, tmp_path, name="mine", settings=TINY, command="x")
    assert outcome.model is None
    assert outcome.worse
    assert list(tmp_path.iterdir()) == []


def test_a_model_without_weights_is_refused(base, material, tmp_path):
    """A base whose weights are not beside it cannot be taught: one line that names the missing file."""
    alone = tmp_path / "alone.onnx"
    alone.write_bytes(base.read_bytes())
    alone.with_suffix(".json").write_bytes(base.with_suffix(".json").read_bytes())
    with pytest.raises(InputError, match=r"alone\.weights\.npz"):
        teach(material, alone, tmp_path / "out", name="mine", settings=TINY, command="x")
