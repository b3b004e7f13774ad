"""When the set-up is fit to race with: configuration, track, calibration, model, detector. Facts to verdicts, nothing else.

Knows the limits and what to type. Reads no file.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn

OLD_DAYS = 60.0
ERROR_WARN_M = 0.02
"""Mean calibration error, metres, where the configuration sets no limit."""
BUSY_SHARE = 0.7
"""Share of a frame's time that decoding and detection may take."""
MOST_FRAMES_A_LOOK = 3.0
"""While a car is looked for, a frame may take so many frames' time: those between are thrown away."""
LOST_WARN, LOST_FAIL = 0.01, 0.2
"""Shares of the frames that a running race may throw away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupState:
    """What of a set-up is there."""

    config: Path | None
    wanted: Path
    """Where the system's configuration would be."""
    setup: Path
    draft: Path | None
    """A set-up that was begun on the pages and not saved."""


def judge_set_up(state: SetupState) -> Verdict:
    """Whether a track is set up."""
    pages = "Open http://" + "NAME.local:8080/setup (NAME is what `hostname` says)"
    if state.config is None:
        begun = " (begun on the pages, not saved)" if state.draft is not None else ""
        return fail(
            f"no track is set up{begun}: neither {state.wanted} nor {state.setup}/dnb-edge.yaml is there",
            f"{pages} and go through its steps, or look at one with `dnb-edge doctor --config FILE`.",
        )
    return ok(f"{state.config}")


def judge_config(fault: str | None) -> Verdict:
    """Whether the configuration is right."""
    if fault is None:
        return ok("right, and names a source, a detector and a display that there are")
    return fail(fault, "Mend the line that is named, then type `dnb-edge config check FILE`.")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackFound:
    """What became of the track's files."""

    fault: str | None
    name: str
    length_m: float | None


def judge_track(track: TrackFound) -> Verdict:
    """Whether the track's files make a route."""
    if track.fault is not None:
        return fail(
            track.fault,
            "Mend what is named, or make the track again with `dnb-edge track build --out FILE`, or under Set up.",
        )
    length = "" if track.length_m is None else f", {track.length_m:.2f} m round"
    return ok(f"{track.name}{length}")


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationFound:
    """What is known of how the camera's pixels map to the floor."""

    fault: str | None
    method: str = ""
    """`keypoints`, `markers` or `refined`."""
    mean_m: float | None = None
    """Mean error at the points that it was made from, metres."""
    sigma_m: float | None = None
    """One sigma of a place on the route where it is greatest, metres."""
    too_bad: str | None = None
    """Why laps are not scored with it, by the configuration's own limit."""
    doubt: str | None = None
    """Why keypoints cannot be what they are said to be, whatever their error: swapped, mirrored."""
    age_days: float | None = None


_ANEW = "Calibrate again under Set up on the pages, or with `dnb-edge calibrate keypoints --out FILE`."


def judge_calibration(found: CalibrationFound) -> Verdict:
    """Whether the calibration is there, for this camera and this track, and good enough."""
    if found.fault is not None:
        return fail(found.fault, _ANEW)
    error = "" if found.mean_m is None else f", {1e3 * found.mean_m:.1f} mm off on average"
    sigma = "" if found.sigma_m is None else f", one sigma at worst {1e3 * found.sigma_m:.1f} mm"
    words = f"by {found.method}{error}{sigma}"
    if found.doubt is not None:
        return fail(f"{words}: {found.doubt}", _ANEW)
    if found.too_bad is not None:
        return fail(f"{words}: {found.too_bad}", _ANEW)
    if found.mean_m is not None and found.mean_m > ERROR_WARN_M:
        return warn(words, _ANEW)
    return ok(words)


def judge_age(found: CalibrationFound) -> Verdict:
    """Whether the calibration is recent."""
    if found.age_days is None:
        return skip("nothing says when it was made")
    if found.age_days < -1.0:
        return warn(
            f"made {-found.age_days:.0f} days from now: the clock was wrong then, or is now",
            "Look at the clock with `timedatectl`, then type `dnb-edge calibrate check`.",
        )
    words = f"{max(0.0, found.age_days):.0f} days old"
    if found.age_days > OLD_DAYS:
        return warn(
            words, "Type `dnb-edge calibrate check` to see whether it still holds, and calibrate again if it does not."
        )
    return ok(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFound:
    """What became of the detector's model."""

    fault: str | None
    name: str
    is_ours: bool
    """Whether a card with its SHA-256 lies beside it."""


def judge_model(model: ModelFound) -> Verdict:
    """Whether the model is whole."""
    if model.fault is not None:
        return fail(
            model.fault,
            "Install dnb-edge again with `sudo ./install.sh`, or copy the model and its card again and "
            "name it in detector.model.",
        )
    if not model.is_ours:
        return ok(f"{model.name} can be read; nothing says what its checksum should be")
    return ok(f"{model.name}: its SHA-256 is that of its card")


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """How long the detector takes for a frame; medians, since other programs interrupt."""

    fps: float
    window_ms: float
    """Decoding a frame, and detecting in a window of it: what a followed car takes."""
    whole_ms: float
    """Decoding it, and detecting in all of it: what a car takes that is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RacePace:
    """Whether the running race keeps up, by what it says itself."""

    latency_ms: float | None
    """From a frame's stamp to its events, ms: 19 of 20 are below."""
    lost_share: float
    """Share of the frames that it threw away since it was too slow."""


_FASTER = (
    "Lower capture.fps, set `detector.threads: 2`, or close other programs (`top` names them); `dnb-edge bench` shows what "
    "takes the time."
)


def judge_pace(pace: Pace | RacePace) -> Verdict:
    """Whether the detector keeps up with the camera."""
    if isinstance(pace, RacePace):
        latency = (
            "" if pace.latency_ms is None else f", 19 of 20 are through {pace.latency_ms:.0f} ms after their stamp"
        )
        found = f"the race throws away {100 * pace.lost_share:.1f} % of the frames{latency}"
        if pace.lost_share < LOST_WARN:
            return ok(found)
        return (fail if pace.lost_share > LOST_FAIL else warn)(found, _FASTER)
    frame_ms = 1e3 / pace.fps
    found = (
        f"{pace.window_ms:.1f} ms a frame while a car is followed, {pace.whole_ms:.1f} ms while one is looked for; a frame "
        f"lasts {frame_ms:.1f} ms"
    )
    if pace.window_ms > frame_ms:
        return fail(found, _FASTER)
    slow = pace.window_ms > BUSY_SHARE * frame_ms or pace.whole_ms > MOST_FRAMES_A_LOOK * frame_ms
    return warn(found, _FASTER) if slow else ok(found)
