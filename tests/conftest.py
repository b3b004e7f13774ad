"""Fixtures shared by all tests."""

from pathlib import Path

import pytest
from hypothesis import settings

# How long one example takes says more about what else the machine does than about the code.
settings.register_profile("dnb-edge", deadline=None)
settings.load_profile("dnb-edge")

REAL_DIR = Path(__file__).resolve().parents[1].parent / "shared" / "real"


@pytest.fixture
def real_dir() -> Path:
    """The folder of real footage that lies beside the checkout; skips where there is none."""
    if not REAL_DIR.is_dir():
        pytest.skip(f"real footage is not at {REAL_DIR}: see README, 'Real footage'")
    return REAL_DIR
