"""Tests import their helpers by bare names, so those must be unique."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent


def test_no_two_files_have_one_name() -> None:
    """Of all tests and helpers: of two the second would be hidden by the first wherever both are imported in one process."""
    files = [path for path in HERE.rglob("*.py") if path.name not in ("conftest.py", "__init__.py")]
    assert [name for name, count in Counter(path.name for path in files).items() if count > 1] == []
