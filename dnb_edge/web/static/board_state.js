// What a board shows, as one value, and how each event changes it: a pure reducer, the peer of dnb_edge/display/state.py and
// car_board.py, whose rules these are (a test runs both over the same races). Knows events; knows no page and no clock:
// `t_s` comes with the events, in seconds from the first frame of the run. Members are named as in the events' JSON.

export const FLASH_S = 1.0;
export const UNSEEN_S = 2.0;
export const LAPS_KEPT = 50;
export const START_LINE = "start";

export const Phase = Object.freeze({ WAITING: "waiting", OUT_LAP: "out_lap", LAP: "lap", FINISHED: "finished" });

/** A car of which nothing has been heard. `passes`: the sector lines that it crossed in its running lap, [{line, t_s}]. */
export function newCar(car = 1) {
  return {
    car,
    target_id: null,
    phase: Phase.WAITING,
    lap_number: null,
    lap_start_s: null,
    laps: [],
    best_lap: null,
    crossed_s: null,
    seen_s: null,
    running: null,
    passes: [],
  };
}

/** The board before a run's first event. */
export function newBoard(laps_wanted = null, start_line = START_LINE) {
  return {
    start_line,
    laps_wanted,
    t_s: 0,
    cars: [newCar()],
    shown_car: 1,
    race: null,
    standings: null,
    told: [],
    told_count: 0,
    health: null,
    summary: null,
  };
}

/** The board once `event` has happened. A lap and the crossing that ends it may come in either order. */
export function after(board, event) {
  switch (event.event) {
    case "lap":
    case "incident":
      return happened(board, event);
    case "race":
      return { ...at(board, event.t_s), race: event };
    case "health":
      return { ...at(board, event.t_s), health: event };
    case "standings":
      return { ...at(board, event.t_s), standings: event, shown_car: event.rows[0]?.car ?? board.shown_car };
    case "run":
      return { ...board, cars: board.cars.map(finished), summary: event };
    case "target":
    case "crossing":
    case "running":
    case "observation":
      return moved(at(board, event.t_s), event);
    default:
      return board; // scores, and whatever a later version tells
  }
}

/** The same board at `t_s`; time never runs backwards. */
export function at(board, t_s) {
  return t_s > board.t_s ? { ...board, t_s } : board;
}

function moved(board, event) {
  if (event.event === "target" && event.state === "confirmed") return seen(board, event);
  if (event.event === "running") return withCar(board, event.car, (car) => ({ ...car, running: event }));
  if (event.event === "crossing" && event.direction === "forward") {
    if (event.line === board.start_line) return withCar(board, event.car, (car) => crossed(car, event));
    // A sector line makes no car known that was not: only the start line does.
    const known = board.cars.some((car) => car.car === event.car);
    if (event.status === "sector" && known) return withCar(board, event.car, (car) => passed(car, event));
  }
  return board;
}

function happened(board, event) {
  const lasted_s = event.event === "lap" ? event.time_s : event.lasted_s;
  const told = {
    ...at(board, event.start_s + lasted_s),
    told: [...board.told, event].slice(-LAPS_KEPT),
    told_count: board.told_count + 1,
  };
  return event.event === "lap" ? withCar(told, event.car, (car) => lapped(car, event, board.laps_wanted)) : told;
}

/** Number of the car to which a target belongs: the one last told under its number; before any crossing, the shown one. */
export function carOf(board, target_id) {
  const known = board.cars.find((car) => car.target_id === target_id);
  if (known !== undefined) return known.car;
  const front = shown(board);
  return front.target_id === null || board.cars.length === 1 ? front.car : null;
}

function seen(board, target) {
  const number = carOf(board, target.target_id);
  if (number === null) return board;
  return withCar(board, number, (car) => ({
    ...car,
    phase: car.phase === Phase.WAITING ? Phase.OUT_LAP : car.phase,
    seen_s: target.t_s,
  }));
}

/** With one car changed; a car that was not known before joins the others. */
function withCar(board, number, change) {
  if (board.cars.some((car) => car.car === number)) {
    return { ...board, cars: board.cars.map((car) => (car.car === number ? change(car) : car)) };
  }
  return { ...board, cars: [...board.cars, change(newCar(number))].sort((one, other) => one.car - other.car) };
}

function crossed(car, crossing) {
  const later = { ...car, crossed_s: crossing.t_s, target_id: crossing.target_id };
  const status = crossing.status ?? null;
  const begins = status === null ? car.phase === Phase.WAITING || car.phase === Phase.OUT_LAP : status === "start";
  // A running lap is ended by its lap alone: the rules may have refused this crossing (minimum lap).
  if (!begins || car.phase === Phase.FINISHED) return later;
  const number = crossing.lap ?? lapsDone(car) + 1;
  return { ...later, phase: Phase.LAP, lap_number: number, lap_start_s: crossing.t_s, running: null, passes: [] };
}

function passed(car, crossing) {
  return { ...car, passes: [...car.passes, { line: crossing.line, t_s: crossing.t_s }] };
}

function lapped(car, lap, laps_wanted) {
  const faster = lap.valid && (car.best_lap === null || officialS(lap) < officialS(car.best_lap));
  const later = {
    ...car,
    target_id: lap.target_id ?? car.target_id,
    laps: [...car.laps, lap].slice(-LAPS_KEPT),
    best_lap: faster ? lap : car.best_lap,
    running: null,
    passes: [],
  };
  if (car.phase === Phase.FINISHED || (laps_wanted !== null && lap.number >= laps_wanted)) return finished(later);
  return { ...later, phase: Phase.LAP, lap_number: lap.number + 1, lap_start_s: lap.start_s + lap.time_s };
}

function finished(car) {
  return { ...car, phase: Phase.FINISHED, lap_number: null, lap_start_s: null, running: null, passes: [] };
}

/** The lap's time with its penalties, seconds. */
export function officialS(lap) {
  return lap.official_time_s ?? lap.time_s;
}

/** The car in front: the one that leads. */
export function shown(board) {
  return board.cars.find((car) => car.car === board.shown_car) ?? board.cars[0];
}

/** A car's latest complete lap; null before there is one. */
export function lastLap(car) {
  return car.laps.at(-1) ?? null;
}

/** Number of a car's complete laps, those no longer kept included. */
export function lapsDone(car) {
  return lastLap(car)?.number ?? 0;
}

/** Time of the shown car's running lap so far, seconds; null where none is running. */
export function runningS(board) {
  const { lap_start_s } = shown(board);
  return lap_start_s === null ? null : Math.max(0, board.t_s - lap_start_s);
}

/** True for `FLASH_S` after a crossing of the shown car. */
export function flashing(board) {
  const { crossed_s } = shown(board);
  return crossed_s !== null && board.t_s - crossed_s < FLASH_S;
}

/** True where a run is on and the shown car has not been seen for `UNSEEN_S`. */
export function unseen(board) {
  const { phase, seen_s } = shown(board);
  return (phase === Phase.OUT_LAP || phase === Phase.LAP) && seen_s !== null && board.t_s - seen_s > UNSEEN_S;
}

/** True while a countdown runs. */
export function countingDown(board) {
  return board.race?.phase === "countdown";
}

/** The laps and incidents that `later` knows and `earlier` does not, oldest first, as far as they are kept. */
export function newsSince(earlier, later) {
  const missed = Math.max(0, later.told_count - (earlier?.told_count ?? 0));
  return missed === 0 ? [] : later.told.slice(-Math.min(missed, later.told.length));
}
