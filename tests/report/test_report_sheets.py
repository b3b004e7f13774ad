"""The sheets of floor markers: to scale, whole, and readable as they are printed."""

import re
import zlib

import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from dnb_edge.errors import InputError
from dnb_edge.report.marker_sheets import PAPER_MM, Paper, SheetSettings, marker_sheets, sheet_figure
from dnb_edge.view.markers import find_markers, marker_cells

DPI = 254.0
PX_PER_MM = DPI / 25.4


def settings(paper=Paper.A4, size_mm=150.0, family="4X4_50", numbers=(0, 1, 2)):
    return SheetSettings(family=family, numbers=numbers, size_mm=size_mm, paper=paper)


def raster(wanted, number):
    """The sheet as a printer of 10 dots a millimetre has it, grey."""
    figure = sheet_figure(wanted, number, marker_cells(wanted.family, number))
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return cv2.cvtColor(np.asarray(canvas.buffer_rgba())[..., :3].copy(), cv2.COLOR_RGB2GRAY)


@pytest.mark.parametrize(("paper", "points"), [(Paper.A4, (595.276, 841.89)), (Paper.LETTER, (612.0, 792.0))])
def test_pages_are_of_the_papers_size(paper, points):
    """Every page's box is the paper, in points of 1/72 inch: a printer at 100 % then prints to scale."""
    data = marker_sheets(settings(paper))
    boxes = re.findall(rb"/MediaBox \[ ?([\d. ]+) ?\]", data)
    assert len(boxes) == 3
    for box in boxes:
        assert [float(part) for part in box.split()] == pytest.approx([0, 0, *points], abs=0.01)


def test_the_pdf_draws_square_and_bar_to_scale():
    """The drawing operators themselves hold a black square of 150 mm and a bar of 100 mm."""
    data = marker_sheets(settings(numbers=(4,)))
    starts = [match.end() for match in re.finditer(rb"(?<!end)stream\r?\n", data)]
    drawn = b"".join(zlib.decompressobj().decompress(data[at:]) for at in starts if data[at : at + 1] == b"x")
    outlines = re.findall(rb"([\d.]+) ([\d.]+) m\n((?:[\d.]+ [\d.]+ l\n)+)h", drawn)
    widths = set()
    for u, _, rest in outlines:
        across = [float(u), *(float(line.split()[0]) for line in rest.splitlines())]
        widths.add(round((max(across) - min(across)) / 72 * 25.4, 2))
    assert {150.0, 100.0} <= widths


@pytest.mark.parametrize(
    ("paper", "family", "size_mm"),
    [(Paper.A4, "4X4_50", 150.0), (Paper.LETTER, "4X4_50", 150.0), (Paper.A4, "APRILTAG_36h11", 120.0)],
)
def test_the_printed_marker_reads_and_measures_right(paper, family, size_mm):
    """On the rastered sheet the detector reads the number the right way up, its side is right within 0.15 mm (a dot and a
    half), and the bar and the white border are as long as they say."""
    picture = raster(settings(paper, size_mm, family), 2)
    width_mm, height_mm = PAPER_MM[paper]
    assert picture.shape == (round(height_mm * PX_PER_MM), round(width_mm * PX_PER_MM))
    (marker,) = find_markers(picture, family=family).markers
    assert marker.number == 2
    assert np.linalg.norm(np.diff(marker.camera_px, axis=0), axis=1) / PX_PER_MM == pytest.approx(size_mm, abs=0.15)
    top_left, top_right = marker.camera_px[0], marker.camera_px[1]
    assert abs(top_left[1] - top_right[1]) < 1.0
    assert top_left[0] < top_right[0]
    rows = np.flatnonzero((picture < 60).sum(axis=1) > 95 * PX_PER_MM)
    bar_row = picture[rows[-1]]
    dark = np.flatnonzero(bar_row < 128)
    assert (dark[-1] - dark[0] + 1) / PX_PER_MM == pytest.approx(100.0, abs=0.2)
    cell = size_mm / len(marker_cells(family, 0)) * PX_PER_MM
    u, v = top_left
    assert picture[round(v - 0.95 * cell) : round(v), round(u) : round(top_right[0])].min() > 100
    assert picture[round(v) : round(v + cell), round(u - 0.95 * cell) : round(u) - 1].min() > 100


def test_no_seams_between_white_neighbours():
    """Where two white cells meet, no black shows through, at any resolution."""
    wanted = settings(numbers=(0,))
    cells = marker_cells("4X4_50", 0)
    rows, columns = np.nonzero(cells[:, :-1] & cells[:, 1:])
    assert len(rows)
    for dpi in (71.0, 97.3, 133.7):
        figure = sheet_figure(wanted, 0, cells)
        figure.set_dpi(dpi)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        grey = np.asarray(canvas.buffer_rgba())[..., 0]
        (marker,) = find_markers(np.ascontiguousarray(grey), family="4X4_50").markers
        corner, side = marker.camera_px[0], float(marker.camera_px[1, 0] - marker.camera_px[0, 0])
        for row, column in zip(rows, columns, strict=True):
            u, v = corner + side / len(cells) * np.array([column + 1.0, row + 0.5])
            assert grey[round(v), round(u) - 2 : round(u) + 3].min() > 240


def test_the_same_sheets_are_the_same_file():
    """No date and no chance gets into the PDF."""
    assert marker_sheets(settings()) == marker_sheets(settings())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"size_mm": 170.0}, "may be 15"),
        ({"paper": Paper.LETTER, "size_mm": 170.0}, "may be 161 mm"),
        ({"family": "4X4_51"}, "unknown family"),
        ({"numbers": (49, 50)}, "0 to 49, not 50"),
    ],
)
def test_what_cannot_be_printed_is_refused(changes, said):
    """A marker too large for the paper, an unknown family and a number that a family has not are told in one line."""
    with pytest.raises(InputError, match=said):
        marker_sheets(settings(**changes))
