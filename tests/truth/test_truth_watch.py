"""A drive watched and measured: what is told is told, what is true is true, and the two are matched rightly."""

import time
from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.sim.circuit import circuit_along
from dnb_edge.sim.driver import Style
from dnb_edge.sim.manoeuvre import Leg, ahead, manoeuvre
from dnb_edge.sim.path import closed_path
from dnb_edge.truth.counts import cases, counted, stepping_wall_clock
from dnb_edge.truth.measure import measured, nearest
from dnb_edge.truth.scenarios import Scenario, catalogue
from dnb_edge.truth.sightings import Sightings
from dnb_edge.truth.watch import watch
from dnb_edge.values import Crossing, Lap

EXACT = Scenario(
    name="exact",
    title="nothing errs",
    place="table-paper",
    fps=30.0,
    styles=(Style(top_mps=1.0, lowest_mps=1.0, pace=(0.9, 1.05), wander=0.5),),
    sightings=Sightings(sigma_px=1e-4),
)


@pytest.fixture(scope="module")
def exact():
    return watch(EXACT, laps=6, seed=5, number=0)


def test_without_errors_the_laps_are_true(exact):
    """Exact ground points give every lap to a twentieth of a millisecond, every position to a tenth of a millimetre and every
    score to a hundredth of a point."""
    found = measured(exact, series=True)
    assert (found["laps_true"], found["laps_told"], found["phantom"]) == (6, 6, 0)
    assert [lap["lap"] for lap in found["laps"]] == [1, 2, 3, 4, 5, 6]
    assert max(abs(lap["error_s"]) for lap in found["laps"]) < 5e-5
    assert max(found["position_mm"]) < 0.1
    assert max(abs(lap["similarity_percent"] - lap["true_similarity_percent"]) for lap in found["laps"]) < 0.05
    assert found["found_frames"] > 0.97 * found["frames"]


def test_errors_are_along_and_across_the_way():
    """A detector that errs by 3 mm to the right and 4 mm upwards errs along and across the way on the bottom straight; however
    the car is turned, by 5 mm in all."""
    watched = watch(EXACT, laps=2, seed=5, number=0)
    moved = [
        replace(event, track_m=(event.track_m[0] + 0.003, event.track_m[1] + 0.004))
        if hasattr(event, "covariance_m2")
        else event
        for event in watched.events
    ]
    series = measured(replace(watched, events=tuple(moved)), series=True)["series"]
    place = np.array(series["place_m"])
    start = (place < 0.1) | (place > watched.lap_m - 0.1)
    assert np.array(series["along_mm"])[start] == pytest.approx(3.0, abs=0.7)
    assert np.array(series["across_mm"])[start] == pytest.approx(4.0, abs=0.6)
    assert np.hypot(series["along_mm"], series["across_mm"]) == pytest.approx(5.0, abs=0.1)


def test_missed_and_phantom_laps_are_found_out(exact):
    """A lap that is left out is missed, one that is told twice or between no two crossings is a phantom."""
    laps = [event for event in exact.events if isinstance(event, Lap)]
    less = replace(exact, events=tuple(event for event in exact.events if event is not laps[2]))
    found = measured(less, series=False)
    assert [lap["told"] for lap in found["laps"]] == [True, True, False, True, True, True]
    assert found["phantom"] == 0
    twice = measured(replace(exact, events=(*exact.events, laps[1])), series=False)
    assert twice["phantom"] == 1
    long = replace(laps[4], start_t_ns=laps[3].start_t_ns)
    joined = tuple(long if event is laps[4] else event for event in exact.events if event is not laps[3])
    found = measured(replace(exact, events=joined), series=False)
    assert (found["phantom"], sum(not lap["told"] for lap in found["laps"])) == (1, 2)


def test_crossings_are_those_of_the_start_line_forward(exact):
    """Each true crossing is told once, with its own error."""
    found = measured(exact, series=False)["crossings"]
    assert [one["crossing"] for one in found] == list(range(7))
    told = [event for event in exact.events if isinstance(event, Crossing)]
    assert found[0]["error_s"] == pytest.approx(told[0].t_ns * 1e-9 - exact.crossings_s[0])


def test_the_nearest_instant():
    """The nearest one within reach, or none."""
    assert nearest(1.04, (0.0, 1.0, 2.0), 0.1) == 1
    assert nearest(1.5, (0.0, 1.0, 2.0), 0.3) is None
    assert nearest(1.0, (), 1.0) is None


