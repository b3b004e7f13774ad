"""The displays' code on real MicroPython, Debian 13's, unpacked beside the system: no virtual machine, nothing installed."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from harness.recipe import CACHE, MIRROR

sys.path.insert(0, str(Path(__file__).parents[1] / "display"))

import on_device

from dnb_edge.display.panel import face

SUITE = "trixie"


@pytest.fixture(scope="module")
def micropython():
    """The words that begin a command: the unpacked program, with its own loader and C library."""
    if shutil.which("mmdebstrap") is None:
        pytest.skip("MicroPython cannot be unpacked here: apt install mmdebstrap")
    tree = CACHE / f"micropython-{SUITE}"
    if not (tree / "usr/bin/micropython").exists():
        shutil.rmtree(tree, ignore_errors=True)
        CACHE.mkdir(parents=True, exist_ok=True)
        words = ["mmdebstrap", "--quiet", "--variant=extract", "--include=micropython", "--keyring=/usr/share/keyrings"]
        done = subprocess.run([*words, SUITE, tree, MIRROR], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            shutil.rmtree(tree, ignore_errors=True)
            pytest.skip(f"MicroPython cannot be unpacked here: {done.stderr.strip()[-200:]}")
    loader = next(path for path in tree.glob("usr/lib*/**/ld-linux-*.so.*"))
    libraries = ":".join(str(path) for path in sorted(tree.glob("usr/lib/*-linux-gnu*")))
    return str(loader), "--library-path", libraries, str(tree / "usr/bin/micropython")


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_the_display_draws_the_simulators_pixels(micropython, layout):
    """Every picture of every face is bit for bit the simulator's, in a microcontroller's memory."""
    on_device.draws_the_same(layout, micropython)


def test_the_display_stands_a_megabyte_of_rubbish(micropython):
    """No crash, no wrong picture after a repaint, no memory that grows."""
    on_device.stands_rubbish(micropython)
