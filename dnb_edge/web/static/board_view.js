// Writes a board into a page: whatever of the places named `data-show` the page has. Knows the document; all words come from
// others. Writes only what has changed, so that an event costs little.

import { figures, heading, incidentNow, lapRows, lapRowsKey, places, sectors } from "./board_figures.js";
import { healthFacts, lineWords, sentence, standstill, warnings } from "./board_health.js";

const KINDS = ["good", "warn", "bad", "best", "accent"];

export class BoardView {
  #places = new Map();
  #written = new WeakMap();
  #keys = new Map();

  constructor(root = document) {
    for (const element of root.querySelectorAll("[data-show]")) this.#places.set(element.dataset.show, element);
    this.laps_shown = Number(this.#places.get("laps")?.dataset.most ?? 50);
  }

  /** The element of a place; undefined where this page has none. */
  place(name) {
    return this.#places.get(name);
  }

  /** What moves with the clock alone. */
  tick(clock, remaining) {
    this.#figure("clock", clock);
    const element = this.#places.get("clock");
    element.dataset.digits = String(clock.text.indexOf(".")); // its size goes by these
    element.classList.toggle("is-idle", clock.text === "--.-");
    this.#figure("remaining", remaining);
  }

  /** All that the race says; `still`: what the page says instead of a race, or null. */
  race(board, still) {
    const all = figures(board);
    this.#figure("state", { text: heading(board, still), note: "", kind: "" });
    for (const name of ["delta", "last", "best", "score", "seen"]) this.#figure(name, all[name]);
    this.#once("laps", lapRowsKey(board), () => this.#laps(board));
    const standings = places(board);
    this.#once("places", JSON.stringify(standings), () => this.#standings(standings));
    const cells = sectors(board);
    this.#once("sectors", JSON.stringify(cells), () => this.#sectors(cells));
    const incident = incidentNow(board);
    this.#figure("incident", { text: incident === null ? "" : sentence(incident), note: "", kind: "warn" });
  }

  /** How the appliance and the line to it are. */
  appliance(health, state, line, retry_in_s) {
    const words = lineWords(line, state, retry_in_s);
    this.#figure("line", { ...words, note: "" });
    this.#figure("run", { text: state?.run ?? "", note: "", kind: "" });
    this.#figure("track", { text: state?.track ?? "", note: "", kind: "" });
    const facts = healthFacts(health);
    this.#once("health", JSON.stringify(facts), () => this.#facts(facts));
    const still = standstill(line, state);
    // What heads the page already need not be said twice.
    const title = this.#places.get("state")?.textContent === still?.title ? undefined : still?.title;
    const told = [...(still === null || still.text === "" ? [] : [{ ...still, title }]), ...(line === "connected" ? warnings(health) : [])];
    this.#once("notices", JSON.stringify(told), () => this.#notices(told));
    document.body.classList.toggle("is-old", line !== "connected");
  }

  /** What cars tell of themselves: rows of names and values. */
  vehicles(facts) {
    this.#once("vehicles", JSON.stringify(facts), () => {
      const list = this.#places.get("vehicles");
      list.closest("[data-optional]").hidden = facts.length === 0;
      list.replaceChildren(...facts.flatMap(factRow));
    });
  }

  /** Say it to those who listen with a screen reader. */
  announce(text) {
    const region = this.#places.get("said");
    if (region !== undefined) region.textContent = text;
  }

  #figure(name, { text, note, kind }) {
    const element = this.#places.get(name);
    if (element === undefined) return;
    const key = `${text}\n${note}\n${kind}`;
    if (this.#written.get(element) === key) return;
    this.#written.set(element, key);
    const value = element.querySelector("[data-value]") ?? element;
    value.textContent = text;
    const remark = element.querySelector("[data-note]");
    if (remark !== null) remark.textContent = note;
    if (element.dataset.optional !== undefined) element.hidden = text === "";
    const base = element.dataset.kind ?? "is";
    for (const one of KINDS) element.classList.toggle(`${base}-${one}`, one === kind);
  }

  /** Do it where `key` is another one than the last time and the page has the place. */
  #once(name, key, write) {
    if (!this.#places.has(name) || this.#keys.get(name) === key) return;
    this.#keys.set(name, key);
    write();
  }

  #laps(board) {
    const rows = lapRows(board).slice(0, this.laps_shown);
    const body = this.#places.get("laps");
    body.replaceChildren(...rows.flatMap(lapRow));
    body.closest("table").classList.toggle("has-sectors", rows.some((row) => row.sectors.length > 0));
    body.closest("[data-empty]")?.toggleAttribute("data-is-empty", rows.length === 0);
  }

  #standings(standings) {
    const body = this.#places.get("places");
    body.closest("[data-optional]").hidden = standings === null;
    if (standings === null) return body.replaceChildren();
    const head = this.#places.get("places-by");
    if (head !== undefined) head.textContent = standings.by;
    const title = this.#places.get("places-title");
    if (title !== undefined) title.textContent = standings.final ? "Result" : "Standings";
    body.replaceChildren(...standings.rows.map(standingRow));
  }

  #sectors(cells) {
    const list = this.#places.get("sectors");
    list.hidden = cells.length === 0;
    list.replaceChildren(
      ...cells.map((cell) => {
        const item = made("li", `sector${cell.kind === "" ? "" : ` is-${cell.kind}`}${cell.running ? "" : " is-to-come"}`);
        item.append(made("span", "sector__name", cell.name), made("span", "sector__time number", cell.text), made("span", "sector__note number", cell.note));
        return item;
      }),
    );
  }

  #facts(facts) {
    const list = this.#places.get("health");
    list.replaceChildren(...facts.flatMap(factRow));
  }

  #notices(told) {
    this.#places.get("notices").replaceChildren(
      ...told.map(({ kind, title, text, link }) => {
        const notice = made("div", `notice notice--${kind}`);
        if (title !== undefined) notice.append(made("strong", "", title));
        notice.append(made("p", "", text));
        // A wall has nothing to press.
        if (link !== undefined && this.#places.get("notices").dataset.links !== undefined) {
          const way = made("a", "button button--small", link.text);
          way.href = link.href;
          notice.append(way);
        }
        return notice;
      }),
    );
  }
}

