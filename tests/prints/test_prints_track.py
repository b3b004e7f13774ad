"""The printed track: its sheets, glued together as the map says, are the track that its files tell of, ready to be raced on."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from itertools import islice

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from printed import bars_mm, grey, page_sizes_mm, pages
from typer.testing import CliRunner

from dnb_edge.cli.main import app
from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.marker_layout import load_marker_layout
from dnb_edge.config.track_file import load_track
from dnb_edge.errors import InputError
from dnb_edge.prints.ground import circuit_size_m, circuit_track, ground_of, with_markers
from dnb_edge.prints.paper import PAPER_MM, Paper, pdf_of, svgs_of
from dnb_edge.prints.tiles import FOOT_MM, MARGIN_MM, tilings, whole
from dnb_edge.prints.track import map_page, track_pages
from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.places import figure_eight, place, table_oval
from dnb_edge.sim.rig import Rig
from dnb_edge.view.markers import find_markers

PX_PER_MM = 2.0
LANE = ("--lane-hsv", "206,38,72")


def run(*words):
    """`dnb-edge WORDS`; its stdout."""
    ran = CliRunner().invoke(app, [str(word) for word in words])
    if ran.exception is not None and not isinstance(ran.exception, SystemExit):
        raise ran.exception
    assert ran.exit_code == 0, ran.stderr
    return ran.stdout


def oval(paper):
    """The oval's floor with its markers, and its sheets on `paper`."""
    circuit = table_oval()
    track = circuit_track(circuit)
    ground = ground_of(track, size_m=circuit_size_m(circuit), family="4X4_50", marker_mm=100.0)
    plan = min(tilings(ground.size_mm, paper, overlap_mm=10.0), key=lambda one: len(one.only(ground.needs).tiles))
    ground = with_markers(ground, plan, cells=6, numbers=(40, 41, 42, 43, 44, 45))
    return track, ground, plan.only(ground.needs)


def glued(pictures, ground, plan, *, px_per_mm=PX_PER_MM):
    """The floor, (height, width, 3), on which the sheets lie: each cut where its neighbours say so, one over the other.

    Also how much of what a sheet covers looks another way than the sheet does, at most, as a share of the covered px.
    """
    width, height = (round(length * px_per_mm) for length in ground.size_mm)
    floor = np.full((height, width, 3), 255, np.uint8)
    laid, unlike = np.zeros((height, width), bool), 0.0
    margin = round(MARGIN_MM * px_per_mm)
    for tile, picture in zip(plan.tiles, pictures, strict=True):
        box = tile.printed
        left, top = round(box.left * px_per_mm), round((ground.size_mm[1] - box.top) * px_per_mm)
        right, bottom = round(box.right * px_per_mm), round((ground.size_mm[1] - box.bottom) * px_per_mm)
        part = picture[margin : margin + bottom - top, margin : margin + right - left]
        there = (slice(top, bottom), slice(left, right))
        covered = laid[there]
        if covered.any():
            differs = np.abs(floor[there].astype(int) - part.astype(int)).max(axis=2) > 60
            unlike = max(unlike, float((differs & covered).sum() / covered.sum()))
        floor[there] = part
        laid[there] = True
    return floor, unlike


@pytest.fixture(scope="module")
def printed_oval(tmp_path_factory):
    """Everything that `dnb-edge print track` writes, and the glued sheets as a picture of 2 px a mm."""
    directory = tmp_path_factory.mktemp("track")
    said = run("print", "track", "--out", directory / "track.pdf")
    _, ground, plan = oval(Paper.A4)
    pictures = pages((directory / "track.pdf").read_bytes(), px_per_mm=PX_PER_MM)
    floor, unlike = glued(pictures[1:], ground, plan)
    cv2.imwrite(str(directory / "glued.png"), floor)
    return directory, ground, floor, unlike, said


@pytest.mark.parametrize("paper", [Paper.A4, Paper.LETTER])
def test_every_sheet_of_a_track_has_its_bar_and_its_papers_size(paper):
    """All sheets and the map are of one paper; the bar on each measures 100 mm to 0.1 mm."""
    _, ground, plan = oval(paper)
    pdf = pdf_of(track_pages(ground, plan, paper), title="t")
    sizes = page_sizes_mm(pdf)
    assert len(sizes) == len(plan.tiles) + 1 <= 30
    for size, bar in zip(sizes, bars_mm(pdf), strict=True):
        assert sorted(size) == pytest.approx(sorted(PAPER_MM[paper]), abs=0.01)
        assert bar == pytest.approx(100.0, abs=0.1)


