"""The pure core from detections to events, against cars whose laps are known exactly."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest
from circle import circle_setup, circle_track, detection, frames, on_circle
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.core import Core, CoreSetup
from dnb_edge.race.rules import LapRules
from dnb_edge.track.line import line_across
from dnb_edge.values import Crossing, Direction, Event, FrameDetections, Lap, Observation, PointM, Score

OMEGA = 1.3
"""Angular speed of the steady car, radians per second."""

START_RAD = -0.6


def steady(t_s: float) -> PointM:
    return on_circle(START_RAD + OMEGA * t_s)


def race(setup: CoreSetup, position: Callable[[float], PointM | None], **how: float) -> list[Event]:
    core = Core(setup)
    events: list[Event] = []
    for found in frames(position, **how):  # type: ignore[arg-type]
        events += core.step(found)
    return events + core.finish()


def laps_of(events: list[Event]) -> list[Lap]:
    return [event for event in events if isinstance(event, Lap)]


def crossings_of(events: list[Event]) -> list[Crossing]:
    return [event for event in events if isinstance(event, Crossing)]


@pytest.mark.parametrize("fps", [15.0, 29.97, 60.0])
def test_lap_time_of_a_steady_car_is_exact_whatever_the_frame_rate(fps: float) -> None:
    """A noiseless car has the same lap time at every frame rate, far finer than a frame."""
    laps = laps_of(race(circle_setup(), steady, seconds=16, fps=fps))
    assert len(laps) == 3
    for lap in laps:
        assert lap.time_s == pytest.approx(2 * math.pi / OMEGA, abs=3e-4)
        assert lap.valid
        assert lap.observed_fraction == 1.0


def test_crossing_instants_are_the_true_ones() -> None:
    """The first crossing is where the car truly crosses, not where it was confirmed."""
    first = crossings_of(race(circle_setup(), steady, seconds=16))[0]
    assert first.t_s == pytest.approx(-START_RAD / OMEGA, abs=3e-4)
    assert first.direction is Direction.FORWARD
    assert not first.estimated


def test_stated_sigma_matches_the_scatter_of_noisy_crossings() -> None:
    """With one pixel of noise the errors of crossings are as large as their stated sigma says."""
    ratios = []
    for seed in range(12):
        core = Core(circle_setup())
        events = [e for found in frames(steady, seconds=30, noise_px=1.0, seed=seed) for e in core.step(found)]
        for k, crossing in enumerate(crossings_of(events)):
            ratios.append((crossing.t_s - (2 * math.pi * k - START_RAD) / OMEGA) / crossing.sigma_s)
    rms = math.sqrt(sum(ratio**2 for ratio in ratios) / len(ratios))
    assert 0.7 < rms < 1.3, (rms, len(ratios))


def test_a_lap_on_the_centreline_scores_a_hundred() -> None:
    """Following the route exactly is worth 100 %, up to the chords between frames."""
    scores = [e for e in race(circle_setup(), steady, seconds=12, fps=120) if isinstance(e, Score)]
    assert scores[0].similarity_percent == pytest.approx(100.0, abs=0.02)


def test_laps_and_scores_come_in_pairs_with_the_same_similarity() -> None:
    """The lap event carries its score's similarity."""
    events = race(circle_setup(), steady, seconds=16)
    scores = {e.lap: e.similarity_percent for e in events if isinstance(e, Score)}
    assert {lap.number: lap.similarity_percent for lap in laps_of(events)} == scores


def test_a_setup_that_must_not_score_gives_laps_without_similarity() -> None:
    """Behind a closed gate laps are timed and not scored."""
    events = race(circle_setup(not_scored_because="too wrong"), steady, seconds=16)
    assert [lap.similarity_percent for lap in laps_of(events)] == [None, None, None]
    assert not any(isinstance(event, Score) for event in events)


def test_a_car_that_never_reaches_the_line_again_makes_no_lap() -> None:
    """One forward crossing starts a lap and completes none."""
    events = race(circle_setup(), lambda t: steady(min(t, 4.0)), seconds=10)
    assert len(crossings_of(events)) == 1
    assert laps_of(events) == []


def test_driving_the_wrong_way_makes_reverse_crossings_and_no_lap() -> None:
    """Laps in the wrong direction are ignored."""
    events = race(circle_setup(), lambda t: on_circle(0.6 - OMEGA * t), seconds=16)
    assert {crossing.direction for crossing in crossings_of(events)} == {Direction.REVERSE}
    assert laps_of(events) == []


def test_jitter_on_the_line_makes_no_crossing() -> None:
    """A car parked on the line with 20 mm of jitter crosses nothing."""
    parked = lambda t: on_circle(0.02 * math.sin(40 * t) if t > 1 else -0.3 + 0.3 * t)  # noqa: E731
    events = race(circle_setup(), parked, seconds=30)
    assert len(crossings_of(events)) <= 1
    assert laps_of(events) == []


