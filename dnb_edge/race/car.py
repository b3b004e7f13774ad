"""One car's race: its progress, its crossings and its laps, which exist once for each car and know nothing of the others.

Knows observations, fixes, lines and laps; knows nothing of pictures, nor how the car was told from others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import PLAIN_STAMPS, Fix, FrameStamps, Progress
from dnb_edge.race.laps import DrivenLap, LapMachine, LapState
from dnb_edge.race.rules import LapRules
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.values import Crossing, Observation, PointM

Passed: TypeAlias = Crossing | DrivenLap
"""A crossing, or the lap that the crossing before it completed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CarRace:
    """The parts of a race that belong to one car, joined."""

    progress: Progress
    lines: tuple[LineWatch, ...]
    laps: LapMachine

    @classmethod
    def begin(
        cls,
        track: Track,
        crossing: CrossingSettings,
        rules: LapRules,
        *,
        map_sigma_m: Mapping[str, float] | None = None,
    ) -> Self:
        """A car before its first frame. `map_sigma_m`: one sigma of the map's place for each line, across it, by its name."""
        sigma_m = map_sigma_m or {}
        return cls(
            progress=Progress(track.centreline),
            lines=tuple(LineWatch(line, crossing, map_sigma_m=sigma_m.get(line.name, 0.0)) for line in track.lines),
            laps=LapMachine(rules, track.lap_m()[1], has_finish_line=track.finish_line is not None),
        )

    @property
    def finished(self) -> bool:
        """Whether the wanted number of laps is complete."""
        return self.laps.state is LapState.FINISHED

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
        stamps: FrameStamps = PLAIN_STAMPS,
    ) -> list[Fix]:
        """The fixes of new observations, oldest first; `track_m` is the filter's estimate at `t_ns`, `stamps` what the frames'
        stamps mean.

        Of an earlier frame there is no estimate any more: what was seen then is taken as observed.
        """
        return [
            self.progress.fix(
                observation,
                target_id=target_id,
                track_m=track_m if observation.t_ns == t_ns else observation.track_m,
                stamps=stamps,
            )
            for observation in observations
        ]

    def frame(self, t_ns: int, fixes: Sequence[Fix], *, more_may_come: bool) -> list[Passed]:
        """Takes one frame with the fixes that became known in it; returns crossings and laps in the order of stamps.

        Where `more_may_come` for frames up to this one, no crossing is closed for want of fixes.
        """
        self.laps.frame(t_ns)
        crossings: list[Crossing] = []
        for fix in fixes:
            self.laps.fix(fix)
            for line in self.lines:
                crossings += line.feed(fix)
        for line in self.lines if not more_may_come else ():
            crossings += line.tick(t_ns)
        return self._passed(crossings)

    def finish(self) -> list[Passed]:
        """Says that no frame will follow; returns what was still waiting for one."""
        return self._passed([crossing for line in self.lines for crossing in line.finish()])

    def _passed(self, crossings: Sequence[Crossing]) -> list[Passed]:
        passed: list[Passed] = []
        for crossing in sorted(crossings, key=lambda crossing: crossing.t_ns):
            passed.append(crossing)
            driven = self.laps.crossed(crossing) if crossing.line in (START_LINE, FINISH_LINE) else None
            if driven is not None:
                passed.append(driven)
        return passed
