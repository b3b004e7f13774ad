"""What a picture tells of lens and lamps, on pictures whose truth is known."""

import cv2
import numpy as np
import pytest

from dnb_edge.doctor.sight import edge_width_px, lamp_beats


def board(sigma_px: float, *, noise: float = 3.0, contrast: int = 160) -> np.ndarray:
    """A chessboard a little askew, (480, 640), blurred by a Gaussian, with noise of some levels."""
    rows, columns = np.mgrid[0:480, 0:640].astype(float)
    u, v = columns * 0.98 + rows * 0.17, rows * 0.98 - columns * 0.17
    squares = ((u // 60 + v // 60) % 2) * contrast + 40.0
    blurred = cv2.GaussianBlur(squares, (0, 0), sigma_px) if sigma_px else squares
    noisy = blurred + np.random.default_rng(1).normal(0.0, noise, squares.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("sigma_px", "low", "high"), [(0.0, 1.8, 2.3), (1.0, 2.3, 3.5), (2.0, 4.3, 6.2), (3.0, 6.0, 9.0)]
)
def test_edges_are_as_wide_as_they_were_blurred(sigma_px: float, low: float, high: float) -> None:
    """A step is 2 px wide, a blurred one about 2.5 times its Gaussian: focus in numbers that mean something."""
    width = edge_width_px(board(sigma_px))
    assert width is not None
    assert low < width < high


def test_a_picture_without_edges_tells_nothing() -> None:
    """A bare floor is no blurred lens; nor is one with soft shadows and noise."""
    bare = np.full((480, 640), 120.0) + np.linspace(0, 90, 640) + np.random.default_rng(2).normal(0, 4, (480, 640))
    assert edge_width_px(bare.astype(np.uint8)) is None


def test_a_sharp_thing_in_a_soft_picture_counts() -> None:
    """The lens is as good as the sharpest that it shows: a blurred poster beside sharp tape is no fault of focus."""
    picture = board(4.0)
    picture[:, :320] = board(0.8)[:, :320]
    width = edge_width_px(picture)
    assert width is not None
    assert width < 3.5


def lit(
    mains_hz: float, share: float, *, fps: float = 30.0, row_s: float = 0.0, noise: float = 0.004, drift: float = 0.0
):
    """Two seconds of rows' brightness under lamps on `mains_hz`, through a shutter that takes `row_s` from row to row."""
    draw = np.random.default_rng(3)
    scene = 60.0 + 80.0 * draw.random(180)
    told = []
    for number in range(round(2 * fps)):
        t_s = number / fps + draw.normal(0, 50e-6)
        lamp = 1.0 + share * np.sin(2 * np.pi * 2 * mains_hz * (t_s + row_s * np.arange(180)))
        rows = scene * lamp * (1.0 + drift * t_s) * (1.0 + draw.normal(0, noise, 180))
        told.append((round(t_s * 1e9), rows))
    return told


@pytest.mark.parametrize("row_s", [0.0, 40e-6, 160e-6])
@pytest.mark.parametrize(("mains_hz", "fps"), [(50, 30.0), (60, 25.0), (50, 29.2), (60, 50.0), (50, 60.0)])
@pytest.mark.parametrize("share", [0.02, 0.1])
def test_the_beat_of_lamps_is_measured(mains_hz: int, fps: float, share: float, row_s: float) -> None:
    """Amplitude and mains frequency are right whatever slow beat the camera makes of it and however its shutter rolls."""
    beats = {beat.mains_hz: beat for beat in lamp_beats(lit(mains_hz, share, fps=fps, row_s=row_s), fps)}
    found = beats[mains_hz]
    assert found.share == pytest.approx(share, rel=0.15)
    assert found.over_others is not None
    assert found.over_others > 4.0
    other = beats[110 - mains_hz]
    assert other.share is None or other.share < 0.5 * share


@pytest.mark.parametrize("drift", [0.0, 0.05, -0.2])
def test_a_steady_light_has_no_beat(drift: float) -> None:
    """Noise, and an exposure that is still settling, are no lamps."""
    for beat in lamp_beats(lit(50, 0.0, drift=drift), 30.0):
        assert beat.share is None or beat.share < 0.005


@pytest.mark.parametrize("speed_rows", [10.0, 90.0, 400.0])
def test_a_car_that_drives_by_is_no_lamp(speed_rows: float) -> None:
    """A dark car changes the rows that it crosses, slow or fast, and again and again."""
    told = lit(50, 0.0)
    for t_ns, rows in told:
        top = int(speed_rows * t_ns * 1e-9) % 170
        rows[top : top + 10] *= 0.93
    for beat in lamp_beats(told, 30.0):
        assert not beat.share or beat.share < 0.01 or (beat.over_others or 0.0) < 4.0


def test_lamps_that_stand_still_are_not_told() -> None:
    """120 Hz at 30 frames a second makes bands that stand: nobody can tell those from the scene in two seconds."""
    beats = {beat.mains_hz: beat for beat in lamp_beats(lit(60, 0.2, row_s=40e-6), 30.0)}
    assert beats[60].share is None
    assert beats[50].beat_hz == pytest.approx(10.0)


def test_a_dark_picture_has_no_beat() -> None:
    """Rows without light would make any noise a share of nothing."""
    dark = [(t_ns, rows * 0.01) for t_ns, rows in lit(50, 0.2)]
    assert all(not beat.share for beat in lamp_beats(dark, 30.0))
