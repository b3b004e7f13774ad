"""Fixtures for the tests of the ground-truth rig."""

import pytest

from dnb_edge.sim.rig import Rig


@pytest.fixture(scope="session")
def rig() -> Rig:
    """One rig for all tests that only look at it; drawing the room takes a second."""
    return Rig(seed=1, fps=30.0, laps=2)
