"""Whatever comes, in whatever order: the table stays legal and the books balance."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.race.fix import Fix
from dnb_edge.race.lap_table import RUNNING
from dnb_edge.race.laps import Course, DrivenLap, LapMachine, LapState, Passed
from dnb_edge.race.rules import FormatRules, LapRules
from dnb_edge.race.sectors import SectorPlan
from dnb_edge.values import Crossing, Direction, Incident, IncidentKind, PassStatus

ROUTE_M = 4.0

JUMP = Incident(
    number=0, kind=IncidentKind.JUMP_START, car=0, target_id=1, lap=None, start_t_ns=0, end_t_ns=0, start_s=0.0,
    lasted_s=0.0, greatest_m=0.05, worst_t_ns=0, track_m=(0.0, 0.0), camera_px=None, s_m=None, text="it moved",
)  # fmt: skip

LINES = st.tuples(
    st.sampled_from(["start", "start", "start", "finish", "sector 1", "sector 2"]),
    st.sampled_from([Direction.FORWARD, Direction.FORWARD, Direction.FORWARD, Direction.REVERSE]),
)
DRIVES = st.tuples(st.just("drive"), st.floats(-1.0, 2.0), st.integers(1, 30))
"""Metres a tenth of a second... times ten: speed, and for how many frames."""
OTHERS = st.sampled_from(["go", "jump", "retire", "lift", "hide", "settle"])


def fix(t_ns: int, progress_m: float, place_m: float) -> Fix:
    return Fix(
        t_ns=t_ns,
        t_s=t_ns * 1e-9,
        target_id=1,
        observed_m=(place_m, 0.0),
        covariance_m2=(1e-6, 0.0, 1e-6),
        track_m=(place_m, 0.0),
        s_m=progress_m % ROUTE_M,
        d_m=0.0,
        outside_m=-0.1,
        progress_m=progress_m,
    )


class Play:
    """A race as the car, the lines and the people outside would make it."""

    def __init__(
        self, *, has_finish_line: bool, grid: bool, laps: int | None, limit_s: float | None, grace: bool
    ) -> None:
        self.machine = LapMachine(
            LapRules(laps=laps, min_lap_s=0.5, stalled_s=1.0, max_lap_s=6.0),
            Course(
                lap_m=ROUTE_M,
                loop_m=ROUTE_M,
                has_finish_line=has_finish_line,
                sectors=SectorPlan(lines=("sector 1", "sector 2"), along_m=(1.0, 2.5)),
            ),
            format_rules=FormatRules(time_limit_s=limit_s, grace_lap=grace),
            grid=grid,
        )
        self.told: list[Passed] = []
        self.t_ns = 0
        self.progress_m = 0.0
        self.place_m = 0.0
        self.settled_ns = 0
        self.crossings = 0

    def act(self, act: object) -> None:
        self.t_ns += 10_000_000
        match act:
            case ("drive", float(metres), int(frames)):
                for _ in range(frames):
                    self.t_ns += 100_000_000
                    self.progress_m += metres / 10
                    self.place_m += metres / 10
                    self.machine.frame(self.t_ns)
                    self.machine.fix(fix(self.t_ns, self.progress_m, self.place_m))
            case (str(line), Direction() as direction):
                self.crossings += 1
                # Told late: somewhere after what is settled.
                t_ns = max(self.settled_ns + 1, self.t_ns - 150_000_000)
                self.told += self.machine.crossed(
                    Crossing(
                        t_ns=t_ns,
                        t_s=t_ns * 1e-9,
                        line=line,
                        direction=direction,
                        sigma_s=0.001,
                        track_m=(0.0, 0.0),
                        target_id=1,
                        estimated=False,
                    )
                )
                self.settled_ns = max(self.settled_ns, t_ns)
            case "go" if self.machine.state in (LapState.BEFORE_START, LapState.RETIRED):
                self.machine.go(self.t_ns)
            case "jump" if self.machine.state is LapState.BEFORE_START:
                self.told.append(self.machine.jumped(JUMP))
            case "retire":
                self.told += self.machine.retire(self.t_ns, "somebody said so")
            case "lift":
                self.place_m += 3.0
                self.progress_m += 1.0
            case "hide":
                self.t_ns += 2_000_000_000
                self.machine.frame(self.t_ns)
            case "settle":
                self.told += self.machine.settle(self.t_ns)
                self.settled_ns = self.t_ns
            case _:
                pass


@settings(max_examples=300, deadline=None)
@given(
    acts=st.lists(st.one_of(LINES, DRIVES, DRIVES, OTHERS), max_size=40),
    has_finish_line=st.booleans(),
    grid=st.booleans(),
    laps=st.sampled_from([None, 1, 2]),
    limit_s=st.sampled_from([None, 3.0, 12.0]),
    grace=st.booleans(),
)
def test_the_books_balance(
    acts: list[object], has_finish_line: bool, grid: bool, laps: int | None, limit_s: float | None, grace: bool
) -> None:
    """No illegal step (it would raise); as many laps as crossings that ended one; each lap between two of its crossings,
    without overlap; every crossing comes out once, with a status, and with a reason exactly where it was ignored; incidents
    are numbered without a gap; a race that is over stays over.
    """
    play = Play(has_finish_line=has_finish_line, grid=grid, laps=laps, limit_s=limit_s, grace=grace)
    over = False
    for act in acts:
        before = len(play.told)
        play.act(act)
        if over:
            assert not any(isinstance(one, DrivenLap) for one in play.told[before:])
        over = over or play.machine.over is not None
        assert over == (play.machine.state in (LapState.FINISHED, LapState.RETIRED))
        assert (play.machine.running is not None) == (play.machine.state in RUNNING)
    told = play.told + play.machine.finish()
    crossings = [one for one in told if isinstance(one, Crossing)]
    driven = [one for one in told if isinstance(one, DrivenLap)]
    assert len(crossings) == play.crossings
    assert all(one.status is not None for one in crossings)
    assert all((one.reason is not None) == (one.status is PassStatus.IGNORED) for one in crossings)
    ends = [one for one in crossings if one.status in (PassStatus.LAP, PassStatus.ARRIVED)]
    starts = {one.t_ns for one in crossings if one.status in (PassStatus.LAP, PassStatus.START)}
    assert [one.lap.end_t_ns for one in driven] == [one.t_ns for one in ends]
    assert [one.lap.number for one in driven] == [one.lap for one in ends] == list(range(1, len(driven) + 1))
    assert {one.lap.start_t_ns for one in driven} <= starts
    assert all(a.lap.end_t_ns <= b.lap.start_t_ns for a, b in pairwise(driven))
    if not has_finish_line:
        assert all(a.lap.end_t_ns == b.lap.start_t_ns for a, b in pairwise(driven))
    assert laps is None or len(driven) <= laps
    for one in driven:
        assert one.lap.valid
        assert len(one.lap.sectors) == 3
        assert all(one.lap.start_t_ns < fix.t_ns <= one.lap.end_t_ns for fix in one.fixes)
        assert all(a.t_ns < b.t_ns for a, b in pairwise(one.fixes))
    incidents = [one for one in told if isinstance(one, Incident)]
    assert [one.number for one in incidents] == list(range(1, len(incidents) + 1))
    assert all(one.start_t_ns <= one.end_t_ns for one in incidents)
    charged = [incident for one in driven for incident in one.incidents]
    assert len({incident.number for incident in charged}) == len(charged)
    assert set(charged) <= set(incidents)
