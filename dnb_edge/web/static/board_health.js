// How the appliance is doing, in words: facts, warnings, and what stands above everything when something is wrong. Pure
// functions of the health event, the daemon's state and the line's; knows no page.

import { Line } from "./live.js";
import { fixed } from "./board_words.js";

const GIGA = 1e9;
const LITTLE_DISK_BYTES = 1e9;
const HOT_C = 80;
const PICTURES = {
  black: "The camera's picture is black: take the cap off, or switch on the light.",
  overexposed: "The camera's picture is overexposed: less light, or a shorter exposure.",
  covered: "Something covers the camera.",
  frozen: "The camera gives one picture again and again.",
};
const LOST = {
  overtaken: "overtaken in the camera",
  queue: "detector too slow",
  gap: "gap in the camera's count",
  damaged: "damaged",
  short: "cut short",
  unreadable: "unreadable",
  stamp: "without a good stamp",
};

/** Facts for a table of names and values: [{name, value, kind}], `kind` one of `""`, `warn`, `bad`. Unknown ones are left out. */
export function healthFacts(health) {
  if (health === null) return [];
  return [speed(health), latency(health), seen(health), lost(health), drift(health), map(health), recording(health), disk(health),
    fact("Display", health.display, health.display === "offline" ? "bad" : ""), temperature(health), memory(health)]
    .filter((one) => one !== null);
}

/** What is wrong or wants a hand: [{kind, text}], the worst first. */
export function warnings(health) {
  if (health === null) return [];
  const told = health.warnings.map((text) => ({ kind: severe(health, text) ? "bad" : "warn", text: sentence(text) }));
  const picture = health.picture && !health.warnings.some((text) => text.includes(health.picture)) ? PICTURES[health.picture] : undefined;
  const found = picture === undefined ? told : [{ kind: "bad", text: picture }, ...told];
  const notes = (health.notes ?? []).map((text) => ({ kind: "accent", text: sentence(text) }));
  return [...found.filter((one) => one.kind === "bad"), ...found.filter((one) => one.kind === "warn"), ...notes];
}

/** The line to the daemon, for the pill: {kind, text}. */
export function lineWords(line, state, retry_in_s = null) {
  switch (line) {
    case Line.CONNECTED:
      return state?.phase === "fault" ? { kind: "bad", text: "fault" } : { kind: "good", text: "live" };
    case Line.DAEMON_DOWN:
      return { kind: "bad", text: "not running" };
    case Line.RECONNECTING:
      return { kind: "warn", text: retry_in_s !== null && retry_in_s >= 1 ? `reconnecting in ${Math.ceil(retry_in_s)} s` : "reconnecting" };
    default:
      return { kind: "accent", text: "connecting" };
  }
}

/** What the page says instead of a race, where there is none: {kind, title, text, link}, or null; `link`: {href, text}, where one helps. */
export function standstill(line, state) {
  if (line === Line.DAEMON_DOWN) {
    return {
      kind: "bad",
      title: "The timing is not running",
      text: "Nothing is timed or recorded just now; what was recorded is safe. This page goes on by itself as soon as the timing does. "
        + "If that takes more than a minute, switch the box off and on.",
    };
  }
  if (line === Line.RECONNECTING) {
    return { kind: "warn", title: "No line to the box", text: "The figures below may be old. This page tries again by itself; no lap is lost." };
  }
  if (state === null) return { kind: "accent", title: "Connecting", text: "" };
  switch (state.phase) {
    case "fault":
      return { kind: "bad", title: "The timing cannot start", text: `${sentence(state.reason ?? "it does not say why")} It tries again by itself.` };
    case "setup":
      return {
        kind: "accent",
        title: "Being set up",
        text: state.reason ? sentence(state.reason) : "The camera gives pictures and no race is on. Go on in the set-up.",
        link: { href: "/setup", text: "Set up the track" },
      };
    case "starting":
      return { kind: "accent", title: "Starting", text: state.reason ? sentence(state.reason) : "The camera is being opened." };
    default:
      return state.reason ? { kind: "warn", title: "Something wants a hand", text: sentence(state.reason) } : null;
  }
}

/** `text` with a capital and a full stop. */
export function sentence(text) {
  const trimmed = text.trim();
  return trimmed.charAt(0).toUpperCase() + trimmed.slice(1) + (/[.!?]$/.test(trimmed) ? "" : ".");
}

function severe(health, text) {
  return ((health.view_moved_m ?? null) !== null && text.startsWith("camera ")) || health.recording === "failed" && text.includes("record");
}

function fact(name, value, kind = "") {
  return value === null || value === undefined ? null : { name, value, kind };
}

function speed(health) {
  return health.fps === null ? null : fact("Frames", `${fixed(health.fps, 1)} fps`);
}

function latency(health) {
  if (health.latency_ms === null) return null;
  const p95 = (health.latency_p95_ms ?? null) === null ? "" : `, 95 % within ${fixed(health.latency_p95_ms, 0)} ms`;
  return fact("Latency", `${fixed(health.latency_ms, 0)} ms${p95}`);
}

function seen(health) {
  const share = health.frames === 0 ? "" : ` (${fixed((100 * health.detected_frames) / health.frames, 1)} %)`;
  return fact("Car seen in", `${health.detected_frames} of ${health.frames}${share}`);
}

function lost(health) {
  const reasons = (health.lost ?? []).map(({ reason, frames }) => `${frames} ${LOST[reason] ?? reason}`);
  const told = reasons.length === 0 ? "" : `: ${reasons.join(", ")}`;
  return fact("Frames lost", health.dropped_frames === 0 ? "none" : `${health.dropped_frames}${told}`, health.dropped_frames > health.frames / 20 ? "warn" : "");
}

function drift(health) {
  const moved = health.view_moved_m ?? null;
  return moved === null ? fact("Camera", "has not moved") : fact("Camera", `has moved: ${fixed(moved * 1000, 0)} mm on the track`, "bad");
}

function map(health) {
  const sigma = health.view_sigma_m ?? null;
  if (sigma !== null) return fact("Map", `± ${fixed(sigma * 1000, 1)} mm at its worst`);
  return health.view_error_mean_m === null ? null : fact("Map", `${fixed(health.view_error_mean_m * 1000, 1)} mm mean error`);
}

function recording(health) {
  const saved = health.saved_laps ?? null;
  const laps = saved === null ? "" : `, ${saved} ${saved === 1 ? "lap" : "laps"} saved`;
  const words = { none: "no recording", recording: "on", failed: "failed" };
  return fact("Recording", `${words[health.recording] ?? health.recording}${laps}`, health.recording === "failed" ? "bad" : "");
}

function disk(health) {
  const free = health.disk_free_bytes ?? null;
  if (free === null) return null;
  return fact("Disk free", `${fixed(free / GIGA, free < 10 * GIGA ? 1 : 0)} GB`, free < LITTLE_DISK_BYTES ? "bad" : "");
}

function temperature(health) {
  const degrees = health.temperature_c ?? null;
  const slowed = health.throttled ? ", slowed down by heat or a weak supply" : "";
  if (degrees === null) return health.throttled ? fact("Processor", "slowed down by heat or a weak supply", "bad") : null;
  return fact("Processor", `${fixed(degrees, 0)} °C${slowed}`, health.throttled ? "bad" : degrees >= HOT_C ? "warn" : "");
}

function memory(health) {
  const bytes = health.memory_bytes ?? null;
  return bytes === null ? null : fact("Memory", `${fixed(bytes / 1e6, 0)} MB`);
}
