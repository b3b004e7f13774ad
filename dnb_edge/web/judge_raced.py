"""The run that was raced again last, so that a judge's next decision, and each thumbnail, need not race them anew.

One run is raced at a time, whoever asks: the box has a race to look after. Knows recordings and pictures; knows no request.
Its methods block, and may be called from several threads.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, field, replace
from pathlib import Path

from dnb_edge.archive.moments import picture_near
from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.errors import InputError
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.report.evidence import thumbnail
from dnb_edge.values import Observation, PointM, PointPx, Target

KEPT_RUNS = 1
"""An hour of one car is some 200 MB, and the pages have no memory to spare."""
KEPT_PICTURES = 256
"""Of each run: some 10 kB each."""

SAME_FRAME_NS = 50_000_000
"""A car seen no longer than this from the picture's own frame is where the picture shows it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RacedRun:
    """A run as the race said it, without edits."""

    raced: Replayed
    unfinished: bool
    """True while it is recorded, or where it was cut short."""
    pictures: OrderedDict[tuple[int, int], bytes | None] = field(default_factory=OrderedDict)
    """Thumbnails that were asked for lately, by stamp and car."""


class RacedRuns:
    """Keeps the last one: those who judge at once judge the same."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: OrderedDict[tuple[Path, int, int], RacedRun] = OrderedDict()

    def of(self, path: Path) -> RacedRun:
        """The run at `path`, raced anew where the file has changed. Raises `InputError` where it cannot be read."""
        with self._lock:
            return self._of(path)

    def picture(self, path: Path, t_ns: int, *, car: int, track_m: PointM, target_id: int | None) -> bytes | None:
        """A JPEG of car `car` at `t_ns`, when it was at `track_m`; None where no picture was kept near it.

        Raises `InputError` where the recording cannot be read.
        """
        with self._lock:
            run = self._of(path)
            key = (t_ns, car)
            if key not in run.pictures:
                run.pictures[key] = _picture(run.raced, t_ns, track_m, target_id)
                while len(run.pictures) > KEPT_PICTURES:
                    run.pictures.popitem(last=False)
            run.pictures.move_to_end(key)
            return run.pictures[key]

    def _of(self, path: Path) -> RacedRun:
        try:
            there = path.stat()
        except OSError as error:
            raise InputError(f"{path.name}: cannot be read: {error.strerror}") from error
        key = (path, there.st_mtime_ns, there.st_size)
        if key not in self._kept:
            unfinished = path.name.endswith(PART_SUFFIX)
            while len(self._kept) >= KEPT_RUNS:
                # Before the next one is raced, which needs the room.
                self._kept.popitem(last=False)
            self._kept[key] = RacedRun(raced=_raced(path, unfinished=unfinished), unfinished=unfinished)
        self._kept.move_to_end(key)
        return self._kept[key]


def _raced(path: Path, *, unfinished: bool) -> Replayed:
    """The run without its targets, of which there is one a frame: no decision needs them."""
    raced = replay(path, edits=False, unfinished=unfinished)
    return replace(raced, events=tuple(event for event in raced.events if not isinstance(event, Target)))


def _picture(raced: Replayed, t_ns: int, track_m: PointM, target_id: int | None) -> bytes | None:
    frame = picture_near(raced.path, t_ns)
    if frame is None:
        return None
    ground = raced.setup.ground
    camera_px = _seen_px(raced, frame.t_ns, target_id) or ground.point_to_camera_px(track_m)
    if camera_px is None:
        return None
    scale = frame.width_px / ground.width_px
    return thumbnail(frame, (camera_px[0] * scale, camera_px[1] * scale))


def _seen_px(raced: Replayed, t_ns: int, target_id: int | None) -> PointPx | None:
    """Where the target was seen in the picture at `t_ns`; None where it was not seen then."""
    near = [
        event
        for event in raced.events
        if isinstance(event, Observation)
        and abs(event.t_ns - t_ns) <= SAME_FRAME_NS
        and (target_id is None or event.target_id == target_id)
    ]
    best = min(near, key=lambda seen: abs(seen.t_ns - t_ns), default=None)
    return None if best is None else best.camera_px
