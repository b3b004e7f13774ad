"""What a picture tells of the lens and of the lamps: how wide its sharpest edges are, how much it flickers.

Pure: arrays in, numbers out. Knows no camera and no limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

REACH_PX = 7
"""An edge's height is the range of levels so far to both sides of it: edges to about 12 px wide are measured."""
LEAST_STEP = 40.0
"""Levels, 0..255, that an edge must span to be measured: noise and soft shadows do not."""
FEWEST_EDGES = 200
_SHARPEST_PERCENT = 20.0
"""Of all edges, since many things in a picture are soft by themselves."""

LAMP_HZ = {50: 100.0, 60: 120.0}
"""Lamps go bright and dark twice in each period of the mains."""
_OTHER_HZ = np.arange(1.7, 14.0, 0.37)
"""Where no lamp is, for comparison, Hz."""
_STILL_HZ = 0.75
"""A beat slower than this, Hz, cannot be told from the scene in two seconds."""


def edge_width_px(picture: NDArray[np.uint8]) -> float | None:
    """How wide the sharpest edges of a grey picture (h, w) are, px; None where it has too few edges to tell.

    An edge's width is its height in levels over its steepest slope, with the slope taken across two px: 2 for a perfect step,
    2.5 s for one that was blurred by a Gaussian of s px. The value is the one that a fifth of the edges stay below.
    """
    levels = picture.astype(np.float32)
    widths = np.concatenate([_widths(levels), _widths(np.ascontiguousarray(levels.T))])
    return float(np.percentile(widths, _SHARPEST_PERCENT)) if len(widths) >= FEWEST_EDGES else None


def _widths(levels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Widths of the edges across rows, px."""
    slope = np.abs(levels[:, 2:] - levels[:, :-2]) / 2.0
    slope = np.pad(slope, ((0, 0), (1, 1)))
    along = np.ones((1, 2 * REACH_PX + 1), dtype=np.uint8)
    step = cv2.dilate(levels, along) - cv2.erode(levels, along)
    crest = slope >= cv2.dilate(slope, np.ones((1, 2 * REACH_PX + 1), dtype=np.uint8))
    chosen = crest & (step >= LEAST_STEP) & (slope > 0)
    return np.asarray(step[chosen] / slope[chosen], dtype=np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat:
    """How much the picture's brightness beats with the lamps of one mains frequency."""

    mains_hz: int
    beat_hz: float
    """The slow beat that the camera makes of it."""
    share: float | None
    """Amplitude as a share of the brightness; None where the beat is too slow to be told from a still picture."""
    over_others: float | None
    """How many times as strong it is as what the picture does at other frequencies."""


def lamp_beats(brightness: Sequence[tuple[int, NDArray[np.float64]]], fps: float) -> tuple[Beat, ...]:
    """The beats of 50 and 60 Hz lamps in rows' brightness (stamp in ns, (rows,)) of frames at about `fps`.

    Each row's course is projected on the lamp's own frequency at the frames' stamps, so it does not matter which slow beat the
    camera makes of it, nor that a rolling shutter sees the lamp at another phase in each row: the amplitude is the root of the
    rows' mean square.
    """
    t_s = np.array([t_ns for t_ns, _ in brightness], dtype=np.float64) * 1e-9
    rows = np.array([row for _, row in brightness])
    level = rows.mean(axis=0)
    lit = level > 8.0
    changes = (rows[:, lit] - level[lit]) / level[lit] if lit.any() else np.zeros((len(rows), 1))
    # What drives by and what the exposure does are slow; the whole picture's trend goes first.
    centred = t_s - t_s.mean()
    changes = changes - np.outer(centred, centred @ changes / max(float(centred @ centred), 1e-12))
    others = float(np.median([_amplitude(changes, t_s, float(hz)) for hz in _OTHER_HZ]))
    beats = []
    for mains_hz, lamp_hz in LAMP_HZ.items():
        beat_hz = abs(lamp_hz - round(lamp_hz / fps) * fps)
        if beat_hz < _STILL_HZ:
            beats.append(Beat(mains_hz=mains_hz, beat_hz=beat_hz, share=None, over_others=None))
            continue
        share = _amplitude(changes, t_s, lamp_hz)
        beats.append(Beat(mains_hz=mains_hz, beat_hz=beat_hz, share=share, over_others=share / max(others, 1e-6)))
    return tuple(beats)


def _amplitude(changes: NDArray[np.float64], t_s: NDArray[np.float64], hz: float) -> float:
    """Amplitude of `changes` (frames, rows) at `hz`, the root of the rows' mean square."""
    turned = np.exp(-2j * np.pi * hz * (t_s - t_s[0]))
    return float(2.0 * np.sqrt(np.mean(np.abs(turned @ changes / len(t_s)) ** 2)))
