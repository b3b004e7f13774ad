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
    """The program, `MICROPYTHON` before what the PATH has; None where there is none."""
    return os.environ.get("MICROPYTHON") or shutil.which("micropython")


def run(*words, heap=HEAP, command=None):
    """What it prints for a script, from the repository's root. `command`: words instead of what `found` has; skips without."""
    if command is None:
        if (program := found()) is None:
            pytest.skip("no micropython on this machine: apt install micropython (Debian 13), or set MICROPYTHON")
        command = (program,)
    words = [*command, "-X", f"heapsize={heap}", *map(str, words)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False, cwd=HERE.parents[1])
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
