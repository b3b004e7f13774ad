"""The report's pictures: what is on them, where, and that they are the same every time."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.report.lap_style import LAP_COLOURS
from dnb_edge.report.plots import lap_times_picture, path_picture
from dnb_edge.report.run import RunResult
from dnb_edge.report.track_map import round_length_m


def pixels(png: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image


def has_colour(image: np.ndarray, colour: str) -> np.ndarray:
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return np.asarray((np.abs(image.astype(int) - rgb[::-1]) < 12).all(axis=2))


@pytest.mark.parametrize("picture", [path_picture, lap_times_picture])
def test_each_lap_is_drawn_in_its_own_colour(picture: Callable[..., bytes], result: Callable[..., RunResult]) -> None:
    """Every lap's colour is on the picture, and the next colour in the row is not."""
    image = pixels(picture(result()))
    counts = [has_colour(image, colour).sum() for colour in LAP_COLOURS[:4]]
    assert min(counts[:3]) > 300
    assert counts[3] == 0


def test_the_tracks_top_is_the_pictures_top(result: Callable[..., RunResult]) -> None:
    """A path in the track's upper half (y up) is drawn in the upper half of the picture, left where x is small."""
    run = result(lap_times_s=(10.0,))
    path = np.column_stack((np.linspace(0.6, 1.8, 50), np.full(50, 2.0)))
    rows, columns = np.nonzero(
        has_colour(pixels(path_picture(replace(run, paths_m=(path,), stamps_ns=())))[:450], LAP_COLOURS[0])
    )
    assert len(rows) > 100
    assert rows.max() < 200
    assert columns.max() < 500


def test_the_twin_lies_under_the_path_in_register(result: Callable[..., RunResult]) -> None:
    """A mark at a twin px and a path through the same point on the track meet in the picture."""
    run = result(lap_times_s=(10.0,))
    spot_m = np.array([[1.7, 1.5]])
    u, v = run.track.scale.to_twin_px(spot_m)[0]
    twin = np.full((960, 1760, 3), 255, np.uint8)
    cv2.circle(twin, (round(u), round(v)), 40, (0, 0, 255), -1)
    path = spot_m + np.array([[-0.02, 0.0], [0.02, 0.0]])
    image = pixels(path_picture(replace(run, paths_m=(path,), stamps_ns=(), twin=twin)))
    mark = (image[:, :, 2].astype(int) - image[:, :, 0] > 80)[:450]
    drawn = has_colour(image, LAP_COLOURS[0])[:450]
    centre = [np.mean(np.nonzero(mask), axis=1) for mask in (mark, drawn)]
    assert np.abs(centre[0] - centre[1]).max() < 2.0


@pytest.mark.parametrize("picture", [path_picture, lap_times_picture])
@pytest.mark.parametrize("picture_format", ["png", "svg"])
def test_the_same_run_gives_the_same_bytes(
    picture: Callable[..., bytes], picture_format: str, result: Callable[..., RunResult]
) -> None:
    """No date and no random identifier gets into a picture."""
    run = result()
    first = picture(run, picture_format=picture_format)
    assert first == picture(run, picture_format=picture_format)
    assert first.startswith(b"\x89PNG" if picture_format == "png" else b"<?xml")


@pytest.mark.parametrize("laps", [0, 1, 40])
@pytest.mark.parametrize("picture", [path_picture, lap_times_picture])
def test_any_number_of_laps_can_be_drawn(
    picture: Callable[..., bytes], laps: int, result: Callable[..., RunResult]
) -> None:
    """No lap, one lap, and more laps than colours or legend rows."""
    assert pixels(picture(result(lap_times_s=(2.0,) * laps))).shape[1] > 600


def test_drawing_leaves_pyplot_alone() -> None:
    """Importing the pictures does not load pyplot, whose figures are global state and whose backend may want a display."""
    code = "import sys, dnb_edge.report.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("length_m", "rounded_m"), [(1.0, 1.0), (0.99, 0.5), (0.2, 0.2), (4.9, 2.0), (73.0, 50.0)])
def test_scale_bar_lengths(length_m: float, rounded_m: float) -> None:
    """The bar is the next lower of 1, 2, 5."""
    assert round_length_m(length_m) == pytest.approx(rounded_m)


@given(length_m=st.floats(1e-4, 1e4))
def test_the_scale_bar_never_outgrows_its_room_nor_shrinks_to_nothing(length_m: float) -> None:
    """At most what was asked for, and more than a third of it."""
    assert length_m / 3 < round_length_m(length_m) <= length_m * (1 + 1e-6)
