"""Each watcher by itself: from what on it tells, when it tells, and with which evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import pytest
from race_drive import at, drive, incidents_of, laps_of, ring

from dnb_edge.race.fix import Fix
from dnb_edge.race.incidents import STILL_M, Draft, Pace, Stalled, WrongWay
from dnb_edge.race.off_track import Lane, OffTrack, Overhang
from dnb_edge.race.rules import Footprint, LapRules
from dnb_edge.values import Crossing, Direction, IncidentKind

FPS = 50
BEGIN = Crossing(
    t_ns=0, t_s=0.0, line="start", direction=Direction.FORWARD, sigma_s=0.001, track_m=(0.0, 0.0), target_id=1, estimated=False
)  # fmt: skip


def fix(t_s: float, x_m: float = 0.0, *, outside_m: float = -0.1) -> Fix:
    return Fix(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        target_id=7,
        observed_m=(x_m, 0.0),
        covariance_m2=(1e-6, 0.0, 1e-6),
        track_m=(x_m, 0.0),
        s_m=x_m,
        d_m=0.0,
        outside_m=outside_m,
        progress_m=x_m,
        camera_px=(10 * x_m, 5.0),
    )


def at_rate(seconds: float) -> Iterable[float]:
    return (k / FPS for k in range(round(seconds * FPS)))


def off_track(
    outside_m: Callable[[float], float], *, seconds: float = 3.0, **rules: object
) -> list[tuple[float, Draft]]:
    """(when it was told, what) of a car that is so far outside at t_s."""
    watch = OffTrack(LapRules(**rules))  # type: ignore[arg-type]
    told = []
    for t_s in at_rate(seconds):
        draft = watch.feed(fix(t_s), outside_m(t_s))
        told += [] if draft is None else [(t_s, draft)]
    last = watch.close()
    return told if last is None else [*told, (seconds, last)]


def bumps(*stretches: tuple[float, float, float]) -> Callable[[float], float]:
    """So far outside in each stretch (from_s, until_s, metres), else well inside."""
    return lambda t: next((metres for a, b, metres in stretches if a - 1e-9 <= t < b - 1e-9), -0.1)


@pytest.mark.parametrize(
    ("outside", "lasted"),
    [
        (bumps(), []),
        (bumps((1.0, 1.3, 0.2)), []),
        (bumps((1.0, 1.36, 0.2)), [0.34]),
        (bumps((1.0, 2.0, 0.049)), []),
        (bumps((1.0, 1.2, 0.2), (1.32, 1.5, 0.2)), [0.48]),
        (bumps((1.0, 1.2, 0.2), (1.5, 1.7, 0.2)), []),
        (bumps((1.0, 1.5, 0.2), (1.8, 2.3, 0.2)), [0.48, 0.48]),
        (bumps((2.0, 3.0, 0.2)), [0.98]),
        (bumps((0.0, 1.0, 0.2)), [0.98]),
    ],
    ids=["inside", "too short", "long enough", "within the margin", "two near ones are one", "two short ones are none", "two",
         "at the end", "at the beginning"],
)  # fmt: skip
def test_an_excursion_counts_from_its_least_duration_on(outside: Callable[[float], float], lasted: list[float]) -> None:
    """0.3 s and 50 mm, both to be exceeded; what is less than 0.2 s apart is one."""
    found = [(draft.end_t_ns - draft.start_t_ns) * 1e-9 for _, draft in off_track(outside)]
    assert found == pytest.approx(lasted, abs=1e-6)


def test_at_a_slow_frame_rate_a_single_fix_inside_parts_two_excursions() -> None:
    """Eight frames a second: a quarter of a second lies between the two, more than joins them."""
    watch, told = OffTrack(LapRules()), []
    for k in range(16):
        draft = watch.feed(fix(k / 8), -0.1 if k in (0, 6, 15) else 0.2)
        told += [] if draft is None else [draft.start_t_ns * 1e-9]
    last = watch.close()
    assert told == [0.125]
    assert last is not None
    assert last.start_s == 0.875


def test_an_excursion_is_told_once_the_car_is_back_with_its_worst_moment() -> None:
    """A fifth of a second after it came back; the greatest distance, its stamp and place, and a sentence with both numbers."""
    ((told_s, draft),) = off_track(bumps((1.0, 1.4, 0.1), (1.4, 1.42, 0.12), (1.42, 1.82, 0.08)))
    assert told_s == pytest.approx(2.02, abs=0.021)
    incident = draft.told(number=3, car=2, lap=4)
    assert (incident.kind, incident.number, incident.car, incident.lap) == (IncidentKind.OFF_TRACK, 3, 2, 4)
    assert (incident.target_id, incident.greatest_m, incident.worst_t_ns) == (7, 0.12, 1_400_000_000)
    assert (incident.start_s, incident.start_t_ns, incident.end_t_ns) == (1.0, 1_000_000_000, 1_800_000_000)
    assert incident.camera_px == (0.0, 5.0)
    assert incident.text == "the car left the lane for 0.8 s, by up to 120 mm"


@pytest.mark.parametrize("turned", [0.0, 0.3, -0.5, math.pi / 2])
@pytest.mark.parametrize("d_m", [0.0, 0.12, -0.14])
@pytest.mark.parametrize("radius_m", [0.5, 1.0, 5.0])
def test_the_corners_of_the_car_are_where_they_are(radius_m: float, d_m: float, turned: float) -> None:
    """Against the distance of each corner from the ring's centre: to a millimetre for a car of a fifth of a metre."""
    lane = Lane(ring(radius_m).centreline)
    found = lane.corners_outside_m(0.0, d_m, turned, (0.2, 0.1))
    exact = []
    for ahead in (0.1, -0.1):
        for aside in (0.05, -0.05):
            # At s = 0 the route runs to +y and its left is -x.
            along = ahead * math.cos(turned) - aside * math.sin(turned)
            left = d_m + ahead * math.sin(turned) + aside * math.cos(turned)
            exact.append(abs(radius_m - math.hypot(radius_m - left, along)) - 0.15)
    assert found == pytest.approx(exact, abs=0.001 if radius_m > 0.6 else 0.003)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, -60.0, 90.0, 180.0])
