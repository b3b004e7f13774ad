"""Where an unseen car is expected along the lane, and whether a newcomer is it.

Knows the route, targets and their looks; knows no frame and no picture. An unseen car is taken to go on along the
centreline at the speed and the distance from it at which it was last seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dnb_edge.motion.doubt import MARGIN
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.motion.target import Followed, renamed
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import PointM, TargetState

OBSERVATIONS = 3
"""Observations that a newcomer needs to be taken for a missing car; its place has already been told."""

TRAVEL_M = 0.02
"""Distance that it must have moved beyond what two observations scatter."""

READS = 2
"""Observations that suffice where it bears the missing car's number."""

OTHER_LOOKS = 40.0
"""Squared distance in looks, in spreads, above which a newcomer is surely another car."""

_SLACK_M = 0.3
_FASTER = 1.5
_ACCELERATION_MPS2 = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Along:
    """Where an unseen car is expected."""

    s_m: float
    d_m: float


def along(route: Centreline, target: Followed, t_ns: int) -> Along:
    """Where `target` is expected at `t_ns` along the route from where it was last seen."""
    estimate = target.seen_estimate
    s_m, d_m = route.locate_point(estimate.track_m)
    speed = _speed_along(route, target, s_m)
    unseen_s = (t_ns - estimate.t_ns) * 1e-9
    left_m, right_m = route.half_widths_at(s_m + speed * unseen_s)
    return Along(s_m=s_m + speed * unseen_s, d_m=min(max(d_m, -right_m), left_m))


def is_in_reach(route: Centreline, missing: Followed, point_m: PointM, t_ns: int) -> bool:
    """Whether the missing car can be at `point_m`: between where it was seen and half as far again as its speed brings it."""
    s_m, _ = route.locate_point(missing.seen_estimate.track_m)
    speed = _speed_along(route, missing, s_m)
    unseen_s = (t_ns - missing.seen_estimate.t_ns) * 1e-9
    driven_m = _FASTER * abs(speed) * unseen_s + _ACCELERATION_MPS2 * unseen_s**2 / 2
    here_m, _ = route.locate_point(point_m)
    ahead_m = math.copysign(1.0, speed) * (here_m - s_m)
    length_m = route.length_m
    return (ahead_m + _SLACK_M) % length_m <= driven_m + 2 * _SLACK_M


def regained(
    route: Centreline | None, newcomer: Followed, missing: Sequence[Followed], settings: MotionSettings
) -> Followed | None:
    """The missing car that the newcomer surely is, before it has earned confirmation by itself; None where that is not sure."""
    t_ns = newcomer.last.t_ns
    by_number = [car for car in missing if car.looks.marker is not None and car.looks.marker == newcomer.looks.marker]
    if by_number:
        return by_number[0] if newcomer.observations >= READS else None
    if route is None or newcomer.observations < OBSERVATIONS or not _moves(newcomer):
        return None
    awaited = [
        car
        for car in missing
        if (t_ns - car.last.t_ns) * 1e-9 <= settings.regain_s
        # What stood there before the car was lost is something else.
        and newcomer.first.t_ns > car.last.t_ns
        and is_in_reach(route, car, newcomer.last.track_m, t_ns)
        and not car.looks.is_another(newcomer.looks)
        and car.looks.misfit(newcomer.looks) < OTHER_LOOKS
    ]
    return awaited[0] if len(awaited) == 1 else _by_looks(newcomer, awaited)


def taken_for(route: Centreline | None, newcomer: Followed, missing: Sequence[Followed]) -> Followed | None:
    """The missing car that a newcomer is taken for when it can be no new one: by its looks, else the nearest along the route.

    None where it bears a number that none of them can have: it is a stranger.
    """
    possible = [car for car in missing if not car.looks.is_another(newcomer.looks)]
    chosen = _by_looks(newcomer, possible)
    if chosen is not None or not possible:
        return chosen
    if route is None:
        return max(possible, key=lambda car: (car.last.t_ns, -car.target_id))
    here_m, _ = route.locate_point(newcomer.last.track_m)
    return min(possible, key=lambda car: (_away_m(route, car, here_m, newcomer.last.t_ns), car.target_id))


def rejoined(newcomer: Followed, car: Followed) -> Followed | None:
    """The unseen but not yet lost `car` where the newcomer, which bears its number, is; None while that is not sure."""
    if newcomer.looks.marker != car.looks.marker or car.last.t_ns >= newcomer.last.t_ns:
        return None
    found = renamed(newcomer, car.target_id, car.looks)
    # What both saw at one stamp is told once.
    later = (observation for observation in found.pending if observation.t_ns > car.last.t_ns)
    return replace(found, state=TargetState.CONFIRMED, doubt=car.doubt, pending=(*car.pending, *later))


def _by_looks(newcomer: Followed, cars: Sequence[Followed]) -> Followed | None:
    """The one whose looks fit better than all others' by the margin; None where there is none."""
    ranked = sorted((car.looks.misfit(newcomer.looks), car.target_id, car) for car in cars)
    if len(ranked) == 1:
        return ranked[0][2]
    return ranked[0][2] if ranked and ranked[1][0] - ranked[0][0] >= MARGIN else None


def _moves(target: Followed) -> bool:
    xx, _, yy = target.last.covariance_m2
    return target.travel_m >= TRAVEL_M + 2.0 * math.sqrt((xx + yy) / 2.0)


def _away_m(route: Centreline, car: Followed, here_m: float, t_ns: int) -> float:
    apart_m = (here_m - along(route, car, t_ns).s_m) % route.length_m
    return min(apart_m, route.length_m - apart_m)


def _speed_along(route: Centreline, target: Followed, s_m: float) -> float:
    (vx, vy), (tx, ty) = target.seen_estimate.velocity_mps, route.direction_at(s_m)
    return vx * tx + vy * ty
