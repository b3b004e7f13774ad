"""Follows targets from frame to frame: who gets which observation, who is born, confirmed, lost and found again.

Feed one frame's sightings, read the targets. Knows metres and stamps only. What moves on the lane and keeps moving is a
car; what jitters on the spot, or lives beside the lane, is furniture and never gets confirmed. The parts have files of
their own: `assignment`, `appearance`, one `target`, `doubt` after a meeting, `regain` after a loss.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dnb_edge.motion import kalman
from dnb_edge.motion.appearance import COLOUR_CAP, HEADING_WEIGHT, MARKER_COST, Sighting, evidence
from dnb_edge.motion.assignment import assign
from dnb_edge.motion.doubt import are_near, named
from dnb_edge.motion.regain import along, regained, rejoined, taken_for
from dnb_edge.motion.settings import MOST_CARS, MotionSettings
from dnb_edge.motion.target import LIVE, Followed, aged, ahead, born, covariance_beside, renamed, seen, shared
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Observation, PointM, TargetState

MERGED_S = 1.0
"""Longest time for which two cars may share one detection; after it one of them is taken for unseen."""

MERGED_SIGMA_LENGTHS = 0.25
"""One standard deviation of a shared detection about the middle of the cars, in car lengths."""

MERGED_REACH_LENGTHS = 0.5
"""Distance from a shared detection, in car lengths, beyond which a car that shares it is drawn back."""

STILL_MERGED_LENGTHS = 2.0
"""Distance from a detection, in car lengths, within which cars that have shared one are taken to share it still."""

GHOST_LENGTHS = 0.5
"""Distance from a followed car, in its lengths, within which a newcomer is a second detection of it."""

AGREEING_GATE = 4.0
"""By how much the gate is wider for a sighting that bears the car's own number: twice as many standard deviations, since the
number tells who it is and the place need only be believable.
"""

LIKE_SIZE = (0.4, 2.5)
"""Length of a newcomer as a share of a followed car's, between which it may be a car of the same race."""

