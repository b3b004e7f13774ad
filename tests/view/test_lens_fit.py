"""The lens from views: true lenses found again, sigmas that hold, and what is said of bad, few and alike views."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_pictures import Studio, poses

from dnb_edge.errors import InputError
from dnb_edge.view.boards import BoardSight, find_board, parse_board
from dnb_edge.view.lens import LensModel
from dnb_edge.view.lens_fit import LensView, fit_lens
from dnb_edge.view.lens_views import ViewPicker

BOARD = parse_board("chessboard:7x10:15mm")
SIZE = (1280, 720)
SMALL = (640, 360)
PINHOLE = ([[1000.0, 0, 645], [0, 1003.0, 352], [0, 0, 1]], [-0.25, 0.1, 0.001, -0.0005, -0.02])
WIDE = ([[700.0, 0, 640], [0, 702.0, 360], [0, 0, 1]], [0.05, -0.01, 0.002, -0.0005])


def halved(matrix):
    return np.array(matrix) * [[0.5], [0.5], [1.0]]


def drawn(board, truth, *, fisheye=False, count=16, **how):
    """Views of a drawn board, found in pictures half as large as `truth`'s."""
    studio = Studio(board, halved(truth[0]), truth[1], SMALL, fisheye=fisheye)
    sights = [find_board(board, studio.picture(*pose, seed=i)) for i, pose in enumerate(poses(board, count, **how))]
    return [LensView(name=f"view {i}", sight=sight) for i, sight in enumerate(sights) if sight is not None]


def noisy(truth, *, count=18, sigma_px=0.2, seed=0, fisheye=False, **how):
    """Views of exact corners with noise, without the picture between."""
    studio = Studio.__new__(Studio)
    studio.k, studio.d, studio.fisheye = np.array(truth[0]), np.array(truth[1]), fisheye
    random = np.random.default_rng(seed)
    ids = np.arange(len(BOARD.points_m))
    how = {"distance_m": 0.42, "aside": 0.35, "seed": seed} | how
    return [
        LensView(
            name=f"view {i}",
            sight=BoardSight(
                ids=ids, camera_px=studio.project(BOARD.points_m, *pose) + random.normal(0, sigma_px, (len(ids), 2))
            ),
        )
        for i, pose in enumerate(poses(BOARD, count, **how))
    ]


def numbers(lens):
    return np.array([lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, *lens.distortion])


def true_numbers(truth):
    (fx, _, cx), (_, fy, cy), _ = truth[0]
    return np.array([fx, fy, cx, cy, *truth[1]])


@pytest.mark.parametrize(
    ("text", "model", "truth", "how"),
    [
        ("chessboard:7x10:15mm", LensModel.PINHOLE, PINHOLE, {"distance_m": 0.45, "aside": 0.35}),
        ("charuco:5x7:30mm:22mm", LensModel.PINHOLE, PINHOLE, {"distance_m": 0.45, "aside": 0.35}),
        ("chessboard:7x5:25mm", LensModel.FISHEYE, WIDE, {"distance_m": 0.25, "aside": 1.0}),
        ("charuco:5x7:30mm:22mm", LensModel.FISHEYE, WIDE, {"distance_m": 0.25, "aside": 1.0}),
    ],
)
def test_a_true_lens_from_drawn_pictures(text, model, truth, how):
    """From pictures drawn through a known lens: focal lengths and centre within 0.5 %, every number within four sigmas."""
    board = parse_board(text)
    fit = fit_lens(board, drawn(board, truth, fisheye=model is LensModel.FISHEYE, **how), size_px=SMALL, model=model)
    right = true_numbers((halved(truth[0]), truth[1]))
    off = numbers(fit.lens) - right
    assert np.abs(off[:4] / right[:4]).max() < 0.005
    assert np.abs(off / np.array(list(fit.sigmas.values()))).max() < 4.0
    assert fit.rms_px < 0.2


@pytest.mark.parametrize(("model", "truth"), [(LensModel.PINHOLE, PINHOLE), (LensModel.FISHEYE, WIDE)])
def test_sigmas_hold(model, truth):
    """In 20 trials with noise of 0.2 px, the truth lies within two sigmas in 88-100 % of all numbers, and sigmas are no larger
    than needed: the mean square of error over sigma is near one."""
    scores = []
    how = {"aside": 0.6} if model is LensModel.PINHOLE else {"distance_m": 0.25, "aside": 1.0}
    for seed in range(20):
        views = noisy(truth, seed=seed, fisheye=model is LensModel.FISHEYE, **how)
        fit = fit_lens(BOARD, views, size_px=SIZE, model=model)
        assert fit.rms_px == pytest.approx(0.2 * np.sqrt(2), rel=0.1)
        scores.append((numbers(fit.lens) - true_numbers(truth)) / np.array(list(fit.sigmas.values())))
    within = np.mean(np.abs(scores) < 2.0)
    assert within >= 0.88
    assert 0.4 < np.mean(np.square(scores)) < 1.5


def test_a_lens_that_would_fold_is_fitted_with_fewer_coefficients():
    """Where no corner near the rim keeps the last coefficient in check, it is left out, and that is said; asked for by number,
    it is refused."""
    views = noisy(PINHOLE, seed=8)
    fit = fit_lens(BOARD, views, size_px=SIZE)
    assert len(fit.lens.distortion) == 4
    assert "k3" not in fit.sigmas
    assert any("k3 left out" in note for note in fit.notes)
    assert fit.lens.fx_px == pytest.approx(1000.0, abs=4 * fit.sigmas["fx_px"])
    with pytest.raises(InputError, match="folds the picture over"):
        fit_lens(BOARD, views, size_px=SIZE, coefficients=5)


