// What the places of a board page hold, as plain values: texts, kinds, rows. Pure functions of a board of board_state.js; knows
// no page. `kind` is one of "", "good", "warn", "bad", "best", "accent".

import * as B from "./board_state.js";
import { fixed, headline, percent, remarks, seconds, sigma, signed, standingFigure, standingGap, stateLine, ticking, who } from "./board_words.js";

/** From so many cars on there are standings to show. */
const LEAST_CARS = 2;

/** What heads the page: what the daemon does where it races not, else where the race stands. */
export function heading(board, still) {
  const begun = board.told_count > 0 || board.summary !== null || B.shown(board).phase !== B.Phase.WAITING;
  return still === null || begun ? capital(title(board)) : still.title;
}

/** All texts that change with the race: {name: {text, note, kind}}. */
export function figures(board, decimals = 2) {
  const car = B.shown(board);
  const last = B.lastLap(car);
  const best = car.best_lap;
  return {
    clock: { text: headline(board, decimals), note: "", kind: clockKind(board, last) },
    delta: delta(car),
    last: lapFigure(last, best),
    best: best === null ? none() : { text: seconds(B.officialS(best)), note: `lap ${best.number}`, kind: "best" },
    score: score(car, last),
    seen: { text: B.unseen(board) ? "car not seen" : "", note: "", kind: "warn" },
    remaining: { text: remaining(board), note: "", kind: "" },
  };
}

function title(board) {
  const on = board.cars.some((car) => car.phase !== B.Phase.FINISHED);
  const leads = board.cars.length > 1 && B.shown(board).phase !== B.Phase.WAITING && on;
  return `${leads ? `${who(board, board.shown_car)}, ` : ""}${stateLine(board)}`;
}

function clockKind(board, last) {
  if (B.countingDown(board)) return "accent";
  if (B.shown(board).phase === B.Phase.FINISHED || !B.flashing(board)) return "";
  return last !== null && !last.valid ? "bad" : "good";
}

function delta(car) {
  const value = car.running?.delta_s ?? null;
  if (value === null) return none("");
  return { text: `${signed(value)} s`, note: "to the best lap", kind: value < 0 ? "good" : "warn" };
}

function lapFigure(last, best) {
  if (last === null) return none();
  const penalty = last.penalty_s > 0 ? ` +${fixed(last.penalty_s, 1)} s` : "";
  const kind = !last.valid || last.suspect.length > 0 ? "bad" : best?.number === last.number ? "best" : "";
  return { text: seconds(last.time_s), note: `${sigma(last.sigma_s)}${penalty}${last.valid ? "" : ", not valid"}`, kind };
}

function score(car, last) {
  const now = car.running?.similarity_percent ?? null;
  const running = now === null ? "" : `now ${percent(now)}`;
  return { text: last === null ? "–" : percent(last.similarity_percent), note: running, kind: "" };
}

function remaining(board) {
  const left_s = board.race?.phase === "racing" ? (board.race.remaining_s ?? null) : null;
  if (left_s === null) return "";
  const now_s = Math.max(0, left_s - (board.t_s - board.race.t_s));
  return `${Math.floor(now_s / 60)}:${String(Math.floor(now_s % 60)).padStart(2, "0")} left`;
}

function none(text = "–") {
  return { text, note: "", kind: "" };
}

function capital(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** The shown car's laps, the latest first: [{number, cells, remarks, kind}]. */
export function lapRows(board) {
  const car = B.shown(board);
  return [...car.laps].reverse().map((lap) => ({
    number: lap.number,
    best: car.best_lap?.number === lap.number,
    time: seconds(lap.time_s),
    sigma: sigma(lap.sigma_s),
    score: percent(lap.similarity_percent),
    sectors: lap.sectors.map((sector) => seconds(sector.time_s)),
    remarks: remarks(lap),
    kind: !lap.valid || lap.suspect.length > 0 ? "bad" : car.best_lap?.number === lap.number ? "best" : "",
  }));
}

/** Changes whenever `lapRows` may have. */
export function lapRowsKey(board) {
  return `${board.shown_car}/${board.told_count}`;
}

/** Places of several cars: {unit, final, rows: [{place, name, laps, value, gap, last, kind}]}; null where there are not several. */
export function places(board) {
  const { standings } = board;
  if (standings === null || standings.rows.length < LEAST_CARS) return null;
  const { unit } = standings;
  return {
    by: `${standings.rank_by.replaceAll("_", " ")}${unit === "laps" ? "" : `, ${unit === "percent" ? "%" : unit}`}`,
    final: standings.final,
    rows: standings.rows.map((row) => ({
      place: `${row.place}${row.tied ? "=" : ""}`,
      car: row.car,
      name: row.name,
      note: (row.dnf ?? null) === null ? "" : `out: ${row.dnf}`,
      laps: String(row.laps),
      value: standingFigure(row.value, unit),
      gap: standingGap(row, unit),
      last: seconds(row.last_lap_s),
      kind: (row.dnf ?? null) !== null ? "bad" : "",
    })),
  };
}

/** The sectors of the running lap, with those that are still to come as they were in the lap before. */
export function sectors(board) {
  const car = B.shown(board);
  const last = B.lastLap(car);
  const known = (car.best_lap ?? last)?.sectors ?? car.passes.map(({ line }, at) => ({ number: at + 1, line }));
  const driven = runningSectors(car);
  return known.map((sector, at) => {
    const now = driven.find((one) => one.line === sector.line);
    const time_s = now?.time_s ?? last?.sectors[at]?.time_s ?? null;
    const best_s = car.best_lap?.sectors[at]?.time_s ?? null;
    const against_s = now === undefined || best_s === null ? null : now.time_s - best_s;
    return {
      name: `S${sector.number}`,
      text: seconds(time_s),
      note: against_s === null ? "" : signed(against_s),
      kind: against_s === null ? "" : against_s < 0 ? "good" : "warn",
      running: now !== undefined,
    };
  });
}

function runningSectors(car) {
  if (car.lap_start_s === null) return [];
  return car.passes.map(({ line, t_s }, at) => ({ line, time_s: t_s - (car.passes[at - 1]?.t_s ?? car.lap_start_s) }));
}

/** The latest incident of the shown car in its running lap, as a sentence; null where there is none. */
export function incidentNow(board) {
  const car = B.shown(board);
  const found = board.told.findLast((one) => one.event === "incident" && one.car === car.car);
  return found !== undefined && found.lap !== null && found.lap === car.lap_number ? found.text : null;
}

export { ticking };
