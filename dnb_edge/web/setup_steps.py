"""How far the set-up is: the draft's track and map, and each step's state in words.

Knows the draft and what follows from it. Knows no request and no daemon.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dnb_edge.track.model import Track, crossings_of
from dnb_edge.values import Points
from dnb_edge.web.setup_draft import Draft
from dnb_edge.web.setup_keypoints import (
    FEWEST,
    KeypointsFound,
    keypoints_of,
    lane_in_camera,
    residuals_px,
    words,
)
from dnb_edge.web.setup_models import (
    KeypointsSaid,
    LineSaid,
    LoopSaid,
    PointSaid,
    SetupAnswer,
    StepSaid,
    StepState,
    TrackSaid,
)
from dnb_edge.web.setup_track import TrackFound, track_of

STEPS = {
    "aim": "Aim the camera",
    "twin": "Twin of the track",
    "route": "Route and scale",
    "keypoints": "Keypoints",
    "start": "Start line",
    "sectors": "Sectors",
    "save": "Save",
    "drive": "Test drive",
    "teach": "Teach the car",
}
_MOST_DRAWN = 600
_FEWEST_CHECKED = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Understood:
    """The draft and what follows from it."""

    draft: Draft
    track: TrackFound
    keypoints: KeypointsFound

    @property
    def metric_track(self) -> Track | None:
        """The track where its scale is known."""
        return None if self.track.scale is None else self.track.track


@lru_cache(maxsize=2)
def understood(draft: Draft, folder: Path) -> Understood:
    """Everything that follows from the draft whose pictures lie in `folder`.

    Takes seconds for a twin that is new, next to nothing for what was asked before.
    """
    track = _track(
        Draft(
            name=draft.name, twin=draft.twin, lane=draft.lane, route=draft.route, scale=draft.scale, lines=draft.lines
        ),
        folder,
    )
    metric = None if track.scale is None else track.track
    return Understood(draft=draft, track=track, keypoints=keypoints_of(draft, track.scale, metric))


@lru_cache(maxsize=2)
def _track(draft: Draft, folder: Path) -> TrackFound:
    """The track alone, which stays as it is while keypoints are clicked."""
    return track_of(draft, None if draft.twin is None else folder / draft.twin.file)


def answer(known: Understood, *, configured: bool) -> SetupAnswer:
    """All of it for a page."""
    return SetupAnswer(
        draft=known.draft,
        steps=[
            StepSaid(key=key, title=title, state=state, text=text, needs=_blocked_by(known, key, configured=configured))
            for (key, title), (state, text) in zip(STEPS.items(), _states(known, configured=configured), strict=True)
        ],
        track=_track_said(known),
        loops=[
            LoopSaid(
                letter=loop.letter,
                points_px=_pairs(_thinned(loop.points_px)),
                waypoints_px=_pairs(np.array(loop.waypoints_px)),
                length_px=round(loop.length_px, 1),
            )
            for loop in known.track.found.loops
        ],
        keypoints=_keypoints_said(known),
        configured=configured,
    )


def unready(known: Understood) -> list[str]:
    """What stands in the way of saving, in words; empty where nothing does.

    Keypoints that make a map do not, be they poor: the box times laps with it, and says that it does not score them.
    """
    steps = zip(STEPS, _needed(known), strict=False)
    mapped = known.keypoints.found is not None
    return [
        f"{STEPS[key]}: {text}"
        for key, (state, text) in steps
        if state != "done" and not (key == "keypoints" and mapped)
    ]


def _states(known: Understood, *, configured: bool) -> list[tuple[StepState, str]]:
    draft = known.draft
    saved = configured and draft.saved_revision is not None
    fresh = saved and draft.saved_revision == draft.revision
    missing = [text.partition(":")[0] for text in unready(known)]
    save: tuple[StepState, str]
    if fresh:
        save = "done", "The configuration is in place"
    elif missing:
        save = "open", f"Not ready to save. First: {', '.join(missing)}"
    else:
        save = "open", "Changed since it was saved: save again" if saved else "Ready to save"
    drive: tuple[StepState, str] = ("open", "Drive a lap and see whether the car is found" if saved else "Save first")
    return [*_needed(known), save, drive, _teach(draft)]


def _teach(draft: Draft) -> tuple[StepState, str]:
    if draft.model is None:
        return "open", "Only where the car is not found well enough"
    return "done", "A model of your own finds the car, once it is saved"


def _needed(known: Understood) -> list[tuple[StepState, str]]:
    """The states of the steps up to the sectors."""
    return [_aim(known), _twin(known), _route(known), _keypoints(known), _start(known), _sectors(known)]


def _blocked_by(known: Understood, key: str, *, configured: bool) -> list[str]:
    """The steps without which this one has nothing to show."""
    draft = known.draft
    missing = {
        "aim": draft.photo is None,
        "twin": draft.twin is None,
        "route": known.track.track is None,
        "save": not configured or draft.saved_revision is None,
    }
    needs = {
        "route": ("twin",),
        "keypoints": ("aim", "twin"),
        "start": ("route",),
        "sectors": ("route",),
        "drive": ("save",),
    }
    return [need for need in needs.get(key, ()) if missing[need]]


def _aim(known: Understood) -> tuple[StepState, str]:
    photo = known.draft.photo
    if photo is None:
        return "open", "Aim, focus, then take the picture"
    return "done", f"A picture of {photo.width_px} × {photo.height_px} px is taken"


def _twin(known: Understood) -> tuple[StepState, str]:
    twin = known.draft.twin
    if twin is None:
        return "open", "Give a drawing of the track from straight above, or flatten the camera's picture"
    return "done", f"{twin.width_px} × {twin.height_px} px"


def _route(known: Understood) -> tuple[StepState, str]:
    found, draft = known.track.found, known.draft
    if draft.twin is None:
        return "open", "Needs the twin first"
    if draft.lane is None:
        return "open", "Tap the lane, or have it found by its shade"
    if found.fault is not None:
        return "wrong", _sentence(found.fault)
    if known.track.scale is None:
        return "open", "The route is found: give its scale, one length that you measured"
    assert known.track.track is not None, "a route without a fault makes a track"
    length_m = known.track.track.centreline.length_m
    if not 0.2 <= length_m <= 2000.0:
        return "wrong", f"The route would be {length_m:.3g} m long: check the scale"
    return "done", f"{'A lap' if draft.route.closed else 'A route'} of {length_m:.2f} m"


def _keypoints(known: Understood) -> tuple[StepState, str]:
    draft, keypoints = known.draft, known.keypoints
    if draft.photo is None or draft.twin is None:
        return "open", "Needs the camera's picture and the twin first"
    half = [pair.name for pair in draft.pairs if (pair.camera_px is None) != (pair.twin_px is None)]
    whole = sum(pair.camera_px is not None and pair.twin_px is not None for pair in draft.pairs)
    if keypoints.fault is not None:
        return "wrong", _sentence(keypoints.fault)
    if whole < FEWEST:
        return (
            "open",
            f"{whole} of at least {FEWEST} pairs are clicked, better {_FEWEST_CHECKED} to 12 all round the track",
        )
    if half:
        return "open", f"Keypoint {half[0]} is clicked on one side only: click its other side, or delete it"
    assert keypoints.found is not None, "pairs without a fault make a map"
    fit = keypoints.found.fit
    if fit.outliers:
        return "wrong", f"Keypoint {fit.outliers[0].name} contradicts the others: click it anew, or delete it"
    if fit.suspects:
        return "wrong", f"One of the keypoints {', '.join(fit.suspects)} is wrong: click them anew, or add one"
    if keypoints.over_limit is not None:
        return "wrong", _sentence(keypoints.over_limit)
    error = fit.calibration.error
    mean = f"{error.mean_px:.1f} twin px" if known.track.scale is None else f"{1000 * (error.mean_m or 0.0):.1f} mm"
    return "done", f"{whole} pairs, {mean} apart on average"


def _start(known: Understood) -> tuple[StepState, str]:
    if known.track.track is None:
        return "open", "Needs the route first"
    lines = known.draft.lines
    if known.track.line_fault is not None:
        return "wrong", _sentence(known.track.line_fault)
    if lines.start_px is None and known.draft.route.closed:
        return "open", "Drag the line to where laps start, and check the arrow: that way cars drive"
    return "done", "Crossed once a lap" + ("" if lines.finish_px is None else ", with a finish line of its own")


def _sectors(known: Understood) -> tuple[StepState, str]:
    if known.track.sector_fault is not None:
        return "wrong", _sentence(known.track.sector_fault)
    count = len(known.draft.lines.sectors_px)
    return "done", f"{count} sector line{'s' if count > 1 else ''}" if count else "None: laps have no split times"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _track_said(known: Understood) -> TrackSaid | None:
    found, track = known.track, known.track.track
    if track is None or found.found.route is None:
        return None
    line, scale = track.centreline, track.scale
    route = found.found.route
    width_px = float(np.median(route.half_left_px + route.half_right_px))
    metres_per_px = None if found.scale is None else found.scale.metres_per_px

    def side(offset_m: NDArray[np.float64]) -> list[tuple[float, float]]:
        chosen = range(0, len(line.points_m), max(1, len(line.points_m) // _MOST_DRAWN))
        at_m = np.array([line.point_at(float(line.s_m[k]), float(offset_m[k])) for k in chosen])
        return _pairs(scale.to_twin_px(at_m))

    return TrackSaid(
        middle_px=side(np.zeros(len(line.points_m))),
        left_px=side(line.half_left_m),
        right_px=side(-line.half_right_m),
        closed=line.closed,
        lines=_lines_said(track),
        length_px=route.length_px,
        lane_width_px=width_px,
        metres_per_px=metres_per_px,
        length_m=None if metres_per_px is None else line.length_m,
        lane_width_m=None if metres_per_px is None else width_px * metres_per_px,
    )


def _lines_said(track: Track) -> list[LineSaid]:
    said = []
    for line in track.lines:
        start, end = np.round(track.scale.to_twin_px(np.array([line.start_m, line.end_m])), 2).tolist()
        crossed = crossings_of(track.centreline, line)
        said.append(
            LineSaid(
                name=line.name,
                ends_px=((start[0], start[1]), (end[0], end[1])),
                s_m=crossed[0][0] if crossed else None,
            )
        )
    return said


def _keypoints_said(known: Understood) -> KeypointsSaid:
    keypoints = known.keypoints
    if keypoints.found is None or keypoints.pairs is None:
        names = () if keypoints.pairs is None else keypoints.pairs.names
        return KeypointsSaid(
            points=[
                PointSaid(
                    name=name,
                    state="swapped" if name in keypoints.swapped else "good",
                    error_px=None,
                    error_mm=None,
                    put_px=None,
                )
                for name in names
            ],
            fault=None if keypoints.fault is None else _sentence(keypoints.fault),
            swapped=list(keypoints.swapped),
        )
    found, pairs = keypoints.found, keypoints.pairs
    fit, plain = found.fit, found.plain
    mm_per_px = None if known.track.scale is None else 1000.0 * known.track.scale.metres_per_px
    outliers = {outlier.name for outlier in fit.outliers}
    put_px = residuals_px(found, pairs).tolist()
    per_unit = 1000.0 if mm_per_px is not None else 1.0
    middle, most = (np.percentile(found.sigmas_m, [50, 95]) * per_unit).tolist()
    likely_m = fit.calibration.error.mean_m
    track = known.metric_track

    def millimetres(error_px: float | None) -> float | None:
        return None if mm_per_px is None or error_px is None else error_px * mm_per_px

    return KeypointsSaid(
        points=[
            PointSaid(
                name=name,
                state="wrong" if name in outliers else "suspect" if name in fit.suspects else "good",
                error_px=error_px,
                error_mm=millimetres(error_px),
                put_px=(put[0], put[1]),
            )
            for name, error_px, put in zip(pairs.names, plain.per_point_px, put_px, strict=True)
        ],
        fault=None,
        swapped=[],
        mean_px=plain.mean_px,
        max_px=plain.max_px,
        leave_one_out_px=plain.leave_one_out_mean_px,
        mean_mm=millimetres(plain.mean_px),
        leave_one_out_mm=millimetres(plain.leave_one_out_mean_px),
        likely_mean_mm=None if mm_per_px is None or likely_m is None else 1000.0 * likely_m,
        sigma_p50=middle,
        sigma_p95=most,
        sigma_unit="mm" if mm_per_px is not None else "twin px",
        over_limit=None if keypoints.over_limit is None else _sentence(keypoints.over_limit),
        notes=list(words(found.notes)),
        advice=list(words(found.advice)),
        camera_to_twin=list(fit.calibration.ground.camera_to_twin),
        lane_camera_px=[] if track is None else [list(way) for way in lane_in_camera(fit.calibration.ground, track)],
    )


def _thinned(points: Points) -> Points:
    return np.asarray(points[:: max(1, len(points) // _MOST_DRAWN)])


def _pairs(points: Points) -> list[tuple[float, float]]:
    return [(round(u, 2), round(v, 2)) for u, v in points.tolist()]
