"""What is driven and watched for the certificate, scenario by scenario, and which figures each must reach.

Knows speeds, rates, disturbances and limits. Knows nothing of how they are measured. Every drive's seed follows from the
campaign's seed and the scenario's `drives`, so that scenarios which share `drives` see the very same laps.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from dnb_edge.sim.disturb import Disturbance
from dnb_edge.sim.driver import Style
from dnb_edge.sim.rig import Scenery
from dnb_edge.truth.sightings import Sightings


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A figure of a scenario and the bounds within which it must lie, both included."""

    figure: str
    """Name of a member of the scenario's figures; its size counts, not its sign."""
    most: float
    least: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Some drives under one set of conditions."""

    name: str
    title: str
    place: str
    fps: float
    styles: tuple[Style, ...]
    """Drive number k is driven in style k, beginning again at the end."""
    rendered: bool = False
    """True: rendered frames through the shipped detector; False: detections drawn from the model `sightings`."""
    sightings: Sightings = field(default_factory=Sightings)
    """Of a rendered scenario only what becomes of its frames counts: `dropped`, `gap_frames`, `stamp_sigma_s`."""
    scenery: Scenery = field(default_factory=Scenery)
    share: float = 1.0
    """Share of the campaign's laps that it gets."""
    laps_per_drive: int = 25
    drives: str = ""
    """Scenarios of one word here see the same drives; empty for drives of its own."""
    limits: tuple[Limit, ...] = ()
    clicked_px: float = 0.0
    """Error of each keypoint of the calibration, one standard deviation, camera px."""
    sweep: bool = False
    """True where it is one point of the table of speeds and rates."""

    @property
    def kind(self) -> str:
        """How its detections come about."""
        return "rendered" if self.rendered else "fast"

    def drive_seed(self, seed: int, number: int) -> int:
        """Seed of drive `number`, from 0."""
        return _seed(seed, self.drives or self.name, number)

    def noise_seed(self, seed: int, number: int) -> int:
        """Seed of all else in that drive."""
        return _seed(seed, self.name + "/noise", number)


def _seed(seed: int, name: str, number: int) -> int:
    (state,) = np.random.SeedSequence([seed, zlib.crc32(name.encode()), number]).generate_state(1).tolist()
    return int(state)


_PACE = (0.94, 1.08)
_COVERAGE = Limit(figure="coverage_percent", least=93.0, most=97.0)
_ALL_TOLD = (Limit(figure="missed", most=0.0), Limit(figure="phantom", most=0.0))


def steady(speed_mps: float) -> tuple[Style, ...]:
    """The same speed everywhere, another pace each lap; tidy, middling and loose across the lane.

    Of all three: a detector errs alike where a car drives alike, so more cancels between a tidy car's crossings than between
    those of a loose one.
    """
    return tuple(
        Style(top_mps=speed_mps, lowest_mps=speed_mps, pace=_PACE, wander=wander) for wander in (0.6, 1.4, 2.4)
    )


def by_curvature(top_mps: float, lateral_mps2: float, *, wander: float = 1.0) -> Style:
    """Slower in bends; `lateral_mps2` is the acceleration to the side that is dared in them."""
    return Style(
        top_mps=top_mps,
        lowest_mps=min(0.5, top_mps),
        lateral_mps2=lateral_mps2,
        braking_m=0.3,
        pace=(0.9, 1.06),
        wander=wander,
        run_up_m=max(1.1, 0.9 * top_mps),
    )


_FIGURE_LAPS: tuple[tuple[str, str, float, float, Limit, tuple[Limit, ...]], ...] = (
    ("30fps-1mps", "30 fps, 1 m/s and a little more", 30.0, 1.06, Limit(figure="p95_ms", most=4.0),
     (Limit(figure="bias_ms", most=0.5),)),
    ("60fps-1mps", "60 fps, 1 m/s and a little more", 60.0, 1.06, Limit(figure="p95_ms", most=2.5), ()),
    ("30fps-0.5mps", "30 fps, 0.5 m/s", 30.0, 0.5, Limit(figure="p95_ms", most=10.0), ()),
)  # fmt: skip