def test_the_footprint_lies_along_the_way_of_the_fixes(angle_deg: float) -> None:
    """On a ring so wide that it is straight, a car of 0.2 by 0.1 m that drives at an angle to the route."""
    route = ring(1000.0, points=6283).centreline
    rules = LapRules(off_lane=Footprint.ANY_WHEEL, car_length_m=0.2, car_width_m=0.1)
    overhang = Overhang(rules, Lane(route))
    turned = math.radians(angle_deg)
    for k in range(30):
        s_m, d_m = 10.0 + 0.01 * k * math.cos(turned), 0.01 * (k - 29) * math.sin(turned)
        where = replace(fix(k / FPS), track_m=route.point_at(s_m, d_m), s_m=s_m, d_m=d_m)
        found = overhang.outside_m(where)
    reach = 0.1 * abs(math.sin(turned)) + 0.05 * abs(math.cos(turned))
    assert found == pytest.approx(reach - 0.15, abs=1e-3)


def swerve_m(t_s: float, by_m: float) -> float:
    """Radius of a car that is further out from 2 to 4 s and takes half a second to get there and back."""
    return 1.0 + by_m * min(max((2.5 - abs(t_s - 3.0) - 1.0) / 0.5, 0.0), 1.0)


@pytest.mark.parametrize(
    ("part", "beyond_mm", "who"),
    [
        (Footprint.CENTRE, None, ""),
        (Footprint.ANY_WHEEL, 97, "a wheel of the car"),
        (Footprint.ALL_WHEELS, None, ""),
    ],
)
def test_the_part_of_the_car_that_counts(part: Footprint, beyond_mm: int | None, who: str) -> None:
    """A car 0.1 m wide and 0.2 m long, 40 mm beyond the outer edge with its centre and along the route: its outer wheels are
    out by 90 mm and the bend, its inner ones are inside."""
    rules = LapRules(off_lane=part, car_length_m=0.2, car_width_m=0.1, off_lane_margin_m=0.05)
    told = drive(ring(), lambda t: at(-0.5 + t, swerve_m(t, 0.19)), seconds=7.5, rules=rules)
    texts = [one.text for one in incidents_of(told) if one.kind is IncidentKind.OFF_TRACK]
    if beyond_mm is None:
        assert texts == []
        return
    (text,) = texts
    assert text.startswith(f"{who} left the lane for 2.")
    # As it swerves out its corners reach further than when it is along the route.
    assert int(text.split()[-2]) >= beyond_mm - 5


