// What both pages of the recordings share: asking the API, words for figures, naming, pinning and deleting a run.

import { toast } from "./ui.js";

export const API = "/api/v1";
const csrf = document.querySelector('meta[name="csrf"]')?.content ?? null;
/** Whether this browser may change anything. */
export const mayChange = csrf !== null;

export class ApiError extends Error {
  constructor(status, code, text) {
    super(text);
    this.status = status;
    this.code = code;
  }
}

/** The JSON of an address; an ApiError with words for people where there is none. 202 gives {working: ...}. */
export async function ask(path, { method = "GET", body = null } = {}) {
  const headers = { Accept: "application/json" };
  if (method !== "GET") headers["X-CSRF-Token"] = csrf ?? "";
  if (body !== null) headers["Content-Type"] = "application/json";
  let answer;
  try {
    answer = await fetch(API + path, { method, headers, body: body === null ? null : JSON.stringify(body) });
  } catch {
    throw new ApiError(0, "away", "The box does not answer: is it on, and on this network?");
  }
  const found = await answer.json().catch(() => ({}));
  if (!answer.ok) {
    const text = found.error?.text ?? `The box answered ${answer.status}.`;
    throw new ApiError(answer.status, found.error?.code ?? "unknown", text);
  }
  return answer.status === 202 ? { working: found } : found;
}

/** An element with properties and children; text is text, never HTML. */
export function el(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((one) => one !== null && one !== undefined));
  return made;
}

export function sizeText(bytes) {
  if (bytes >= 1e9) return `${(bytes / 1e9).toFixed(1)} GB`;
  if (bytes >= 1e6) return `${(bytes / 1e6).toFixed(1)} MB`;
  return `${Math.max(1, Math.round(bytes / 1e3))} kB`;
}

export function timeText(seconds, digits = 3) {
  if (seconds === null || seconds === undefined) return "–";
  if (seconds < 60) return `${seconds.toFixed(digits)} s`;
  const whole = Math.floor(seconds / 60);
  const rest = (seconds - whole * 60).toFixed(digits).padStart(digits === 0 ? 2 : digits + 3, "0");
  return `${whole}:${rest}`;
}

export function durationText(seconds) {
  if (seconds === null) return "–";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

export function whenText(iso) {
  const when = new Date(iso);
  return Number.isNaN(when.getTime()) ? "–" : when.toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
}

/** What people call the run. */
export function nameOf(run) {
  return run.name ?? (run.entry === null ? run.file : [run.entry, run.entry_version].filter(Boolean).join(" "));
}

const STATES = {
  recording: ["pill pill--accent", "Recording"],
  finished: ["pill", "Finished"],
  cut: ["pill pill--warn", "Cut short"],
  damaged: ["pill pill--bad", "Damaged"],
};

export function pillsOf(run) {
  const [kind, text] = STATES[run.state] ?? ["pill", run.state];
  const pills = [el("span", { class: kind }, text)];
  if (run.pinned) pills.push(el("span", { class: "pill pill--good" }, "Pinned"));
  if (run.edited) pills.push(el("span", { class: "pill" }, "Judged"));
  return pills;
}

/** A button that pins and unpins; `changed` is given the run as it is then. */
export function pinButton(run, changed) {
  return el("button", {
    class: "button button--small", type: "button", "aria-pressed": String(run.pinned), "data-key": `pin-${run.id}`,
    title: "Pinned recordings are never deleted to make room",
    onclick: () => attempt(async () => changed(await ask(`/runs/${run.id}`, { method: "PATCH", body: { pinned: !run.pinned } }))),
  }, run.pinned ? "Pinned" : "Pin");
}

/** Puts a field for the name where `place` is, until it is saved or left. */
export function rename(place, run, changed) {
  const field = el("input", { type: "text", maxlength: "120", value: run.name ?? "", placeholder: nameOf(run), "aria-label": "Name of the recording" });
  const form = el("form", { class: "runs-name" }, field,
    el("button", { class: "button button--small button--primary", type: "submit" }, "Save"),
    el("button", { class: "button button--small", type: "button", onclick: () => back() }, "Cancel"));
  const before = [...place.childNodes];
  const back = () => { place.replaceChildren(...before); place.querySelector("button")?.focus(); };
  form.addEventListener("keydown", (event) => { if (event.key === "Escape") { event.preventDefault(); back(); } });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    attempt(async () => changed(await ask(`/runs/${run.id}`, { method: "PATCH", body: { name: field.value } })));
  });
  place.replaceChildren(form);
  field.focus();
  field.select();
}

/** Asks for the file's name and deletes the run; `gone` is called once it is. */
export function askToDelete(run, gone) {
  const field = el("input", { type: "text", id: "delete-name", autocomplete: "off", spellcheck: "false", autocapitalize: "off" });
  const wrong = el("p", { class: "field__error", role: "alert", hidden: true });
  const yes = el("button", { class: "button button--danger", type: "submit", disabled: true }, "Delete for good");
  const more = run.files.length > 1 ? `, all ${run.files.length} files of it` : "";
  const form = el("form", { class: "stack" },
    el("h2", { id: "delete-title" }, `Delete ${nameOf(run)}?`),
    el("p", {}, `The recording${more}, a judge's decisions and its pictures go for good: ${sizeText(run.size_bytes + run.pictures_bytes)}.`),
    el("div", { class: "field" }, el("label", { for: "delete-name" }, "To confirm, type ", el("code", {}, run.file)), field, wrong),
    el("div", { class: "dialog__actions" },
      el("button", { class: "button", type: "button", onclick: () => dialog.close() }, "Cancel"), yes));
  const dialog = el("dialog", { class: "dialog", "aria-labelledby": "delete-title" }, form);
  field.addEventListener("input", () => { yes.disabled = field.value.trim() !== run.file; });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    yes.disabled = true;
    try {
      const done = await ask(`/runs/${run.id}`, { method: "DELETE", body: { confirm: field.value.trim() } });
      dialog.close();
      toast(`Deleted: ${sizeText(done.size_bytes)} are free again.`);
      gone();
    } catch (error) {
      wrong.textContent = error.message;
      wrong.hidden = false;
      yes.disabled = false;
    }
  });
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
  field.focus();
}

/** Does `work` and tells what goes wrong. */
export async function attempt(work) {
  try {
    await work();
  } catch (error) {
    if (!(error instanceof ApiError)) throw error;
    toast(error.message, { bad: true });
  }
}
