"""The places, styles and disturbances of the certificate: what they are is what they say, and the demo is as ever."""

import numpy as np
import pytest

from dnb_edge.sim.circuit import LANE_HSV, draw_twin
from dnb_edge.sim.disturb import Disturbance, Disturber
from dnb_edge.sim.driver import Style, drive
from dnb_edge.sim.files import course_files
from dnb_edge.sim.places import PLACES, place
from dnb_edge.sim.rig import Rig, Scenery, floor_to_camera_px
from dnb_edge.track.build import TrackSettings, build_track
from dnb_edge.track.twin import LaneColour, load_twin

ALL = {name: place(name) for name in PLACES}
TABLE = ALL["table"]


def lane_points(name, offset_m=0.0):
    line = ALL[name].circuit.centreline
    s = np.arange(0.0, line.length_m, 0.02)
    return line.at(s) + offset_m * line.normal(s)


@pytest.mark.parametrize("name", PLACES)
def test_the_camera_sees_the_whole_lane(name):
    """Every place's lane lies in a camera's picture and on the twin, and no bend is tighter than the lane's half width."""
    here = ALL[name]
    half = 0.5 * here.circuit.lane_width_m
    for offset in (-half, half):
        points = lane_points(name, offset)
        assert np.any([camera.shows(floor_to_camera_px(camera, points)) for camera in here.cameras], axis=0).all()
        twin = here.circuit.scale.to_twin_px(points)
        assert twin.min() > 0.0
        assert np.all(twin < here.circuit.twin_size_px)
    line = here.circuit.centreline
    assert 1.0 / np.abs(line.curvature(np.linspace(0, line.length_m, 3000))).max() > half


@pytest.mark.parametrize("name", ["table", "eight", "hairpin"])
def test_the_twin_leads_back_to_the_circuit(name, tmp_path):
    """From the twin's picture the other rooms find the true centreline, its direction and its length."""
    here = ALL[name]
    files = course_files(tmp_path, here.circuit, here.camera)
    hue, saturation, value = LANE_HSV
    settings = TrackSettings(
        name=name,
        lane_colour=LaneColour(hue_deg=hue, saturation_percent=saturation, value_percent=value),
        metres_per_px=files.metres_per_px,
        start_line_px=files.start_line_px,
    )
    track = build_track(load_twin(files.twin), settings, source=name)
    line = here.circuit.centreline
    assert track.centreline.length_m == pytest.approx(line.length_m, rel=0.005)
    ahead = line.at(here.circuit.start_s_m + np.arange(0.02, 0.3, 0.02))
    s_m, d_m = track.centreline.locate(ahead)
    assert np.all(np.diff(s_m) > 0.0)
    assert np.abs(d_m).max() < 0.01


def test_the_twins_picture_has_the_circuits_size():
    """A twin is as large as its circuit says."""
    assert draw_twin(TABLE.circuit).shape == (400, 480, 3)


def test_the_demos_drive_is_as_ever():
    """Styles changed nothing for the demo: its crossings to the nanosecond."""
    known = (0.7693049145795765, 7.590112826720125, 14.124345291555358)
    assert drive(ALL["demo"].circuit, laps=2, seed=1).crossings_s == pytest.approx(known, abs=1e-9)


def test_a_steady_style_keeps_its_speed():
    """Lowest and top speed alike and one pace: every lap takes its length over the speed."""
    style = Style(top_mps=0.8, lowest_mps=0.8, pace=(1.0, 1.0), wander=0.0)
    driven = drive(TABLE.circuit, laps=3, seed=4, style=style)
    assert np.diff(driven.crossings_s) == pytest.approx([TABLE.circuit.centreline.length_m / 0.8] * 3, abs=1e-6)


def test_looser_styles_stray_further_and_pace_spreads_laps():
    """Wander scales the distance from the centreline; pace makes laps differ."""
    tidy, loose = (
        drive(TABLE.circuit, laps=4, seed=4, style=Style(wander=wander, pace=(0.9, 1.1))) for wander in (0.5, 2.0)
    )
    at = np.linspace(0.0, tidy.duration_s, 500)
    s_m = tidy.along_m(at)
    assert np.allclose(loose.wander.offset_m(s_m), 4.0 * tidy.wander.offset_m(s_m))
    assert np.ptp(np.diff(tidy.crossings_s)) > 0.05
    with pytest.raises(ValueError, match="order"):
        Style(top_mps=0.5, lowest_mps=1.0)


def test_a_laps_path_runs_from_crossing_to_crossing():
    """The true way of a lap begins and ends where the drive is at its crossings, in steps no longer than asked."""
    driven = drive(TABLE.circuit, laps=2, seed=5)
    path = np.array(driven.path_m(1, 0.01))
    ends = driven.points(np.array(driven.crossings_s[1:]))
    assert np.allclose(path[[0, -1]], ends)
    assert len(path) >= (driven.crossings_s[2] - driven.crossings_s[1]) / 0.01


def test_a_parked_car_is_where_it_was_put():
    """The picture differs from that of the empty place round the parked car's ground point and nowhere else."""
    free = Rig(seed=3, laps=1, place=TABLE)
    taken = Rig(seed=3, laps=1, place=TABLE, scenery=Scenery(parked_m=((1.4, -0.25),)))
    changed = np.abs(free.frame(0).bgr.astype(int) - taken.frame(0).bgr.astype(int)).max(axis=2) > 15
    v, u = np.nonzero(changed)
    line = TABLE.circuit.centreline
    s = np.array([1.4])
    (at,) = floor_to_camera_px(TABLE.camera, line.at(s) - 0.25 * line.normal(s))
    assert np.hypot(u.mean() - at[0], v.mean() - at[1]) < 25
    assert max(np.ptp(u), np.ptp(v)) < 180


@pytest.mark.parametrize(
    "wanted", [Disturbance(ramp=0.4), Disturbance(flicker=0.1), Disturbance(noise_sigma=8.0), Disturbance(hands=0.8)]
)
def test_disturbances_follow_from_the_seed(wanted):
    """Each changes the picture, the same way for the same seed."""
    plain = np.full((120, 160, 3), 128, dtype=np.uint8)
    one, other = (Disturber(wanted, seed=2, size_px=(160, 120), hand_px=20.0) for _ in range(2))
    pictures = [disturber.apply(plain.copy(), index=40, t_s=1.37) for disturber in (one, other)]
    assert np.array_equal(*pictures)
    assert not np.array_equal(pictures[0], plain)
    assert pictures[0].dtype == np.uint8


def test_light_falls_by_the_ramps_share():
    """In the middle of a ramp the light is less by its share; shares beyond 1 are refused."""
    plain = np.full((40, 40, 3), 200, dtype=np.uint8)
    disturber = Disturber(Disturbance(ramp=0.4, ramp_s=10.0), seed=1, size_px=(40, 40), hand_px=9.0)
    assert disturber.apply(plain.copy(), index=0, t_s=5.0).mean() == pytest.approx(120.0, abs=1.0)
    with pytest.raises(ValueError, match="share"):
        Disturbance(hands=1.5)
