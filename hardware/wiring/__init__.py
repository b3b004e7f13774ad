"""Wiring diagrams of the displays, drawn by code: what is joined to what, pin by pin.

`pictures()` gives every diagram's name and SVG text; `python -m hardware build|check` writes and compares them.
"""

from hardware.wiring.diagrams import pictures

__all__ = ["pictures"]