def test_all_wheels_are_out_when_the_inner_ones_are() -> None:
    """110 mm beyond the edge with its centre, the inner wheels are out by 60 mm less the bend."""
    rules = LapRules(off_lane=Footprint.ALL_WHEELS, car_length_m=0.2, car_width_m=0.1, off_lane_margin_m=0.05)
    told = drive(ring(), lambda t: at(-0.5 + t, swerve_m(t, 0.26)), seconds=7.5, rules=rules)
    (incident,) = [one for one in incidents_of(told) if one.kind is IncidentKind.OFF_TRACK]
    assert incident.text.startswith("the car with all wheels left the lane for ")
    assert incident.greatest_m == pytest.approx(0.06, abs=0.008)


def stalls(x_m: Callable[[float], float], seconds: float, **rules: object) -> list[tuple[float, Draft]]:
    settings = LapRules(**rules)  # type: ignore[arg-type]
    pace, watch = Pace(settings.lifted_m), Stalled(settings, BEGIN)
    told = []
    for t_s in at_rate(seconds):
        draft = watch.feed(pace.step(fix(t_s, x_m(t_s))))
        told += [] if draft is None else [(t_s, draft)]
    last = watch.close()
    return told if last is None else [*told, (seconds, last)]


@pytest.mark.parametrize(
    ("x_m", "lasted_s"),
    [
        (lambda t: min(t, 1.0) + max(0.0, t - 5.9), []),
        (lambda t: min(t, 1.0) + max(0.0, t - 6.2), [5.2]),
        (lambda t: min(t, 1.0) + 0.02 * math.sin(40 * t) + max(0.0, t - 7.0), [6.0]),
        (lambda t: 0.02 * t, []),
        (lambda t: 0.0, [9.98]),
    ],
    ids=["not long enough", "long enough", "20 mm of jitter", "slow", "from beginning to end"],
)
def test_a_stand_counts_from_its_least_duration_on(x_m: Callable[[float], float], lasted_s: list[float]) -> None:
    """Five seconds within 50 mm; one who crawls has not stalled."""
    found = stalls(x_m, 10.0)
    assert [(draft.end_t_ns - draft.start_t_ns) * 1e-9 for _, draft in found] == pytest.approx(lasted_s, abs=0.12)


def test_a_stand_is_told_when_the_car_drives_on() -> None:
    """Then, and not again."""
    ((told_s, draft),) = stalls(lambda t: max(0.0, t - 6.0), 9.0)
    assert told_s == pytest.approx(6.0 + STILL_M, abs=0.03)
    assert draft.text == "the car stood for 6.0 s"


def wrong_ways(driven_m: Iterable[float]) -> list[tuple[int, Draft]]:
    watch = WrongWay(LapRules())
    told = []
    for k, metres in enumerate(driven_m):
        draft = watch.feed(fix(k, metres), metres)
        told += [] if draft is None else [(k, draft)]
    last = watch.close()
    return told if last is None else [*told, (-1, last)]


