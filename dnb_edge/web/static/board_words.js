// What a board says, as text: numbers, laps, health and warnings in words. Pure functions of a board of board_state.js and
// of the daemon's state; knows no page.

import * as B from "./board_state.js";

/** `value` with so many decimals, rounded as Python does it: halves to the even neighbour. */
export function fixed(value, decimals) {
  const twice = value * 2 ** (decimals + 1);
  if (!Number.isInteger(twice) || twice % 2 === 0) return value.toFixed(decimals);
  const below = Math.floor(value * 10 ** decimals); // exact: it ends in .5
  return ((below % 2 === 0 ? below : below + 1) / 10 ** decimals).toFixed(decimals);
}

/** A car's run in a few words, such as `lap 2 of 3`. */
export function stateLine(board) {
  const { race } = board;
  if (race?.phase === "waiting" || race?.phase === "countdown") {
    if (B.countingDown(board)) {
      return (race.countdown_s ?? null) === null ? "countdown" : `countdown, ${fixed(race.countdown_s, 0)} s`;
    }
    if (race.text) return race.text;
  }
  const car = B.shown(board);
  switch (car.phase) {
    case B.Phase.WAITING:
      return "waiting for the car";
    case B.Phase.OUT_LAP:
      return "out lap";
    case B.Phase.LAP: {
      const wanted = board.laps_wanted === null ? "" : ` of ${board.laps_wanted}`;
      return `lap ${car.lap_number}${wanted}${race?.phase === "grace" ? ", the time is up" : ""}`;
    }
    default:
      return "finished";
  }
}

/** What stands in the largest figures: the countdown; the last lap while it flashes and after the run; else the running lap. */
export function headline(board, decimals = 1) {
  if (B.countingDown(board)) {
    return (board.race.countdown_s ?? null) === null ? "--.-" : fixed(board.race.countdown_s, 0);
  }
  const last = B.lastLap(B.shown(board));
  if (last !== null && (B.flashing(board) || B.shown(board).phase === B.Phase.FINISHED)) {
    return fixed(last.time_s, 3).slice(0, 7);
  }
  const running = B.runningS(board);
  return running === null ? "--.-" : fixed(running, decimals);
}

/** True where `headline` is the running lap's time, which the page's clock moves on between events. */
export function ticking(board) {
  if (B.countingDown(board) || B.runningS(board) === null) return false;
  return !(B.flashing(board) && B.lastLap(B.shown(board)) !== null);
}

/** Seconds with three decimals; a dash for none. */
export function seconds(value) {
  return value === null || value === undefined ? "–" : fixed(value, 3);
}

/** One standard deviation, in milliseconds, at least one. */
export function sigma(value) {
  return value === null || value === undefined ? "" : `± ${Math.max(1, Math.round(value * 1000))} ms`;
}

/** With its sign: `+0.21`, `−0.05`. */
export function signed(value, decimals = 2) {
  const text = fixed(Math.abs(value), decimals);
  return `${value < 0 && Number(text) !== 0 ? "−" : "+"}${text}`;
}

export function percent(value) {
  return value === null || value === undefined ? "–" : `${fixed(value, 1)} %`;
}

/** The remarks about a lap: sentences with a kind, `bad`, `warn` or `plain`. */
export function remarks(lap) {
  const penalties = lap.penalties.map((penalty) => ({ kind: "warn", text: `${cost(penalty)}${penalty.reason}` }));
  const official =
    lap.penalty_s > 0
      ? [{ kind: "plain", text: `Official time ${seconds(B.officialS(lap))} s, with ${fixed(lap.penalty_s, 3)} s of penalty` }]
      : [];
  return [
    ...lap.suspect.map((text) => ({ kind: "bad", text: `Suspect: ${text}` })),
    ...(lap.valid ? [] : lap.reasons.map((text) => ({ kind: "bad", text: `Not valid: ${text}` }))),
    ...(lap.valid || lap.reasons.length > 0 ? [] : [{ kind: "bad", text: "Not valid" }]),
    ...official,
    ...penalties,
    ...(lap.estimated ? [{ kind: "plain", text: "The car was not seen at the line: the time is estimated" }] : []),
  ];
}

function cost(penalty) {
  if (penalty.dnf) return "Out: ";
  if (penalty.seconds > 0) return `+${fixed(penalty.seconds, 1)} s: `;
  return penalty.factor < 1 ? `Score × ${penalty.factor}: ` : "";
}

/** The car's number, and its name where standings have told one. */
export function who(board, number) {
  const name = board.standings?.rows.find((row) => row.car === number)?.name ?? `car ${number}`;
  return name === `car ${number}` ? name : `car ${number} ${name}`;
}

/** A finished lap as a sentence, for those who listen. */
export function lapSentence(board, lap) {
  const car = board.cars.find((one) => one.car === lap.car);
  const best = car?.best_lap?.number === lap.number ? ", best lap" : "";
  const score = lap.similarity_percent === null ? "" : `, score ${fixed(lap.similarity_percent, 0)} percent`;
  const penalty = lap.penalty_s > 0 ? `, ${fixed(lap.penalty_s, 0)} seconds penalty` : "";
  const driver = board.cars.length > 1 ? `${who(board, lap.car)}, ` : "";
  return `${driver}lap ${lap.number}: ${fixed(lap.time_s, 2)} seconds${best}${score}${penalty}${lap.valid ? "" : ", not valid"}`;
}

/** A place's value in its unit, and the way to the leader. */
export function standingFigure(value, unit) {
  if (value === null) return "–";
  return unit === "s" ? fixed(value, 3) : unit === "percent" || unit === "m" ? fixed(value, 1) : String(value);
}

export function standingGap(row, unit) {
  if ((row.gap ?? null) !== null) return `+${standingFigure(Math.abs(row.gap), unit)}`;
  if ((row.gap_laps ?? null) !== null) return `+${row.gap_laps} ${row.gap_laps === 1 ? "lap" : "laps"}`;
  return "";
}
