"""What the firmware must do on real MicroPython; `command` holds the words that begin a call of it."""

import json
import os
import signal
import subprocess
import threading
import tty

import board_checks
import micropython
import pytest
from display_events import race
from lit_pictures import pictures_of
from micropython import HERE

from dnb_edge.display import flash
from dnb_edge.display.serial_port import SerialDisplay


def here():
    """The words that call this machine's MicroPython. Skips where there is none."""
    if (program := micropython.found()) is None:
        pytest.skip("no micropython on this machine: apt install micropython (Debian 13), or set MICROPYTHON")
    return (program,)


def unpack(folder):
    """A board's files, as they are written to it."""
    for path, content in flash.board_files().items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)


def passes_the_checks(command, folder):
    """Drivers, settings and loop against the models of the chips."""
    unpack(folder)
    printed = micropython.run(HERE / "board_checks.py", folder, heap="2m", command=command)
    assert printed.endswith(f"all {len(board_checks.CHECKS)} checks passed\n")


def shows_a_race(command, folder):
    """The appliance's own serial display tells it of a race over a pseudo-terminal, and the race is on the panel.

    The heap is about what a Raspberry Pi Pico has, for words twice as long, with the models of the chips in it.
    """
    unpack(folder)
    (folder / "settings.json").write_text(json.dumps({"panel": "max7219-32x8"}))
    master, slave = os.openpty()
    tty.setraw(slave)
    words = [*command, "-X", "heapsize=512k", HERE / "board_run.py", folder, folder / "settings.json"]
    process = subprocess.Popen(words, stdin=master, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        state = race(3, laps_wanted=3)
        with SerialDisplay(os.ttyname(slave)) as display:
            display.post(state)
            # Says only how long a broken test may hang.
            hung = threading.Timer(120, process.kill)
            hung.start()
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGINT)
            printed, _ = process.communicate(timeout=20)
            hung.cancel()
    finally:
        process.kill()
        process.wait()
        os.close(slave)
        os.close(master)
    end, *rows, counts = printed.splitlines()
    assert end == "KeyboardInterrupt"
    lines, dropped = (int(word) for word in counts.replace(" lines, ", " ").removesuffix(" dropped").split())
    assert lines > 15
    assert dropped == 0
    assert "\n".join(rows) in pictures_of(state)
