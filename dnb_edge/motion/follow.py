"""The life of targets: born from an observation on the lane, confirmed by travel, coasting when unseen, lost in the end.

Feed one frame's observations, read the targets. Knows metres and stamps only. What moves on the lane and keeps moving is a
car; what jitters on the spot, or lives beside the lane, is furniture and never gets confirmed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dnb_edge.motion import kalman
from dnb_edge.values import Observation, Target, TargetState

PENDING_KEPT = 300
"""Observations kept of a car that waits to be confirmed: ten seconds, so that one that is parked for hours costs nothing."""

MAX_CARS = 1
"""Greatest number of confirmed targets at a time: a run is one car's attempt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSettings:
    """How targets are followed."""

    acceleration_sigma_mps2: float = 4.0
    """Spread of the car's acceleration, metres per second squared."""
    start_speed_sigma_mps: float = 2.0
    """Spread of a new target's unknown speed, metres per second."""
    gate: float = 16.0
    """Greatest squared Mahalanobis distance at which an observation belongs to a target (16: 3.4 in 10,000 missed)."""
    confirm_observations: int = 4
    """Observations that a target needs before it can be confirmed."""
    confirm_travel_m: float = 0.08
    """Distance from its first to its latest observation that a target must have moved before it is confirmed."""
    tentative_lost_after_s: float = 0.2
    """Time unseen after which a target that was never confirmed is forgotten."""
    coasting_lost_after_s: float = 0.7
    """Time unseen after which a confirmed target is lost."""
    strayed_lost_after_s: float = 2.0
    """Time beside the lane after which a target is no longer taken for a car."""

    def __post_init__(self) -> None:
        for name in ("acceleration_sigma_mps2", "start_speed_sigma_mps", "gate"):
            if not getattr(self, name) > 0:
                raise ValueError(f"motion.{name}: {getattr(self, name)} must be positive")
        if self.confirm_observations < 2:
            raise ValueError(
                f"motion.confirm_observations: {self.confirm_observations} is too few, at least 2 are needed"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """One target with what is remembered of it."""

    target_id: int
    state: TargetState
    estimate: kalman.Estimate
    first: Observation
    last: Observation
    """The latest observation that was taken for this target."""
    on_lane_t_ns: int
    """Stamp of the latest observation on the lane."""
    length_px: float
    """Smoothed apparent length, camera px."""
    pending: tuple[Observation, ...]
    """The last `PENDING_KEPT` observations from before the confirmation; empty afterwards."""
    observations: int = 1

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


class Follower:
    """Follows targets from frame to frame. Deterministic: the same observations give the same targets."""

    def __init__(self, settings: MotionSettings) -> None:
        self._settings = settings
        self._followed: list[Followed] = []
        self._next_id = 1

    @property
    def followed(self) -> tuple[Followed, ...]:
        """All targets that are alive, oldest first."""
        return tuple(self._followed)

    def step(self, t_ns: int, observations: Sequence[Observation], on_lane: Sequence[bool]) -> tuple[Followed, ...]:
        """Takes one frame's observations, with whether each lies on the lane, and returns the targets at `t_ns`.

        Targets that died in this frame are returned once, with state LOST.
        """
        acceleration = self._settings.acceleration_sigma_mps2
        predicted = [
            replace(target, estimate=kalman.predict(target.estimate, t_ns, acceleration)) for target in self._followed
        ]
        owners = self._assign(predicted, observations)
        after = [
            self._seen(target, observations[owners[i]], on_lane=on_lane[owners[i]]) if i in owners else target
            for i, target in enumerate(predicted)
        ]
        taken = set(owners.values())
        born = [
            self._born(observation)
            for j, observation in enumerate(observations)
            if j not in taken and on_lane[j] and not self._covered(observation, after)
        ]
        settled = self._settle(after + born, t_ns)
        self._followed = [target for target in settled if target.state is not TargetState.LOST]
        return tuple(settled)

    def _assign(self, targets: Sequence[Followed], observations: Sequence[Observation]) -> dict[int, int]:
        """Index of the observation for each target: cheapest pair first, confirmed targets before tentative ones."""
        pairs = []
        for i, target in enumerate(targets):
            for j, observation in enumerate(observations):
                distance = kalman.distance_squared(target.estimate, observation.track_m, observation.covariance_m2)
                if distance <= self._settings.gate:
                    pairs.append((target.state is TargetState.TENTATIVE, distance, i, j))
        owners: dict[int, int] = {}
        for _, _, i, j in sorted(pairs):
            if i not in owners and j not in owners.values():
                owners[i] = j
        return owners

    def _seen(self, target: Followed, observation: Observation, *, on_lane: bool) -> Followed:
        state = TargetState.TENTATIVE if target.state is TargetState.TENTATIVE else TargetState.CONFIRMED
        tagged = replace(observation, target_id=target.target_id)
        return replace(
            target,
            state=state,
            estimate=kalman.update(target.estimate, observation.track_m, observation.covariance_m2),
            last=tagged,
            on_lane_t_ns=observation.t_ns if on_lane else target.on_lane_t_ns,
            length_px=0.7 * target.length_px + 0.3 * observation.length_px,
            pending=(*target.pending[1 - PENDING_KEPT :], tagged) if state is TargetState.TENTATIVE else (),
            observations=target.observations + 1,
        )

    def _born(self, observation: Observation) -> Followed:
        tagged = replace(observation, target_id=self._next_id)
        self._next_id += 1
        speed = self._settings.start_speed_sigma_mps
        return Followed(
            target_id=self._next_id - 1,
            state=TargetState.TENTATIVE,
            estimate=kalman.begin(observation.t_ns, observation.track_m, observation.covariance_m2, speed),
            first=tagged,
            last=tagged,
            on_lane_t_ns=observation.t_ns,
            length_px=observation.length_px,
            pending=(tagged,),
        )

    def _covered(self, observation: Observation, targets: Sequence[Followed]) -> bool:
        """Whether a confirmed target stands within one car length: a second detection of the same car."""
        return any(
            target.state is not TargetState.TENTATIVE
            and target.last.t_ns == observation.t_ns
            and math.dist(target.last.camera_px, observation.camera_px) < target.length_px
            for target in targets
        )

    def _settle(self, targets: Sequence[Followed], t_ns: int) -> list[Followed]:
        """Ages every target and confirms those that have earned it, the most travelled first."""
        aged = [replace(target, state=self._aged(target, t_ns)) for target in targets]
        free = MAX_CARS - sum(target.state in (TargetState.CONFIRMED, TargetState.COASTING) for target in aged)
        ready = [target for target in aged if self._earned(target)]
        ready.sort(key=lambda target: (-_travel_m(target), target.target_id))
        confirmed = {target.target_id for target in ready[: max(0, free)]}
        return [
            replace(target, state=TargetState.CONFIRMED) if target.target_id in confirmed else target for target in aged
        ]

    def _aged(self, target: Followed, t_ns: int) -> TargetState:
        unseen_s = (t_ns - target.last.t_ns) * 1e-9
        if (t_ns - target.on_lane_t_ns) * 1e-9 > self._settings.strayed_lost_after_s:
            return TargetState.LOST
        if target.state is TargetState.TENTATIVE:
            return TargetState.LOST if unseen_s > self._settings.tentative_lost_after_s else TargetState.TENTATIVE
        if unseen_s > self._settings.coasting_lost_after_s:
            return TargetState.LOST
        return TargetState.COASTING if unseen_s > 0 else TargetState.CONFIRMED

    def _earned(self, target: Followed) -> bool:
        return (
            target.state is TargetState.TENTATIVE
            and target.observations >= self._settings.confirm_observations
            and _travel_m(target) >= self._settings.confirm_travel_m
        )


def _travel_m(target: Followed) -> float:
    return math.dist(target.first.track_m, target.last.track_m)
