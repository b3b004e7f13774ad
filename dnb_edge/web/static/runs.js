// The list of recordings: filter, cards, table of entries, disk. Everything comes from the API.

import { ask, ApiError, attempt, durationText, el, mayChange, nameOf, pillsOf, pinButton, rename, sizeText, timeText, whenText, API } from "./runs_common.js";
import { toast } from "./ui.js";

const PAGE = 48;
const AGAIN_MS = 8000;
const SOON_MS = 250;
const form = document.querySelector("#filter");
const list = document.querySelector("#runs");
const count = document.querySelector("#count");
const chosen = new Set();
let shown = [];
let offset = 0;
let last = "";
let asked = 0;
let failing = false;

form.addEventListener("submit", (event) => event.preventDefault());
form.addEventListener("input", () => { offset = 0; soon(); });
document.querySelector("#earlier").addEventListener("click", () => { offset = Math.max(0, offset - PAGE); load(); });
document.querySelector("#later").addEventListener("click", () => { offset += PAGE; load(); });
document.querySelector("#choose-all").addEventListener("click", () => { shown.filter(canCompare).forEach((run) => chosen.add(run.id)); draw(); });
document.querySelector("#choose-none").addEventListener("click", () => { chosen.clear(); draw(); });
document.querySelector("#make-table").addEventListener("click", showTable);
document.querySelector("#table-close").addEventListener("click", () => document.querySelector("#table").close());

let timer = null;
function soon() {
  clearTimeout(timer);
  timer = setTimeout(load, SOON_MS);
}

function query() {
  const wanted = new FormData(form);
  const found = new URLSearchParams({ offset: String(offset), limit: String(PAGE) });
  for (const name of ["text", "session", "entry", "state"]) if (wanted.get(name)) found.set(name, wanted.get(name));
  if (wanted.get("pinned")) found.set("pinned", "true");
  return found;
}

async function load() {
  const number = ++asked;
  try {
    const found = await ask(`/runs?${query()}`);
    if (number !== asked) return;
    failing = false;
    shown = found.runs;
    if (shown.length === 0 && offset > 0) { offset = 0; load(); return; }
    choices("#session", found.sessions.map((one) => [one.id, `${one.name} (${one.runs})`]));
    choices("#entry", found.entries.map((one) => [one.name, `${one.name} (${one.runs})`]));
    pager(found);
    const text = JSON.stringify(found.runs);
    if (text !== last && !busy()) { last = text; draw(); }
    count.textContent = words(found);
  } catch (error) {
    if (!(error instanceof ApiError)) throw error;
    count.textContent = error.message;
    if (!failing) toast(error.message, { bad: true });
    failing = true;
  }
}

/** Somebody is typing a name: nothing moves meanwhile. */
function busy() {
  return list.querySelector("form") !== null;
}

function words(found) {
  if (found.total === 0) return "No recordings.";
  return found.total === 1 ? "1 recording" : `${found.total} recordings`;
}

function choices(selector, options) {
  const select = document.querySelector(selector);
  const text = JSON.stringify(options);
  if (select.dataset.options === text) return;
  const value = select.value;
  select.dataset.options = text;
  select.replaceChildren(el("option", { value: "" }, "All"), ...options.map(([id, name]) => el("option", { value: id }, name)));
  select.value = options.some(([id]) => id === value) ? value : "";
}

function pager(found) {
  document.querySelector("#pager").hidden = found.total <= PAGE;
  document.querySelector("#earlier").disabled = offset === 0;
  document.querySelector("#later").disabled = offset + PAGE >= found.total;
  document.querySelector("#where").textContent = `${offset + 1} to ${Math.min(offset + PAGE, found.total)} of ${found.total}`;
  const zip = document.querySelector("#session-zip");
  const session = form.elements.session.value;
  zip.hidden = session === "";
  if (session !== "") zip.href = `${API}/sessions/${session}.zip`;
}

