"""Everything that is printed: to scale on paper as another program renders it, and read by the product's own eyes."""

import re

import cv2
import numpy as np
import pytest
from printed import PX_PER_MM, bars_mm, grey, page_sizes_mm, pages

from dnb_edge.config.marker_layout import load_marker_layout
from dnb_edge.detect.codes import CodeBook
from dnb_edge.errors import InputError
from dnb_edge.prints.board import board_page
from dnb_edge.prints.floor import FloorSettings, floor_pages, placed, plan_page
from dnb_edge.prints.layout import layout_text
from dnb_edge.prints.paper import BAR_MM, PAPER_MM, Paper, parse_paper, pdf_of, svgs_of
from dnb_edge.prints.roof import RoofSettings, roof_pages
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.boards import find_board, parse_board
from dnb_edge.view.markers import find_markers, marker_cells


def floor_settings(paper=Paper.A4, size_mm=150.0, family="4X4_50", numbers=(0, 1, 2)):
    return FloorSettings(family=family, numbers=numbers, size_mm=size_mm, paper=paper)


def roof_settings(paper=Paper.A4, size_mm=70.0, family="4X4_50", numbers=(7, 12)):
    return RoofSettings(family=family, numbers=numbers, size_mm=size_mm, paper=paper)


def sheets(kind, paper):
    """All pages of one kind of printable."""
    match kind:
        case "roof":
            return list(roof_pages(roof_settings(paper, numbers=(1, 2, 3, 4, 5))))
        case "floor":
            wanted = floor_settings(paper, numbers=(0, 1, 2, 3))
            return [*floor_pages(wanted), plan_page(wanted, placed(wanted.numbers, (2.0, 1.5)), (2.0, 1.5))]
        case _:
            return [board_page(parse_board(kind), paper)]


KINDS = ("roof", "floor", "charuco:5x7:30mm:22mm", "chessboard:7x10:15mm", "chessboard:10x6:20mm")


@pytest.mark.parametrize("paper", list(Paper))
@pytest.mark.parametrize("kind", KINDS)
def test_every_sheet_is_the_papers_size_and_its_bar_is_100_mm(kind, paper):
    """Each page's box is the paper, upright or lying, and the bar on it measures 100 mm to 0.1 mm as PDFium renders it."""
    pdf = pdf_of(sheets(kind, paper), title="test")
    for size, bar in zip(page_sizes_mm(pdf), bars_mm(pdf), strict=True):
        assert sorted(size) == pytest.approx(sorted(PAPER_MM[paper]), abs=0.01)
        assert bar == pytest.approx(BAR_MM, abs=0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_svg_sheets_have_the_papers_size_and_a_bar_of_100_mm(kind):
    """An SVG's size in points is the paper's, its user unit is a point, and a rectangle 100 mm wide and 4 mm high is in it."""
    for (_, data), page in zip(svgs_of(sheets(kind, Paper.A4)), sheets(kind, Paper.A4), strict=True):
        text = data.decode()
        width, height = re.search(r'width="([\d.]+)pt" height="([\d.]+)pt"', text).groups()
        size_mm = page.figure.get_size_inches() * 25.4
        assert (float(width) / 72 * 25.4, float(height) / 72 * 25.4) == pytest.approx(tuple(size_mm), abs=0.01)
        assert f'viewBox="0 0 {width} {height}"' in text
        outlines = [
            np.array([float(part) for part in re.findall(r"[\d.]+", path)]).reshape(-1, 2)
            for path in re.findall(r'<path d="(M [\d. \nLz]+)"', text)
        ]
        spans = {tuple(np.round(np.ptp(one, axis=0) / 72 * 25.4, 2)) for one in outlines if len(one) in (4, 5)}
        assert (100.0, 4.0) in spans


@pytest.mark.parametrize("kind", ["roof", "floor", "charuco:4x4:30mm:22mm"])
def test_the_same_sheets_are_the_same_files(kind):
    """No date and no chance gets into PDF or SVG."""
    assert pdf_of(sheets(kind, Paper.A4), title="a") == pdf_of(sheets(kind, Paper.A4), title="a")
    assert list(svgs_of(sheets(kind, Paper.A4))) == list(svgs_of(sheets(kind, Paper.A4)))


@pytest.mark.parametrize(
    ("paper", "family", "size_mm", "numbers"),
    [
        (Paper.A4, "4X4_50", 70.0, (7, 12, 0, 49, 3)),
        (Paper.LETTER, "5X5_100", 40.0, tuple(range(90, 100))),
        (Paper.A3, "APRILTAG_36h11", 100.0, (0, 586)),
    ],
)
def test_roof_markers_read_as_what_they_are(paper, family, size_mm, numbers):
    """The race's own reader of roof markers reads every number, its nose up; sides are right within 0.2 mm (two dots)."""
    pdf = pdf_of(roof_pages(roof_settings(paper, size_mm, family, numbers)), title="test")
    seen = []
    for picture in pages(pdf):
        for one in CodeBook(family, (), least_confidence=0.95).read(grey(picture), closely=False):
            seen.append(one.number)
            (u, v), right, _, below = one.corners_px
            assert abs(v - right[1]) < 2 < right[0] - u
            assert abs(u - below[0]) < 2 < below[1] - v
            sides = np.linalg.norm(np.diff(one.corners_px, axis=0), axis=1) / PX_PER_MM
            assert sides == pytest.approx(size_mm, abs=0.2)
    assert sorted(seen) == sorted(numbers)


@pytest.mark.parametrize(
    ("paper", "family", "size_mm"),
    [(Paper.A4, "4X4_50", 150.0), (Paper.LETTER, "4X4_50", 150.0), (Paper.A4, "APRILTAG_36h11", 120.0)],
)
def test_floor_markers_read_and_measure_right(paper, family, size_mm):
    """Each sheet's number is read the right way up, the sides are right within 0.15 mm, and a cell of white is round it."""
    wanted = floor_settings(paper, size_mm, family, (2, 9))
    for number, picture in zip(wanted.numbers, pages(pdf_of(floor_pages(wanted), title="t")), strict=True):
        seen = grey(picture)
        (marker,) = find_markers(seen, family=family).markers
        assert marker.number == number
        assert np.linalg.norm(np.diff(marker.camera_px, axis=0), axis=1) / PX_PER_MM == pytest.approx(size_mm, abs=0.15)
        (u, v), top_right = marker.camera_px[0], marker.camera_px[1]
        assert abs(v - top_right[1]) < 1.0
        assert u < top_right[0]
        cell = size_mm / len(marker_cells(family, 0)) * PX_PER_MM
        assert seen[round(v - 0.95 * cell) : round(v) - 1, round(u) : round(top_right[0])].min() > 100
        assert seen[round(v) : round(v + cell), round(u - 0.95 * cell) : round(u) - 1].min() > 100


def test_no_seams_between_white_neighbours():
    """Where two white cells meet, no black shows through, at any resolution."""
    pdf = pdf_of(floor_pages(floor_settings(numbers=(0,))), title="t")
    cells = marker_cells("4X4_50", 0)
    rows, columns = np.nonzero(cells[:, :-1] & cells[:, 1:])
    assert len(rows)
    for px_per_mm in (2.8, 3.83, 5.26):
        (picture,) = pages(pdf, px_per_mm=px_per_mm)
        seen = grey(picture)
        (marker,) = find_markers(seen, family="4X4_50").markers
        corner, side = marker.camera_px[0], float(marker.camera_px[1, 0] - marker.camera_px[0, 0])
        for row, column in zip(rows, columns, strict=True):
            u, v = corner + side / len(cells) * np.array([column + 1.0, row + 0.5])
            assert seen[round(v), round(u) - 2 : round(u) + 3].min() > 240


@pytest.mark.parametrize("count", [4, 6, 9, 14])
def test_a_floor_layout_loads_with_every_marker_apart(count, tmp_path):
    """The layout that goes with the sheets is one that `calibrate markers` reads: all numbers, spread over the area."""
    numbers = tuple(range(10, 10 + count))
    path = tmp_path / "layout.yaml"
    scale = TwinScale(metres_per_px=0.002, height_px=1050.0)
    path.write_text(layout_text(placed(numbers, (2.4, 1.5)), scale, sigma_mm=5.0, says=("a test",)))
    layout = load_marker_layout(path)
    assert layout.scale == scale
    assert [point.number for point in layout.points] == list(numbers)
    places = np.array([point.at_m for point in layout.points])
    assert np.ptp(places, axis=0) == pytest.approx((2.4, 1.5))
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)[~np.eye(count, dtype=bool)]
    assert apart.min() > 0.4