CAR_LENGTHS_M = (0.04, 1.0)
"""Lengths that cars have which race beside another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """Where a target will be, for the detector to look there."""

    target_id: int
    track_m: PointM
    length_px: float
    length_m: float


class Follower:
    """Follows targets from frame to frame. Deterministic: the same sightings give the same targets."""

    def __init__(self, settings: MotionSettings, route: Centreline | None = None, *, unseen_s: float = 0.0) -> None:
        """With a `route`, a lost car is awaited further along it. `unseen_s`: time for which a car may be missing in frames
        without being out of sight, as where cameras share the track; 0 where every frame shows all of it."""
        self._settings = settings
        self._unseen_s = unseen_s
        self._route = route
        self._followed: list[Followed] = []
        self._missing: list[Followed] = []
        self._next_id = 1

    @property
    def followed(self) -> tuple[Followed, ...]:
        """All targets that are alive, oldest first."""
        return tuple(self._followed)

    @property
    def parked(self) -> tuple[Followed, ...]:
        """What has looked like a car for a while and never moved: furniture, or a car that waits."""
        return tuple(target for target in self._followed if target.is_parked(self._settings))

    def adopt(self, target_id: int) -> None:
        """Takes something that is parked for a car from now on, as where cars are awaited standing; no more than are wanted."""
        confirmed = sum(target.state is not TargetState.TENTATIVE for target in self._followed)
        if confirmed < self._settings.cars:
            self._followed = [
                replace(target, state=TargetState.CONFIRMED) if target.target_id == target_id else target
                for target in self._followed
            ]

    def step(self, t_ns: int, sightings: Sequence[Sighting]) -> tuple[Followed, ...]:
        """Takes one frame's sightings and returns the targets at `t_ns`.

        Targets that died in this frame are returned once, with state LOST.
        """
        predicted = [ahead(target, t_ns, self._settings) for target in self._followed]
        owners = self._assign(predicted, sightings)
        after, own, taken = self._observed(predicted, sightings, owners)
        after = named(after, {i: sightings[j] for i, j in own.items()}, t_ns)
        newcomers = [
            self._born(sighting)
            for j, sighting in enumerate(sightings)
            if j not in taken and sighting.on_lane and not self._is_covered(sighting.observation, after)
        ]
        settled = self._settle(after + newcomers, t_ns)
        self._followed = [target for target in settled if target.state is not TargetState.LOST]
        return tuple(settled)

    def expected(self, t_ns: int) -> tuple[Expected, ...]:
        """Where the cars are expected at `t_ns`, no earlier than the latest frame: seen ones first, then those unseen, then,
        while cars are still wanted, what may become one. At most `MOST_CARS`.
        """
        cars = [target for target in self._followed if target.state in LIVE]
        awaited = [car for car in self._missing if (t_ns - car.last.t_ns) * 1e-9 <= self._settings.regain_s]
        cars.sort(key=lambda target: target.state is not TargetState.CONFIRMED)
        maybe = [
            target
            for target in self._followed
            if 0 < len(cars) < self._settings.cars
            and target.state is TargetState.TENTATIVE
            and not target.is_parked(self._settings)
        ]
        return tuple(
            Expected(
                target_id=target.target_id,
                track_m=self._expected_m(target, t_ns),
                length_px=target.length_px,
                length_m=target.length_m,
            )
            for target in (*cars, *awaited, *maybe)[:MOST_CARS]
        )

    def _expected_m(self, target: Followed, t_ns: int) -> PointM:
        """Straight on for what was seen in the latest frame, along the lane for the unseen."""
        if target.state in (TargetState.CONFIRMED, TargetState.TENTATIVE) or self._route is None:
            return kalman.predict(target.estimate, t_ns, self._settings.acceleration_sigma_mps2).track_m
        place = along(self._route, target, t_ns)
        return self._route.point_at(place.s_m, place.d_m)

    def _assign(self, targets: Sequence[Followed], sightings: Sequence[Sighting]) -> dict[int, int]:
        """Index of the sighting for each target that gets one: the cheapest way for the cars in sight, then for those out of
        sight, so that a vague guess takes nothing from a sure one; what is left to the tentative, cheapest pair first.
        """
        live = [i for i, target in enumerate(targets) if target.state in LIVE]
        sure = [i for i in live if targets[i].state is TargetState.CONFIRMED]
        sure += [i for i in live if i not in sure and any(are_near(targets[i], targets[k]) for k in sure)]
        owners = self._share_out(targets, sure, sightings, range(len(sightings)))
        free = [j for j in range(len(sightings)) if j not in owners.values()]
        in_sight = [(targets[i], sightings[j].observation) for i, j in owners.items()]
        alone = [j for j in free if not any(_ghost(car, at, sightings[j].observation) for car, at in in_sight)]
        owners |= self._share_out(targets, [i for i in live if i not in sure], sightings, alone)
        pairs = [
            (distance, i, j)
            for i, target in enumerate(targets)
            if target.state is TargetState.TENTATIVE
            for j in free
            if (distance := _distance(target, sightings[j])) <= self._settings.gate
        ]
        for _, i, j in sorted(pairs):
            if i not in owners and j not in owners.values():
                owners[i] = j
        return owners

    def _share_out(
        self, targets: Sequence[Followed], cars: Sequence[int], sightings: Sequence[Sighting], free: Sequence[int]
    ) -> dict[int, int]:
        """Sighting for each of the targets `cars` out of `free`: squared Mahalanobis distance inside the gate, and looks."""
        if not cars or not free:
            return {}
        looks = [targets[i].looks for i in cars]
        velocities = [targets[i].estimate.velocity_mps for i in cars]
        numbers = {target.looks.marker for target in targets if target.state in LIVE}
        costs = [[math.inf] * len(free) for _ in cars]
        for column, j in enumerate(free):
            sighting = sightings[j]
            distances = [_distance(targets[i], sighting) for i in cars]
            if min(distances) > AGREEING_GATE * self._settings.gate:
                continue
            by_looks = evidence(looks, velocities, sighting)
            for row, (i, distance) in enumerate(zip(cars, distances, strict=True)):
                # Another's number may mean that the two were confused; a stranger's, that this is a stranger.
                strange = by_looks[row] >= MARKER_COST and sighting.marker_id not in numbers
                agrees = targets[i].looks.agrees(sighting.marker_id)
                gate = self._settings.gate * (AGREEING_GATE if agrees else 1.0)
                if distance <= gate and not strange:
                    costs[row][column] = distance + by_looks[row]
        miss_cost = AGREEING_GATE * self._settings.gate + COLOUR_CAP + 2 * HEADING_WEIGHT + MARKER_COST + 1.0
        return {cars[row]: free[column] for row, column in assign(costs, miss_cost).items()}

    def _observed(
        self, targets: Sequence[Followed], sightings: Sequence[Sighting], owners: Mapping[int, int]
    ) -> tuple[list[Followed], dict[int, int], set[int]]:
        """The targets after their sightings, who had which one for itself, and all sightings that are spoken for."""
        sharing = _sharing(targets, sightings, owners)
        own = {i: j for i, j in owners.items() if j not in sharing}
        after = list(targets)
        for i, j in own.items():
            alone = targets[i].doubt is None and not any(
                k != i and other.state in LIVE and are_near(targets[i], other) for k, other in enumerate(targets)
            )
            after[i] = seen(targets[i], sightings[j], learn=alone)
        for j, members in sharing.items():
            for i, target in zip(members, _shared([targets[i] for i in members], sightings[j]), strict=True):
                after[i] = target
        return after, own, {*owners.values(), *sharing}

    def _is_covered(self, observation: Observation, targets: Sequence[Followed]) -> bool:
        """Whether it is a second detection of a car that is followed, in this picture or in another camera's."""
        return _covered(observation, targets) or any(
            _seen_by_another(target, observation, self._unseen_s)
            for target in targets
            if target.state is not TargetState.TENTATIVE
        )

    def _born(self, sighting: Sighting) -> Followed:
        self._next_id += 1
        return born(self._next_id - 1, sighting, self._settings)

    def _settle(self, targets: Sequence[Followed], t_ns: int) -> list[Followed]:
        """Ages every target, takes newcomers for missing cars, and confirms those that have earned it, most travelled first."""
        settled = [aged(target, t_ns, self._settings, self._unseen_s) for target in targets]
        lost = [
            replace(target, doubt=None, pending=())
            for target, before in zip(settled, targets, strict=True)
            if target.state is TargetState.LOST and before.state in LIVE
        ]
        self._missing = [car for car in (*self._missing, *lost) if self._is_awaited(car, t_ns)]
        tentative = [i for i, target in enumerate(settled) if target.state is TargetState.TENTATIVE]
        tentative.sort(key=lambda i: (-settled[i].travel_m, settled[i].target_id))
        for i in tentative:
            self._rejoin(settled, i)
        for i in tentative:
            cars = [target for target in settled if target.state in LIVE]
            if len(cars) < self._settings.cars and settled[i].state is TargetState.TENTATIVE:
                settled[i] = self._confirmed(settled[i], cars)
        return settled

    def _rejoin(self, settled: list[Followed], i: int) -> None:
        """Where newcomer `i` bears the number of a car that is out of sight but not yet lost, it is that car."""
        for k, car in enumerate(settled):
            if car.state in LIVE and car.looks.agrees(settled[i].looks.marker):
                found = rejoined(settled[i], car)
                if found is not None:
                    settled[k], settled[i] = found, replace(settled[i], state=TargetState.LOST)
                return

    def _is_awaited(self, car: Followed, t_ns: int) -> bool:
        """Several cars are remembered for good, since whoever comes back is one of them; one for as long as it is awaited."""
        return self._settings.cars > 1 or (t_ns - car.last.t_ns) * 1e-9 <= self._settings.regain_s

    def _confirmed(self, newcomer: Followed, cars: Sequence[Followed]) -> Followed:
        """The newcomer as the car that it is, confirmed; itself where that is too early to say."""
        if any(_ghost(car, car.last, newcomer.last) for car in cars if car.last.t_ns == newcomer.last.t_ns):
            return newcomer
        if any(_seen_by_another(car, newcomer.last, self._unseen_s) for car in cars):
            return newcomer
        number = newcomer.looks.marker_id if newcomer.looks.reads > 0 else None
        if any(car.looks.agrees(number) for car in cars):
            # It is that car, or a ghost of it, and never another.
            return newcomer
        if cars and not _of_like_size(newcomer, cars):
            return newcomer
        car = regained(self._route, newcomer, self._missing, self._settings)
        if car is None and not self._earned(newcomer):
            return newcomer
        if car is None and self._settings.cars > 1 and len(cars) + len(self._missing) >= self._settings.cars:
            car = taken_for(self._route, newcomer, self._missing)
            if car is None:
                return newcomer
        if car is None:
            return replace(newcomer, state=TargetState.CONFIRMED)
        self._missing = [other for other in self._missing if other is not car]
        found = renamed(newcomer, car.target_id, car.looks)
        return replace(found, state=TargetState.CONFIRMED, returned=self._settings.cars > 1)

    def _earned(self, target: Followed) -> bool:
        return (
            target.observations >= self._settings.confirm_observations
            and target.travel_m >= self._settings.confirm_travel_m
        )