def test_rendered_frames_go_through_the_detector():
    """A lap of rendered frames through the shipped detector is told, near the truth."""
    scenario = replace(EXACT, rendered=True, name="exact-rendered", place="table")
    found = measured(watch(scenario, laps=1, seed=5, number=0), series=True)
    assert (found["laps_told"], found["phantom"]) == (1, 0)
    assert abs(found["laps"][0]["error_s"]) < 0.03
    assert np.median(found["position_mm"]) < 20.0
    assert found["found_frames"] > 0.9 * found["frames"]


def test_scenarios_with_one_word_see_the_same_laps():
    """`drives` decides the drives; noise is each scenario's own."""
    scored = [scenario for scenario in catalogue() if scenario.drives == "score"]
    assert len(scored) == 4
    assert len({scenario.drive_seed(1, 0) for scenario in scored}) == 1
    assert len({scenario.noise_seed(1, 0) for scenario in scored}) == 4
    assert scored[0].drive_seed(1, 0) != scored[0].drive_seed(2, 0) != scored[0].drive_seed(2, 1)


CIRCLE = circuit_along(
    closed_path([(1 + np.cos(a) / 2, 1 + np.sin(a) / 2) for a in np.arange(24) * np.pi / 12]), start_s_m=0.2
)


def test_a_manoeuvre_does_its_legs():
    """Way, place across the lane, shaking, jumps and absence are as asked."""
    legs = [
        ahead(1.0, 0.5), Leg(seconds=4.0), Leg(seconds=5.0, shake_m=0.02), ahead(-0.4, 0.4),
        Leg(seconds=1.0, seen=False), Leg(seconds=2.0, jump_m=0.7, to_d_m=0.05),
    ]  # fmt: skip
    moved = manoeuvre(CIRCLE, -0.5, legs)
    t = np.array([0.0, 3.0, 5.5, 12.5, 13.5, 14.9])
    assert moved.along_m(t) == pytest.approx([-0.5, 0.5, 0.5, 0.1, 0.8, 0.8], abs=0.01)
    shaking = moved.along_m(np.linspace(7.0, 11.0, 500))
    assert (shaking.min(), shaking.max()) == pytest.approx((0.48, 0.52), abs=0.002)
    assert moved.seen(t).tolist() == [True, True, True, False, True, True]
    left = moved.points(np.array([moved.duration_s])) - np.array([[1.0, 1.0]])
    assert np.linalg.norm(left) == pytest.approx(0.45, abs=4e-3)
    assert moved.duration_s == pytest.approx(15.0, abs=0.01)
    with pytest.raises(ValueError, match="legs"):
        manoeuvre(CIRCLE, 0.0, [])


@pytest.mark.parametrize("case", [case for case in cases() if case.legs is not None], ids=lambda case: case.name)
def test_a_cases_laps_follow_from_its_way(case):
    """A case's right answer is what its way alone says: a lap for every whole round that lies between two forward crossings of
    the line, none for a round that was undone. A lifted car is put down behind where it was, never beyond the line."""
    assert case.legs is not None
    lap_m = 7.4
    moved = manoeuvre(CIRCLE, -1.1, case.legs(lap_m))
    s = moved.table_s_m
    laps, start = 0, None
    for a, b in zip(s[:-1].tolist(), s[1:].tolist(), strict=True):
        if np.floor(b / lap_m) > np.floor(a / lap_m):
            line = round(np.floor(b / lap_m))
            if start is None:
                start = line
            elif line > start:
                laps, start = laps + 1, line
    assert laps == case.laps


@pytest.mark.parametrize(
    "name", ["shaking", "reversing", "u-turn", "wrong-way-round", "lifted", "lifted-long", "wall-clock"]
)
def test_laps_are_counted_exactly(name):
    """Each case's laps are told, no more and no fewer."""
    (case,) = (one for one in cases() if one.name == name)
    found = counted(case, seed=11, trial=0)
    assert found["told"] == case.laps
    assert found["same"]


def test_the_stepping_clock_steps_and_is_put_right_again():
    """Inside, the wall clock jumps by an hour from look to look; afterwards it is the machine's again."""
    real = time.time
    with stepping_wall_clock():
        looks = [time.time() for _ in range(4)]
        assert abs(np.diff(looks)).min() > 3599.0
        assert abs(time.time_ns() - time.time_ns()) > 3.5e12
    assert time.time is real