function draw() {
  const focused = document.activeElement?.dataset?.key;
  const filtered = [...query().keys()].length > 2;
  if (shown.length === 0) {
    const text = filtered ? "Nothing passes this filter." : "Nothing is recorded yet. Each race appears here as soon as it begins: to look at, to judge and to take home.";
    list.replaceChildren(el("li", { class: "empty" }, el("p", {}, text)));
  } else {
    list.replaceChildren(...shown.map(card));
  }
  // Nothing to find, to choose or to count where nothing is.
  for (const part of document.querySelectorAll("[data-some]")) part.hidden = shown.length === 0 && !filtered;
  if (focused) list.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  document.querySelector("#choose-all").disabled = !shown.some(canCompare);
  document.querySelector("#make-table").disabled = chosen.size === 0;
  document.querySelector("#make-table").textContent = chosen.size === 0 ? "Table of entries" : `Table of ${chosen.size} ${chosen.size === 1 ? "run" : "runs"}`;
  document.querySelector("#choose-none").hidden = chosen.size === 0;
}

function canCompare(run) {
  return run.state === "finished";
}

function card(run) {
  const address = `/runs/${run.id}`;
  const title = el("div", {}, el("h2", {}, el("a", { href: address, "data-key": `open-${run.id}` }, nameOf(run))));
  const when = run.started === null ? `Written ${whenText(run.written)}` : whenText(run.started);
  const where = [when, run.session, run.name === null ? null : run.entry].filter(Boolean).join(" · ");
  const box = el("input", { type: "checkbox", "data-key": `choose-${run.id}`, "aria-label": `Choose ${nameOf(run)} for the table`, disabled: !canCompare(run) });
  box.checked = chosen.has(run.id);
  box.addEventListener("change", () => { if (box.checked) chosen.add(run.id); else chosen.delete(run.id); draw(); });
  const picture = `${API}${address}/picture.jpg?n=${run.laps ?? 0}`;
  return el("li", { class: `card card--flush runs-card${chosen.has(run.id) ? " is-chosen" : ""}` },
    el("a", { class: "runs-card__picture", href: address, tabindex: "-1", "aria-hidden": "true" },
      el("img", { src: picture, alt: "", width: "480", height: "270", loading: "lazy" })),
    el("div", { class: "runs-card__body" },
      el("div", { class: "row" }, ...pillsOf(run)),
      title,
      el("p", { class: "muted truncate" }, where),
      el("div", { class: "runs-figures" },
        figure("Laps", run.laps === null ? "–" : String(run.laps)),
        figure("Best", timeText(run.best_lap_s)),
        figure("Lasts", durationText(run.duration_s)),
        figure("Size", sizeText(run.size_bytes))),
      run.notes.length === 0 ? null : el("p", { class: "field__error" }, run.notes[0]),
      el("div", { class: "spread runs-card__foot" },
        el("label", { class: "choice" }, box, "Choose"),
        el("div", { class: "toolbar" }, ...actions(run, title)))));
}

function actions(run, title) {
  const found = [el("a", { class: "button button--small", href: `${API}/runs/${run.id}/recording.mcap`, download: true, "data-key": `take-${run.id}`, "aria-label": `Download ${nameOf(run)}` }, "Download")];
  if (mayChange) {
    if (run.pinnable) found.push(pinButton(run, changed));
    found.push(el("button", { class: "button button--small", type: "button", "data-key": `name-${run.id}`, "aria-label": `Rename ${nameOf(run)}`, onclick: () => rename(title, run, changed) }, "Rename"));
  }
  return found;
}

function changed(run) {
  shown = shown.map((one) => (one.id === run.id ? run : one));
  draw();
  load();
}

function figure(name, value) {
  return el("div", { class: "figure" }, el("span", { class: "figure__name" }, name), el("span", { class: "figure__value" }, value));
}