function factRow({ name, value, kind }) {
  return [made("dt", "", name), made("dd", kind === "" ? "" : `is-${kind}`, value)];
}

function lapRow(lap) {
  const row = made("tr", lap.kind === "" ? "" : `is-${lap.kind}`);
  const head = made("th", "number", String(lap.number));
  head.scope = "row";
  const time = made("td", "number laps__time", lap.time);
  if (lap.best) time.prepend(made("span", "pill pill--best", "best"));
  row.append(head, time, made("td", "number muted", lap.sigma), made("td", "number", lap.score));
  row.append(made("td", "number laps__sectors", lap.sectors.join("  ")));
  if (lap.remarks.length === 0) return [row];
  row.classList.add("has-remarks");
  const under = made("tr", `laps__remarks${lap.kind === "" ? "" : ` is-${lap.kind}`}`);
  const cell = made("td", "");
  cell.colSpan = 5;
  cell.append(...lap.remarks.map(({ kind, text }) => made("div", kind === "plain" ? "muted" : `is-${kind}`, text)));
  under.append(cell);
  return [row, under];
}

function standingRow(row) {
  const line = made("tr", row.kind === "" ? "" : `is-${row.kind}`);
  const name = made("th", "", row.name);
  name.scope = "row";
  if (row.note !== "") name.append(" ", made("span", "muted", row.note));
  line.append(made("td", "number", row.place), name, made("td", "number", row.laps), made("td", "number", row.value), made("td", "number", row.gap));
  line.append(made("td", "number places__last", row.last));
  return line;
}

function made(name, classes, text) {
  const element = document.createElement(name);
  if (classes !== "") element.className = classes;
  if (text !== undefined) element.textContent = text;
  return element;
}