def _of_like_size(newcomer: Followed, cars: Sequence[Followed]) -> bool:
    """Whether the newcomer is as long, on the floor, as a car of one race with `cars`: people's feet are not.

    Its latest box must be as long as it usually is too: one round more than it has not moved it.
    """
    length_px, (least, most) = newcomer.typical_length_px, LIKE_SIZE
    length_m = length_px * newcomer.length_m / newcomer.length_px
    return (
        CAR_LENGTHS_M[0] <= length_m <= CAR_LENGTHS_M[1]
        and least * length_px <= newcomer.last.length_px <= most * length_px
        and any(least * car.length_m <= length_m <= most * car.length_m for car in cars)
    )


def _distance(target: Followed, sighting: Sighting) -> float:
    observation = sighting.observation
    return kalman.distance_squared(target.estimate, observation.track_m, covariance_beside(target, observation))


def _sharing(
    targets: Sequence[Followed], sightings: Sequence[Sighting], owners: Mapping[int, int]
) -> dict[int, list[int]]:
    """The detections that are of several cars, by index, with those cars: each got nothing of its own, or this one."""
    owned = {j: i for i, j in owners.items()}
    sharing: dict[int, list[int]] = {}
    without = [
        i for i, car in enumerate(targets) if i not in owners and car.state in LIVE and not _merged_too_long(car)
    ]
    for i in without:
        for j, sighting in enumerate(sightings):
            others = [owned[j]] if j in owned else [k for k in without if k != i]
            if any(_is_of_both(targets[i], targets[k], sighting.observation) for k in others):
                members = sharing.setdefault(j, [owned[j]] if j in owned else [])
                members.append(i)
                break
    return {j: members for j, members in sharing.items() if len(members) > 1}


