"""A track is driven from its start line, forward, and survives storage bit for bit."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twin_pictures import PINK, painted, ring, theta

from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings, build_track, track_from_route
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.track.overlay import draw_track
from dnb_edge.track.route import find_route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import load_twin

SCALE = TwinScale(metres_per_px=0.01, height_px=400)
ROUTE = find_route(ring(), source="ring")


def track(**changes):
    return track_from_route(ROUTE, SCALE, TrackSettings(name="ring", lane_colour=PINK, **changes), source="ring")


def circular(s_m, length_m):
    return (s_m + length_m / 2) % length_m - length_m / 2


@given(angle=st.floats(0, 2 * math.pi), outward=st.booleans())
def test_the_start_line_sets_place_and_direction(angle, outward):
    """Wherever the line lies and whichever way it points, s = 0 is on it and +s crosses it forward, once."""
    u, v = math.cos(angle), math.sin(angle)
    ends = ((200 + 100 * u, 200 + 100 * v), (200 + 160 * u, 200 + 160 * v))
    built = track(start_line_px=ends if outward else ends[::-1])
    crossings = crossings_of(built.centreline, built.start_line)
    assert len(crossings) == 1
    assert crossings[0][1]
    assert abs(circular(crossings[0][0], built.centreline.length_m)) < 1e-9
    x, y = built.centreline.direction_at(0.0)
    fx, fy = built.start_line.forward
    assert x * fx + y * fy > 0.95
    chords = np.hypot(*(np.roll(built.centreline.points_m, -1, axis=0) - built.centreline.points_m).T)
    assert chords.max() / chords.min() < 1.01


def test_without_a_start_line_the_lap_starts_on_the_straightest_place():
    """By default a theta's lap starts on one of its straights, anticlockwise."""
    built = build_track(painted(theta()), TrackSettings(name="t", lane_colour=PINK, metres_per_px=0.01), source="t")
    x, y = built.centreline.points_m.T
    assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0
    turned = [built.centreline.direction_at(s) for s in np.linspace(-0.3, 0.3, 9)]
    assert max(math.dist(turned[0], other) for other in turned) < 0.05
    assert crossings_of(built.centreline, built.start_line)[0][1]


def test_sector_lines_come_in_the_order_of_a_lap():
    """Given in any order and direction, they are named and turned along the route."""

    def spoke(degrees, *, flipped=False):
        u, v = math.cos(math.radians(degrees)), -math.sin(math.radians(degrees))
        ends = ((200 + 100 * u, 200 + 100 * v), (200 + 160 * u, 200 + 160 * v))
        return ends[::-1] if flipped else ends

    built = track(
        start_line_px=spoke(0, flipped=True), sector_lines_px=(spoke(250), spoke(120, flipped=True), spoke(200))
    )
    assert [line.name for line in built.sector_lines] == ["sector 1", "sector 2", "sector 3"]
    crossings = [crossings_of(built.centreline, line) for line in built.sector_lines]
    assert all(len(found) == 1 and found[0][1] for found in crossings)
    lap = built.centreline.length_m
    placed = [found[0][0] / lap * 360 for found in crossings]
    ascending = [120, 200, 250] if built.centreline.direction_at(0)[1] > 0 else [110, 160, 240]
    assert placed == pytest.approx(ascending, abs=1)


@pytest.mark.parametrize(
    ("changes", "pattern"),
    [
        ({"start_line_px": ((0, 200), (400, 200))}, (r"line 'start' from \(0, 200\) to \(400, 200\) twin px crosses the "
         r"route 2 times, at \(\d+, 200\) and \(\d+, 200\)")),
        ({"start_line_px": ((190, 200), (210, 200))}, r"crosses the route 0 times: draw it"),
        ({"start_line_px": ((190, 200), (190, 200))}, r"line 'start': its ends"),
        ({"sector_lines_px": (((0, 200), (400, 200)),)}, r"line 'sector 1' .* crosses the route 2 times"),
    ],
)  # fmt: skip
def test_lines_must_cross_the_route_once(changes, pattern):
    """A line beside the route, or through two of its lanes, is refused with the places where it crosses."""
    with pytest.raises(InputError, match=pattern):
        track(**changes)


def test_a_track_needs_a_scale():
    """Without metres there is no track, and the message says what to measure."""
    with pytest.raises(InputError, match=r"t\.png: the twin's scale is not known: measure"):
        build_track(painted(ring()), TrackSettings(name="t", lane_colour=PINK), source="t.png")


def test_the_stored_form_is_exact():
    """A recording's copy of the track is the track, bit for bit."""
    built = track(sector_lines_px=(((200, 40), (200, 100)),))
    again = Track.from_dict(json.loads(json.dumps(built.to_dict())))
    assert again == built
    assert json.dumps(again.to_dict()) == json.dumps(built.to_dict())


@pytest.mark.parametrize("missing", ["name", "scale", "centreline", "start_line", "sector_lines"])
def test_a_damaged_stored_form_is_refused(missing):
    """A member that is gone or of another kind is an input error that names the remedy."""
    whole = track().to_dict()
    gone = {key: value for key, value in whole.items() if key != missing}
    with pytest.raises(InputError):
        Track.from_dict(gone)
    if missing != "name":
        with pytest.raises(InputError):
            Track.from_dict({**whole, missing: 3})


def test_building_twice_gives_the_same_track():
    """The picture alone decides: nothing in the building is left to chance."""
    settings = TrackSettings(name="t", lane_colour=PINK, metres_per_px=0.01)
    image = painted(theta())
    assert build_track(image, settings, source="t") == build_track(image, settings, source="t")


def test_overlays_show_the_route_and_leave_the_twin_alone():
    """The picture has the twin's size, dark pixels along the middle, red ones on the start line; the input is kept."""
    image = painted(ring())
    kept = image.copy()
    built = track(start_line_px=((300, 200), (360, 200)))
    drawn = draw_track(image, built)
    assert drawn.shape == image.shape
    assert np.array_equal(image, kept)
    assert drawn[70, 200].max() < 120
    blue, green, red = drawn[200, 345].astype(int)
    assert red > 150
    assert max(blue, green) < 100
    assert draw_track(None, built).shape[0] == 400


def test_the_papers_truth_fits_its_track(real_dir):
    """Over the paper's start line, the true path of the driven clip crosses forward at the true times."""
    folder = real_dir / "drivenetbench"
    truth = json.loads((folder / "driven-lap.truth.json").read_text())
    line_px = tuple((u, v) for u, v in truth["start_line_twin"])
    settings = TrackSettings(name="paper", lane_colour=PINK, metres_per_px=0.0015, start_line_px=line_px)
    built = build_track(load_twin(folder / "digital-twin.jpg"), settings, source="paper")
    path = [tuple(p) for p in built.scale.to_track_m(np.array([f["twin"] for f in truth["frames"]])).tolist()]
    times = []
    for k in range(len(path) - 1):
        fraction = built.start_line.intersects_segment(path[k], path[k + 1])
        if fraction is not None:
            assert built.start_line.signed_distance(path[k + 1]) > 0
            t0, t1 = truth["frames"][k]["t"], truth["frames"][k + 1]["t"]
            times.append(t0 + fraction * (t1 - t0))
    assert times == pytest.approx(truth["crossings_s"], abs=0.004)
    _, d_m = built.centreline.locate(np.array(path))
    assert abs(d_m).max() < built.centreline.half_left_m.min()
