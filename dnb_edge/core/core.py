"""The rooms from detections to events, joined: sight, motion, and the field of cars.

Knows the order of things within a frame. See `dnb_edge.core` for what the core promises.
"""

from __future__ import annotations

from dataclasses import replace

from dnb_edge.core.field import Field
from dnb_edge.core.setup import CoreSetup
from dnb_edge.core.sight import Sight
from dnb_edge.core.views import ViewLog
from dnb_edge.motion.follow import Follower
from dnb_edge.motion.target import Followed
from dnb_edge.race.fix import Fix, FrameStamps
from dnb_edge.race.seats import Seats
from dnb_edge.race.standings import CarResult
from dnb_edge.values import Event, FrameDetections, PointM, SearchWindow, TargetState


class Core:
    """Feed it each frame's detections in order; it returns the events that they cause, in order."""

    def __init__(self, setup: CoreSetup, *, tell_running: bool = True) -> None:
        """`tell_running`: whether running laps are told while they run; it changes nothing else."""
        self._setup = setup
        self._follower = Follower(setup.motion, setup.track.centreline)
        self._sight = Sight(setup.ground, setup.track.centreline, margin_m=setup.birth_margin_m)
        self._seats = Seats(setup.motion.cars, setup.cars)
        self._views = ViewLog(setup.track.centreline, camera_gap_s=setup.camera_gap_s)
        self._field = Field(setup, self._views, tell_running=tell_running)
        self._first_t_ns: int | None = None
        self._last_t_ns: int | None = None
        self._stamps = FrameStamps(row_s=setup.row_s, height_px=setup.ground.height_px)
        self._told: set[int] = set()

    @property
    def finished(self) -> bool:
        """Whether as many cars as are wanted have completed the wanted number of laps."""
        return self._field.finished

    def step(self, found: FrameDetections) -> list[Event]:
        """Takes one frame's detections. Raises `ValueError` where its stamp is not later than the one before."""
        if self._last_t_ns is not None and found.t_ns <= self._last_t_ns:
            raise ValueError(f"frame {found.sequence}: stamp {found.t_ns} ns is not later than {self._last_t_ns} ns")
        if self._first_t_ns is None:
            self._first_t_ns = found.t_ns
        self._last_t_ns = found.t_ns
        self._views.frame(found.t_ns, found.view_moved_m)
        t_s = (found.t_ns - self._first_t_ns) * 1e-9
        sightings = [
            sighting
            for detection in found.detections
            if (sighting := self._sight.sighting(detection, found.t_ns, t_s)) is not None
        ]
        if found.stamp_source is not self._stamps.source:
            self._stamps = replace(self._stamps, source=found.stamp_source)
        events: list[Event] = []
        fixes: dict[int, list[Fix]] = {}
        waiting = set()
        for target in self._follower.step(found.t_ns, sightings):
            if not self._is_told(target):
                continue
            seat = self._seat(target)
            if seat is None:
                events.append(target.as_value(t_s))
                continue
            car = self._field.entrants[seat].race
            seen = car.news([] if _is_held(target) else target.pending)
            events += seen
            events.append(target.as_value(t_s))
            fixes[seat] = fixes.get(seat, []) + car.fixes(
                seen, target_id=target.target_id, t_ns=found.t_ns, track_m=target.estimate.track_m, stamps=self._stamps
            )
            if _is_held(target):
                waiting.add(seat)
        events += self._field.frame(found.t_ns, fixes, waiting=waiting)
        self._adopt()
        return events

    def _is_told(self, target: Followed) -> bool:
        """Whether a target is one to tell of: a confirmed one, to its end."""
        if target.state is TargetState.CONFIRMED:
            self._told.add(target.target_id)
            return True
        if target.target_id not in self._told:
            return False
        if target.state is TargetState.LOST:
            self._told.discard(target.target_id)
        return True

    def _seat(self, target: Followed) -> int | None:
        """The car that a target is; None for one that does not take part."""
        seat = self._seats.held_by(target.target_id)
        if seat is None:
            followed = {one.target_id for one in self._follower.followed}
            seat = self._seats.of(target.target_id, target.looks, followed)
        return seat

    def _adopt(self) -> None:
        """Takes what is parked on the grid for cars while standing cars are awaited there: nothing else makes them cars."""
        grid = self._field.awaited_on_grid
        if grid is None or not self._follower.parked:
            return
        route = self._setup.track.centreline
        for target in self._follower.parked:
            s_m, _ = route.locate_point(target.first.track_m)
            if 0 < grid.before_m(s_m) <= self._setup.start.grid_m:
                self._follower.adopt(target.target_id)

    def finish(self) -> list[Event]:
        """Says that no frame will follow; returns the events that were still waiting for one."""
        return self._field.finish()

    def results(self) -> tuple[CarResult, ...]:
        """What each car has done so far; a judge's standings are made of it."""
        return self._field.results()

    def windows(self, t_ns: int) -> tuple[SearchWindow, ...]:
        """Where the cars are expected in the frame stamped `t_ns`, one window each; none while no car is known."""
        if self._last_t_ns is None or t_ns < self._last_t_ns:
            return ()
        windows = []
        for expected in self._follower.expected(t_ns):
            camera_px = self._setup.ground.point_to_camera_px(expected.track_m)
            if camera_px is not None:
                windows.append(
                    SearchWindow(
                        target_id=expected.target_id,
                        camera_px=camera_px,
                        length_px=expected.length_px,
                    )
                )
        return tuple(windows)

    def parked(self) -> tuple[PointM, ...]:
        """Places, track m, where something that looks like a car has stood for a while and never moved."""
        return tuple(target.first.track_m for target in self._follower.parked)

    def notes(self) -> tuple[str, ...]:
        """What the core would like to be told or shown, a sentence each: parked things, as long as a car is wanted."""
        wanted = self._setup.motion.cars - sum(
            target.state is not TargetState.TENTATIVE for target in self._follower.followed
        )
        if wanted <= 0:
            return ()
        return tuple(
            f"something like a car stands at ({x:.2f}, {y:.2f}) m and has not moved: it counts once it drives"
            for x, y in self.parked()
        )


def _is_held(target: Followed) -> bool:
    """Whether what was seen of the target must wait; a lost one waits for nothing more."""
    return target.held and target.state is not TargetState.LOST