def _is_of_both(car: Followed, other: Followed, observation: Observation) -> bool:
    """Whether one detection seems to be of two cars: it lies nearer to the middle of them than to the other one, or they
    have been one detection already and it is still within reach.
    """
    if other.state not in LIVE:
        return False
    (ax, ay), (bx, by), at_m = car.estimate.track_m, other.estimate.track_m, observation.track_m
    if car.merged_since_t_ns is not None and other.merged_since_t_ns is not None:
        return math.dist(at_m, (ax, ay)) <= STILL_MERGED_LENGTHS * car.length_m
    middle_m = math.dist(at_m, ((ax + bx) / 2, (ay + by) / 2))
    return are_near(car, other) and middle_m < min(math.dist(at_m, (bx, by)), car.length_m / 2)


def _shared(cars: Sequence[Followed], sighting: Sighting) -> list[Followed]:
    """The cars after one detection of them all: it tells where their middle is, and that none is far from it."""
    length_m = max(car.length_m for car in cars)
    middle = _of_several(sighting.observation, MERGED_SIGMA_LENGTHS * length_m)
    about = _of_several(sighting.observation, MERGED_REACH_LENGTHS * length_m)
    estimates = kalman.update_mean([car.estimate for car in cars], middle.track_m, middle.covariance_m2)
    after = []
    for car, estimate in zip(cars, estimates, strict=True):
        away_m = math.dist(estimate.track_m, about.track_m)
        held = estimate
        if away_m > MERGED_REACH_LENGTHS * length_m:
            held = kalman.update(estimate, about.track_m, about.covariance_m2)
        after.append(shared(car, about, held, on_lane=sighting.on_lane))
    return after


def _merged_too_long(target: Followed) -> bool:
    since_t_ns = target.merged_since_t_ns
    return since_t_ns is not None and (target.estimate.t_ns - since_t_ns) * 1e-9 > MERGED_S


def _of_several(observation: Observation, more_m: float) -> Observation:
    """The observation with `more_m` added to its standard deviations: nobody knows which part of the cars was found."""
    xx, xy, yy = observation.covariance_m2
    return replace(observation, covariance_m2=(xx + more_m**2, xy, yy + more_m**2))


def _covered(observation: Observation, targets: Sequence[Followed]) -> bool:
    """Whether a confirmed target stands within one car length: a second detection of the same car."""
    return any(
        target.state is not TargetState.TENTATIVE
        and target.last.t_ns == observation.t_ns
        and math.dist(target.last.camera_px, observation.camera_px) < target.length_px
        for target in targets
    )


def _ghost(car: Followed, at: Observation, observation: Observation) -> bool:
    """Whether `observation` is a second detection of the car that was seen `at` the same stamp."""
    return math.dist(at.camera_px, observation.camera_px) < GHOST_LENGTHS * car.length_px


def _seen_by_another(car: Followed, observation: Observation, within_s: float) -> bool:
    """Whether another camera has just seen the car where that is observed: two maps never agree to the last millimetre."""
    return (
        car.last.camera != observation.camera
        and 0 <= (observation.t_ns - car.last.t_ns) * 1e-9 <= within_s
        and math.dist(car.estimate.track_m, observation.track_m) < car.length_m
    )