def test_reversing_over_the_line_does_not_count_a_lap() -> None:
    """Forward, back and forward over the line is one start, not a lap; the lap that follows is counted once."""

    def there_and_back(t_s: float) -> PointM:
        if t_s < 4:
            return on_circle(0.5 * math.sin(math.pi * (t_s / 4 * 3 - 0.5)))
        return on_circle(0.5 + OMEGA * (t_s - 4))

    events = race(circle_setup(laps=LapRules(min_lap_s=0.5)), there_and_back, seconds=9.5)
    assert [c.direction for c in crossings_of(events)] == ["forward", "reverse", "forward", "forward"]
    assert len(laps_of(events)) == 1


def test_a_short_gap_at_the_line_keeps_the_lap_and_widens_its_sigma() -> None:
    """A crossing inside a gap of 0.3 s is estimated, marked and wider; the lap count stays right."""
    true_s = (2 * math.pi - START_RAD) / OMEGA
    hidden = lambda t: None if abs(t - true_s) < 0.16 else steady(t)  # noqa: E731
    crossings = crossings_of(race(circle_setup(), hidden, seconds=16))
    assert [crossing.estimated for crossing in crossings] == [False, True, False, False]
    assert abs(crossings[1].t_s - true_s) < 0.02
    assert crossings[1].sigma_s > 5 * crossings[0].sigma_s


def test_a_lap_in_which_the_car_was_lost_too_long_is_not_valid_and_says_so() -> None:
    """A gap beyond the limit keeps the lap, marks it and gives the reason."""
    hidden = lambda t: None if 2.0 < t < 3.5 else steady(t)  # noqa: E731
    lap = laps_of(race(circle_setup(), hidden, seconds=11))[0]
    assert not lap.valid
    assert "not seen for 1.5 s" in lap.reasons[0]
    assert lap.observed_fraction < 0.8


def test_a_lap_off_the_lane_is_not_valid_and_says_so() -> None:
    """Leaving the lane by more than the margin for longer than the limit is a reason."""
    wide = lambda t: on_circle(START_RAD + OMEGA * t, 1.0 + 0.35 * max(0.0, math.sin(math.pi * (t - 1.5) / 2)) ** 2)  # noqa: E731
    lap = laps_of(race(circle_setup(), wide, seconds=11))[0]
    assert not lap.valid
    assert "left the lane" in lap.reasons[0]


def test_furniture_beside_the_lane_is_never_followed() -> None:
    """Something that moves outside the lane never becomes a target."""
    events = race(circle_setup(), lambda t: on_circle(OMEGA * t, 1.6), seconds=10)
    assert events == []


def test_the_run_ends_after_the_wanted_laps() -> None:
    """With two laps wanted the core says that it is finished at the end of the second and counts no more."""
    core = Core(circle_setup(laps=LapRules(laps=2)))
    events = [event for found in frames(steady, seconds=30) for event in core.step(found)]
    assert core.finished
    assert [lap.number for lap in laps_of(events)] == [1, 2]


def test_frames_before_the_confirmation_are_told_afterwards_in_order() -> None:
    """Every frame in which the car was seen has its observation, those before the confirmation included."""
    observations = [e for e in race(circle_setup(), steady, seconds=3) if isinstance(e, Observation)]
    assert [o.t_ns for o in observations] == [found.t_ns for found in frames(steady, seconds=3)]


def test_a_new_target_takes_over_without_telling_any_frame_twice() -> None:
    """When the followed thing stands still and goes, and another has been moving meanwhile, no stamp is told twice."""
    core = Core(circle_setup())
    events: list[Event] = []
    for found in frames(lambda t: steady(min(t, 3.0)) if t < 5 else None, seconds=14):
        other = detection(on_circle(2.5 + OMEGA * found.t_ns * 1e-9))
        seen = (*found.detections, other) if found.t_ns > 4e9 else found.detections
        events += core.step(FrameDetections(sequence=found.sequence, t_ns=found.t_ns, detections=seen, full_frame=True))
    observations = [event for event in events if isinstance(event, Observation)]
    stamps = [observation.t_ns for observation in observations]
    assert stamps == sorted(set(stamps))
    assert len({observation.target_id for observation in observations}) == 2


def test_a_thing_that_is_lost_before_it_is_confirmed_is_never_told() -> None:
    """What appears for three frames on the lane and goes again leaves no trace in the events."""
    core = Core(circle_setup())
    events: list[Event] = []
    for found in frames(steady, seconds=16):
        flicker = () if found.sequence % 40 > 2 else (detection(on_circle(found.sequence)),)
        both = FrameDetections(
            sequence=found.sequence, t_ns=found.t_ns, detections=(*found.detections, *flicker), full_frame=True
        )
        events += core.step(both)
    stamps = [event.t_ns for event in events if isinstance(event, Observation)]
    assert stamps == sorted(set(stamps))


def test_a_setup_survives_json_bit_for_bit() -> None:
    """What a recording stores of the setup gives the same setup back."""
    setup = circle_setup(not_scored_because="x")
    assert CoreSetup.from_dict(json.loads(json.dumps(setup.to_dict()))) == setup


