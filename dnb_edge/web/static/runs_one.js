// One recording: what it is, its laps, its files. Everything comes from the API.

import { ask, ApiError, askToDelete, attempt, durationText, el, mayChange, nameOf, pillsOf, pinButton, rename, sizeText, timeText, whenText, API } from "./runs_common.js";

const AGAIN_MS = 4000;
const id = document.querySelector("#run").dataset.run;
const place = (name) => document.querySelector(`#${name}`);
let last = "";
let lapsKnown = null;

async function load() {
  const run = await ask(`/runs/${id}`);
  const text = JSON.stringify(run);
  if (text !== last && place("title").querySelector("form") === null) {
    last = text;
    draw(run);
  }
  const laps = `${run.laps} ${run.edited}`;
  if (laps !== lapsKnown) {
    lapsKnown = laps;
    await loadLaps();
    document.querySelector("#run img").src = `${API}/runs/${id}/picture.jpg?n=${run.laps ?? 0}`;
  }
  return run;
}

function draw(run) {
  const focused = document.activeElement?.dataset?.key;
  document.title = `${nameOf(run)} – dnb-edge`;
  place("title").replaceChildren(el("h1", {}, nameOf(run)));
  if (mayChange) {
    place("title").append(el("button", { class: "button button--small", type: "button", "data-key": "rename", onclick: () => rename(place("title"), run, changed) }, "Rename"));
  }
  place("pills").replaceChildren(...pillsOf(run));
  place("notes").replaceChildren(...run.notes.map((text) => el("p", { class: "notice notice--warn" }, text)));
  place("actions").replaceChildren(...actions(run));
  facts(run);
  take(run);
  if (focused) document.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

function actions(run) {
  const found = [];
  if (run.state === "finished") found.push(el("a", { class: "button button--primary", href: `${API}/runs/${id}/report.html`, target: "_blank", rel: "noopener", "data-key": "report" }, "Report"));
  if (mayChange) {
    found.push(el("a", { class: "button", href: `/runs/${id}/judge`, "data-key": "judge" }, "Judge"));
    if (run.pinnable) found.push(pinButton(run, changed));
    const why = run.current ? "It is being recorded just now" : run.pinned ? "Unpin it first" : null;
    found.push(el("button", { class: "button button--small", type: "button", disabled: why !== null, title: why, "data-key": "delete", onclick: () => askToDelete(run, () => { location.assign("/runs"); }) }, "Delete …"));
  }
  return found;
}

function facts(run) {
  const rows = [
    ["Entry", [run.entry, run.entry_version].filter(Boolean).join(" ") || "–"],
    ["Session", run.session ?? "–"],
    ["Began", run.started === null ? "–" : whenText(run.started)],
    ["Last written", whenText(run.written)],
    ["Lasts", durationText(run.duration_s)],
    ["Laps", run.laps === null ? "–" : String(run.laps)],
    ["Best lap", timeText(run.best_lap_s)],
    ["Source", run.source ?? "–"],
    ["File", run.file],
    ["Size", sizeText(run.size_bytes) + (run.pictures_bytes > 0 ? `, and ${sizeText(run.pictures_bytes)} of pictures` : "")],
    ...Object.entries(run.identity).map(([name, digest]) => [name[0].toUpperCase() + name.slice(1), digest]),
    ["Software", run.versions["dnb-edge"] ?? "–"],
  ];
  place("facts").replaceChildren(...rows.filter(([, value]) => value !== "–").flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
}

function take(run) {
  const one = `${API}/runs/${id}`;
  const parts = run.files.map((file) => link(
    `${one}/recording.mcap?part=${file.part}`,
    run.files.length === 1 ? `Recording (MCAP, ${sizeText(file.size_bytes)})` : `Part ${file.part} (${sizeText(file.size_bytes)})`));
  const groups = [el("div", { class: "runs-take" }, ...parts, link(`${one}/recording.zip`, "All of it (zip)"))];
  if (run.pictures_bytes > 0) groups[0].append(link(`${one}/recording.zip?pictures=true`, `With pictures (${sizeText(run.pictures_bytes)})`));
  if (run.state === "recording") groups.push(el("p", { class: "muted" }, "It is being recorded: what you get is a whole file with all that is there so far."));
  groups.push(el("h3", {}, "Laps"), el("div", { class: "runs-take" },
    link(`${one}/laps?format=csv`, "CSV"), link(`${one}/laps?format=json`, "JSON", "laps.json"), link(`${one}/laps?format=latex`, "LaTeX"),
    link(`${one}/laps?format=csv&what=passes`, "Passes (CSV)"), link(`${one}/laps?format=csv&what=incidents`, "Incidents (CSV)")));
  if (run.session_id !== null) {
    groups.push(el("h3", {}, "Session"), el("div", { class: "runs-take" }, link(`${API}/sessions/${run.session_id}.zip`, `All of ${run.session} (zip)`)));
  }
  place("take").replaceChildren(...groups);
}

function link(address, text, name = true) {
  return el("a", { class: "button button--small", href: address, download: name, "data-key": address }, text);
}

async function loadLaps() {
  const box = place("laps");
  try {
    let found = await ask(`/runs/${id}/laps`);
    while (found.working) {
      box.replaceChildren(el("p", { class: "runs-pad muted" }, `${found.working.text} …`));
      await new Promise((resolve) => { setTimeout(resolve, 1000 * found.working.retry_after_s); });
      found = await ask(`/runs/${id}/laps`);
    }
    box.replaceChildren(found.laps.length === 0 ? el("p", { class: "runs-pad muted" }, "No complete lap.") : lapTable(found.laps));
  } catch (error) {
    if (!(error instanceof ApiError)) throw error;
    box.replaceChildren(el("p", { class: "runs-pad field__error" }, error.message));
  }
}

function lapTable(laps) {
  const counted = laps.filter((lap) => !lap.removed);
  const official = (lap) => lap.official_time_s ?? lap.time_s;
  const best = Math.min(...counted.filter((lap) => lap.valid).map(official));
  const cars = new Set(laps.map((lap) => lap.car)).size > 1;
  const sectors = Math.max(0, ...laps.map((lap) => lap.sectors_s.length));
  const numbers = Array.from({ length: sectors }, (_, k) => k);
  const head = [["Lap", false], ...(cars ? [["Car", true]] : []), ["Time", true], ["± (s)", true], ...numbers.map((k) => [`S${k + 1}`, true]), ["Penalty (s)", true], ["Similarity (%)", true], ["Remarks", false]];
  const rows = laps.map((lap) => {
    const remarks = [...lap.reasons, ...lap.suspect, ...(lap.estimated ? ["estimated"] : []), ...lap.edits];
    const kind = lap.removed ? "runs-gone" : lap.valid && official(lap) === best ? "is-best" : lap.valid ? null : "is-bad";
    return el("tr", { class: kind },
      el("th", { scope: "row" }, String(lap.number)),
      ...(cars ? [number(String(lap.car))] : []),
      number(timeText(official(lap))),
      number(lap.sigma_s.toFixed(4)),
      ...numbers.map((k) => number(lap.sectors_s[k] == null ? "–" : lap.sectors_s[k].toFixed(3))),
      number(lap.penalty_s === 0 ? "" : `+${lap.penalty_s}`),
      number(lap.similarity_percent === null ? "–" : lap.similarity_percent.toFixed(2)),
      el("td", {}, [lap.removed ? "taken away" : lap.valid ? null : "not valid", ...remarks].filter(Boolean).join("; ")));
  });
  return el("table", { class: "table" },
    el("thead", {}, el("tr", {}, ...head.map(([text, right]) => el("th", { scope: "col", class: right ? "number" : null }, text)))),
    el("tbody", {}, ...rows));
}

function number(text) {
  return el("td", { class: "number" }, text);
}

function changed(run) {
  last = "";
  place("title").replaceChildren();
  draw(run);
  place("title").querySelector("button")?.focus();
}

attempt(load);
setInterval(() => {
  if (document.visibilityState !== "visible") return;
  load().catch((error) => { if (!(error instanceof ApiError)) throw error; });
}, AGAIN_MS);
