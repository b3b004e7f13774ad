"""Several cars on one lane: apart, lawful, each with its own truth; and their pictures show where each one is."""

import cv2
import numpy as np
import pytest

from dnb_edge.capture.simulated import parse_simulator_uri
from dnb_edge.errors import InputError
from dnb_edge.sim.car import LENGTH_M, PAINTS
from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.places import table_oval
from dnb_edge.sim.rig import Rig
from dnb_edge.sim.traffic import CLOSEST_M, drives

CIRCUIT = demo_circuit()
LENGTH_OF_LAP_M = CIRCUIT.centreline.length_m


@pytest.mark.parametrize("cars", [2, 3, 8])
@pytest.mark.parametrize("seed", [1, 2, 3, 17])
def test_no_two_cars_meet(cars, seed):
    """Along the lane no car comes nearer to the one ahead than it may, nor do any two on the floor, whatever the seed."""
    driven = drives(CIRCUIT, cars=cars, laps=4, seed=seed)
    t = np.arange(0.0, driven[0].duration_s, 0.02)
    along = [one.along_m(t) for one in driven]
    ahead = [along[-1] + LENGTH_OF_LAP_M, *along[:-1]]
    assert min(float((a - b).min()) for a, b in zip(ahead, along, strict=True)) > CLOSEST_M
    at = [one.points(t) for one in driven]
    nearest = min(np.linalg.norm(at[i] - at[k], axis=1).min() for i in range(cars) for k in range(i))
    assert nearest > 1.5 * LENGTH_M


@pytest.mark.parametrize("cars", [2, 8])
def test_every_car_drives_its_own_laps(cars):
    """Each makes all laps, at least, crosses the line at its true instants, never stands or goes back; no two times agree."""
    driven = drives(CIRCUIT, cars=cars, laps=3, seed=5)
    times = [lap for one in driven for lap in np.diff(one.crossings_s)]
    assert len({round(time, 3) for time in times}) == len(times)
    for one in driven:
        assert one.duration_s == driven[0].duration_s
        assert 3 <= one.laps <= 4
        assert len(one.crossings_s) == one.laps + 1
        crossed = one.along_m(np.array(one.crossings_s))
        assert np.allclose(crossed, LENGTH_OF_LAP_M * np.arange(one.laps + 1), atol=0.03)
        assert np.all(np.diff(one.table_s_m) > 0.0)
    assert min(one.along_m(np.array([one.duration_s]))[0] for one in driven) > 3 * LENGTH_OF_LAP_M + 0.5


def test_cars_that_do_not_fit_are_refused():
    """Nine cars, none, and eight on a table of 2.7 m are mistakes of the caller."""
    for circuit, cars in ((CIRCUIT, 9), (CIRCUIT, 0), (table_oval(), 8)):
        with pytest.raises(ValueError, match="cars do not fit"):
            drives(circuit, cars=cars, laps=1, seed=1)


@pytest.fixture(scope="module")
def three():
    """A rig of three cars."""
    return Rig(seed=1, laps=1, cars=3)


def test_pictures_show_each_car_in_its_paint_at_its_place(three):
    """Round each true place the picture differs from the empty room, and what differs there has the hue of that car's paint."""
    for index in range(20, three.frames, 60):
        picture, empty = three.frame(index).bgr, three._renderer.picture(index, None)
        changed = np.abs(picture.astype(int) - empty).sum(axis=2) > 120
        left = changed.copy()
        for car, paint in enumerate(three.paints):
            u, v = np.rint(three.frame_truth(index, car).camera_px).astype(int)
            box = np.s_[max(0, v - 70) : v + 50, max(0, u - 70) : u + 70]
            assert changed[box].sum() > 1500
            left[box] = False
            hsv = cv2.cvtColor(picture[box], cv2.COLOR_BGR2HSV)
            wanted = int(cv2.cvtColor(np.array([[paint.bgr]], dtype=np.uint8), cv2.COLOR_BGR2HSV)[0, 0, 0])
            full = changed[box] & (hsv[..., 1] > 150)
            off = np.abs((hsv[..., 0][full].astype(int) - wanted + 90) % 180 - 90)
            assert np.median(off) < 6
        assert left.sum() < 30


def test_several_cars_come_out_alike_whatever_was_drawn_before(three):
    """The same arguments give the same bytes, and a car drawn over another leaves no trace in the next picture."""
    three.frame(90)
    assert np.array_equal(three.frame(40).bgr, Rig(seed=1, laps=1, cars=3).frame(40).bgr)


def test_the_nearer_car_hides_the_farther():
    """Where two cars overlap in the picture, the one nearer to the camera is whole, and the rest of the other stays."""
    rig = Rig(seed=1, laps=1, cars=2)
    near = rig.drive.pose(2.0)
    x, y = near.track_m
    far = type(near)(track_m=(x + 0.02, y + 0.12), heading_rad=near.heading_rad, speed_mps=0.0)
    away = type(near)(track_m=(x + 0.02, y + 0.6), heading_rad=near.heading_rad, speed_mps=0.0)
    u, v = np.rint(rig.camera.project(np.array([[x, y, 0.07]]))[0]).astype(int)
    box = np.s_[v - 8 : v + 9, u - 8 : u + 9]
    alone, both = rig._renderer.picture(0, near, away), rig._renderer.picture(0, near, far)
    assert np.array_equal(alone[box], both[box])
    assert not np.array_equal(alone[v - 60 : v, u - 40 : u + 40], both[v - 60 : v, u - 40 : u + 40])
    beside = type(near)(track_m=(x, y + 0.17), heading_rad=near.heading_rad, speed_mps=0.0)
    u, v = np.rint(rig.camera.project(np.array([[x, y + 0.17, 0.1]]))[0]).astype(int)
    roof = np.s_[v - 5 : v + 6, u - 5 : u + 6]
    seen = [rig._renderer.picture(0, one, beside)[roof].astype(int) for one in (near, away)]
    assert np.abs(seen[0] - seen[1]).max() <= 1


def test_one_car_is_drawn_as_ever(rig):
    """Adding cars to the rig changed neither the drive nor the picture of one: figures taken before."""
    assert rig.paints == ()
    assert rig.truth.crossings_s == pytest.approx((0.7693049145795765, 7.590112826720125, 14.124345291555358), abs=1e-9)
    grid = rig.frame(40).bgr.astype(float).reshape(4, 180, 4, 320, 3).mean(axis=(1, 3, 4))
    before = [
        [121.16, 140.89, 142.26, 145.50],
        [126.86, 139.48, 158.45, 137.51],
        [113.82, 135.08, 141.13, 133.70],
        [130.81, 124.16, 140.62, 145.95],
    ]
    assert grid == pytest.approx(np.array(before), abs=0.02)


def test_paints_have_names_and_colours_of_their_own():
    """Eight of them, as configurations write colours."""
    assert len({paint.name for paint in PAINTS}) == len({paint.hex for paint in PAINTS}) == 8
    assert PAINTS[0].hex == "#d62428"


@pytest.mark.parametrize("number", ["0", "9", "two"])
def test_a_number_of_cars_that_cannot_be_is_refused(number):
    """One line that names the option."""
    with pytest.raises(InputError, match="cars must"):
        parse_simulator_uri(f"sim:?cars={number}")