def _figures() -> Iterator[Scenario]:
    """The figures that the certificate is about, once fast and once rendered."""
    for name, title, fps, speed_mps, p95, more in _FIGURE_LAPS:
        limits = (*more, p95, _COVERAGE, *_ALL_TOLD)
        fast = Scenario(name=name, title=title, place="demo-paper", fps=fps, styles=steady(speed_mps), limits=limits)
        yield fast
        yield replace(
            fast,
            name=name + "-rendered",
            title=title + ", rendered, short laps",
            place="table-paper",
            rendered=True,
            laps_per_drive=10,
            share=1.0,
        )


def _conditions() -> Iterator[Scenario]:
    """One thing made worse at a time, and the other tracks.

    On the table a car comes to the line out of a bend: to the fit that is an unruly car, though it is the same bend every lap.
    """
    base = Scenario(
        name="",
        title="",
        place="table-paper",
        fps=30.0,
        styles=steady(1.06),
        limits=(_COVERAGE, *_ALL_TOLD),
        share=0.4,
    )
    lossy = Sightings(dropped=0.1, gap_frames=3)
    yield replace(
        base, name="drops-and-gap", title="10 % of frames dropped, 3-frame gap at the line", sightings=lossy, share=1.0,
        limits=(Limit(figure="bias_ms", most=2.0), Limit(figure="crossing_bias_ms", most=2.0), *_ALL_TOLD),
    )  # fmt: skip
    yield replace(base, name="short-laps", title="short laps, the line right behind a bend")
    yield replace(base, name="noise-2px", title="detector's error 2 px", sightings=Sightings(sigma_px=2.0))
    yield replace(
        base, name="place-error", title="error that follows from the place, 1 px",
        sightings=Sightings(sigma_px=0.5, place_px=1.0), limits=_ALL_TOLD,
    )  # fmt: skip
    yield replace(
        base, name="lasting-error", title="error that lasts 0.15 s, 0.6 px, beside 0.4 px white",
        sightings=Sightings(sigma_px=0.4, memory_px=0.6), limits=_ALL_TOLD,
    )  # fmt: skip
    yield replace(
        base, name="false-finds", title="2 % false finds, a car beside the lane, 5 % not found",
        place="demo", styles=(by_curvature(1.6, 2.0),),
        sightings=Sightings(false_rate=0.02, bystander_m=(2.3, 0.85), missed=0.05),
        share=0.2, limits=_ALL_TOLD,
    )  # fmt: skip
    yield replace(
        base, name="hidden", title="0.6 m of the track hidden", place="demo", styles=(by_curvature(1.6, 2.0),),
        sightings=Sightings(hidden_m=(3.0, 3.6)), share=0.2, limits=_ALL_TOLD,
    )  # fmt: skip
    yield replace(
        base, name="stamps-2ms", title="stamps off by 2 ms, and said so", sightings=Sightings(stamp_sigma_s=0.002)
    )
    yield replace(
        base, name="demo-paper", title="demo track, the paper's camera, speed by curvature", place="demo-paper",
        styles=(by_curvature(1.6, 2.0), by_curvature(1.2, 1.5)), share=0.3,
    )  # fmt: skip
    yield replace(
        base,
        name="eight",
        title="figure of eight, speed by curvature",
        place="eight",
        styles=(by_curvature(1.8, 2.5),),
        share=0.3,
    )
    yield replace(
        base,
        name="hairpin-3mps",
        title="hairpin, up to 3 m/s",
        place="hairpin",
        styles=(by_curvature(3.0, 4.0),),
        share=0.2,
    )


def _score() -> Iterator[Scenario]:
    """The same laps at several rates and with drops: what becomes of the score."""
    limits = (Limit(figure="score_max_points", most=0.5), *_ALL_TOLD)
    styles = (by_curvature(1.4, 1.8, wander=0.7), by_curvature(1.6, 2.2, wander=2.0))
    base = Scenario(
        name="",
        title="",
        place="demo",
        fps=30.0,
        styles=styles,
        laps_per_drive=10,
        drives="score",
        share=0.1,
        limits=limits,
    )
    for fps in (15.0, 30.0, 60.0):
        yield replace(base, name=f"score-{fps:g}fps", title=f"score at {fps:g} fps", fps=fps)
    yield replace(
        base, name="score-drops", title="score at 30 fps, 10 % of frames dropped", sightings=Sightings(dropped=0.1)
    )


HALL, HALL_WIDE = "hall", "hall-wide"
"""The scenarios of a track under two cameras, and of the same laps under one with pixels as fine."""