def test_glued_sheets_are_the_track_of_its_file(printed_oval, tmp_path):
    """`track build` on the glued sheets finds a route as long as the track file's within 0.5 %, nowhere 3 mm beside it; under
    each overlap lies the same as on it, but for marks and dots of edges."""
    directory, _, _, unlike, _ = printed_oval
    out = tmp_path / "built.yaml"
    told = json.loads(run(
        "track", "build", "--image", directory / "glued.png", *LANE, "--metres-per-px", 0.001 / PX_PER_MM,
        "--start-at", "1200,1739", "--out", out, "--json",
    ))  # fmt: skip
    track = load_track(directory / "track.yaml")
    assert told["length_m"] == pytest.approx(track.centreline.length_m, rel=0.005)
    found = load_track(out).centreline.points_m
    apart = np.linalg.norm(found[:, None] - track.centreline.points_m[None], axis=2).min(axis=1)
    assert apart.max() < 0.003 + 0.0025, "points lie every 5 mm"
    assert unlike < 0.08


def test_the_twin_makes_the_same_track(printed_oval, tmp_path):
    """`track build` on the twin's picture gives the track of the track file within 0.5 %, driven the same way."""
    directory, *_ = printed_oval
    track = load_track(directory / "track.yaml")
    line = track.start_line
    start = [f"{part:g}" for part in track.scale.to_twin_px(np.array([line.start_m, line.end_m])).ravel()]
    told = json.loads(run(
        "track", "build", "--image", directory / "track.twin.png", *LANE, "--metres-per-px", 0.001,
        "--start-line", ",".join(start), "--json",
    ))  # fmt: skip
    assert told["length_m"] == pytest.approx(track.centreline.length_m, rel=0.005)
    assert track.centreline.length_m == pytest.approx(table_oval().centreline.length_m, rel=1e-3)


def test_floor_markers_lie_where_the_layout_says(printed_oval):
    """On the glued sheets each marker of the layout is read, whole, its middle within 0.6 mm of its place."""
    directory, ground, floor, *_ = printed_oval
    layout = load_marker_layout(directory / "track.layout.yaml")
    seen = {one.number: one.camera_px.mean(axis=0) for one in find_markers(grey(floor), family="4X4_50").markers}
    assert sorted(seen) == [point.number for point in layout.points] == [40, 41, 42, 43, 44, 45]
    for point in layout.points:
        u, v = seen[point.number] + 0.5
        at_mm = (u / PX_PER_MM, ground.size_mm[1] - v / PX_PER_MM)
        assert at_mm == pytest.approx(1000 * np.array(point.at_m), abs=0.6)


@pytest.fixture(scope="module")
def calibrated(printed_oval):
    """The camera of the table's place sees the glued sheets, and the printed command makes its calibration file."""
    directory, ground, floor, _, said = printed_oval
    camera = place("table").camera
    to_floor = np.array(
        [
            [0.001 / PX_PER_MM, 0, 0.0005 / PX_PER_MM],
            [0, -0.001 / PX_PER_MM, ground.size_mm[1] / 1000 - 0.0005 / PX_PER_MM],
            [0, 0, 1],
        ]
    )
    finer = 3
    to_fine = np.array([[finer, 0, (finer - 1) / 2], [0, finer, (finer - 1) / 2], [0, 0, 1]])
    size = (camera.width_px * finer, camera.height_px * finer)
    matrix = to_fine @ camera.floor_homography() @ to_floor
    seen = cv2.warpPerspective(floor, matrix, size, flags=cv2.INTER_AREA, borderValue=(120, 130, 140))
    picture = cv2.resize(seen, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(directory / "seen.png"), picture)
    words = re.search(r"dnb-edge (calibrate markers .*)", said)[1].split()
    at = words.index("--source")
    words[at : at + 2] = ["--picture", str(directory / "seen.png")]
    run(*(str(directory / word) if word.startswith("track.") else word for word in words))
    return directory, camera


