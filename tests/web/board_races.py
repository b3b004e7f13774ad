"""Races for the board's tests: streams of events, by the core and by hand, and what Python's board makes of them."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

for room in ("core", "display"):
    sys.path.append(str(Path(__file__).resolve().parents[1] / room))

import display_events as made  # noqa: E402 the displays' own examples
from circle import circle_setup, circle_track, detection, on_circle  # noqa: E402

from dnb_edge import wire  # noqa: E402
from dnb_edge.core import Core  # noqa: E402
from dnb_edge.display.picture import headline_text  # noqa: E402
from dnb_edge.display.state import BoardState  # noqa: E402
from dnb_edge.motion.settings import MotionSettings  # noqa: E402
from dnb_edge.race.rules import LapRules  # noqa: E402
from dnb_edge.track.line import line_across  # noqa: E402
from dnb_edge.values import FrameDetections, PassStatus, RacePhase  # noqa: E402

FPS = 30.0
COLOURS = ((40.0, 40.0, 190.0), (180.0, 70.0, 40.0))


def raced(*cars, seconds, laps=None, sectors=True):
    """The core's events of cars at angle(t_s) and radius_m on a round track with two sector lines."""
    track = circle_track()
    if sectors:
        lines = tuple(
            line_across(track.centreline, share * track.centreline.length_m, name=f"sector {number}", margin_m=0.05)
            for number, share in ((1, 0.3), (2, 0.7))
        )
        track = replace(track, sector_lines=lines)
    core = Core(circle_setup(track=track, motion=MotionSettings(cars=len(cars)), laps=LapRules(laps=laps)))
    events = []
    for k in range(int(seconds * FPS)):
        found = tuple(
            replace(detection(on_circle(angle(k / FPS), radius_m)), colour_bgr=colour)
            for (angle, radius_m), colour in zip(cars, COLOURS, strict=False)
            if angle(k / FPS) is not None
        )
        frame = FrameDetections(sequence=k, t_ns=round(k * 1e9 / FPS), detections=found, full_frame=True)
        events += core.step(frame)
    return [*events, *core.finish()]


@cache
def one_car():
    """Three laps, of which the second is the fastest."""
    return raced((lambda t: -0.5 + 1.6 * t + 0.3 * math.sin(0.9 * t), 1.0), seconds=13.5, laps=3)


def two_cars():
    """A race without end, which is cut off in the middle of laps."""
    return raced((lambda t: -0.6 + 1.5 * t, 0.93), (lambda t: 0.5 + 1.1 * t, 1.07), seconds=12)


def by_hand():
    """What simulated races seldom have: countdown, grid, penalties, refused laps, grace, failures of the appliance."""
    return [
        made.race_state(0.0, RacePhase.WAITING, text="waiting for 2 cars to stand on the grid"),
        made.target(0.2),
        made.race_state(0.5, RacePhase.COUNTDOWN, countdown_s=2.5),
        made.race_state(0.9, RacePhase.COUNTDOWN),
        made.race_state(1.5, RacePhase.RACING, remaining_s=60.0),
        made.crossing(2.0, status=PassStatus.IGNORED),
        made.crossing(2.5, status=PassStatus.START, lap=1),
        made.running(3.0),
        made.health(3.1, warnings=("the disk is nearly full",), notes=("nothing moves yet",)),
        made.lap(1, 2.5, 12.0, valid=False, reasons=("the car left the lane for 0.8 s",)),
        made.crossing(14.5, status=PassStatus.LAP, lap=1),
        made.crossing(14.6, car=2, status=PassStatus.START, lap=1),
        made.lap(2, 14.5, 10.0, official_time_s=12.0, penalty_s=2.0),
        made.lap(3, 24.5, 11.25, suspect=("the camera moved",)),
        made.standings(36.0, 2, 1),
        made.race_state(60.0, RacePhase.GRACE),
        made.lap(1, 14.6, 47.0, car=2, similarity=None),
        made.standings(62.0, 2, 1),
        made.run_summary(),
        made.target(63.0),
        made.lap(4, 47.0, 16.0),
        made.crossing(64.0, status=PassStatus.START, lap=5),
    ]


def summary(state: BoardState):
    """What a board says, as plain JSON."""
    return {
        "t_s": state.t_s,
        "shown_car": state.shown.car,
        "cars": [
            {
                "car": car.car,
                "target_id": car.target_id,
                "phase": car.phase.value,
                "lap_number": car.lap_number,
                "lap_start_s": car.lap_start_s,
                "laps": [lap.number for lap in car.laps],
                "best": None if car.best_lap is None else car.best_lap.number,
                "crossed_s": car.crossed_s,
                "seen_s": car.seen_s,
                "running": None if car.running is None else car.running.t_s,
                "laps_done": car.laps_done,
            }
            for car in state.cars
        ],
        "running_s": state.running_s,
        "flashing": state.flashing,
        "unseen": state.unseen,
        "counting_down": state.counting_down,
        "told": [type(one).__name__.lower() for one in state.told],
        "told_count": state.told_count,
        "health": None if state.health is None else state.health.t_s,
        "race": None if state.race is None else state.race.phase.value,
        "state_line": state.state_line,
        "headline": headline_text(state),
    }


SUMMARY_JS = """
(B, W) => (board) => ({
  t_s: board.t_s,
  shown_car: B.shown(board).car,
  cars: board.cars.map((car) => ({
    car: car.car, target_id: car.target_id, phase: car.phase, lap_number: car.lap_number, lap_start_s: car.lap_start_s,
    laps: car.laps.map((lap) => lap.number), best: car.best_lap?.number ?? null, crossed_s: car.crossed_s, seen_s: car.seen_s,
    running: car.running?.t_s ?? null, laps_done: B.lapsDone(car),
  })),
  running_s: B.runningS(board), flashing: B.flashing(board), unseen: B.unseen(board), counting_down: B.countingDown(board),
  told: board.told.map((one) => one.event), told_count: board.told_count, health: board.health?.t_s ?? null,
  race: board.race?.phase ?? null, state_line: W.stateLine(board), headline: W.headline(board),
})
"""
"""`summary` of the page's board."""

AFTER_EACH_JS = f"""
async ([events, laps_wanted]) => {{
  const [B, W] = await Promise.all([import("/static/board_state.js"), import("/static/board_words.js")]);
  const summary = ({SUMMARY_JS})(B, W);
  let board = B.newBoard(laps_wanted);
  return events.map((event) => summary(board = B.after(board, event)));
}}
"""


def plain(events):
    """Events as the page hears them."""
    return [json.loads(wire.event_to_json(event)) for event in events]


def after_each(events, laps_wanted=None):
    """What Python's board says after each event."""
    state, said = BoardState(laps_wanted=laps_wanted), []
    for event in events:
        state = state.after(event)
        said.append(summary(state))
    return said