def _hall() -> Iterator[Scenario]:
    """A track larger than one view. Both cameras see the line: nowhere does it matter more that no two maps agree."""
    base = Scenario(
        name=HALL, title="5 m track, one target handed over between two cameras", place="hall", fps=30.0,
        styles=steady(1.06), clicked_px=1.0, share=0.3, drives="hall", limits=_ALL_TOLD,
    )  # fmt: skip
    wide = replace(base, name=HALL_WIDE, title="the same laps under one camera", place="hall-wide")
    for one in (base, wide):
        yield one
        yield replace(
            one, name=one.name + "-rendered", title=one.title + ", rendered", rendered=True, laps_per_drive=5,
            share=0.1, limits=_ALL_TOLD,
        )  # fmt: skip


DRIVERS = ("driver-1", "driver-2", "driver-3", "driver-4")
"""The scenarios of the paper's four drivers, in the paper's order: slow and tidy to fast and loose."""


def _drivers() -> Iterator[Scenario]:
    words = ("slow and tidy", "brisker, less tidy", "fast, loose", "fastest, loosest")
    # The paper's completion times are as 67.5 : 53.4 : 42.9 : 34.7.
    for name, word, pace, wander in zip(DRIVERS, words, (1.0, 1.264, 1.573, 1.945), (0.8, 1.5, 2.3, 3.2), strict=True):
        yield Scenario(
            name=name,
            title=f"driver {name[-1]}: {word}",
            place="demo-paper",
            fps=30.0,
            styles=(by_curvature(0.75 * pace, 0.8 * pace**2, wander=wander),),
            laps_per_drive=5,
            # All four drive by the same draws: only their style tells them apart.
            drives="drivers",
            share=0.1,
            limits=_ALL_TOLD,
        )


def _sweep() -> Iterator[Scenario]:
    """Error over speed and rate."""
    for fps in (15.0, 30.0, 60.0):
        for speed in (0.3, 0.5, 1.0, 2.0, 3.0):
            fast = speed > 1.0
            yield Scenario(
                name=f"sweep-{speed:g}mps-{fps:g}fps",
                title=f"{speed:g} m/s at {fps:g} fps",
                place="hairpin" if fast else "table-paper",
                fps=fps,
                styles=(by_curvature(speed, 4.0),) if fast else steady(speed),
                share=0.1,
                drives=f"sweep-{speed:g}",
                sweep=True,
            )


def _rendered_conditions() -> Iterator[Scenario]:
    """Light, noise and things in the picture, through the real detector."""
    base = Scenario(
        name="", title="", place="table-paper", fps=30.0, styles=steady(1.06), rendered=True, laps_per_drive=10, share=0.2,
        limits=_ALL_TOLD,
    )  # fmt: skip
    lights = Scenery(disturbance=Disturbance(ramp=0.35, flicker=0.04))
    yield replace(base, name="light-rendered", title="light that falls by a third, lamps that flicker", scenery=lights)
    noisy = Scenery(disturbance=Disturbance(noise_sigma=8.0))
    yield replace(base, name="noise-rendered", title="a noisy sensor", scenery=noisy)
    hands = Scenery(disturbance=Disturbance(hands=0.6))
    yield replace(
        base, name="hand-rendered", title="a hand in the picture, also over the car", scenery=hands, limits=_ALL_TOLD
    )
    lossy = Sightings(dropped=0.1, gap_frames=3)
    yield replace(base, name="drops-rendered", title="10 % of frames dropped, 3-frame gap at the line", sightings=lossy)
    yield replace(
        base, name="demo-rendered", title="demo track under its mast, speed by curvature", place="demo",
        styles=(by_curvature(1.45, 2.0),), laps_per_drive=5, share=0.15,
    )  # fmt: skip
    yield replace(
        base, name="eight-rendered", title="figure of eight, speed by curvature", place="eight",
        styles=(by_curvature(1.8, 2.5),), laps_per_drive=5, share=0.1,
    )  # fmt: skip


def catalogue() -> tuple[Scenario, ...]:
    """All scenarios, in the certificate's order; no two of one name."""
    every = (*_figures(), *_conditions(), *_rendered_conditions(), *_score(), *_drivers(), *_hall(), *_sweep())
    names = [scenario.name for scenario in every]
    assert len(set(names)) == len(names), "a scenario's name is its results' file name"
    return every
