"""Gathering a run's events into a result."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest

from dnb_edge.report.run import RunResult, lap_paths, stamped_paths
from dnb_edge.values import Crossing, Event, Health, Lap, Observation

HEALTH = Health(
    t_ns=1,
    t_s=0.0,
    frames=1,
    detected_frames=1,
    dropped_frames=0,
    fps=None,
    latency_ms=None,
    display="none",
    recording="none",
    view_error_mean_px=None,
    view_error_mean_m=None,
    warnings=("the display is offline",),
)

Seen: TypeAlias = tuple[Lap, list[Crossing], list[Observation]]


@pytest.fixture
def stranger(drive_oval: Callable[..., list[Event]]) -> Seen:
    """A lap of one second by target 1, with another target seen in its midst and the driver seen once after it."""
    events = drive_oval(lap_times_s=(1.0,))
    crossings = [replace(event, track_m=(0.0, 0.0)) for event in events if isinstance(event, Crossing)]
    sample = next(event for event in events if isinstance(event, Observation))
    lap = next(event for event in events if isinstance(event, Lap))

    def seen(share: float, x: float, target_id: int) -> Observation:
        return replace(sample, t_ns=lap.start_t_ns + int(share * 1e9), track_m=(x, 0.0), target_id=target_id)

    return lap, crossings, [seen(0.3, 1.0, 1), seen(0.5, 99.0, 2), seen(0.6, 2.0, 1), seen(1.5, 50.0, 1)]


def test_events_are_gathered_by_kind(result: Callable[..., RunResult]) -> None:
    """Laps, scores, crossings and the closing summary come from the events."""
    run = result()
    assert [lap.number for lap in run.laps] == [1, 2, 3]
    assert len(run.crossings) == 4
    assert (run.frames, run.detected_frames, run.recording) == (1200, 1188, "oval.mcap")
    assert [score and score.lap for score in map(run.score_of, run.laps)] == [1, 2, 3]


def test_facts_given_by_hand_win_over_events(result: Callable[..., RunResult]) -> None:
    """The caller knows better what the recording is called now."""
    assert result(recording="renamed.mcap").recording == "renamed.mcap"


def test_a_repeated_warning_is_kept_once(result: Callable[..., RunResult]) -> None:
    """Health repeats its warnings; a reader needs each once."""
    run = result()
    gathered = RunResult.from_events([HEALTH, HEALTH], entry="a", source_uri="sim:", track=run.track)
    assert gathered.warnings == ("the display is offline",)


def test_a_lap_without_a_score_has_none(result: Callable[..., RunResult]) -> None:
    """Not scored is not an error."""
    run = replace(result(), scores=())
    assert run.score_of(run.laps[0]) is None


def test_a_lap_path_runs_from_crossing_to_crossing(result: Callable[..., RunResult]) -> None:
    """The first and last points are the interpolated crossings, and the path goes once round the oval."""
    run = result()
    for path in run.paths_m:
        assert path[0] == pytest.approx(run.track.centreline.point_at(0.0))
        assert path[-1] == pytest.approx(run.track.centreline.point_at(0.0))
        length_m = np.hypot(*np.diff(path, axis=0).T).sum()
        assert length_m == pytest.approx(run.track.centreline.length_m, rel=0.05)


def test_another_target_does_not_bend_the_path(stranger: Seen) -> None:
    """What was seen of a target that did not drive the lap is left out; without target ids everything is taken."""
    lap, crossings, observations = stranger
    (path,) = lap_paths([lap], observations, crossings)
    np.testing.assert_array_equal(path, [[0, 0], [1, 0], [2, 0], [0, 0]])
    (path,) = lap_paths([lap], [replace(one, target_id=None) for one in observations], crossings)
    assert len(path) == 5


def test_a_lap_that_nobody_saw_has_an_empty_path(stranger: Seen) -> None:
    """Empty is (0, 2), so that drawing it needs no special case."""
    lap, _, _ = stranger
    (path,) = lap_paths([lap], [])
    assert path.shape == (0, 2)


def test_stamps_go_with_the_path_point_by_point(stranger: Seen) -> None:
    """Each instant once, rising, from crossing to crossing; a second sighting in one frame adds no point."""
    lap, crossings, observations = stranger
    twice = [*observations, replace(observations[0], track_m=(7.0, 7.0))]
    (path,) = stamped_paths([lap], [*twice[1:], *twice[:1]], crossings)
    np.testing.assert_array_equal(path.track_m[1], [7, 7])
    (path,) = stamped_paths([lap], twice, crossings)
    since_s = (path.t_ns - lap.start_t_ns) * 1e-9
    np.testing.assert_allclose(since_s, [0.0, 0.3, 0.6, 1.0])
    np.testing.assert_array_equal(path.track_m, [[0, 0], [1, 0], [2, 0], [0, 0]])


def test_a_path_ends_at_a_finish_line_of_its_own(stranger: Seen) -> None:
    """On a route from point to point a lap ends with the crossing of another line; other cars' crossings are not taken."""
    lap, (start, end), observations = stranger
    finish = replace(end, line="finish", track_m=(5.0, 0.0))
    (path,) = lap_paths([lap], observations, [start, finish])
    np.testing.assert_array_equal(path[-1], [5, 0])
    (path,) = lap_paths([lap], observations, [start, replace(finish, car=2)])
    np.testing.assert_array_equal(path[-1], [2, 0])
    (path,) = lap_paths([lap], observations, [start, replace(finish, line="a sector")])
    np.testing.assert_array_equal(path[-1], [2, 0])


def test_laps_and_paths_must_go_together(result: Callable[..., RunResult]) -> None:
    """A result whose paths were lost is refused at once."""
    with pytest.raises(ValueError, match="3 laps with 1 paths"):
        replace(result(), paths_m=(np.zeros((0, 2)),))
    with pytest.raises(ValueError, match="stamps do not go with the paths"):
        replace(result(), paths_m=(np.zeros((0, 2)),) * 3)