@settings(max_examples=15, deadline=None)
@given(offset_ns=st.integers(min_value=0, max_value=10**15), noise_px=st.sampled_from([0.0, 1.0]))
def test_shifting_the_clock_shifts_every_stamp_alike(offset_ns: int, noise_px: float) -> None:
    """Lap times do not depend on where the clock's zero lies."""
    found = list(frames(steady, seconds=12, noise_px=noise_px))
    shifted = [
        FrameDetections(sequence=f.sequence, t_ns=f.t_ns + offset_ns, detections=f.detections, full_frame=True)
        for f in found
    ]
    plain, moved = Core(circle_setup()), Core(circle_setup())
    laps = laps_of([event for f in found for event in plain.step(f)])
    laps_moved = laps_of([event for f in shifted for event in moved.step(f)])
    assert [lap.time_s for lap in laps] == [lap.time_s for lap in laps_moved]
    assert [lap.end_t_ns + offset_ns for lap in laps] == [lap.end_t_ns for lap in laps_moved]


def test_a_stamp_that_runs_backwards_is_refused() -> None:
    """The core is fed in order or not at all."""
    core = Core(circle_setup())
    found = list(frames(steady, seconds=1))
    core.step(found[1])
    with pytest.raises(ValueError, match="not later"):
        core.step(found[0])


def test_windows_lie_where_the_car_will_be() -> None:
    """The search window for the next frame is centred within a few pixels of the car's true place."""
    core = Core(circle_setup())
    found = list(frames(steady, seconds=2))
    for now, then in pairwise(found):
        core.step(now)
        windows = core.windows(then.t_ns)
    (window,) = windows
    assert math.dist(window.camera_px, then.detections[0].camera_px) < 3.0


@pytest.mark.parametrize("stop_s", [1.6, 10.0])
def test_a_stop_just_beyond_the_line_belongs_to_the_lap_that_it_begins(stop_s: float) -> None:
    """A car that halts 30 mm beyond the start line is in its first lap from there; it was seen all the time."""
    true_s = -START_RAD / OMEGA

    def halting(t_s: float) -> PointM:
        driven_s = t_s if t_s < true_s + 0.023 else max(true_s + 0.023, t_s - stop_s)
        return steady(driven_s)

    lap = laps_of(race(circle_setup(), halting, seconds=7 + stop_s))[0]
    assert lap.valid, lap.reasons
    # Only the jerks of its stop and start, which no real car makes, are gated away.
    assert lap.observed_fraction > 0.9
    assert lap.time_s == pytest.approx(2 * math.pi / OMEGA + stop_s, abs=0.02)


def test_a_crossing_is_told_although_the_car_is_not_seen_again() -> None:
    """A car that vanishes just beyond the line has crossed it; the news waits for frames, not for the car."""
    true_s = -START_RAD / OMEGA
    core = Core(circle_setup())
    told_s = [
        found.t_ns * 1e-9
        for found in frames(lambda t: steady(t) if t < true_s + 0.12 else None, seconds=3)
        for event in core.step(found)
        if isinstance(event, Crossing)
    ]
    assert len(told_s) == 1
    assert told_s[0] < true_s + 0.3


def test_sector_lines_are_crossed_and_make_no_laps() -> None:
    """Each line is told by its name; only the start line ends laps."""
    track = circle_track()
    sector = line_across(track.centreline, 5.9, name="last bend", margin_m=0.05)
    events = race(circle_setup(track=replace(track, sector_lines=(sector,))), steady, seconds=11)
    assert [crossing.line for crossing in crossings_of(events)] == ["last bend", "start"] * 3
    begins_s = -START_RAD / OMEGA
    assert [lap.start_s for lap in laps_of(events)] == pytest.approx(
        [begins_s, begins_s + 2 * math.pi / OMEGA], abs=1e-3
    )


def test_windows_grow_with_the_car() -> None:
    """As the car comes nearer its window's length follows what the detector says."""
    core = Core(circle_setup())
    for found in frames(steady, seconds=2):
        longer = tuple(replace(one, length_px=40.0 + found.sequence) for one in found.detections)
        core.step(replace(found, detections=longer))
    (window,) = core.windows(2_000_000_000)
    assert window.length_px == pytest.approx(99.0, abs=4.0)


def test_a_second_car_like_thing_does_not_take_the_race_over() -> None:
    """While the car is followed, another thing on the lane makes no crossing of its own."""
    core = Core(circle_setup())
    events: list[Event] = []
    for found in frames(steady, seconds=16):
        intruder = detection(on_circle(3.0 - 0.7 * found.t_ns * 1e-9))
        both = FrameDetections(
            sequence=found.sequence, t_ns=found.t_ns, detections=(*found.detections, intruder), full_frame=True
        )
        events += core.step(both)
    assert len(laps_of(events)) == 3
    assert len({crossing.target_id for crossing in crossings_of(events)}) == 1


def test_the_start_line_of_the_round_track_is_crossed_forward_anticlockwise() -> None:
    """The helper's own track is what these tests say it is."""
    assert circle_track().start_line.forward[1] == pytest.approx(1.0, abs=0.02)
