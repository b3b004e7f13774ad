"""The Unix port of MicroPython, where this machine has it: what runs on the displays' microcontrollers, as a program."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
HEAP = "384k"
"""An RP2040 leaves MicroPython some 190 KiB; words of 64 bits take twice the room."""


def found():
    """The command's words, `MICROPYTHON` before what the PATH has. Skips where there is none."""
    program = os.environ.get("MICROPYTHON") or shutil.which("micropython")
    if program is None:
        pytest.skip("no micropython on this machine: apt install micropython (Debian 13), or set MICROPYTHON")
    return (program,)


def run(command, *words, heap=HEAP):
    """What it prints for a script of this repository, as seen from its root."""
    words = [*command, "-X", f"heapsize={heap}", *map(str, words)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False, cwd=HERE.parents[1])
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
