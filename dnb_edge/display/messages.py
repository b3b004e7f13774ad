"""Which messages a serial display is told: all of them after a connection, only what changed afterwards.

Knows boards and messages; knows no port and no clock.
"""

from __future__ import annotations

from dnb_edge import values
from dnb_edge.display import protocol
from dnb_edge.display.state import BoardState, Phase, laps_since

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
        state_message(state),
        *laps,
        *_best(state),
        *health_messages(state.health),
        run_message(state),
    ]


def news(earlier: BoardState, later: BoardState) -> list[protocol.Message]:
    """What `later` has to tell to a display that shows `earlier`; the running time always, as a sign of life."""
    told: list[protocol.Message] = []
    if later.crossed_s is not None and later.crossed_s != earlier.crossed_s:
        told.append(protocol.Cross(t_s=later.crossed_s))
    for lap in laps_since(earlier, later):
        told += lap_messages(lap)
    if later.best_lap != earlier.best_lap:
        told += _best(later)
    if state_message(later) != state_message(earlier):
        told.append(state_message(later))
    if health_messages(later.health) != health_messages(earlier.health):
        told += health_messages(later.health)
    return [*told, run_message(later)]


def state_message(state: BoardState) -> protocol.State:
    """Where the run stands."""
    if state.phase is Phase.LAP:
        return protocol.State(word="LAP", lap=state.lap_number, laps_wanted=state.laps_wanted)
    return protocol.State(word=_STATE_WORDS[state.phase])


def run_message(state: BoardState) -> protocol.Run:
    """The running lap."""
    return protocol.Run(lap=state.lap_number, elapsed_s=state.running_s)


def lap_messages(lap: values.Lap) -> list[protocol.Message]:
    """A complete lap, why its numbers may be wrong, and why it is not valid where it is not."""
    row = protocol.Lap(
        lap=lap.number,
        time_s=lap.time_s,
        sigma_s=lap.sigma_s,
        valid=lap.valid,
        similarity_percent=lap.similarity_percent,
    )
    because: list[protocol.Message] = [protocol.Suspect(lap=lap.number, text=text) for text in lap.suspect[:1]]
    because += [protocol.Why(lap=lap.number, text=reason) for reason in lap.reasons]
    return [row, *because[:REASONS_TOLD]]


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
    return [] if state.best_lap is None else [protocol.Best(lap=state.best_lap.number, time_s=state.best_lap.time_s)]
