"""One car's race: its progress, its crossings and its laps, which exist once for each car and know nothing of the others.

Knows observations, fixes, lines and laps; knows nothing of pictures, nor how the car was told from others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import PLAIN_STAMPS, Fix, FrameStamps, Progress
from dnb_edge.race.lap_table import LapState
from dnb_edge.race.laps import WAIT_S, Course, LapMachine, Passed
from dnb_edge.race.rules import FormatRules, LapRules, StartMode, StartRules
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Incident, Observation, PointM

__all__ = ["CarRace", "Passed"]

ORDER_S = 1.0
"""So long, at most, a crossing waits for another line's that may be earlier, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CarRace:
    """The parts of a race that belong to one car, joined."""

    progress: Progress
    lines: tuple[LineWatch, ...]
    laps: LapMachine
    waiting: list[Crossing] = field(default_factory=list)
    """Crossings that are known and not told yet: another line's may turn out to be earlier."""

    @classmethod
    def begin(
        cls,
        track: Track,
        crossing: CrossingSettings,
        rules: LapRules,
        *,
        map_sigma_m: Mapping[str, float] | None = None,
        car: int = 1,
        start: StartRules | None = None,
        format_rules: FormatRules | None = None,
    ) -> Self:
        """A car before its first frame; the track's lines are right (see `sectors.check_lines`). `map_sigma_m`: one sigma of
        the map's place for each line, across it, by its name; `car`: its number, from 1. From a grid it starts with `laps.go`.
        """
        sigma_m = map_sigma_m or {}
        return cls(
            progress=Progress(track.centreline),
            lines=tuple(
                LineWatch(line, crossing, map_sigma_m=sigma_m.get(line.name, 0.0), route=track.centreline)
                for line in track.lines
            ),
            laps=LapMachine(
                rules,
                Course.of(track, rules),
                car=car,
                format_rules=format_rules,
                grid=start is not None and start.mode is StartMode.GRID,
            ),
        )

    @property
    def finished(self) -> bool:
        """Whether the car's race is over: the wanted laps are complete, the time is up, or it was taken out."""
        return self.laps.state in (LapState.FINISHED, LapState.RETIRED)

    def news(self, observations: Sequence[Observation]) -> list[Observation]:
        """Those that are later than all that is known of the car: what another target did meanwhile belongs to nobody."""
        last_t_ns = self.progress.last_t_ns
        return [observation for observation in observations if observation.t_ns > last_t_ns]

    def fixes(
        self,
        observations: Sequence[Observation],
        *,
        target_id: int,
        t_ns: int,
        track_m: PointM,
        stamps: Sequence[FrameStamps] = (PLAIN_STAMPS,),
    ) -> list[Fix]:
        """The fixes of new observations, oldest first; `track_m` is the filter's estimate at `t_ns`, `stamps` what the stamps
        of each camera's frames mean.

        Of an earlier frame there is no estimate any more: what was seen then is taken as observed. What one camera's rows
        show of an earlier moment than the fix before, which is another's, is left out: fixes are in the order of what is seen.
        """
        return [
            self.progress.fix(
                observation,
                target_id=target_id,
                track_m=track_m if observation.t_ns == t_ns else observation.track_m,
                stamps=stamps[observation.camera],
            )
            for observation in observations
            if len(stamps) == 1 or self.progress.is_next(observation, stamps[observation.camera])
        ]

    def frame(self, t_ns: int, fixes: Sequence[Fix], *, more_may_come: bool, shows: bool = True) -> list[Passed]:
        """Takes one frame with the fixes that became known in it; returns crossings, incidents and laps in the order of stamps.

        Where `more_may_come` for frames up to this one, no crossing is closed for want of fixes. `shows`: whether the frame
        shows where the car is.
        """
        self.laps.frame(t_ns, shows=shows)
        for fix in fixes:
            self.laps.fix(fix)
            for line in self.lines:
                self.waiting.extend(line.feed(fix))
        for line in self.lines if not more_may_come else ():
            self.waiting.extend(line.tick(t_ns))
        sure_ns = self.progress.last_t_ns if more_may_come else t_ns
        for line in self.lines:
            unsettled_t_ns = line.unsettled_t_ns
            if unsettled_t_ns is not None:
                # The crossing may come to lie before the fix before the line.
                sure_ns = min(sure_ns, unsettled_t_ns - 1)
        passed = self._released(max(sure_ns, t_ns - round(ORDER_S * 1e9))) if self.waiting else []
        return passed + self.laps.settle(max(sure_ns, t_ns - round(WAIT_S * 1e9)), sure_t_ns=sure_ns)

    def retire(self, t_ns: int, reason: str) -> list[Incident]:
        """Takes the car out of its race; returns the incidents that were going on."""
        return self.laps.retire(t_ns, reason)

    def finish(self) -> list[Passed]:
        """Says that no frame will follow; returns what was still waiting for one."""
        self.waiting.extend(crossing for line in self.lines for crossing in line.finish())
        latest_ns = max((crossing.t_ns for crossing in self.waiting), default=0)
        return self._released(latest_ns) + self.laps.finish()

    def _released(self, t_ns: int) -> list[Passed]:
        """What the waiting crossings up to `t_ns` lead to; they wait no longer."""
        ready = sorted((one for one in self.waiting if one.t_ns <= t_ns), key=lambda crossing: crossing.t_ns)
        self.waiting[:] = [one for one in self.waiting if one.t_ns > t_ns]
        return [passed for crossing in ready for passed in self.laps.crossed(crossing)]
