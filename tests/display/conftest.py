"""Fixtures for the displays."""

import pytest
from pty_line import PtyLine


@pytest.fixture
def line(tmp_path):
    """A plugged-in serial line."""
    line = PtyLine(tmp_path / "ttyTEST")
    line.plug()
    yield line
    line.unplug()
