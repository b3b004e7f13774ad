"""The appliance's counts, all from the frames' own stamps and numbers."""

import pytest
from played import frame

from dnb_edge.daemon.meter import Meter
from dnb_edge.machine.state import MachineState
from dnb_edge.values import LostFrames, Observation


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


LIVE = MachineState(temperature_c=85.0, throttled=True, memory_bytes=100_000_000, disk_free_bytes=10**10)


def test_percentiles_of_latency_are_those_of_the_whole_run() -> None:
    """p95 and p99 since the run began, beside the median of the period."""
    counts = meter()
    for milliseconds in range(1, 101):
        counts.latency(float(milliseconds))
    counts.health(display="none", recording="none")
    health = counts.health(display="none", recording="none")
    assert health.latency_ms is None
    assert health.latency_p95_ms == pytest.approx(95.0, rel=0.021)
    assert health.latency_p99_ms == pytest.approx(99.0, rel=0.021)


def test_the_machine_is_told_with_its_warnings_after_the_others() -> None:
    """What the race itself suffers from comes first."""
    counts = meter()
    health = counts.health(display="none", recording="none", warnings=("away",), machine=LIVE, queued_frames=2)
    assert (health.temperature_c, health.throttled, health.memory_bytes) == (85.0, True, 100_000_000)
    assert (health.disk_free_bytes, health.queued_frames) == (10**10, 2)
    assert health.warnings[0] == "away"
    assert len(health.warnings) == 3


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("queue", "this machine is too slow for the camera's rate"),
        ("overtaken", "this machine is too slow for the camera's rate"),
        ("gap", "the camera or its cable loses them"),
        ("short", "they come cut off, check the camera's cable"),
        ("odd", "odd"),
    ],
)
def test_frames_lost_in_a_period_are_a_warning_with_their_reason(reason: str, words: str) -> None:
    """More than 2 % of a live source's last period, until a whole second shows that it is over. Files warn of none."""
    counts, told = meter(), []
    for period, lost in enumerate((2, 3, 3)):
        counts.lost_before = (LostFrames(reason=reason, frames=lost),)
        for i in range(100):
            counts.frame(frame(period * 100 + i))
        told.append(counts.health(display="none", recording="none", machine=MachineState()).warnings)
        assert counts.lost == counts.lost_before
    # 2 of 101 frames, 1 of 101, none.
    assert told == [(), (), ()]
    counts.lost_before = (LostFrames(reason=reason, frames=13),)
    counts.frame(frame(1000))
    for i in range(89):
        counts.frame(frame(1001 + i))
    health = counts.health(display="none", recording="none", machine=MachineState())
    assert health.warnings == (f"10 % of frames lost: {words}",)
    for sequence in (1090, 1091, 1300):
        out_of_turn = counts.health(display="none", recording="none", machine=MachineState())
        assert out_of_turn.warnings == health.warnings
        counts.frame(frame(sequence))
    assert counts.health(display="none", recording="none", machine=MachineState()).warnings == ()
    counts.lost_before = (LostFrames(reason=reason, frames=200),)
    counts.frame(frame(1500))
    assert counts.health(display="none", recording="none").warnings == ()


def test_what_the_race_left_out_is_lost_too() -> None:
    """Unreadable pictures and stamps that run backwards, beside what the feed lost."""
    counts = meter()
    counts.lost_before = (LostFrames(reason="queue", frames=1),)
    counts.unreadable_frames, counts.misstamped_frames = 2, 3
    lost = counts.health(display="none", recording="none").lost
    assert [(one.reason, one.frames) for one in lost] == [("queue", 1), ("stamp", 3), ("unreadable", 2)]