@pytest.mark.parametrize("paper", [Paper.A4, Paper.LETTER])
@pytest.mark.parametrize(
    "text", ["chessboard:7x10:18mm", "chessboard:8x5:20mm", "charuco:5x7:30mm:22mm", "charuco:6x8:25mm:18mm:4X4_50"]
)
def test_a_printed_board_is_found_to_scale(text, paper):
    """Every corner of the rendered page is found, as far from the first as the board says, within 0.1 mm."""
    board = parse_board(text)
    (picture,) = pages(pdf_of([board_page(board, paper)], title="t"))
    sight = find_board(board, grey(picture))
    assert len(sight.ids) == len(board.points_m)
    found_mm, truth_mm = sight.camera_px / PX_PER_MM, 1000 * board.points_m
    apart = np.linalg.norm(found_mm - found_mm[0], axis=1)
    assert apart == pytest.approx(np.linalg.norm(truth_mm - truth_mm[0], axis=1), abs=0.1)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: list(floor_pages(floor_settings(size_mm=170.0))), "--size-mm 170: .* may be 15. mm large on a4"),
        (lambda: list(floor_pages(floor_settings(Paper.LETTER, 170.0))), "may be 161 mm large on letter"),
        (lambda: list(floor_pages(floor_settings(family="4X4_51"))), "unknown family"),
        (lambda: list(floor_pages(floor_settings(numbers=(49, 50)))), "0 to 49, not 50"),
        (lambda: list(roof_pages(roof_settings(size_mm=200.0))), "--size-mm 200: .* may be 145 mm large on a4"),
        (lambda: list(roof_pages(roof_settings(numbers=(50,)))), "0 to 49, not 50"),
        (lambda: list(roof_pages(roof_settings(family="QR"))), "unknown family"),
        (lambda: board_page(parse_board("chessboard:7x10:30mm"), Paper.A4), "240 x 330 mm do not fit on a4 paper"),
        (lambda: parse_paper("a5"), "--paper a5: must be one of a4, a3, letter"),
    ],
)
def test_what_cannot_be_printed_is_refused(make, said):
    """A size too large for the paper, an unknown family, paper or number are told in one line."""
    with pytest.raises(InputError, match=said) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_the_largest_marker_named_in_the_refusal_fits():
    """Who takes the size that the refusal names gets sheets."""
    assert len(list(roof_pages(roof_settings(size_mm=145.0)))) == 2
    assert cv2.countNonZero(grey(pages(pdf_of(roof_pages(roof_settings(size_mm=145.0)), title="t"))[0])) > 0
