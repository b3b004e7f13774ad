"""The rooms from detections to events, joined: sight, motion, and the field of cars.

Knows the order of things within a frame. See `dnb_edge.core` for what the core promises.
"""

from __future__ import annotations

import math
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
from dnb_edge.values import Event, FrameDetections, PointM, PointPx, SearchWindow, TargetState
from dnb_edge.view.ground import GroundMap

HANDOVER_S = 0.15
"""For so long a car may be unseen by each of several cameras before it counts as unseen: four frames at 30 a second."""

EDGE_SHARE = 0.02
"""So far beyond the picture's edge, as a share of its width, part of a car there is still in it."""


class Core:
    """Feed it each frame's detections in order; it returns the events that they cause, in order."""

    def __init__(self, setup: CoreSetup, *, tell_running: bool = True) -> None:
        """`tell_running`: whether running laps are told while they run; it changes nothing else."""
        self._setup = setup
        views, route = setup.views, setup.track.centreline
        # Of several cameras not each sees a car that is there.
        self._follower = Follower(setup.motion, route, unseen_s=HANDOVER_S if len(views) > 1 else 0.0)
        self._sights = [
            Sight(view.ground, route, margin_m=setup.birth_margin_m, camera=number) for number, view in enumerate(views)
        ]
        self._seats = Seats(setup.motion.cars, setup.cars)
        self._views = ViewLog(setup.track.centreline, camera_gap_s=setup.camera_gap_s)
        self._field = Field(setup, self._views, tell_running=tell_running)
        self._first_t_ns: int | None = None
        self._last_t_ns: int | None = None
        self._stamps = [FrameStamps(row_s=view.row_s, height_px=view.ground.height_px) for view in views]
        self._told: set[int] = set()

    @property
    def finished(self) -> bool:
        """Whether as many cars as are wanted have completed the wanted number of laps."""
        return self._field.finished

    def step(self, found: FrameDetections) -> list[Event]:
        """Takes one frame's detections. Raises `ValueError` where its stamp is not later than that of the one before, of
        whichever camera, or where there is no such camera."""
        if self._last_t_ns is not None and found.t_ns <= self._last_t_ns:
            raise ValueError(f"frame {found.sequence}: stamp {found.t_ns} ns is not later than {self._last_t_ns} ns")
        if not 0 <= found.camera < len(self._sights):
            raise ValueError(f"frame {found.sequence}: of camera {found.camera}, and there are {len(self._sights)}")
        if self._first_t_ns is None:
            self._first_t_ns = found.t_ns
        self._last_t_ns = found.t_ns
        self._views.frame(found.t_ns, found.view_moved_m, found.camera)
        t_s = (found.t_ns - self._first_t_ns) * 1e-9
        sightings = [
            sighting
            for detection in found.detections
            if (sighting := self._sights[found.camera].sighting(detection, found.t_ns, t_s)) is not None
        ]
        if found.stamp_source is not self._stamps[found.camera].source:
            self._stamps[found.camera] = replace(self._stamps[found.camera], source=found.stamp_source)
        events: list[Event] = []
        fixes: dict[int, list[Fix]] = {}
        waiting, elsewhere = set[int](), set[int]()
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
            if not seen and not self._shows(found.camera, target.estimate.track_m):
                elsewhere.add(seat)
        events += self._field.frame(found.t_ns, fixes, waiting=waiting, elsewhere=elsewhere)
        self._adopt()
        return events

    def _shows(self, camera: int, track_m: PointM) -> bool:
        """Whether that camera's picture shows a place; an only camera is taken to show all of the track."""
        if not self._setup.further:
            return True
        ground = self._setup.views[camera].ground
        camera_px = ground.point_to_camera_px(track_m)
        return camera_px is not None and _is_in_picture(ground, camera_px, margin=0.0)

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

    def windows(self, t_ns: int, camera: int = 0) -> tuple[SearchWindow, ...]:
        """Where the cars are expected in that camera's frame stamped `t_ns`, one window each; none while no car is known.

        Of several cameras each is told of the cars that its picture shows, in its own pixels.
        """
        if self._last_t_ns is None or t_ns < self._last_t_ns:
            return ()
        ground = self._setup.views[camera].ground
        windows = []
        for expected in self._follower.expected(t_ns):
            camera_px, length_px = ground.point_to_camera_px(expected.track_m), expected.length_px
            if camera_px is not None and self._setup.further:
                if not _is_in_picture(ground, camera_px, margin=EDGE_SHARE):
                    continue
                xu, xv, yu, yv = ground.slopes(camera_px)
                length_px = expected.length_m / math.sqrt(abs(xu * yv - xv * yu))
            if camera_px is not None:
                windows.append(SearchWindow(target_id=expected.target_id, camera_px=camera_px, length_px=length_px))
        return tuple(windows)

    def is_awaited(self, t_ns: int, camera: int) -> bool:
        """Whether that camera's frame stamped `t_ns` need be searched: not where all cars are followed in other pictures."""
        if not self._setup.further or self.windows(t_ns, camera):
            return True
        live = [target for target in self._follower.followed if target.state is TargetState.CONFIRMED]
        return len(live) < self._setup.motion.cars

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


def _is_in_picture(ground: GroundMap, camera_px: PointPx, *, margin: float) -> bool:
    """Whether a point lies in the picture, or beside it within `margin`, a share of its width."""
    margin_px = margin * ground.width_px
    u, v = camera_px
    return -margin_px <= u <= ground.width_px + margin_px and -margin_px <= v <= ground.height_px + margin_px


def _is_held(target: Followed) -> bool:
    """Whether what was seen of the target must wait; a lost one waits for nothing more."""
    return target.held and target.state is not TargetState.LOST
