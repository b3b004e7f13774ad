"""A track under two cameras: one target throughout, no lap torn, and laps as good as one camera's."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dnb_edge.core import Core, CoreSetup
from dnb_edge.sim.driver import drive
from dnb_edge.truth.cameras import sighted_by_all
from dnb_edge.truth.course import course
from dnb_edge.truth.measure import measured
from dnb_edge.truth.scenarios import HALL, HALL_WIDE, catalogue
from dnb_edge.truth.sightings import Sightings
from dnb_edge.truth.watch import watch
from dnb_edge.values import Crossing, FrameDetections, Lap, Observation, Target, TargetState

LAPS = 6


def scenario(name):
    return next(one for one in catalogue() if one.name == name)


@pytest.fixture(scope="module")
def hall():
    return watch(scenario(HALL), laps=LAPS, seed=7, number=0)


@pytest.fixture(scope="module")
def detections():
    """Every frame of a drive under both cameras."""
    here = course("hall", lasting_share=0.0, clicked_px=1.0)
    driven = drive(here.place.circuit, laps=3, seed=3, style=scenario(HALL).styles[0])
    found = sighted_by_all(
        driven, here.place.cameras, Sightings(), fps=30.0, lap_m=driven.circuit.centreline.length_m,
        crossings_s=driven.crossings_s, seed=3,
    )  # fmt: skip
    return here.setup, list(found)


def test_one_target_is_handed_over_without_a_break(hall):
    """It keeps its number over all hand-overs, is never out of sight, and every lap is told, valid and wholly observed."""
    seen = [event for event in hall.events if isinstance(event, Observation)]
    cameras = [one.camera for one in seen]
    assert sum(a != b for a, b in pairwise(cameras)) > 2 * LAPS
    assert {one.target_id for one in seen} == {seen[0].target_id}
    targets = [event for event in hall.events if isinstance(event, Target)]
    assert {target.state for target in targets} == {TargetState.CONFIRMED}
    laps = [event for event in hall.events if isinstance(event, Lap)]
    assert [lap.number for lap in laps] == list(range(1, LAPS + 1))
    assert all(lap.valid and not lap.suspect for lap in laps)
    assert min(lap.observed_fraction for lap in laps) > 0.98


def test_laps_are_as_good_as_under_one_camera(hall):
    """The line lies where both cameras see it and their maps disagree by millimetres: no crossing is told twice, and the laps'
    errors stay within half as much again of one camera's over the same laps."""
    two = measured(hall, series=False)
    one = measured(watch(scenario(HALL_WIDE), laps=LAPS, seed=7, number=0), series=False)
    assert (two["laps_told"], two["phantom"]) == (LAPS, 0)
    assert len([event for event in hall.events if isinstance(event, Crossing)]) == LAPS + 1
    worst = [max(abs(lap["error_s"]) for lap in found["laps"]) for found in (two, one)]
    assert worst[0] < 1.5 * worst[1]


def test_a_setup_with_several_cameras_is_stored_whole(detections):
    """What is recorded of the setup makes the same race again, event for event."""
    setup, found = detections
    again = CoreSetup.from_dict(setup.to_dict())
    assert again == setup
    raced = []
    for one in (setup, again):
        core = Core(one)
        raced.append([event for frame in found for event in core.step(frame)] + core.finish())
    assert raced[0] == raced[1]
    assert sum(isinstance(event, Lap) for event in raced[0]) == 3


def test_a_camera_is_asked_for_what_its_picture_shows(detections):
    """A car is looked for in the pictures that can show it, in their own pixels, and nowhere else once it is followed."""
    setup, found = detections
    core, asked = Core(setup), {0: 0, 1: 0}
    for frame in found:
        windows = core.windows(frame.t_ns, frame.camera)
        if windows and frame.detections:
            (window,), (detection,) = windows, frame.detections
            asked[frame.camera] += 1
            assert np.hypot(*np.subtract(window.camera_px, detection.camera_px)) < 0.5 * detection.length_px
            assert window.length_px == pytest.approx(detection.length_px, rel=0.25)
        elif core.parked() == () and frame.t_ns > 1e9:
            assert frame.detections == () or not windows
            assert core.is_awaited(frame.t_ns, frame.camera) == bool(windows)
        core.step(frame)
    assert min(asked.values()) > 100


def test_where_one_camera_fails_its_laps_say_so(detections):
    """A camera that sends nothing for two seconds marks the lap, though the other one sends all the time."""
    setup, found = detections
    gone = [frame for frame in found if not (frame.camera == 1 and 10e9 < frame.t_ns < 12e9)]
    core = Core(setup)
    laps = [event for frame in gone for event in core.step(frame) if isinstance(event, Lap)]
    assert any("camera gap: no frames came for 2.0 s" in reason for lap in laps for reason in lap.suspect)


def test_rows_that_were_read_before_the_last_fix_are_left_out(detections):
    """Rolling shutters of 25 ms make one camera's later frame show an earlier moment than the other's: time never runs
    backwards in what crossings are fitted to, and all laps are still told."""
    setup, found = detections
    row_s = 0.025 / setup.ground.height_px
    rolling = replace(setup, row_s=row_s, further=tuple(replace(view, row_s=row_s) for view in setup.further))
    core = Core(rolling)
    events = [event for frame in found for event in core.step(frame)] + core.finish()
    assert sum(isinstance(event, Lap) for event in events) == 3


@pytest.mark.parametrize("camera", [-1, 2])
def test_frames_of_no_camera_are_refused(detections, camera):
    """A frame of a camera that the setup does not have is a fault of the caller's."""
    setup, _ = detections
    with pytest.raises(ValueError, match="of camera"):
        Core(setup).step(FrameDetections(sequence=0, t_ns=0, detections=(), full_frame=True, camera=camera))
