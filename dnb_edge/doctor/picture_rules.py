"""When a picture is fit to find cars in: facts to verdicts, nothing else.

Knows the limits and what to type. Looks at no pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.capture.picture_health import REMEDIES, PictureFault
from dnb_edge.doctor.sight import Beat
from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn

SOFT_PX, BLURRED_PX = 4.5, 7.0
"""Widths of the sharpest edges of a picture 1280 px wide from which on it is soft, and from which on cars are hard to find."""
FLICKER_WARN, FLICKER_FAIL = 0.01, 0.08
"""Amplitudes of the brightness, as a share of it."""
OVER_OTHERS = 4.0
"""A beat that is not so many times what the picture does anyway is none."""


def judge_shows(fault: PictureFault | None) -> Verdict:
    """Whether the picture shows anything."""
    if fault is None:
        return ok("not black, not white, not covered, not frozen")
    found, _, advice = REMEDIES[fault].partition(": ")
    fixes = {
        PictureFault.BLACK: "Take the lens cap off and put the light on, then type `dnb-edge doctor --only picture`.",
        PictureFault.OVEREXPOSED: "Lower `capture.exposure_us` or `capture.gain`, then type `dnb-edge doctor --only picture`.",
        PictureFault.COVERED: "Uncover the lens and turn its focus, then type `dnb-edge doctor --only picture`.",
        PictureFault.FROZEN: "Unplug the camera and plug it in again, then type `dnb-edge doctor --only picture`.",
    }
    return fail(f"{found} ({advice})", fixes[fault])


@dataclass(frozen=True, slots=True, kw_only=True)
class Sharpness:
    """How wide the sharpest edges are."""

    edge_px: float | None
    width_px: int
    """Of the picture."""
    mm_per_px: float | None
    """On the floor in the middle of the picture; None where no calibration tells."""


def judge_sharpness(sharp: Sharpness) -> Verdict:
    """Whether the lens is in focus."""
    if sharp.edge_px is None:
        return skip("the picture has too few edges to tell: lay something with print in front of the camera")
    floor = "" if sharp.mm_per_px is None else f", {sharp.edge_px * sharp.mm_per_px:.0f} mm on the floor"
    found = f"the sharpest edges are {sharp.edge_px:.1f} px wide{floor}"
    scale = max(1.0, sharp.width_px / 1280.0)
    if sharp.edge_px <= SOFT_PX * scale:
        return ok(found)
    fix = (
        "Turn the lens until the Aim page (Set up) is sharpest, or set `capture.focus` by `v4l2-ctl "
        "--list-ctrls`, and wipe the lens."
    )
    return (fail if sharp.edge_px > BLURRED_PX * scale else warn)(found, fix)


def judge_flicker(beats: Sequence[Beat]) -> Verdict:
    """Whether the lamps' flicker shows."""
    told = [beat for beat in beats if beat.share is not None]
    if not told:
        return skip("at this frame rate lamps stand still in the picture: no beat to measure")
    worst = max(told, key=lambda beat: beat.share or 0.0)
    share, over = worst.share or 0.0, worst.over_others or 0.0
    if share < FLICKER_WARN or over < OVER_OTHERS:
        hidden = [f"{beat.mains_hz} Hz" for beat in beats if beat.share is None]
        unseen = f"; lamps of {' and '.join(hidden)} stand still at this rate" if hidden else ""
        return ok(f"no beat of lamps over {100 * FLICKER_WARN:g} %{unseen}")
    found = f"the brightness beats by {100 * share:.1f} % at {worst.beat_hz:.1f} Hz, as lamps on {worst.mains_hz} Hz make it"
    fix = (
        f"Use lamps that do not flicker, or let the exposure be one whole flicker (`capture.exposure_us: "
        f"{10_000 if worst.mains_hz == 50 else 8_300}`, in which fast cars smear), or, while the camera chooses it by itself, "
        f"set `capture.power_line_hz: {worst.mains_hz}`."
    )
    return (fail if share >= FLICKER_FAIL else warn)(found, fix)


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the camera is, compared with when it was calibrated."""

    moved_m: float | None
    """How far the picture is off over the track, metres; None where it is in its place or nobody can tell."""
    is_sure: bool
    """Whether the comparison could be made."""
    limit_m: float
    """From where on laps are marked."""


def judge_place(place: Place) -> Verdict:
    """Whether the camera still stands where it was calibrated."""
    fix = "Put the camera back (`dnb-edge calibrate check` tells when it is), or calibrate again on the pages under Set up."
    if not place.is_sure:
        return warn(
            "the picture cannot be compared with that of the calibration: too much is hidden or looks otherwise", fix
        )
    if place.moved_m is not None and place.moved_m > place.limit_m:
        return fail(f"the camera has moved: the picture is off by {1e3 * place.moved_m:.1f} mm over the track", fix)
    off = "" if place.moved_m is None else f", {1e3 * place.moved_m:.1f} mm off"
    return ok(f"the camera is where it was calibrated{off}")
