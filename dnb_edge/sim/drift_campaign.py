"""How well the drift watch finds bumps, and how often it cries wolf: many bumps and many quiet minutes in drawn rooms.

Run as `python -m dnb_edge.sim.drift_campaign --bumps 200 --minutes 1000 --seed 1 --json`. Knows rooms, scenes and the watch;
the same arguments give the same figures. Bumps are seen at 6 frames a second, quiet minutes at one, a whole look in each.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from typing import Any

import cv2
import numpy as np

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.drift_rooms import CAMERAS, Bump, DriftRoom, FloorKind, drift_room
from dnb_edge.sim.drift_scene import DriftScene
from dnb_edge.view.drift import DriftWatch
from dnb_edge.view.drift_judge import DriftSettings

FPS = 6.0
WITHIN_S = 5.0
"""A bump that is told later was not found in time."""
AT_ALL_S = 20.0
"""A bump that is told later was not found at all."""

_SCENE_MINUTES = 12.0
_QUIET_MINUTES = 50.0
_SMALL_SHARES = (0.0005, 0.001, 0.0015, 0.002, 0.0025, 0.003)
_FOUND_IN = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class BumpTrial:
    """One bump and what came of it."""

    room: str
    share: float
    """Greatest displacement over the track, as a share of its span."""
    delay_s: float | None
    """From the bump to the alarm; None where there was none within 20 s."""
    told_share: float | None
    """What the watch said it was, as a share of the span."""
    false_alarm: bool
    """Whether it had been told before it happened."""
    watched: bool
    """False where the watch had said that the floor shows too little."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuietRun:
    """Some minutes in which nothing moved the camera."""

    room: str
    minutes: float
    alarms_s: tuple[float, ...]
    """When the watch cried wolf."""
    looks: dict[str, int]
    """How many looks ended with which verdict."""


def campaign_rooms(seed: int) -> list[Callable[[], DriftRoom]]:
    """Every floor under every camera; each room is drawn when it is asked for."""
    pairs = [(floor, camera) for floor in FloorKind for camera in CAMERAS]
    return [partial(_room, floor, camera, seed * 100 + k) for k, (floor, camera) in enumerate(pairs)]


def _room(floor: FloorKind, camera: Callable[[], PinholeCamera], seed: int) -> DriftRoom:
    return drift_room(floor, camera(), seed)


def bump_trial(room: DriftRoom, *, seed: int, share: float) -> BumpTrial:
    """One bump of a random kind that puts the track off by `share` of its span, while people and light go on."""
    random = np.random.default_rng([seed, 31])
    scene = _scene(room, seed, _SCENE_MINUTES)
    bump = room.bump_of(_kind(random), share)
    bumped = room.picture(bump)
    begin_s = float(random.uniform(0.0, _SCENE_MINUTES * 60.0 - 30.0))
    bump_s = float(random.uniform(5.0, 8.0))
    watch = DriftWatch(room.watched)
    found: dict[str, Any] = {"delay_s": None, "told_share": None, "false_alarm": False}
    for number in range(int((bump_s + AT_ALL_S) * FPS) + 1):
        t_s = number / FPS
        is_bumped = t_s >= bump_s
        picture = scene.frame(room, begin_s + t_s, *((bump, bumped) if is_bumped else ()))
        if watch.look(picture, round(t_s * 1e9)) and watch.moved_m is not None:
            told = None if not is_bumped else watch.moved_m / room.watched.span_m
            delay_s = t_s - bump_s if is_bumped else None
            found = {"delay_s": delay_s, "told_share": told, "false_alarm": not is_bumped}
            break
    return BumpTrial(room=room.name, share=share, watched=watch.note is None, **found)


def quiet_run(room: DriftRoom, *, seed: int, minutes: float) -> QuietRun:
    """`minutes` in which everything moves but the camera. After a false alarm the watch begins anew."""
    scene = _scene(room, seed, minutes)
    settings = DriftSettings(spread_s=0.0)
    watch = DriftWatch(room.watched, settings=settings)
    alarms, looks, last = [], Counter[str](), None
    for t_s in range(int(minutes * 60.0)):
        watch.look(scene.frame(room, float(t_s)), t_s * 1_000_000_000)
        if watch.last is not None and watch.last is not last:
            last = watch.last
            looks[last.verdict.value] += 1
        if watch.moved_m is not None:
            alarms.append(float(t_s))
            watch = DriftWatch(room.watched, settings=settings)
    return QuietRun(room=room.name, minutes=minutes, alarms_s=tuple(alarms), looks=dict(looks))


def _scene(room: DriftRoom, seed: int, minutes: float) -> DriftScene:
    return DriftScene(seed=seed, size_px=room.size_px, minutes=minutes, lane_px=room.lane_px, jpeg=seed % 2 == 1)


