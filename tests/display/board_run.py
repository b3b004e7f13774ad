"""The firmware as a board runs it at power on, with a model of MAX7219 matrices at the pins, until it is interrupted.

`micropython board_run.py FOLDER SETTINGS`: the firmware is unpacked in FOLDER, lines come on stdin; `ready` goes to
stdout once lines are on the panel, at the end the lit pixels and how many lines were obeyed.
"""

import sys

from board_checks import face, firmware, with_modules
from chip_models import Max7219Chain, matrix_rows
from pico_model import Pico

chain = Max7219Chain(4)
with_modules(Pico(wired={17: chain.load}, spi=chain))
served = []


firmware_turn = firmware.Firmware.turn


class Watched(firmware.Firmware):
    """Lets the test count."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        served.append(self)
        self._told = False

    def turn(self):
        firmware_turn(self)
        if not self._told and self._step > face.TEST_STEPS and self.panel.lines > 15 and not self._changed:
            sys.stdout.write("ready\n")
            self._told = True


firmware.Firmware = Watched
try:
    firmware.run(sys.argv[2])
except (KeyboardInterrupt, EOFError) as end:
    sys.stdout.write(f"{type(end).__name__}\n")
sys.stdout.write("\n".join(matrix_rows(chain)))
sys.stdout.write(f"\n{served[0].panel.lines} lines, {served[0].panel.dropped} dropped\n")