def test_the_printed_command_calibrates_the_camera(calibrated):
    """A camera that sees the glued sheets is calibrated by the printed command, places every point of the lane within 5 mm, and
    the written configuration is right."""
    directory, camera = calibrated
    calibration = load_calibration(directory / "track.view.yaml")
    lane_m = load_track(directory / "track.yaml").centreline.points_m
    camera_px = camera.project(np.column_stack((lane_m, np.zeros(len(lane_m)))))
    apart = np.linalg.norm(calibration.ground.to_track_m(camera_px) - lane_m, axis=1)
    assert apart.max() < 0.005
    run("config", "check", directory / "track.race.yaml")


def test_a_track_of_ones_own_is_printed_where_it_lies(printed_oval, tmp_path):
    """`print track TRACK` prints a lane from a file, in that file's own metres, and leaves the file alone."""
    directory, *_ = printed_oval
    own = directory / "track.yaml"
    before = own.read_bytes()
    run("print", "track", own, "--paper", "a3", "--out", tmp_path / "mine.pdf", "--outline")
    assert own.read_bytes() == before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["mine.layout.yaml", "mine.pdf", "mine.race.yaml"]
    layout = load_marker_layout(tmp_path / "mine.layout.yaml")
    assert layout.scale == load_track(own).scale
    assert len(layout.points) == 6


def test_svg_sheets_have_the_sheets_names(tmp_path):
    """As SVG a poster is the file asked for; sheets are named as the map names them."""
    run("print", "track", "--paper", "poster", "--out", tmp_path / "one.svg")
    assert (tmp_path / "one.svg").stat().st_size > 10_000
    _, ground, plan = oval(Paper.A3)
    assert [name for name, _ in svgs_of(islice(track_pages(ground, plan, Paper.A3), 3))] == ["map", "A1", "A2"]


def test_a_crossing_lane_has_no_hole():
    """Where the figure of eight crosses itself its lane is printed through, as on the rest of it."""
    circuit = figure_eight()
    ground = ground_of(circuit_track(circuit), size_m=circuit_size_m(circuit), family="4X4_50", marker_mm=100.0)
    pdf = pdf_of(track_pages(ground, whole(ground.size_mm), Paper.A4), title="t")
    (picture,) = pages(pdf, px_per_mm=0.5)
    crossing = picture[
        round((MARGIN_MM + ground.size_mm[1] / 2) * 0.5), round((MARGIN_MM + ground.size_mm[0] / 2) * 0.5)
    ]
    assert np.abs(crossing.astype(int) - (184, 153, 114)).max() < 12


@given(
    width=st.floats(300, 4000),
    height=st.floats(300, 3000),
    paper=st.sampled_from(list(Paper)),
    overlap=st.floats(0, 40),
)
def test_sheets_cover_the_floor_once(width, height, paper, overlap):
    """In sight, all sheets together are the floor, each part once; what is printed is more by the overlap, and fits."""
    for plan in tilings((width, height), paper, overlap_mm=overlap):
        area = sum((t.in_sight.right - t.in_sight.left) * (t.in_sight.top - t.in_sight.bottom) for t in plan.tiles)
        assert area == pytest.approx(width * height, rel=1e-9)
        assert len({tile.name for tile in plan.tiles}) == len(plan.tiles) == plan.columns * plan.rows
        for tile in plan.tiles:
            box, sight = tile.printed, tile.in_sight
            assert box.right - box.left <= plan.page_mm[0] - 2 * MARGIN_MM + 1e-6
            assert box.top - box.bottom <= plan.page_mm[1] - 2 * MARGIN_MM - FOOT_MM + 1e-6
            more = (0.0 if tile.column == plan.columns - 1 else overlap) - 1e-6
            assert box.right - sight.right >= more
            assert sight.bottom - box.bottom >= (0.0 if tile.row == plan.rows - 1 else overlap) - 1e-6


def test_a_wide_lane_has_no_hole():
    """A sheet that lies between a wide lane's middle and its edge is printed: its colour is missing otherwise."""
    track = circuit_track(replace(table_oval(), lane_width_m=0.8))
    ground = ground_of(track, size_m=None, family="4X4_50", marker_mm=100.0)
    plan, _ = tilings(ground.size_mm, Paper.A4, overlap_mm=10.0)
    used = plan.only(ground.needs)
    middle, half = ground.middle_mm, 400.0
    for tile in plan.tiles:
        box = tile.in_sight
        at = np.array([(box.left + box.right) / 2, (box.bottom + box.top) / 2])
        if np.linalg.norm(middle - at, axis=1).min() < half - 20.0:
            assert used.used(tile.column, tile.row), tile.name


