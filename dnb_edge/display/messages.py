"""Which messages a serial display is told: all of them after a connection, only what changed afterwards.

Knows boards and messages; knows no port and no clock.
"""

from __future__ import annotations

from dnb_edge import values
from dnb_edge.display import protocol, protocol_race
from dnb_edge.display.car_board import Phase, official_s
from dnb_edge.display.state import BoardState, laps_since

LAPS_REPAINTED = 8
"""Laps that a repaint repeats: with their reasons they fit into 0.2 s at 115200 baud."""

REASONS_TOLD = 2
"""Lines that follow a lap: why it is suspect, why it is not valid."""

WARNINGS_TOLD = 4

_STATE_WORDS = {Phase.WAITING: "WAITING", Phase.OUT_LAP: "OUT-LAP", Phase.LAP: "LAP", Phase.FINISHED: "FINISHED"}


def repaint(state: BoardState) -> list[protocol.Message]:
    """Everything that a display which has just been switched on needs, no crossing among it."""
    laps = [message for lap in state.laps[-LAPS_REPAINTED:] for message in lap_messages(lap)]
    return [
        protocol.Hello(),
        *_car(state),
        state_message(state),
        *_count(state),
        *laps,
        *_best(state),
        *_places(state),
        *_live(state),
        *_saved(state),
        *health_messages(state.health),
        *_note(state),
        run_message(state),
    ]


def news(earlier: BoardState, later: BoardState) -> list[protocol.Message]:
    """What `later` has to tell to a display that shows `earlier`; the running time always, as a sign of life.

    Where another car comes to the front, everything: the lines are about that car from then on. So where something stands no
    more, such as what was awaited: no message takes a line back, and a repaint begins by forgetting all.
    """
    told: list[protocol.Message] = []
    known_s = next((car.crossed_s for car in earlier.cars if car.car == later.shown.car), None)
    if later.crossed_s is not None and later.crossed_s != known_s:
        told.append(protocol.Cross(t_s=later.crossed_s))
    is_another = later.shown.car != earlier.shown.car or _car(later) != _car(earlier)
    if is_another or any(part(earlier) and not part(later) for part in (_best, _count, _places, _note)):
        return [*repaint(later), *told, run_message(later)] if told else repaint(later)
    for lap in laps_since(earlier, later):
        told += lap_messages(lap) if lap.car == later.shown.car else [_other_lap(lap)]
    for part in (_best, _state, _count, _places, _live, _saved, _note):
        if part(later) != part(earlier):
            told += part(later)
    if later.shown.running is None and earlier.shown.running is not None:
        told.append(protocol_race.Live(delta_s=None, similarity_percent=None))
    if health_messages(later.health) != health_messages(earlier.health):
        told += health_messages(later.health)
    return [*told, run_message(later)]


def state_message(state: BoardState) -> protocol.State:
    """Where the run stands."""
    if state.phase is Phase.LAP:
        return protocol.State(word="LAP", lap=state.lap_number, laps_wanted=state.laps_wanted)
    return protocol.State(word=_STATE_WORDS[state.phase])


def _state(state: BoardState) -> list[protocol.Message]:
    return [state_message(state)]


def _car(state: BoardState) -> list[protocol.Message]:
    """Which car the lines are about, where there are several."""
    if state.standings is None or len(state.standings.rows) < 2:
        return []
    return [protocol_race.Car(car=row.car, name=row.name) for row in state.standings.rows if row.car == state.shown.car]


def _count(state: BoardState) -> list[protocol.Message]:
    """What is awaited, the countdown, or that the race is on."""
    race = state.race
    if race is None:
        return []
    if race.phase is values.RacePhase.COUNTDOWN:
        return [protocol_race.Count(left_s=race.countdown_s)]
    if race.phase is values.RacePhase.WAITING:
        return [protocol_race.Grid(text=race.text)] if race.text else []
    return [protocol_race.Go(remaining_s=race.remaining_s)]


def _places(state: BoardState) -> list[protocol.Message]:
    """The standings, where there are several cars."""
    if state.standings is None or len(state.standings.rows) < 2:
        return []
    return [
        protocol_race.Place(
            place=row.place,
            tied=row.tied,
            car=row.car,
            laps=row.laps,
            value=row.value,
            gap=row.gap,
            out=row.dnf is not None,
            name=row.name,
        )
        for row in state.standings.rows
    ]


def _live(state: BoardState) -> list[protocol.Message]:
    """How the running lap compares; nothing before it is told, or once no lap runs."""
    running = state.shown.running
    if running is None:
        return []
    return [protocol_race.Live(delta_s=running.delta_s, similarity_percent=running.similarity_percent)]


def _saved(state: BoardState) -> list[protocol.Message]:
    """How many laps are on a disk; nothing where none is recorded."""
    if state.health is None or state.health.saved_laps is None:
        return []
    return [protocol.Saved(laps=state.health.saved_laps)]


def _note(state: BoardState) -> list[protocol.Message]:
    """What people at the box are to read; nothing where there is no such thing."""
    return [] if state.notice is None else [protocol.Note(text=state.notice)]


def _other_lap(lap: values.Lap) -> protocol.Message:
    return protocol_race.CarLap(car=lap.car, lap=lap.number, time_s=official_s(lap), valid=lap.valid)


def run_message(state: BoardState) -> protocol.Run:
    """The running lap."""
    return protocol.Run(lap=state.lap_number, elapsed_s=state.running_s)


def lap_messages(lap: values.Lap) -> list[protocol.Message]:
    """A complete lap, its penalties, why its numbers may be wrong, and why it is not valid where it is not."""
    row = protocol.Lap(
        lap=lap.number,
        time_s=lap.time_s,
        sigma_s=lap.sigma_s,
        valid=lap.valid,
        similarity_percent=lap.similarity_percent,
    )
    penalty: list[protocol.Message] = []
    if lap.penalty_s > 0:
        texts = "; ".join(one.reason for one in lap.penalties if one.seconds > 0)
        penalty = [protocol_race.Penalty(lap=lap.number, seconds=lap.penalty_s, text=texts)]
    because: list[protocol.Message] = [protocol.Suspect(lap=lap.number, text=text) for text in lap.suspect[:1]]
    because += [protocol.Why(lap=lap.number, text=reason) for reason in lap.reasons]
    return [row, *penalty, *because[:REASONS_TOLD]]


def health_messages(health: values.Health | None) -> list[protocol.Message]:
    """The appliance's own state; nothing before its first report."""
    if health is None:
        return []
    summary = protocol.Health(
        fps=health.fps, recording=health.recording.upper(), warnings=min(len(health.warnings), WARNINGS_TOLD)
    )
    warnings = (
        protocol.Warn(number=number, text=text) for number, text in enumerate(health.warnings[:WARNINGS_TOLD], start=1)
    )
    return [summary, *warnings]


def _best(state: BoardState) -> list[protocol.Message]:
    return (
        [] if state.best_lap is None else [protocol.Best(lap=state.best_lap.number, time_s=official_s(state.best_lap))]
    )