@pytest.mark.parametrize(
    ("driven_m", "told", "greatest_m"),
    [
        ([0, 1, 2, 1.75, 2, 3], [], []),
        ([0, 1, 2, 1.9, 1.5, 1.7, 1.9, 2.5], [6], [0.5]),
        ([0, 1, 2, 1.5, 1.7, 1.4, 1.6, 1.8], [7], [0.6]),
        ([0, 2, 1, 2, 1, 2, 3], [3, 5], [1, 1]),
        ([0, -1, -2, -3], [-1], [3]),
    ],
    ids=["a little", "back and on", "with a rest", "twice", "to the end"],
)
def test_driving_back_is_told_when_the_car_goes_forward_again(
    driven_m: list[float], told: list[int], greatest_m: list[float]
) -> None:
    """From 0.3 m below its farthest on, until it has made up 0.3 m from its lowest; or when the lap ends."""
    found = wrong_ways(driven_m)
    assert [k for k, _ in found] == told
    assert [draft.greatest_m for _, draft in found] == pytest.approx(greatest_m)


@pytest.mark.parametrize(
    ("gap_s", "away_m", "is_lifted"),
    [(0.02, 0.3, False), (0.02, 0.45, True), (0.5, 0.85, False), (0.5, 1.0, True), (3.0, 3.3, False), (3.0, 3.6, True)],
)
def test_a_car_is_lifted_that_comes_back_further_than_it_can_have_driven(
    gap_s: float, away_m: float, is_lifted: bool
) -> None:
    """At most 1 m/s was seen of it: 0.4 m more than that is a hand."""
    pace = Pace(LapRules().lifted_m)
    for t_s in at_rate(4.0):
        pace.step(fix(t_s, t_s))
    last = pace.last
    assert last is not None
    assert pace.peek(fix(last.t_s + gap_s, last.t_s + away_m)).lifted == is_lifted
    assert pace.last is last


@pytest.mark.parametrize(("fps", "speed_mps"), [(30, 1.0), (5, 3.0), (60, 0.1)])
def test_a_car_is_as_fast_as_three_steps_in_a_row_show(fps: int, speed_mps: float) -> None:
    """A fast car at a slow frame rate is no hand, from its fourth fix on; one false detection makes it no faster."""
    pace = Pace(LapRules().lifted_m)
    found = [pace.step(fix(k / fps, speed_mps * k / fps)).lifted for k in range(10)]
    assert not any(found[4:])
    pace.step(fix(10 / fps, speed_mps * 10 / fps + 3.0))
    pace.step(fix(11 / fps, speed_mps * 11 / fps))
    assert pace.step(fix(12 / fps, speed_mps * 12 / fps)).can_m == pytest.approx(speed_mps / fps)


def test_what_goes_on_when_a_lap_ends_is_told_with_it_and_again_with_the_next() -> None:
    """Out of the lane from 0.7 rad before the line to 0.7 rad behind it: each lap has its own half."""
    told = drive(
        ring(half_m=0.2),
        lambda t: at(-0.6 + t, 1.24 if abs(-0.6 + t - 2 * math.pi) < 0.7 else 1.0),
        seconds=14,
        rules=LapRules(off_lane_margin_m=0.01),
    )
    first, second = laps_of(told)
    for driven in (first, second):
        (incident,) = driven.incidents
        assert (incident.kind, incident.lap) == (IncidentKind.OFF_TRACK, driven.lap.number)
        assert incident.lasted_s == pytest.approx(0.68, abs=0.05)
        assert driven.lap.start_t_ns <= incident.start_t_ns < incident.end_t_ns <= driven.lap.end_t_ns
    assert told.index(first) == told.index(first.incidents[0]) + 1, "the first is told with the lap's end"
    assert told.index(second.incidents[0]) < told.index(second) - 1, "the second when it was over"
