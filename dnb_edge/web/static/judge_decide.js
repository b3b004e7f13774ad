// The dialog in which a decision is made: its fields, a preview of what it does, saving. Knows the API; knows no table of the page.

import { decide } from "./judge_api.js";
import { inShort, standing, totals, words } from "./judge_words.js";
import { toast } from "./ui.js";

const AUTHOR = "dnb-edge.judge";
const KINDS = ["off_track", "wrong_way", "short_cut", "stalled", "lost", "lifted", "jump_start", "too_slow", "missed_line", "collision"];
const TITLES = {
  add: () => ["Add a lap", "A lap that the race missed, by two passes or by seconds. Its similarity comes from what was seen of the car."],
  remove: (wish) => [`Remove lap ${wish.lap}`, "A lap that was none. It stays listed, with the reason."],
  merge: (wish) => [`Merge lap ${wish.lap} with the next`, "The crossing between them was none."],
  penalty: (wish) => [`Penalty for lap ${wish.lap}`, "The measured time stays; what the lap counts as changes."],
  forgive: (wish) => [`Forgive lap ${wish.lap}`, "Takes away what the rules gave it. A judge's own penalty is undone instead."],
  note: (wish) => [wish.lap === undefined ? "Note on the run" : `Note on lap ${wish.lap}`, "Changes no result."],
  undo: (wish, context) => [`Undo decision ${wish.edit}`, `It was: ${context.subject}. It stays listed; an undo can be undone, too.`],
};

const dialog = document.getElementById("decision");
const form = document.getElementById("decision-form");
const fault = document.getElementById("decision-error");
const preview = document.getElementById("preview");
const trying = document.getElementById("try");
const save = document.getElementById("save");
let open = null;

/** Opens the dialog for `wish`; `done` is called when something was saved, or somebody else decided meanwhile. */
export function openDecision(wish, context, done) {
  open = { wish, context, done };
  const [title, text] = TITLES[wish.action](wish, context);
  document.getElementById("decision-title").textContent = wish.car > 1 && wish.action !== "add" ? `${title} (car ${wish.car})` : title;
  document.getElementById("decision-text").textContent = text;
  document.getElementById("reason-label").textContent = wish.action === "note" ? "Note" : "Because";
  form.reset();
  for (const fields of form.querySelectorAll("[data-for]")) {
    fields.hidden = fields.dataset.for !== wish.action;
    for (const control of fields.querySelectorAll("input, select")) control.disabled = fields.hidden;
  }
  if (wish.action === "forgive") offences(wish, context);
  for (const name of ["start", "end", "car"]) if (wish[name] !== undefined) form.elements[name].value = wish[name];
  form.elements.author.value = kept();
  forget();
  dialog.showModal();
  (form.querySelector("[data-for]:not([hidden]) input") ?? form.elements.reason).focus();
}

function offences(wish, context) {
  const given = new Set((context.lap?.lap.penalties ?? []).map((penalty) => penalty.offence).filter((name) => KINDS.includes(name)));
  const all = document.createElement("option");
  all.value = "";
  all.textContent = "Everything that the rules gave";
  form.elements.offence.replaceChildren(all, ...[...given].map((name) => {
    const option = document.createElement("option");
    option.value = name;
    option.textContent = words(name);
    return option;
  }));
  form.elements.offence.value = wish.offence ?? "";
}

/** The decision as the fields have it now. */
function asked() {
  const { wish, context } = open;
  const fields = form.elements;
  const sent = { ...wish, author: fields.author.value, reason: fields.reason.value, seen: context.seen };
  if (wish.action === "add") Object.assign(sent, { start: moment(fields.start.value), end: moment(fields.end.value), car: Number(fields.car.value || 1) });
  if (wish.action === "penalty") {
    const factor = fields.factor.value === "" ? 1 : Number(fields.factor.value);
    Object.assign(sent, { seconds: Number(fields.seconds.value || 0), factor, invalid: fields.invalid.checked, dnf: fields.dnf.checked });
  }
  if (wish.action === "forgive") sent.offence = fields.offence.value || null;
  return sent;
}

function moment(text) {
  const plain = text.trim();
  return plain === "" || Number.isNaN(Number(plain)) ? plain : Number(plain);
}

async function send(dryRun) {
  const { done } = open;
  const wish = asked();
  const missing = wish.author.trim() === "" ? "Say who decides." : wish.reason.trim() === "" ? "Say why, for those who read the results." : "";
  if (missing !== "") return complain(missing);
  if (wish.action === "add" && (wish.start === "" || wish.end === "")) return complain("Say where the lap begins and where it ends.");
  keep(wish.author.trim());
  trying.disabled = save.disabled = true;
  try {
    const answer = await decide({ ...wish, dry_run: dryRun });
    fault.hidden = true;
    if (dryRun) return show(answer);
    dialog.close();
    toast(`Saved: decision ${answer.edit.number}, ${answer.edit.action} ${answer.subject}.`);
    done();
  } catch (error) {
    if (error.code === "stale") {
      dialog.close();
      toast(`${error.message}. The page has been brought up to date.`, { bad: true });
      done();
    } else {
      complain(error.message);
    }
  } finally {
    trying.disabled = false;
  }
}

function show(answer) {
  const rows = answer.changes.map((one) => [`${one.number}${one.car > 1 ? ` of car ${one.car}` : ""}`, inShort(one.before), inShort(one.after)]);
  if (rows.length === 0) rows.push(["", "no lap changes", "no lap changes"]);
  rows.push(["all", totals(answer.before.totals), totals(answer.after.totals)]);
  const unit = answer.before.standings?.unit ?? answer.after.standings?.unit ?? "";
  const places = [answer.before, answer.after].map((side) => (side.standings?.rows ?? []).map((row) => standing(row, unit)));
  if (Math.max(...places.map((side) => side.length)) > 1) {
    for (let k = 0; k < Math.max(...places.map((side) => side.length)); k += 1) rows.push(["standings", places[0][k] ?? "–", places[1][k] ?? "–"]);
  }
  preview.querySelector("tbody").replaceChildren(...rows.map((cells) => {
    const row = document.createElement("tr");
    for (const text of cells) {
      const cell = document.createElement("td");
      cell.textContent = text;
      row.append(cell);
    }
    return row;
  }));
  preview.hidden = false;
  save.disabled = open.context.unfinished;
  preview.scrollIntoView({ block: "nearest" });
}

function complain(text) {
  forget();
  fault.textContent = text;
  fault.hidden = false;
}

/** What was said of other fields holds no more: nobody saves what they have not seen. */
function forget() {
  fault.hidden = true;
  preview.hidden = true;
  save.disabled = true;
}

function kept() {
  try {
    return localStorage.getItem(AUTHOR) ?? "";
  } catch {
    return "";
  }
}

function keep(name) {
  try {
    localStorage.setItem(AUTHOR, name);
  } catch {
    return;
  }
}

form.addEventListener("input", forget);
form.addEventListener("submit", (event) => {
  event.preventDefault();
  if (!trying.disabled) send(true);
});
save.addEventListener("click", () => send(false));
document.getElementById("cancel").addEventListener("click", () => dialog.close());
