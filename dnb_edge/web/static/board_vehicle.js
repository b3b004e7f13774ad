// What cars tell of themselves, in words: how long their networks take, how often they tell, and how old that is. Knows vehicle
// events and the moment at which they were heard; knows no page. Nothing of a race depends on it.

import { fixed } from "./board_words.js";

/** A car that says nothing for so long is silent. */
const SILENT_MS = 2000;

export class Vehicles {
  #cars = new Map();

  reset() {
    this.#cars.clear();
  }

  /** Takes an event in, heard at `now_ms`; true where it is one of a vehicle. */
  heard(event, now_ms) {
    if (event.event !== "vehicle") return false;
    this.#cars.set(event.car, { event, now_ms });
    return true;
  }

  /** A row for each car, in the order of their numbers: [{name, value, kind}]. */
  facts(now_ms) {
    return [...this.#cars.values()].sort((one, other) => one.event.car - other.event.car).map((heard) => fact(heard, now_ms));
  }
}

function fact({ event, now_ms: heard_ms }, now_ms) {
  const age_ms = Math.max(0, now_ms - heard_ms);
  const told = [];
  if ((event.inference_ms ?? null) !== null) told.push(`inference ${fixed(event.inference_ms, 1)} ms`);
  if ((event.rate_hz ?? null) !== null && age_ms < SILENT_MS) told.push(`${fixed(event.rate_hz, 0)} a second`);
  if (event.missing > 0) told.push(`${event.missing} missing`);
  told.push(age_ms < SILENT_MS ? "now" : `silent for ${fixed(Math.floor(age_ms / 1000), 0)} s`);
  return { name: `Car ${event.car}`, value: told.join(", "), kind: age_ms < SILENT_MS ? "" : "warn" };
}
