"""The board's half of the panel's firmware: drivers of the panels, the settings file and the loop that runs on the RP2040.

Runs on MicroPython and, for the tests and for panels on a Raspberry Pi's own pins, on CPython: no import at the top of a
module but the other modules of this package and what both Pythons have. A driver is given its bus and pins, never looks for
them, and has two methods: `begin()` sets the chip up, also after it was away; `show(surface)` lights what `surface` holds.
"""
