"""One drive watched by the appliance's rooms: what they told, and what was true.

Two ways lead to detections: drawn from a model (`sightings`), or rendered frames through the shipped detector with the core's
search windows, as the daemon's loop does it. The core is the same. Knows drives, frames and events; knows no figures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from heapq import merge

from dnb_edge.capture.picture_health import PictureJudge
from dnb_edge.core import Core
from dnb_edge.sim.driver import Drive, drive
from dnb_edge.sim.places import first_s
from dnb_edge.sim.rig import Rig
from dnb_edge.truth.cameras import all_moments, sighted_by_all
from dnb_edge.truth.course import Course, course
from dnb_edge.truth.scenarios import Scenario
from dnb_edge.truth.sightings import Moments, kept_frames, moments, sighted
from dnb_edge.values import Event, FrameDetections
from dnb_edge.view.drift import DriftWatch
from dnb_edge.view.drift_judge import watched_track


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watched:
    """A drive, and all that was told of it."""

    course: Course
    crossings_s: tuple[float, ...]
    """True instants of the crossings of the start line, seconds on the stamps' clock."""
    at: Moments
    lap_m: float
    along_m: tuple[float, ...]
    """True distance along the drive, for each of `at`'s frames."""
    true_paths_m: tuple[tuple[tuple[float, float], ...], ...]
    """Each lap's true way, track m, densely, from crossing to crossing."""
    events: tuple[Event, ...]
    frames: int
    """How many frames came."""


PATH_STEP_S = 0.005


def watch(scenario: Scenario, *, laps: int, seed: int, number: int) -> Watched:
    """Drive `number` of `scenario`, of so many laps, watched from its first frame to its last."""
    drive_seed, noise_seed = scenario.drive_seed(seed, number), scenario.noise_seed(seed, number)
    # Drawn errors have no part that lasts, unless the model says so: then nobody told the appliance.
    here = course(
        scenario.place,
        scenario.sightings.stamp_sigma_s,
        lasting_share=None if scenario.rendered else 0.0,
        clicked_px=scenario.clicked_px,
    )
    style = scenario.styles[number % len(scenario.styles)]
    circuit, camera, lap_m = here.place.circuit, here.place.camera, here.place.circuit.centreline.length_m
    driven = drive(circuit, laps=laps, seed=drive_seed, style=style)
    if here.place.further:
        return _watched_by_all(here, scenario, driven, drive_seed=drive_seed, noise_seed=noise_seed)
    at = moments(driven, fps=scenario.fps, stamp_sigma_s=scenario.sightings.stamp_sigma_s, seed=noise_seed)
    kept = kept_frames(
        scenario.sightings, frames=len(at.t_s), fps=scenario.fps, crossings_s=driven.crossings_s, seed=noise_seed
    )
    if scenario.rendered:
        rig = Rig(seed=drive_seed, fps=scenario.fps, laps=laps, place=here.place, style=style, scenery=scenario.scenery)
        events = _rendered(here, rig, at, [k for k, is_kept in enumerate(kept.tolist()) if is_kept])
    else:
        found = sighted(driven, camera, at, scenario.sightings, lap_m=lap_m, kept=kept, seed=noise_seed)
        events = told(here, found)
    return _watched(here, driven, at, events, frames=int(kept.sum()))


def _watched(here: Course, driven: Drive, at: Moments, events: tuple[Event, ...], *, frames: int) -> Watched:
    return Watched(
        course=here,
        crossings_s=driven.crossings_s,
        at=at,
        lap_m=driven.circuit.centreline.length_m,
        along_m=tuple(driven.along_m(at.t_s).tolist()),
        true_paths_m=tuple(driven.path_m(k, PATH_STEP_S) for k in range(driven.laps)),
        events=events,
        frames=frames,
    )


def _watched_by_all(here: Course, scenario: Scenario, driven: Drive, *, drive_seed: int, noise_seed: int) -> Watched:
    """The same where several cameras share the track: each finds what its own picture shows."""
    cameras, fps = here.place.cameras, scenario.fps
    if scenario.rendered:
        core = Core(here.setup)
        rigs = [
            Rig(
                seed=drive_seed,
                fps=fps,
                laps=driven.laps,
                place=replace(here.place, camera=camera, further=()),
                style=scenario.styles[0],
                scenery=scenario.scenery,
            )
            for camera in cameras
        ]
        found = _found_by_all(here, core, rigs)
        events = tuple(event for one in found for event in core.step(one)) + tuple(core.finish())
    else:
        found = sighted_by_all(
            driven,
            cameras,
            scenario.sightings,
            fps=fps,
            lap_m=driven.circuit.centreline.length_m,
            crossings_s=driven.crossings_s,
            seed=noise_seed,
        )
        events = told(here, found)
    at = all_moments(driven, len(cameras), fps=fps)
    return _watched(here, driven, at, events, frames=len(at.t_ns))


def _found_by_all(here: Course, core: Core, rigs: Sequence[Rig]) -> Iterator[FrameDetections]:
    """Each frame's detections, in the order of stamps, looked for where `core` expects the car by then."""
    detectors = [here.detector(number) for number in range(len(rigs))]
    due = merge(
        *(
            [(rig.t_ns(k) + round(first_s(number, rig.fps) * 1e9), number, k) for k in range(rig.frames - 1)]
            for number, rig in enumerate(rigs)
        )
    )
    for t_ns, number, k in due:
        if not core.is_awaited(t_ns, number):
            yield FrameDetections(sequence=k, t_ns=t_ns, detections=(), full_frame=False, camera=number)
            continue
        picture = rigs[number].frame_at(t_ns, k).bgr
        assert picture is not None
        windows = core.windows(t_ns, number)
        found = detectors[number].detect(picture, sequence=k, t_ns=t_ns, windows=windows)
        yield replace(found, camera=number)


def told(here: Course, found: Iterator[FrameDetections]) -> tuple[Event, ...]:
    """All that the core says of detections, to its end."""
    core = Core(here.setup)
    events = [event for frame in found for event in core.step(frame)]
    return (*events, *core.finish())


def _rendered(here: Course, rig: Rig, at: Moments, numbers: list[int]) -> tuple[Event, ...]:
    """The daemon's loop without its threads: picture, judge of pictures, drift watch, detector, core."""
    core, detector, judge = Core(here.setup), here.detector(), PictureJudge(live=False)
    drift = DriftWatch(watched_track(here.setup.ground, here.setup.track.centreline.points_m))
    events: list[Event] = []
    for number in numbers:
        t_ns = int(at.t_ns[number])
        picture = rig.frame(number).bgr
        assert picture is not None
        judge.look(picture, t_ns)
        if judge.shows_something:
            drift.look(picture, t_ns)
            windows = core.windows(t_ns)
            found = detector.detect(picture, sequence=number, t_ns=t_ns, windows=windows)
        else:
            found = FrameDetections(sequence=number, t_ns=t_ns, detections=(), full_frame=False)
        events += core.step(replace(found, view_moved_m=drift.moved_m))
    return (*events, *core.finish())
