"""The appliance's counts, all from the frames' own stamps and numbers."""

import pytest
from played import frame

from dnb_edge.daemon.meter import Meter
from dnb_edge.values import Observation


def meter(**given) -> Meter:
    return Meter(**{"view_error_mean_px": 1.5, "view_error_mean_m": 0.002} | given)


def observation(t_ns: int) -> Observation:
    return Observation(
        t_ns=t_ns,
        t_s=t_ns * 1e-9,
        camera_px=(1.0, 2.0),
        track_m=(0.1, 0.2),
        covariance_m2=(1e-4, 0.0, 1e-4),
        confidence=0.9,
        length_px=40.0,
    )


def test_health_is_due_after_each_second_of_the_stamps() -> None:
    """At 50 frames a second: after the 50th frame that follows the first, and again 50 later; the rate is 50 each time."""
    counts = meter()
    due = []
    for i in range(151):
        counts.frame(frame(i, t_ns=5_000_000_000 + i * 20_000_000))
        if counts.due:
            health = counts.health(display="none", recording="none")
            due.append((i, health.t_s, health.fps, health.frames))
    assert due == [(50, 1.0, 50.0, 51), (100, 2.0, 50.0, 101), (150, 3.0, 50.0, 151)]


@pytest.mark.parametrize(
    ("sequences", "dropped"),
    [
        ([0, 1, 2], 0),
        ([5, 6, 7], 0),
        ([0, 1, 4, 5, 7], 3),
        ([900, 901, 0, 1, 3], 1),
    ],
    ids=["none", "starting later", "gaps", "a camera that came back counts anew"],
)
def test_dropped_frames_are_the_gaps_in_the_numbers(sequences: list[int], dropped: int) -> None:
    """Every number that a source left out is a frame that was lost before the race."""
    counts = meter()
    for i, sequence in enumerate(sequences):
        counts.frame(frame(sequence, t_ns=i))
    health = counts.health(display="none", recording="none")
    assert (health.frames, health.dropped_frames) == (len(sequences), dropped)


def test_frames_are_detected_once() -> None:
    """Frames with the car are counted, not observations; those told in hindsight count too."""
    counts = meter()
    counts.observed([])
    counts.observed([observation(1), observation(2), observation(2), observation(3)])
    counts.observed([observation(4)])
    assert counts.detected_frames == 4


def test_a_frame_told_of_by_two_cars_at_different_times_counts_once() -> None:
    """What one car's observations say late, after a meeting, is no second frame."""
    counts = meter()
    counts.observed([observation(1), observation(2)])
    counts.observed([observation(1), observation(2), observation(3)])
    assert counts.detected_frames == 3


def test_latency_is_the_median_of_its_period() -> None:
    """The median since the last Health; None where there was none."""
    counts = meter()
    for milliseconds in (10.0, 500.0, 20.0):
        counts.latency(milliseconds)
    assert counts.health(display="none", recording="none").latency_ms == 20.0
    assert counts.health(display="none", recording="none").latency_ms is None


def test_health_before_any_frame_says_so() -> None:
    """No frame: no rate and no time, and no division by nothing."""
    health = meter().health(display="offline", recording="recording")
    assert (health.frames, health.t_s, health.fps) == (0, 0.0, None)
    assert (health.display, health.recording) == ("offline", "recording")


def test_health_says_all_that_is_wrong() -> None:
    """What is wrong all the time, unreadable pictures, and what the listeners say, in this order."""
    counts = meter(standing_warnings=("not scored",))
    counts.unreadable_frames = 3
    health = counts.health(display="none", recording="none", warnings=("display offline",))
    assert health.warnings == ("not scored", "3 unreadable pictures", "display offline")
    assert (health.view_error_mean_px, health.view_error_mean_m) == (1.5, 0.002)
