// The judge's page: laps, passes, incidents and decisions of one run. Everything goes through the API.

import { look, passes } from "./judge_api.js";
import { openDecision } from "./judge_decide.js";
import { toast } from "./ui.js";
import { digits, official, passMeaning, reasons, time, words } from "./judge_words.js";

const PASSES_AT_ONCE = 24;
const part = (id) => document.getElementById(id);
let view = null;
let crossings = [];
let shown = PASSES_AT_ONCE;

function element(name, { text = null, className = "", ...attributes } = {}, ...children) {
  const made = document.createElement(name);
  if (text !== null) made.textContent = text;
  if (className !== "") made.className = className;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function button(text, run, label = text) {
  const made = element("button", { text, className: "button button--small", type: "button", "aria-label": label });
  made.addEventListener("click", run);
  return made;
}

async function load() {
  try {
    [view, { passes: crossings }] = await Promise.all([look(), passes()]);
  } catch (error) {
    part("sum").textContent = "not to be had";
    part("notices").replaceChildren(element("p", { className: "notice notice--bad", text: error.message }));
    return;
  }
  draw();
}

function draw() {
  const counting = view.laps.filter((one) => one.counts);
  part("name").textContent = view.name;
  const decisions = view.edits_so_far === 1 ? "1 decision" : `${view.edits_so_far} decisions`;
  const laps = counting.length === 1 ? "1 lap" : `${counting.length} laps`;
  part("sum").textContent = `${laps} in ${view.lasts_s.toFixed(1)} s, ${decisions}`;
  const notices = view.warnings.map((text) => element("p", { className: "notice notice--warn", text }));
  if (view.unfinished) {
    notices.unshift(element("p", {
      className: "notice notice--accent",
      text: "This run is still being recorded, or was cut short. You see what is there and can try decisions; they can be saved when it is finished.",
    }));
  }
  part("notices").replaceChildren(...notices);
  drawLaps();
  drawStandings();
  drawEdits();
  drawIncidents();
  drawPasses();
}

function drawLaps() {
  const several = new Set(view.laps.map((one) => one.lap.car)).size > 1;
  document.querySelector("#laps [data-cars]").hidden = !several;
  part("laps").tBodies[0].replaceChildren(...view.laps.map((one) => {
    const lap = one.lap;
    const similarity = lap.similarity_percent === null ? "–" : `${lap.similarity_percent.toFixed(1)} %`;
    const row = element("tr", { className: one.counts ? (lap.valid ? "" : "is-bad") : "is-gone" },
      element("th", { scope: "row", text: String(lap.number) }));
    if (several) row.append(element("td", { text: String(lap.car) }));
    row.append(
      element("td", { className: "number", text: `${lap.start_s.toFixed(3)} s` }),
      element("td", { className: "number", text: time(lap) }),
      element("td", { className: "number", text: one.counts ? official(lap) : "removed" }),
      element("td", { className: "number", text: similarity }),
      element("td", { className: "judge-why" }, ...reasons(one).map((text) => element("div", { text }))),
      element("td", {}, element("div", { className: "toolbar" }, ...lapButtons(one))),
    );
    return row;
  }));
}

function lapButtons(one) {
  if (!one.counts) return [];
  const { number, car } = one.lap;
  const about = (action, more = {}) => () => decide({ action, lap: number, car, ...more }, one);
  const name = `lap ${number} of car ${car}`;
  const later = view.laps.some((other) => other.counts && other.lap.car === car && other.lap.start_t_ns >= one.lap.end_t_ns);
  const given = one.lap.penalties.some((penalty) => penalty.offence !== "judge") || !one.lap.valid;
  return [
    button("Penalty", about("penalty"), `Penalty for ${name}`),
    ...(given ? [button("Forgive", about("forgive"), `Forgive ${name}`)] : []),
    button("Remove", about("remove"), `Remove ${name}`),
    ...(later ? [button("Merge", about("merge"), `Merge ${name} with the next`)] : []),
    button("Note", about("note"), `Note on ${name}`),
  ];
}

function drawStandings() {
  const rows = view.standings?.rows ?? [];
  part("standings").hidden = rows.length < 2;
  part("standings").querySelector("tbody").replaceChildren(...rows.map((row) => element("tr", {},
    element("td", { text: `${row.place}${row.tied ? " (tied)" : ""}` }),
    element("td", { text: row.name }),
    element("td", { className: "number", text: String(row.laps) }),
    element("td", { className: "number", text: row.value === null ? "–" : `${digits(row.value, view.standings.unit)} ${view.standings.unit}` }),
    element("td", { text: row.dnf ?? "" }),
  )));
}

function drawEdits() {
  part("no-edits").hidden = view.edits.length > 0;
  part("edits").hidden = view.edits.length === 0;
  part("edits").tBodies[0].replaceChildren(...view.edits.map((one) => {
    const { edit } = one;
    const because = element("td", { className: "judge-why" }, element("div", { className: "judge-was", text: edit.reason }));
    if (one.undone) because.append(element("div", { className: "muted", text: "undone" }));
    if (one.without_effect !== null) because.append(element("div", { className: "muted", text: `without effect: ${one.without_effect}` }));
    const undo = () => decide({ action: "undo", edit: edit.number }, null, `${edit.action} ${one.subject}`);
    return element("tr", { className: one.undone ? "is-gone" : "" },
      element("th", { scope: "row", text: String(edit.number) }),
      element("td", { text: `${edit.action} ${one.subject}` }),
      because,
      element("td", { text: edit.author }),
      element("td", { text: new Date(edit.time).toLocaleString() }),
      element("td", {}, ...(one.undone ? [] : [button("Undo", undo, `Undo decision ${edit.number}`)])),
    );
  }));
}

function picture(address, alt) {
  const image = element("img", { className: "frame", src: address, alt, loading: "lazy", width: "320", height: "240" });
  image.addEventListener("error", () => image.replaceWith(element("div", { className: "frame no-picture", text: "no picture kept" })));
  return image;
}

function drawIncidents() {
  part("no-incidents").hidden = view.incidents.length > 0;
  part("incidents").replaceChildren(...view.incidents.map((one) => {
    const { incident } = one;
    const lap = view.laps.find((each) => each.counts && each.lap.car === incident.car && each.lap.number === incident.lap);
    const actions = element("div", { className: "toolbar" });
    if (lap !== undefined) {
      const chosen = { lap: incident.lap, car: incident.car };
      actions.append(button("Penalty", () => decide({ action: "penalty", ...chosen }, lap), `Penalty for incident ${incident.number} of car ${incident.car}`));
      if (lap.lap.penalties.some((penalty) => penalty.offence === incident.kind)) {
        const forgive = () => decide({ action: "forgive", ...chosen, offence: incident.kind }, lap);
        actions.append(button("Forgive", forgive, `Forgive incident ${incident.number} of car ${incident.car}`));
      }
    }
    return element("li", {},
      picture(one.picture, `${words(incident.kind)} at ${incident.start_s.toFixed(2)} s`),
      element("strong", { text: `${words(incident.kind)}, ${incident.start_s.toFixed(2)} s` }),
      element("span", { text: incident.text }),
      element("span", { className: "muted", text: `car ${incident.car}${incident.lap === null ? ", outside laps" : `, lap ${incident.lap}`}, lasted ${incident.lasted_s.toFixed(2)} s` }),
      actions,
    );
  }));
}

function drawPasses() {
  const wanted = crossings.filter((one) => !part("only-ignored").checked || one.crossing.status === "ignored");
  part("no-passes").hidden = wanted.length > 0;
  part("more-passes").hidden = wanted.length <= shown;
  part("more-passes").textContent = `More passes (${wanted.length - shown})`;
  part("passes").replaceChildren(...wanted.slice(0, shown).map((one) => {
    const { crossing, number } = one;
    const sigma = Math.max(0.1, crossing.sigma_s * 1000).toFixed(1);
    return element("li", {},
      picture(one.picture, `Car ${crossing.car} at ${crossing.t_s.toFixed(3)} s`),
      element("strong", { text: `Pass ${number}: ${crossing.line} at ${crossing.t_s.toFixed(4)} s` }),
      element("span", { className: "muted", text: `car ${crossing.car}, ${crossing.direction}, ± ${sigma} ms${crossing.estimated ? ", not seen: estimated" : ""}` }),
      element("span", { text: passMeaning(crossing) }),
      element("div", { className: "toolbar" },
        button("Lap from here", () => choose("start", number, crossing.car), `Lap from here, pass ${number}`),
        button("Lap to here", () => choose("end", number, crossing.car), `Lap to here, pass ${number}`)),
    );
  }));
}

// What "Add a lap" begins with: chosen among the passes, in any order.
let adding = {};

function choose(end, number, car) {
  adding = { ...adding, [end]: `pass:${number}`, car };
  if (adding.start !== undefined && adding.end !== undefined) add();
  else if (end === "start") toast(`The lap begins at pass ${number}: now choose where it ends.`);
  else toast(`The lap ends at pass ${number}: now choose where it begins.`);
}

function add() {
  const chosen = { start: "", end: "", car: 1, ...adding };
  adding = {};
  decide({ action: "add", ...chosen });
}

function decide(wish, lap = null, subject = "") {
  openDecision(wish, { seen: view?.edits_so_far ?? null, lap, subject, unfinished: view?.unfinished ?? false }, load);
}

part("add-lap").addEventListener("click", add);
part("add-note").addEventListener("click", () => decide({ action: "note" }));
part("reload").addEventListener("click", load);
part("only-ignored").addEventListener("change", drawPasses);
part("more-passes").addEventListener("click", () => {
  shown += PASSES_AT_ONCE;
  drawPasses();
});
load();
