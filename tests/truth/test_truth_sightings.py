"""Drawn detections are what their model says."""

import numpy as np
import pytest

from dnb_edge.sim.driver import Style, drive
from dnb_edge.sim.places import place
from dnb_edge.sim.rig import floor_to_camera_px
from dnb_edge.truth.sightings import Sightings, kept_frames, moments, sighted

TABLE = place("table-paper")
LAP_M = TABLE.circuit.centreline.length_m
DRIVE = drive(TABLE.circuit, laps=8, seed=3, style=Style(top_mps=1.0, lowest_mps=1.0, pace=(0.9, 1.1)))
FPS = 30.0


def errors(model: Sightings, seed=1):
    """(frames with a find, their errors in camera px (n, 2), the detections)."""
    at = moments(DRIVE, fps=FPS)
    kept = kept_frames(model, frames=len(at.t_s), fps=FPS, crossings_s=DRIVE.crossings_s, seed=seed)
    frames = list(sighted(DRIVE, TABLE.camera, at, model, lap_m=LAP_M, kept=kept, seed=seed))
    true_px = floor_to_camera_px(TABLE.camera, at.track_m)
    found = [frame for frame in frames if frame.detections]
    numbers = np.array([frame.sequence for frame in found])
    off = np.array([frame.detections[0].camera_px for frame in found]) - true_px[numbers]
    return numbers, off, frames


@pytest.mark.parametrize(
    "model", [Sightings(sigma_px=0.7), Sightings(sigma_px=0.5, place_px=1.0), Sightings(sigma_px=0.3, memory_px=0.8)]
)
def test_errors_are_as_large_as_stated(model):
    """Their spread is the sigma that goes with them, along both axes."""
    _, off, frames = errors(model)
    assert frames[0].detections[0].sigma_px == pytest.approx(model.stated_px)
    assert np.sqrt((off**2).mean()) == pytest.approx(model.stated_px, rel=0.15)


def test_the_places_error_repeats_lap_by_lap():
    """Without any other error, the same place has the same error in each lap."""
    numbers, off, _ = errors(Sightings(sigma_px=0.0, place_px=1.0))
    place_m = np.mod(DRIVE.along_m(numbers / FPS), LAP_M)
    order = np.argsort(place_m)
    neighbours = np.diff(place_m[order]) < 0.001
    assert neighbours.sum() > 30
    assert np.abs(np.diff(off[order], axis=0)[neighbours]).max() < 0.15
    assert np.ptp(off) > 2.0


def test_the_fading_error_lasts_over_frames():
    """Neighbouring frames err alike, frames half a second apart do not."""
    _, off, _ = errors(Sightings(sigma_px=0.0, memory_px=1.0, memory_s=0.15))
    u = off[:, 0] - off[:, 0].mean()
    near, far = ((u[:-lag] * u[lag:]).mean() / (u**2).mean() for lag in (1, 20))
    assert near == pytest.approx(np.exp(-1 / FPS / 0.15), abs=0.1)
    assert abs(far) < 0.3


def test_the_same_seed_gives_the_same_detections():
    """Everything is drawn from the seed."""
    model = Sightings(sigma_px=0.7, place_px=0.2, memory_px=0.2, missed=0.1, false_rate=0.1, dropped=0.1, gap_frames=3)
    assert errors(model, seed=5)[2] == errors(model, seed=5)[2]
    assert errors(model, seed=5)[2] != errors(model, seed=6)[2]


def test_dropped_and_missed_frames():
    """A dropped frame never comes; in a missed one nothing is found."""
    whole = len(moments(DRIVE, fps=FPS).t_s)
    dropped, missed = errors(Sightings(dropped=0.1))[2], errors(Sightings(missed=0.1))
    assert len(dropped) == pytest.approx(0.9 * whole, rel=0.05)
    assert len(missed[2]) == whole
    assert len(missed[0]) == pytest.approx(0.9 * whole, rel=0.05)


def test_the_gap_holds_the_crossing():
    """At every other crossing three frames in a row are gone, with the crossing between the neighbours that are left."""
    kept = kept_frames(Sightings(gap_frames=3), frames=2000, fps=FPS, crossings_s=DRIVE.crossings_s, seed=2)
    gone = np.flatnonzero(~kept)
    assert len(gone) == 3 * len(DRIVE.crossings_s[::2])
    for k, crossing_s in enumerate(DRIVE.crossings_s[::2]):
        first, _, last = gone[3 * k : 3 * k + 3]
        assert last == first + 2
        assert (first - 1) / FPS < crossing_s < (last + 1) / FPS


def test_what_is_hidden_is_not_found():
    """On the hidden stretch there is no detection, elsewhere there is."""
    numbers, _, frames = errors(Sightings(hidden_m=(1.0, 1.4)))
    place_m = np.mod(DRIVE.along_m(np.arange(len(frames)) / FPS), LAP_M)
    hidden = (place_m > 1.0) & (place_m < 1.4)
    assert set(numbers.tolist()) == set(np.flatnonzero(~hidden).tolist())


def test_false_finds_and_bystanders_come_besides():
    """They are further detections; the car's own stays the first."""
    frames = errors(Sightings(bystander_m=(0.6, 0.5), false_rate=0.2))[2]
    counts = np.array([len(frame.detections) for frame in frames])
    assert counts.min() == 2
    assert (counts == 3).mean() == pytest.approx(0.2, abs=0.06)
    at = np.array([frame.detections[-1].camera_px for frame in frames])
    (stands,) = floor_to_camera_px(TABLE.camera, np.array([[0.6, 0.5]]))
    assert np.abs(at - stands).max() < 1.5


def test_stamps_err_and_stay_in_order():
    """Stamps are off by their sigma; the pictures are not; no stamp overtakes the next."""
    exact, off = moments(DRIVE, fps=FPS), moments(DRIVE, fps=FPS, stamp_sigma_s=0.004, seed=9)
    assert np.array_equal(exact.track_m, off.track_m)
    assert np.std((off.t_ns - exact.t_ns) * 1e-9) == pytest.approx(0.004, rel=0.15)
    wild = moments(DRIVE, fps=FPS, stamp_sigma_s=0.05, seed=9)
    assert np.all(np.diff(wild.t_ns) > 0)
