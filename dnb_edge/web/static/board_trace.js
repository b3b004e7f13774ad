// Where the cars were: the path of each one's running lap, and of its best. Kept in the page only, from what it heard. Knows
// events and the board; knows no canvas. Times are the source's seconds, places metres on the track plane.

import { carOf, officialS } from "./board_state.js";

/** A lap of ten minutes at sixty frames a second is thinned out to this. */
const MOST_POINTS = 6000;
/** Between two frames a car is drawn where it is going to be, but no farther than this. */
const AHEAD_S = 0.15;
const GAP_S = 0.5;

export class Traces {
  #cars = new Map();

  /** Take in an event that `board` has just taken in. */
  after(board, event) {
    if (event.event === "target") this.#target(board, event);
    else if (event.event === "running") this.#of(event.car).running = event;
    else if (event.event === "crossing" && event.status === "start") this.#begin(this.#of(event.car), event.t_s);
    else if (event.event === "lap") this.#lap(board, event);
  }

  reset() {
    this.#cars.clear();
  }

  /** The path of a car's running lap as [{t_s, x, y}]; of the way there before its first. */
  path(car) {
    return this.#cars.get(car)?.path ?? [];
  }

  /** The path of a car's best lap, times from its start; null where the page did not see all of it. */
  best(car) {
    return this.#cars.get(car)?.best ?? null;
  }

  /** Where a car is at `t_s`: {x, y, vx, vy, fresh}; null before it was seen. */
  place(car, t_s) {
    const last = this.#cars.get(car)?.last;
    if (last === undefined) return null;
    const ahead_s = Math.min(AHEAD_S, Math.max(0, t_s - last.t_s));
    const [vx, vy] = last.velocity_mps;
    return { x: last.track_m[0] + vx * ahead_s, y: last.track_m[1] + vy * ahead_s, vx, vy, fresh: t_s - last.t_s < GAP_S };
  }

  /** Where the car was in its best lap after `elapsed_s`: [x, y]; null before there is one and after its end. */
  ghost(car, elapsed_s) {
    const found = this.#cars.get(car);
    if (found === undefined || elapsed_s === null) return null;
    if (found.best !== null) return between(found.best, elapsed_s);
    return found.running?.ghost_m ?? null;
  }

  #of(car) {
    if (!this.#cars.has(car)) this.#cars.set(car, { path: [], best: null, last: undefined, running: null });
    return this.#cars.get(car);
  }

  #target(board, target) {
    const number = carOf(board, target.target_id);
    if (number === null || target.state === "tentative" || target.state === "lost") return;
    const found = this.#of(number);
    found.last = target;
    if (target.state !== "confirmed") return;
    found.path.push({ t_s: target.t_s, x: target.track_m[0], y: target.track_m[1] });
    if (found.path.length > MOST_POINTS) found.path = found.path.filter((_, at) => at % 2 === 0);
  }

  #begin(found, t_s) {
    found.path = found.path.filter((point) => point.t_s >= t_s);
    found.running = null;
  }

  #lap(board, lap) {
    const found = this.#of(lap.car);
    const end_s = lap.start_s + lap.time_s;
    const driven = found.path.filter((point) => point.t_s >= lap.start_s && point.t_s <= end_s);
    const best = board.cars.find((car) => car.car === lap.car)?.best_lap ?? null;
    if (best !== null && best.number === lap.number && officialS(best) === officialS(lap)) {
      found.best = whole(driven, lap) ? driven.map((point) => ({ ...point, t_s: point.t_s - lap.start_s })) : null;
    }
    this.#begin(found, end_s);
  }
}

/** True where `points` reach from a lap's start to its end. */
function whole(points, lap) {
  return points.length > 1 && points[0].t_s - lap.start_s < GAP_S && lap.start_s + lap.time_s - points.at(-1).t_s < GAP_S;
}

/** The place on a timed path at `t_s`, by bisection; null beyond its ends. */
export function between(points, t_s) {
  if (points.length === 0 || t_s < 0 || t_s > points.at(-1).t_s) return null;
  let low = 0;
  let high = points.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[middle].t_s < t_s) low = middle + 1;
    else high = middle;
  }
  const later = points[low];
  const earlier = points[Math.max(0, low - 1)];
  const span_s = later.t_s - earlier.t_s;
  const share = span_s > 0 ? (t_s - earlier.t_s) / span_s : 0;
  return [earlier.x + share * (later.x - earlier.x), earlier.y + share * (later.y - earlier.y)];
}
