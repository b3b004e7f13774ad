"""Lamps that flicker are told while the camera is aimed."""

from __future__ import annotations

import numpy as np
import pytest

from dnb_edge.live.messages import Picture
from dnb_edge.web.setup_flicker import FEWEST, FlickerWatch

FRAME_NS = 33_333_333


def seen(watch: FlickerWatch, *, lamp_hz: float, depth: float, every: tuple[int, ...], count: int = 30) -> str | None:
    """What is said after `count` pictures of a floor under such lamps, `every` so many frames; a rolling shutter of 20 ms."""
    rng = np.random.default_rng(1)
    said, frame = None, 0
    for number in range(count):
        t_ns = 10**9 + frame * FRAME_NS
        rows_s = t_ns * 1e-9 + np.linspace(0.0, 0.02, 72)
        light = 120.0 * (1.0 + depth * np.sin(2 * np.pi * lamp_hz * rows_s))
        image = np.clip(light[:, None, None] + rng.normal(0.0, 2.0, (72, 96, 3)), 0, 255).astype(np.uint8)
        said = watch.look(Picture(t_ns=t_ns, frame=frame, width_px=96, height_px=72, jpeg=b""), image)
        frame += every[number % len(every)]
    return said


@pytest.mark.parametrize(
    ("lamp_hz", "depth", "every", "words"),
    [
        (100.0, 0.05, (4,), "50 Hz"),
        (120.0, 0.05, (4, 5), None),  # four beats a frame: at 30 a second 60 Hz lamps stand still
        (100.0, 0.0, (4,), None),
        (100.0, 0.05, (3,), None),  # each third frame sees a lamp of 50 Hz at one phase: it cannot be told
        (100.0, 0.05, (3, 4), "50 Hz"),
    ],
)
def test_lamps_are_told_by_their_frequency(
    lamp_hz: float, depth: float, every: tuple[int, ...], words: str | None
) -> None:
    """A flicker of 5 % is named with what to set, steady light is not, nor what the pictures' moments cannot tell."""
    said = seen(FlickerWatch(), lamp_hz=lamp_hz, depth=depth, every=every)
    assert (said is None) if words is None else (said is not None and words in said and "10000 µs" in said), said


def test_too_few_pictures_and_pictures_of_another_time_tell_nothing() -> None:
    """Before enough were seen, and after a gap, nothing is said; a picture that is looked at twice counts once."""
    watch = FlickerWatch()
    assert seen(watch, lamp_hz=100.0, depth=0.05, every=(4,), count=FEWEST - 1) is None
    assert seen(FlickerWatch(), lamp_hz=100.0, depth=0.05, every=(0,)) is None
    assert seen(watch, lamp_hz=100.0, depth=0.05, every=(120,)) is None
