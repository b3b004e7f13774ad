"""Fixtures of the installer's tests."""

import compileall
import shutil
import venv

import pytest
from yard import Checkout, Machine


@pytest.fixture(scope="session")
def template(tmp_path_factory):
    """An empty virtual environment."""
    if shutil.which("flock") is None or shutil.which("setsid") is None:
        pytest.skip("flock and setsid of util-linux are not installed: install.sh is for Debian")
    at = tmp_path_factory.mktemp("template") / "venv"
    venv.create(at, system_site_packages=True, with_pip=True)
    compileall.compile_dir(at / "lib", quiet=2)
    return at


@pytest.fixture
def machine(tmp_path, template):
    """A machine without dnb-edge."""
    one = Machine(root=tmp_path / "machine", template=template)
    yield one
    one.close()


@pytest.fixture
def checkout(tmp_path):
    """`checkout(version=..., behaviour=...)` writes a clone, in the same folder each time, as after `git pull`."""

    def write(**settings):
        return Checkout(folder=tmp_path / "clone", **settings).write().folder

    return write
