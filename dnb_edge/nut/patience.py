"""How long a driver from outside may take by the clock on the wall. Knows nothing else."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """Seconds after which a run ends because of its driver; simulated time knows nothing of them."""

    start_s: float = 30.0
    """To be there and ready: a large model loads for a while."""
    answer_s: float = 5.0
    """For one picture."""
    end_s: float = 2.0
    """To end when it was told to; then it is ended."""


PATIENCE = Patience()
