"""Light that changes while a vehicle drives, as a factor on all pictures of that instant, overhead and front.

Knows seconds and shares of light. Knows no picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class LightChange:
    """How the light changes. The default does not."""

    depth: float = 0.0
    """Share of the light that goes and comes back, as with clouds before a window."""
    period_s: float = 12.0
    """Time in which it goes and comes back."""
    step: float = 0.0
    """Share of the light that goes at once, as where one lamp of several is switched off, and comes back at once."""
    step_period_s: float = 7.0
    """Time between two switchings."""

    def __post_init__(self) -> None:
        shares = (self.depth, self.step)
        if not (all(0.0 <= share < 1.0 for share in shares) and self.period_s > 0.0 and self.step_period_s > 0.0):
            raise ValueError(f"a light's shares lie between 0 and 1 and its periods are positive, not {self}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """One course of the light, as a seed begins it."""

    change: LightChange
    phase: float
    """Where in its period the slow change begins, 0..1."""
    first_step_s: float
    """When the first switching is."""

    def gain(self, t_s: float) -> float:
        """Factor on the pictures taken at `t_s`, above 0 and at most 1."""
        change = self.change
        slow = change.depth * math.sin(math.pi * (t_s / change.period_s + self.phase)) ** 2
        switched = math.floor((t_s - self.first_step_s) / change.step_period_s) + 1 if t_s >= self.first_step_s else 0
        return (1.0 - slow) * (1.0 - change.step * (switched % 2))


def light_of(change: LightChange, seed: int) -> Light:
    """The course of light that `seed` makes of that change."""
    random = np.random.default_rng([seed, 81])
    phase, first = random.uniform(0.0, 1.0), random.uniform(0.3, 1.0)
    return Light(change=change, phase=float(phase), first_step_s=float(first) * change.step_period_s)
