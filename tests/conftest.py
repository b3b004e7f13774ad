"""Fixtures shared by all tests."""

from pathlib import Path

import pytest

REAL_DIR = Path(__file__).resolve().parents[1].parent / "shared" / "real"


@pytest.fixture
def real_dir() -> Path:
    """The folder of real footage that lies beside the checkout; skips where there is none."""
    if not REAL_DIR.is_dir():
        pytest.skip(f"real footage is not at {REAL_DIR}: see README, 'Real footage'")
    return REAL_DIR