def _kind(random: np.random.Generator) -> Bump:
    """Somebody knocks against the mount: it turns about some axis, or shifts, or both."""
    pan, tilt, roll = random.normal(0.0, 1.0, 3) * random.choice([0.0, 1.0], 3)
    x, y, z = random.normal(0.0, 0.03, 3) * float(random.choice([0.0, 1.0]))
    if not any((pan, tilt, roll, x)):
        pan = 1.0
    return Bump(pan_deg=float(pan), tilt_deg=float(tilt), roll_deg=float(roll), shift_m=(float(x), float(y), float(z)))


def summary(bumps: Sequence[BumpTrial], quiet: Sequence[QuietRun], small: Sequence[BumpTrial]) -> dict[str, object]:
    """The campaign's figures."""
    delays = [trial.delay_s for trial in bumps if trial.delay_s is not None and trial.delay_s <= WITHIN_S]
    looks = sum((Counter(run.looks) for run in quiet), Counter[str]())
    found_of = {
        share: float(np.mean([_in_time(trial) for trial in small if trial.share == share]))
        for share in sorted({trial.share for trial in small})
    }
    surely = [
        share for share in found_of if all(found >= _FOUND_IN for larger, found in found_of.items() if larger >= share)
    ]
    off = [
        abs(trial.told_share / trial.share - 1.0) for trial in bumps if trial.told_share is not None and _in_time(trial)
    ]
    return {
        "bumps": len(bumps),
        "found": len(delays),
        "found_share": _share(_in_time(trial) for trial in bumps),
        "found_at_all": sum(trial.delay_s is not None for trial in bumps),
        "not_watched": sum(not trial.watched for trial in bumps),
        "found_share_of_watched": _share(_in_time(trial) for trial in bumps if trial.watched),
        "delay_p50_s": float(np.percentile(delays, 50)) if delays else None,
        "delay_p95_s": float(np.percentile(delays, 95)) if delays else None,
        "delay_max_s": max(delays, default=None),
        "told_before_bump": sum(trial.false_alarm for trial in (*bumps, *small)),
        "size_off_p50": float(np.percentile(off, 50)) if off else None,
        "size_off_p95": float(np.percentile(off, 95)) if off else None,
        "missed": [asdict(trial) for trial in bumps if not _in_time(trial)],
        "quiet_minutes": sum(run.minutes for run in quiet),
        "false_alarms": sum(len(run.alarms_s) for run in quiet),
        "false_alarm_runs": [asdict(run) for run in quiet if run.alarms_s],
        "quiet_looks": dict(looks),
        "found_by_share_of_span": {f"{share:g}": found for share, found in found_of.items()},
        "smallest_found_share": min(surely, default=None),
    }


def _in_time(trial: BumpTrial) -> bool:
    return trial.delay_s is not None and trial.delay_s <= WITHIN_S


def _share(found: Iterable[bool]) -> float | None:
    every = list(found)
    return sum(every) / len(every) if every else None


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the campaign and prints its figures."""
    parser = argparse.ArgumentParser(prog="python -m dnb_edge.sim.drift_campaign", description=__doc__)
    parser.add_argument("--bumps", type=int, default=200, help="bumps of 0.3 %% to 6 %% of the track's span")
    parser.add_argument("--minutes", type=float, default=1000.0, help="quiet minutes, over all rooms")
    parser.add_argument(
        "--small", type=int, default=40, help="smaller bumps of each size, for the smallest that is found"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="one JSON object")
    wanted = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    rooms = [lru_cache(make) for make in campaign_rooms(wanted.seed)]
    random = np.random.default_rng([wanted.seed, 41])
    shares = np.exp(random.uniform(np.log(0.003), np.log(0.06), wanted.bumps)).tolist()
    # The smallest size that must be found stands for a quarter of them.
    shares = [0.003 if k % 4 == 0 else share for k, share in enumerate(shares)]
    trials = [(number, share) for number, share in enumerate(shares)]
    little = [(10_000 + k, share) for k, share in enumerate(np.repeat(_SMALL_SHARES, wanted.small).tolist())]
    bumps, small, quiet = [], [], []
    each_min = min(_QUIET_MINUTES, max(1.0, wanted.minutes / len(rooms)))
    runs = round(wanted.minutes / each_min)
    for k, make in enumerate(rooms):
        room = make()
        bumps += [bump_trial(room, seed=number, share=share) for number, share in trials[k :: len(rooms)]]
        small += [bump_trial(room, seed=number, share=share) for number, share in little[k :: len(rooms)]]
        quiet += [quiet_run(room, seed=20_000 + n, minutes=each_min) for n in range(runs)[k :: len(rooms)]]
        make.cache_clear()
        last = quiet[-1].alarms_s if quiet else ()
        sys.stderr.write(
            f"{room.name}: {len(bumps)} bumps, {sum(run.minutes for run in quiet):.0f} min, alarms {last}\n"
        )
    figures = summary(bumps, quiet, small)
    if wanted.json:
        sys.stdout.write(json.dumps(figures) + "\n")
        return
    for name, value in figures.items():
        sys.stdout.write(f"{name:24} {value}\n")


if __name__ == "__main__":
    main()
