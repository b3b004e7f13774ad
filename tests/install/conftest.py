"""Fixtures of the installer's tests."""

import shutil

import pytest
from yard import Checkout, Machine


@pytest.fixture
def machine(tmp_path):
    """A machine without dnb-edge."""
    if shutil.which("flock") is None or shutil.which("setsid") is None:
        pytest.skip("flock and setsid of util-linux are not installed: install.sh is for Debian")
    one = Machine(root=tmp_path / "machine")
    yield one
    one.close()


@pytest.fixture
def checkout(tmp_path):
    """`checkout(version=..., behaviour=...)` writes a clone, in the same folder each time, as after `git pull`."""

    def write(**settings):
        return Checkout(folder=tmp_path / "clone", **settings).write().folder

    return write
