// The board's page, the projector's and the overlay's: the live stream in, the page out. Events change values at once and the
// next frame of the screen paints them; nothing is polled.

import { SourceClock, Forward } from "./board_clock.js";
import { figures, ticking } from "./board_figures.js";
import { standstill } from "./board_health.js";
import { TrackMap } from "./board_map.js";
import { Sounds } from "./board_sound.js";
import * as B from "./board_state.js";
import { Traces } from "./board_trace.js";
import { Vehicles } from "./board_vehicle.js";
import { BoardView } from "./board_view.js";
import { fixed, lapSentence } from "./board_words.js";
import { follow, Line } from "./live.js";

const SPOKEN_EVERY_MS = 200;

const view = new BoardView();
const canvas = view.place("map");
const map = canvas === undefined ? null : new TrackMap(canvas);
const clock = new SourceClock();
const forward = new Forward();
const traces = new Traces();
const vehicles = new Vehicles();
const sounds = new Sounds();
const calm = matchMedia("(prefers-reduced-motion: reduce)");

let board = B.newBoard();
let state = null;
let line = Line.CONNECTING;
let retryAt = null;
let first = 0;
let dirty = true;
let applianceDirty = true;
let fold = 0;

/** A run begins, or all is told anew. */
function reset() {
  board = B.newBoard(state?.laps_wanted ?? null);
  traces.reset();
  vehicles.reset();
  clock.reset();
  dirty = applianceDirty = true;
}

follow({
  onHello(hello) {
    if (hello.resumed) return;
    first = 0;
    reset();
  },
  onState(next) {
    const earlier = state;
    applianceDirty = true;
    if (next === null) return; // the figures stay, and the page says that they are old
    state = next;
    if ((next.first_sequence ?? 0) > first) {
      first = next.first_sequence;
      reset();
    }
    board = { ...board, laps_wanted: next.laps_wanted ?? null };
    if (map !== null && JSON.stringify(next.scenery) !== JSON.stringify(earlier?.scenery)) map.scenery = next.scenery ?? null;
    dirty = true;
  },
  onEvent(event, { sequence, past }) {
    if (sequence < first || vehicles.heard(event, performance.now())) return;
    const earlier = board;
    board = B.after(board, event);
    traces.after(board, event);
    if (event.event === "health") applianceDirty = true;
    dirty = true;
    if (past) return;
    if (event.t_s !== undefined && event.event !== "crossing") clock.heard(event.t_s, performance.now());
    tell(earlier, event);
  },
  onLine(next, about) {
    line = next;
    retryAt = about.retryAt;
    dirty = applianceDirty = true;
  },
});

/** Sounds and words for what has just happened. */
function tell(earlier, event) {
  for (const news of B.newsSince(earlier, board)) {
    if (news.event !== "lap") continue;
    const text = lapSentence(board, news);
    view.announce(text);
    sounds.say(text);
    document.title = `${fixed(news.time_s, 3)} s, lap ${news.number} – dnb-edge`;
    const best = board.cars.find((car) => car.car === news.car)?.best_lap?.number === news.number;
    sounds.beep(news.penalty_s > 0 || !news.valid ? "penalty" : best ? "best" : "crossing");
  }
  if (event.event === "crossing" && event.status === "start") sounds.beep("crossing");
  if (event.event === "race" && event.phase === "countdown" && (event.countdown_s ?? null) !== null) sounds.beep("count");
  if (event.event === "race" && event.phase === "racing" && earlier.race?.phase === "countdown") sounds.beep("go");
}

function paint(now_ms) {
  const moment = clock.at(now_ms);
  const shown = moment === null ? board : B.at(board, moment);
  paintClock(shown);
  if (dirty) view.race(shown, standstill(line, state));
  dirty = B.flashing(shown) || (B.unseen(shown) !== B.unseen(board));
  // The countdown to the next try ticks; else it is painted when it has changed.
  const fifth = Math.floor(now_ms / SPOKEN_EVERY_MS);
  if (applianceDirty || (retryAt !== null && fifth !== fold)) {
    fold = fifth;
    applianceDirty = false;
    view.appliance(board.health, state, line, retryAt === null ? null : (retryAt - Date.now()) / 1000);
  }
  view.vehicles(vehicles.facts(now_ms));
  map?.paint(cars(shown));
  requestAnimationFrame(paint);
}

function paintClock(shown) {
  const { clock: figure, remaining } = figures(shown);
  const car = B.shown(shown);
  if (ticking(shown)) {
    const running_s = forward.of(`${car.car}/${car.lap_number}/${car.lap_start_s}`, B.runningS(shown));
    // Somebody who wants no motion sees whole seconds go by.
    figure.text = calm.matches ? fixed(Math.floor(running_s), 0) : fixed(Math.floor(running_s * 100) / 100, 2);
  }
  view.tick(figure, remaining);
}

function cars(shown) {
  const several = shown.cars.length > 1;
  return shown.cars.map((car) => ({
    number: car.car,
    label: several ? String(car.car) : null,
    shown: car.car === B.shown(shown).car,
    place: traces.place(car.car, shown.t_s),
    path: traces.path(car.car),
    best: traces.best(car.car),
    ghost: traces.ghost(car.car, car.lap_start_s === null ? null : shown.t_s - car.lap_start_s),
  }));
}

/** Switches of sound and speech, where the page has them. */
for (const box of document.querySelectorAll("[data-sound]")) {
  const name = box.dataset.sound;
  box.checked = sounds.on[name];
  box.disabled = !Sounds.there[name];
  box.addEventListener("change", () => sounds.switch(name, box.checked));
}

requestAnimationFrame(paint);
