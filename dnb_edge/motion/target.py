"""One target: what is remembered of it, and how a sighting or its absence changes that.

Knows one car at a time; who gets which observation is `follow`'s business, who is who after a meeting is `doubt`'s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median
from typing import Any

from dnb_edge.motion import kalman
from dnb_edge.motion.appearance import UNKNOWN, Appearance, Sighting
from dnb_edge.motion.copies import changed
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.values import Observation, Target, TargetState

PENDING_KEPT = 300
"""Observations kept that cannot be told yet: ten seconds, so that a car that is parked for hours costs nothing."""

MAPS_SIGMA_M = 0.01
"""By so much two cameras' maps of one floor disagree, one standard deviation along either axis: eight keypoints that were
clicked to a pixel leave 5 to 10 mm from 2.5 m above."""

PARKED_AFTER_S = 5.0
"""Time after which something car-like that has been seen and has not moved is listed as parked."""

LIVE = (TargetState.CONFIRMED, TargetState.COASTING)


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """Cars with other looks were so near that motion alone does not say who is who."""

    group: frozenset[int]
    """Numbers of the targets in question, this one's among them."""
    since_t_ns: int
    """Stamp of the frame in which the doubt arose."""
    met_t_ns: int
    """Stamp of the latest frame in which they were near or merged."""
    unsure_t_ns: int
    """Stamp from which on its name may be wrong: what was seen before is its own."""
    looks: Appearance = UNKNOWN
    """What was seen of this target since, one sighting a frame."""
    votes: int = 0
    """Number of those sightings."""

    def after(self, sighting: Sighting) -> Doubt:
        """With one more separate sighting."""
        return changed(self, looks=self.looks.after(sighting), votes=self.votes + 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """One target with what is remembered of it."""

    target_id: int
    state: TargetState
    estimate: kalman.Estimate
    seen_estimate: kalman.Estimate
    """The estimate in the latest frame in which it was seen."""
    first: Observation
    last: Observation
    """The latest observation that was taken for this target."""
    on_lane_t_ns: int
    """Stamp of the latest observation on the lane."""
    length_px: float
    """Smoothed apparent length, camera px."""
    length_m: float
    """Smoothed length on the floor, metres."""
    pending: tuple[Observation, ...]
    """Observations that nobody was told of, the last `PENDING_KEPT`: kept from frame to frame while `held`."""
    observations: int = 1
    looks: Appearance = UNKNOWN
    doubt: Doubt | None = None
    returned: bool = False
    """True in the frame in which it was taken for a car that had been lost."""
    merged_since_t_ns: int | None = None
    """Stamp from which on it shares one detection with another target; None while it has its own."""

    @property
    def held(self) -> bool:
        """Whether its observations must wait: it is not yet taken for a car, or not surely for this one."""
        return self.state is TargetState.TENTATIVE or self.doubt is not None or self.returned

    @property
    def travel_m(self) -> float:
        """Distance from the first to the latest observation."""
        return math.dist(self.first.track_m, self.last.track_m)

    @property
    def typical_length_px(self) -> float:
        """Median apparent length over all that waits to be told: a few boxes round more than it count for nothing."""
        return median(one.length_px for one in self.pending) if self.pending else self.length_px

    def is_parked(self, settings: MotionSettings) -> bool:
        """Whether it looks like a car, has been there for a while and has never moved."""
        return (
            self.state is TargetState.TENTATIVE
            and (self.last.t_ns - self.first.t_ns) * 1e-9 >= PARKED_AFTER_S
            and self.travel_m < settings.confirm_travel_m
        )

    def as_value(self, t_s: float) -> Target:
        """The target as others see it, `t_s` being the estimate's stamp in seconds from the first frame."""
        return Target(
            target_id=self.target_id,
            state=self.state,
            t_ns=self.estimate.t_ns,
            t_s=t_s,
            track_m=self.estimate.track_m,
            velocity_mps=self.estimate.velocity_mps,
            covariance_m2=self.estimate.covariance_m2,
        )


def born(target_id: int, sighting: Sighting, settings: MotionSettings) -> Followed:
    """A new, tentative target."""
    observation = changed(sighting.observation, target_id=target_id)
    estimate = kalman.begin(
        observation.t_ns, observation.track_m, observation.covariance_m2, settings.start_speed_sigma_mps
    )
    return Followed(
        target_id=target_id,
        state=TargetState.TENTATIVE,
        estimate=estimate,
        seen_estimate=estimate,
        first=observation,
        last=observation,
        on_lane_t_ns=observation.t_ns,
        length_px=observation.length_px,
        length_m=sighting.length_m,
        pending=(observation,),
        looks=UNKNOWN.after(sighting),
    )


def ahead(target: Followed, t_ns: int, settings: MotionSettings) -> Followed:
    """The target as expected at `t_ns`, before that frame's observations; what was told of it is forgotten."""
    return changed(
        target,
        estimate=kalman.predict(target.estimate, t_ns, settings.acceleration_sigma_mps2),
        pending=target.pending if target.held else (),
    )


def covariance_beside(target: Followed, observation: Observation) -> tuple[float, float, float]:
    """Covariance, (xx, xy, yy), m^2, of an observation against what `target` is known by: another camera's has another map."""
    if observation.camera == target.last.camera:
        return observation.covariance_m2
    xx, xy, yy = observation.covariance_m2
    return xx + MAPS_SIGMA_M**2, xy, yy + MAPS_SIGMA_M**2


def seen(target: Followed, sighting: Sighting, *, learn: bool) -> Followed:
    """The target after its own observation; its looks are learnt only where nothing else is near."""
    observation = sighting.observation
    return _observed(
        target,
        observation,
        kalman.update(target.estimate, observation.track_m, covariance_beside(target, observation)),
        on_lane=sighting.on_lane,
        length_px=0.7 * target.length_px + 0.3 * observation.length_px,
        length_m=0.7 * target.length_m + 0.3 * sighting.length_m,
        merged_since_t_ns=None,
        looks=target.looks.after(sighting) if learn else target.looks,
    )


def shared(target: Followed, observation: Observation, estimate: kalman.Estimate, *, on_lane: bool) -> Followed:
    """The target after an observation of it together with others; `estimate` is what that makes of its own."""
    since = observation.t_ns if target.merged_since_t_ns is None else target.merged_since_t_ns
    return _observed(target, observation, estimate, on_lane=on_lane, merged_since_t_ns=since)


def _observed(
    target: Followed, observation: Observation, estimate: kalman.Estimate, *, on_lane: bool, **more: Any
) -> Followed:
    """The target after an observation, with the members `more` as well: each copy of it costs some microseconds."""
    tagged = changed(observation, target_id=target.target_id)
    return changed(
        target,
        state=TargetState.TENTATIVE if target.state is TargetState.TENTATIVE else TargetState.CONFIRMED,
        estimate=estimate,
        seen_estimate=estimate,
        last=tagged,
        on_lane_t_ns=observation.t_ns if on_lane else target.on_lane_t_ns,
        pending=(*target.pending[1 - PENDING_KEPT :], tagged),
        observations=target.observations + 1,
        **more,
    )


def aged(target: Followed, t_ns: int, settings: MotionSettings, unseen_s: float = 0.0) -> Followed:
    """The target in its state at `t_ns`; up to `unseen_s` it may be missing without being out of sight."""
    state = _state_at(target, t_ns, settings, unseen_s)
    return target if state is target.state else changed(target, state=state)


def _state_at(target: Followed, t_ns: int, settings: MotionSettings, in_sight_s: float) -> TargetState:
    """The target's state, from how long it has been unseen or beside the lane."""
    unseen_s = (t_ns - target.last.t_ns) * 1e-9
    if (t_ns - target.on_lane_t_ns) * 1e-9 > settings.strayed_lost_after_s:
        return TargetState.LOST
    if target.state is TargetState.TENTATIVE:
        return TargetState.LOST if unseen_s > settings.tentative_lost_after_s else TargetState.TENTATIVE
    if unseen_s > settings.coasting_lost_after_s:
        return TargetState.LOST
    return TargetState.COASTING if unseen_s > in_sight_s else TargetState.CONFIRMED


def renamed(target: Followed, target_id: int, looks: Appearance) -> Followed:
    """The same motion, known to be the car `target_id` that looks like `looks`; what waits to be told changes with it."""
    return changed(
        target,
        target_id=target_id,
        looks=looks,
        first=changed(target.first, target_id=target_id),
        last=changed(target.last, target_id=target_id),
        pending=tuple(changed(observation, target_id=target_id) for observation in target.pending),
    )