def test_the_map_names_what_to_measure():
    """Its fourth step has the true distances across the floor between two pairs of markers; without markers it has none."""
    _, ground, plan = oval(Paper.A4)
    for floor in (ground, replace(ground, markers=())):
        said = " ".join(text.get_text() for text in map_page(floor, plan, Paper.A4).figure.axes[0].texts)
        told = [(int(a), int(b), float(m)) for a, b, m in re.findall(r"(\d+) to (\d+) is (\d\.\d+) m", said)]
        at = {one.number: np.array(one.at_m) for one in floor.markers}
        assert [(a, b) for a, b, _ in told] == ([(40, 42), (41, 43)] if floor.markers else [])
        assert [m for *_, m in told] == pytest.approx([np.linalg.norm(at[a] - at[b]) for a, b, _ in told], abs=0.001)
        assert ("calibrate markers" in said) == bool(floor.markers)


def test_markers_that_do_not_fit_are_refused():
    """Floor markers too large for what the lane leaves free are refused, with what to do."""
    circuit = demo_circuit()
    ground = ground_of(circuit_track(circuit), size_m=circuit_size_m(circuit), family="4X4_50", marker_mm=240.0)
    plan, _ = tilings(ground.size_mm, Paper.A4, overlap_mm=10.0)
    with pytest.raises(InputError, match="--marker-mm 240: only 0 floor markers"):
        with_markers(ground, plan, cells=6, numbers=tuple(range(6)))


def test_a_car_is_timed_on_the_printed_track(calibrated):
    """With the written configuration and the view that the printed markers gave, a simulated drive on the same oval is timed as
    it truly was."""
    directory, _ = calibrated
    rig = Rig(place=place("table"), laps=2, seed=3)
    clip = directory / "drive.mp4"
    size = (rig.camera.width_px, rig.camera.height_px)
    writer = cv2.VideoWriter(str(clip), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), rig.fps, size)
    for k in range(rig.frames):
        writer.write(rig.frame(k).bgr)
    writer.release()
    words = [
        sys.executable,
        "-m",
        "dnb_edge",
        "run",
        "--config",
        "track.race.yaml",
        "--source",
        f"file:{clip}",
        "--json",
    ]
    ran = subprocess.run(words, cwd=directory, capture_output=True, text=True, check=True, timeout=300)
    laps = [event for event in map(json.loads, ran.stdout.splitlines()) if event["event"] == "lap"]
    assert [lap["valid"] for lap in laps] == [True, True]
    for lap, truth in zip(laps, rig.truth.laps, strict=True):
        assert lap["time_s"] == pytest.approx(truth.time_s, abs=0.02)
        assert lap["similarity_percent"] > 90


@pytest.mark.parametrize("circuit", [table_oval, demo_circuit, figure_eight], ids=["oval", "demo", "eight"])
@pytest.mark.parametrize("paper", [*Paper, None], ids=lambda paper: paper or "poster")
def test_each_floor_marker_lies_on_one_sheet_and_off_the_lane(circuit, paper):
    """No marker is cut by a sheet's edge or touches the lane's border with its white one, none overlap, and the sheet on which
    each lies is printed."""
    drawn = circuit()
    bare = ground_of(circuit_track(drawn), size_m=circuit_size_m(drawn), family="4X4_50", marker_mm=100.0)
    plans = (whole(bare.size_mm),) if paper is None else tilings(bare.size_mm, paper, overlap_mm=10.0)
    plan = min(plans, key=lambda one: len(one.only(bare.needs).tiles))
    ground = with_markers(bare, plan, cells=6, numbers=(0, 1, 2, 3, 4, 5))
    reach = 100.0 * (0.5 + 1 / 6)
    lane = np.vstack((*ground.border_mm(), ground.middle_mm))
    middles = ground.to_mm(np.array([one.at_m for one in ground.markers]))
    assert len(middles) == 6
    for x, y in middles:
        assert np.abs(lane - (x, y)).max(axis=1).min() > reach
        boxes = [tile.in_sight for tile in plan.only(ground.needs).tiles]
        assert any(
            box.left <= x - reach and x + reach <= box.right and box.bottom <= y - reach and y + reach <= box.top
            for box in boxes
        )
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=2)[~np.eye(6, dtype=bool)]
    assert apart.min() > 2 * reach