async function disk() {
  const section = document.querySelector("#disk");
  try {
    const found = await ask("/disk");
    const used = found.total_bytes === 0 ? 0 : 1 - found.free_bytes / found.total_bytes;
    const meter = section.querySelector(".meter");
    meter.className = `meter${found.short !== null ? " meter--bad" : used > 0.85 ? " meter--warn" : ""}`;
    meter.setAttribute("aria-valuenow", String(Math.round(100 * used)));
    meter.firstElementChild.style.width = `${(100 * used).toFixed(1)}%`;
    const parts = [`${sizeText(found.free_bytes)} free of ${sizeText(found.total_bytes)}`, `recordings ${sizeText(found.recordings_bytes)}`];
    if (found.pictures_bytes > 0) parts.push(`pictures ${sizeText(found.pictures_bytes)}`);
    if (found.next !== null && found.delete_oldest) parts.push(`first to go: ${found.next.pictures_only ? "pictures of " : ""}${found.next.file}`);
    document.querySelector("#disk-text").textContent = parts.join(" · ");
    section.hidden = false;
  } catch (error) {
    if (!(error instanceof ApiError)) throw error;
    section.hidden = true;
  }
}

async function showTable() {
  const dialog = document.querySelector("#table");
  const body = document.querySelector("#table-body");
  const path = `/table?runs=${[...chosen].join(",")}`;
  body.replaceChildren(el("p", {}, el("span", { class: "spinner", "aria-hidden": "true" }), " Racing the recordings again …"));
  dialog.showModal();
  try {
    let found = await ask(path);
    while (found.working && dialog.open) {
      body.replaceChildren(el("p", {}, el("span", { class: "spinner", "aria-hidden": "true" }), ` ${found.working.text} …`));
      await new Promise((resolve) => { setTimeout(resolve, 1000 * found.working.retry_after_s); });
      found = await ask(path);
    }
    if (!found.working) body.replaceChildren(...tableOf(found, path));
  } catch (error) {
    if (!(error instanceof ApiError)) throw error;
    body.replaceChildren(el("p", { class: "notice notice--bad" }, error.message));
  }
}

function tableOf(found, path) {
  const head = ["Entry", "Runs", "Laps", "Path similarity (%)", "Completion time (s)", "Best lap (s)"];
  const rows = found.rows.map((row) => el("tr", {},
    el("th", { scope: "row" }, row.label),
    el("td", { class: "number" }, String(row.runs)),
    el("td", { class: "number" }, `${row.valid_laps}/${row.attempted_laps}`),
    el("td", { class: "number" }, spread(row.similarity_percent, row.similarity_sd_percent, 2)),
    el("td", { class: "number" }, row.finished ? spread(row.completion_time_s, row.completion_time_sd_s, 3) : "DNF"),
    el("td", { class: "number" }, spread(row.best_lap_s, row.best_lap_sigma_s, 3))));
  return [
    ...found.warnings.map((text) => el("p", { class: "notice notice--warn" }, text)),
    el("div", { class: "scroll-x", tabindex: "0", role: "region", "aria-label": "Figures of the entries" }, el("table", { class: "table" },
      el("thead", {}, el("tr", {}, ...head.map((text, k) => el("th", { scope: "col", class: k === 0 ? null : "number" }, text)))),
      el("tbody", {}, ...rows))),
    ...found.notes.map((text) => el("p", { class: "muted" }, text)),
    el("div", { class: "toolbar" },
      ...["csv", "latex", "json"].map((format) => el("a", { class: "button button--small", href: `${API}${path}&format=${format}`, download: format === "json" ? "table.json" : true }, format === "latex" ? "LaTeX" : format.toUpperCase()))),
  ];
}

function spread(mean, sd, digits) {
  if (mean === null) return "–";
  return sd === null ? mean.toFixed(digits) : `${mean.toFixed(digits)} ± ${sd.toFixed(digits)}`;
}

attempt(async () => { await Promise.all([load(), disk()]); });
setInterval(() => { if (document.visibilityState === "visible") { load(); disk(); } }, AGAIN_MS);
document.addEventListener("visibilitychange", () => { if (document.visibilityState === "visible") load(); });