def test_the_fit_is_opencvs_least_squares():
    """`cv2.calibrateCamera` on the same corners finds the same minimum: RMS and numbers agree."""
    views = noisy(PINHOLE, sigma_px=0.5)
    flat = np.column_stack((BOARD.points_m, np.zeros(len(BOARD.points_m)))).astype(np.float32)
    seen = [view.sight.camera_px.astype(np.float32).reshape(-1, 1, 2) for view in views]
    rms, matrix, bent, *_ = cv2.calibrateCamera([flat] * len(seen), seen, SIZE, None, None, criteria=(3, 300, 1e-12))
    fit = fit_lens(BOARD, views, size_px=SIZE)
    assert fit.rms_px == pytest.approx(rms, abs=1e-4)
    assert np.allclose(fit.lens.matrix, matrix, rtol=1e-4)
    assert np.allclose(fit.lens.distortion, bent.ravel(), atol=0.02)


def test_a_bad_view_is_named_and_stays():
    """A view with half of its corners 8 px off is named with what it costs; it still counts in the fit."""
    views = noisy(PINHOLE)
    spoilt = views[5].sight.camera_px.copy()
    spoilt[:35] += (8.0, -3.0)
    views[5] = replace(views[5], sight=replace(views[5].sight, camera_px=spoilt))
    fit = fit_lens(BOARD, views, size_px=SIZE)
    assert fit.bad_views == ("view 5",)
    assert len(fit.views) == len(views)
    assert fit.rms_px > 0.5
    assert fit.rms_without_bad_px == pytest.approx(0.28, abs=0.03)
    assert any("view 5" in note for note in fit.notes)
    assert fit_lens(BOARD, noisy(PINHOLE), size_px=SIZE).bad_views == ()


def test_coverage_and_what_is_missing():
    """Counts are by cell of the picture; a board that never left the right side leaves the left empty, and that is said."""
    views = noisy(PINHOLE, count=40)
    right = [view for view in views if view.sight.camera_px[:, 0].min() > 450]
    fit = fit_lens(BOARD, right, size_px=SIZE)
    assert fit.coverage.counts[:, 0].tolist() == [0, 0, 0]
    assert fit.coverage.counts[1, 1] > 0
    assert fit.coverage.empty[0] == "top left"
    assert any("left, bottom left" in note for note in fit.notes)
    assert 0.05 < fit.coverage.share < 0.6


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"count": 4}, "found in 4 pictures, 6 are the least and 15 good: take 2 more"),
        ({"count": 0}, "found in 0 pictures"),
        ({"tilt_deg": 0.0}, "leaves the focal length open: tilt the board"),
        ({"tilt_deg": 9.0, "sigma_px": 4.0}, "determine the focal length .*: tilt the board"),
    ],
)
def test_views_that_do_not_tell(how, message):
    """Too few views, or all from one side, are refused with what to do."""
    with pytest.raises(InputError, match=message):
        fit_lens(BOARD, noisy(PINHOLE, **how), size_px=SIZE)


def test_one_pose_photographed_many_times():
    """Twelve pictures of one pose count as one: the focal length stays open however many there are."""
    view = noisy(PINHOLE)[0]
    random = np.random.default_rng(1)
    again = [
        replace(view, sight=replace(view.sight, camera_px=view.sight.camera_px + random.normal(0, 0.05, (70, 2))))
        for _ in range(12)
    ]
    with pytest.raises(InputError, match="nearly the same tilt in all 12 views"):
        fit_lens(BOARD, again, size_px=SIZE)


def test_the_real_chessboard(real_dir):
    """All 15 photographs: the plain least squares of 1.008 px, the authors' matrix within 0.5 %, each photograph's error."""
    folder = real_dir / "chessboard"
    paths = sorted(folder.glob("photo-*.jpg"))
    views = [
        LensView(name=path.name, sight=find_board(BOARD, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))) for path in paths
    ]
    fit = fit_lens(BOARD, views, size_px=(1920, 1080))
    assert len(fit.views) == 15
    assert fit.rms_px <= 1.02
    assert fit.rms_px == pytest.approx(1.008, abs=0.001)
    reference = np.load(folder / "reference-intrinsics.npz")["camera_matrix"]
    truth = reference[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert np.abs(numbers(fit.lens)[:4] / truth - 1.0).max() < 0.005
    assert max(view.rms_px for view in fit.views) < 1.5
    assert fit.bad_views == ()


def test_picking_views_from_a_moving_board():
    """A view is kept once it is still, and once only; the best few of many lie farthest apart."""
    views = [view.sight for view in noisy(PINHOLE, sigma_px=0.05, count=12)]
    picker = ViewPicker(BOARD, SIZE)
    assert not picker.picks(None)
    assert not picker.picks(views[0])  # nothing before it to tell whether it is still
    assert picker.picks(views[0])
    assert not picker.picks(views[0])  # known
    turned = replace(views[0], camera_px=views[0].camera_px[::-1].copy())
    assert [picker.picks(turned) for _ in range(3)] == [False] * 3  # the same board the other way up
    assert not picker.picks(views[1])  # moved
    assert picker.picks(views[1])
    assert not picker.picks(None)
    assert not picker.picks(views[1])
    for sight in views[2:]:
        picker.picks(sight)
        picker.picks(sight)
    assert picker.counts.sum() >= len(picker.tilts_deg) >= 8
    best = picker.best(5)
    assert len(best) == len(set(best)) == 5
    assert best == sorted(best)
    assert picker.best(99) == list(range(len(picker.tilts_deg)))
