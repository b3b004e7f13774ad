"""How well a car as the camera sees it fits the colour that somebody wrote down for it.

Knows two colours; knows no car and no picture. What is seen of a car is its paint, shaded, mixed with tyres, windows and floor:
about half as bright as the paint and less full, of the same hue. So the way in which the colour differs from grey is compared,
at whatever strength fits best, and brightness only a little: it tells white from black.
"""

from __future__ import annotations

from dnb_edge.motion.appearance import Colour

LEAST_STRENGTH, MOST_STRENGTH = 0.25, 1.1
"""How full a colour is seen, as a share of the paint's."""

_SPREAD = 12.0
"""Of a seen colour, 0..255."""
_BRIGHTNESS_SHARE, _BRIGHTNESS_ADDED = 0.55, 25.0
"""Brightness as seen, of that of the paint: measured on eight paints in simulated races."""
_BRIGHTNESS_SPREAD = 40.0


def paint_cost(seen_bgr: Colour, paint_bgr: Colour, variance: float = 0.0) -> float:
    """Squared distance of what is seen from a paint, in its spread: 0 and up. `variance` is that of the seen colour."""
    seen, paint = _brightness(seen_bgr), _brightness(paint_bgr)
    away = [one - seen for one in seen_bgr]
    full = [one - paint for one in paint_bgr]
    square = sum(one * one for one in full)
    fits = sum(a * b for a, b in zip(away, full, strict=True)) / square if square else MOST_STRENGTH
    strength = min(MOST_STRENGTH, max(LEAST_STRENGTH, fits))
    hue = sum((a - strength * b) ** 2 for a, b in zip(away, full, strict=True))
    brightness = seen - _BRIGHTNESS_SHARE * paint - _BRIGHTNESS_ADDED
    return hue / (variance + _SPREAD**2) + brightness**2 / _BRIGHTNESS_SPREAD**2


def _brightness(colour: Colour) -> float:
    return sum(colour) / 3.0
