"""A mount plan in words: what is wrong with it, what would be gained, what to measure.

Knows a plan and the limits of what the appliance does. Knows no terminal.
"""

from __future__ import annotations

from dnb_edge.mount.plan import MountPlan, margin_fits
from dnb_edge.view.pose import STEEPEST_DEG

WIDE_DEG = 100.0
"""Lenses wider than this bend lines so much that a pinhole is only roughly right."""

_BLUR_SHARE = 0.05
"""Of the car's length: a smear beyond this is worth a shorter exposure."""

_SMALL_CAR_PX = 22.0
"""Half the length at which the detector looks at a followed car: below, it enlarges the picture more than twice."""


def advice(plan: MountPlan) -> tuple[str, ...]:
    """Sentences, the most urgent first; empty only where there is nothing to say."""
    return tuple(
        sentence
        for rule in (_cut_off, _better, _steep, _horizon, _wide, _blur, _small, _parallax, _rolling)
        if (sentence := rule(plan)) is not None
    )


def _cut_off(plan: MountPlan) -> str | None:
    cover = plan.coverage
    if not cover.cut_off and cover.share > 1.0 - 1e-9:
        if margin_fits(plan.request, plan):
            return None
        return (
            f"The whole track is in the picture, but not the margin of {plan.request.limits.margin_m:g} m round it: a car that "
            "leaves the lane there is lost from sight."
        )
    corners = f", the corner{'s' if len(cover.cut_off) > 1 else ''} {_listed(cover.cut_off)}" if cover.cut_off else ""
    return f"{100.0 * (1.0 - cover.share):.1f} % of the track is outside the picture{corners}: a car there is not seen."


def _better(plan: MountPlan) -> str | None:
    other = plan.better
    if other is None:
        return None
    stand = other.camera.stand
    place = f"{stand.height_m:.2f} m up, {stand.pitch_deg:g} degrees down and {_place(stand.distance_m)}"
    gain = other.worst.resolution.worst_mm / plan.worst.resolution.worst_mm - 1.0
    change = f"{abs(100.0 * gain):.0f} % {'less' if gain < 0 else 'more'}"
    whole = "" if plan.coverage.share > 1.0 - 1e-9 else " the whole track would be in the picture and"
    return (
        f"Better: {place},{whole} a px would cover {other.worst.resolution.worst_mm:.2f} mm at worst instead of "
        f"{plan.worst.resolution.worst_mm:.2f} mm ({change}), a crossing's sigma be "
        f"{1e3 * other.worst.crossing_sigma_s:.1f} ms there instead of {1e3 * plan.worst.crossing_sigma_s:.1f} ms."
    )


def _steep(plan: MountPlan) -> str | None:
    if plan.camera.stand.pitch_deg <= STEEPEST_DEG:
        return None
    told = (
        f"Steeper than {STEEPEST_DEG:g} degrees the keypoints do not tell the camera's height: measure it, from the floor to "
        "the lens, and set view.camera_height_m."
    )
    if plan.gentler is None:
        return told
    stand = plan.gentler.camera.stand
    return (
        f"{told} From {stand.height_m:.2f} m at {stand.pitch_deg:g} degrees, {_place(stand.distance_m)}, they tell it; a px "
        f"then covers {plan.gentler.worst.resolution.worst_mm:.2f} mm at worst instead of "
        f"{plan.worst.resolution.worst_mm:.2f} mm."
    )


def _horizon(plan: MountPlan) -> str | None:
    above_deg = 0.5 * plan.request.optics.vfov_deg - plan.camera.stand.pitch_deg
    if above_deg <= 0:
        return None
    return f"The picture's top looks {above_deg:.0f} degrees above the horizon and shows no floor: tilt further down."


def _wide(plan: MountPlan) -> str | None:
    hfov = plan.request.optics.hfov_deg
    if hfov <= WIDE_DEG:
        return None
    return (
        f"A lens {hfov:g} degrees wide bends straight lines: the figures near the picture's rim are rough, and the lens needs "
        "calibrating (dnb-edge calibrate lens)."
    )


def _blur(plan: MountPlan) -> str | None:
    car = plan.request.car
    if plan.blur_m <= _BLUR_SHARE * car.length_m:
        return None
    allowed_ms = 1000.0 * _BLUR_SHARE * car.length_m / car.speed_mps
    return (
        f"At {car.speed_mps:g} m/s the car smears over {1000.0 * plan.blur_m:.0f} mm, {100.0 * plan.blur_m / car.length_m:.0f} "
        f"% of its length: expose for {allowed_ms:.1f} ms or less and add light."
    )


def _small(plan: MountPlan) -> str | None:
    if plan.far.car_px >= _SMALL_CAR_PX:
        return None
    return (
        f"At the far side the car is only {plan.far.car_px:.0f} px long; the detector looks at followed cars 44 px long and "
        "has to enlarge it: take more pixels (--size), a narrower lens or a place further over the track."
    )


def _parallax(plan: MountPlan) -> str | None:
    car = plan.request.car
    if plan.parallax_m < 0.005:
        return None
    return (
        f"What is {car.height_m:g} m above the floor seems up to {1000.0 * plan.parallax_m:.0f} mm further away than it is: "
        "roof markers are corrected for it (marker_height_m) once the camera's height is known."
    )


def _rolling(plan: MountPlan) -> str | None:
    if not plan.row_delay_s:
        return None
    return (
        f"Rolling shutter: rows of the track are exposed up to {1000.0 * plan.row_delay_s:.1f} ms apart. Laps over one "
        "line are not touched; sector times between lines high and low in the picture are."
    )


def _place(distance_m: float) -> str:
    if distance_m >= 0:
        return f"{distance_m:.2f} m before the near edge"
    return f"{-distance_m:.2f} m beyond the near edge, over the track"


def _listed(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
