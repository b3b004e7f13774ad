// The lane, the way through it and the scale, on the twin.

import { ask } from "./setup_api.js";
import { PictureView } from "./setup_view.js";
import { metres } from "./setup_twin.js";

const byId = (id) => document.getElementById(id);
const LABELS = { measured: "Length of the line, m", lap: "Length of a lap, m", px: "Metres of one pixel" };
const LOOP_COLOURS = ["accent", "warn", "good", "best"];

export function routeStep(setup) {
  let tap = "lane";
  let ends = [];
  let filled = null;
  const view = new PictureView(byId("route-view"), "The twin, for lane, waypoints and scale", {
    onTap(px) {
      if (tap === "lane") setup.change(() => ask("PUT", "lane", { at_px: px }));
      else if (tap === "waypoint") keep({ waypoints_px: [...setup.answer.draft.route.waypoints_px, px] });
      else {
        ends = ends.length === 2 ? [px] : [...ends, px];
        draw();
      }
    },
    onDrag(id, px, done) {
      const [kind, k] = id.split(" ");
      if (kind === "end") { ends[k] = px; draw(); }
      if (kind === "waypoint" && done) {
        keep({ waypoints_px: setup.answer.draft.route.waypoints_px.map((at, at_k) => (at_k === Number(k) ? px : at)) });
      }
    },
    onDelete(id) {
      const [kind, k] = id.split(" ");
      if (kind === "waypoint") without(Number(k));
    },
  });
  view.placing = true;

  /** The route's part of the draft with some of it changed. */
  function keep(changes) {
    const { route, scale } = setup.answer.draft;
    return setup.change(() => ask("PUT", "route", { ...route, scale, ...changes }));
  }

  function without(k) { keep({ waypoints_px: setup.answer.draft.route.waypoints_px.filter((_, at) => at !== k) }); }

  function draw() {
    const { answer } = setup;
    if (answer === null) return;
    const items = [...trackItems(answer.track)];
    answer.loops.forEach((loop, k) => {
      const colour = LOOP_COLOURS[k % LOOP_COLOURS.length];
      items.push({ kind: "way", points: loop.points_px, closed: true, colour, width: 4 });
      items.push({ kind: "point", at: loop.waypoints_px[0], text: loop.letter, colour });
    });
    const { lane, route } = answer.draft;
    if (lane?.at_px) items.push({ kind: "point", at: lane.at_px, text: "lane", colour: "lane" });
    route.waypoints_px.forEach((at, k) => items.push({ kind: "point", id: `waypoint ${k}`, at, text: `${k + 1}`, colour: "best" }));
    if (ends.length === 2) items.push({ kind: "line", points: ends, colour: "warn", width: 3 });
    ends.forEach((at, k) => items.push({ kind: "point", id: `end ${k}`, at, text: k === 0 ? "from" : "to", colour: "warn" }));
    view.put(items);
  }

  function pressed() {
    for (const button of document.querySelectorAll("[data-tap]")) button.setAttribute("aria-pressed", String(button.dataset.tap === tap));
  }

  for (const button of document.querySelectorAll("[data-tap]")) {
    button.addEventListener("click", () => { tap = button.dataset.tap; pressed(); });
  }
  for (const button of document.querySelectorAll("[data-shade]")) {
    button.addEventListener("click", () => setup.change(() => ask("PUT", "lane", { shade: button.dataset.shade })));
  }
  byId("closed").addEventListener("change", (event) => keep({ closed: event.target.checked }));
  byId("seam").addEventListener("change", (event) => {
    const text = event.target.value.trim();
    const close_gap_px = text === "" ? null : metres(text);
    if (close_gap_px !== null && !(close_gap_px > 0)) { setup.trouble("The seam must be a number of pixels, such as 12."); return; }
    keep({ close_gap_px });
  });
  byId("scale-kind").addEventListener("change", () => {
    byId("scale-label").textContent = LABELS[byId("scale-kind").value];
    byId("scale-value").value = "";
    if (byId("scale-kind").value === "measured") { tap = "measure"; pressed(); }
  });
  byId("scale-keep").addEventListener("click", () => {
    const kind = byId("scale-kind").value;
    const text = byId("scale-value").value;
    const value = metres(text);
    let { scale } = setup.answer.draft;
    if (text.trim() !== "") {
      if (!(value > 0)) { setup.trouble("The length must be a number of metres, such as 2.5."); return; }
      if (kind === "measured" && ends.length < 2) { setup.trouble("Tap the two ends of the measured line on the twin first."); return; }
      scale = { measured: { measured: { from_px: ends[0], to_px: ends[1], length_m: value } }, lap: { lap_m: value }, px: { metres_per_px: value } }[kind];
    }
    filled = null;
    keep({ scale, ...(byId("track-name").value.trim() === "" ? {} : { name: byId("track-name").value.trim() }) });
  });

  function fill({ scale, name }) {
    const now = JSON.stringify([scale, name]);
    if (filled === now) return;
    filled = now;
    byId("track-name").value = name;
    const kind = scale?.lap_m ? "lap" : scale?.metres_per_px ? "px" : "measured";
    byId("scale-kind").value = kind;
    byId("scale-label").textContent = LABELS[kind];
    byId("scale-value").value = scale?.measured?.length_m ?? scale?.lap_m ?? scale?.metres_per_px ?? "";
    if (scale?.measured) ends = [scale.measured.from_px, scale.measured.to_px];
  }

  return {
    render(answer) {
      const { address, size } = setup.twinAddress();
      view.show(address, size);
      if (answer.draft.twin === null) ends = [];
      fill(answer.draft);
      if (document.activeElement !== byId("seam")) byId("seam").value = answer.draft.route.close_gap_px ?? "";
      byId("closed").checked = answer.draft.route.closed;
      byId("lane-said").textContent = laneSaid(answer.draft.lane);
      byId("route-said").textContent = trackSaid(answer.track);
      byId("loops").replaceChildren(...answer.loops.map((loop) => button(`Loop ${loop.letter} is driven`, () => keep({ waypoints_px: loop.waypoints_px }))));
      byId("waypoints").replaceChildren(...answer.draft.route.waypoints_px.map((at, k) => {
        const item = document.createElement("li");
        item.append(`Waypoint ${k + 1}: ${at[0].toFixed(0)}, ${at[1].toFixed(0)} px`, button("Delete", () => without(k), `Delete waypoint ${k + 1}`));
        return item;
      }));
      draw();
    },
  };
}

/** The track as it is understood, drawn on its twin. */
export function trackItems(track) {
  if (track === null) return [];
  const { closed } = track;
  return [
    { kind: "way", points: track.left_px, closed, colour: "lane", width: 1.5 },
    { kind: "way", points: track.right_px, closed, colour: "lane", width: 1.5 },
    { kind: "way", points: track.middle_px, closed, colour: "lane", dashed: true, width: 1.5 },
  ];
}

export function button(text, run, name = text) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = "button button--small";
  made.textContent = text;
  made.setAttribute("aria-label", name);
  made.addEventListener("click", run);
  return made;
}

function laneSaid(lane) {
  if (lane === null) return "Tap the lane on the twin: its colour tells it from the floor.";
  if (lane.hsv !== null) return `The lane: hue ${lane.hsv[0]}°, saturation ${lane.hsv[1]} %, value ${lane.hsv[2]} %.`;
  return lane.shade === "between-lines" ? "The lane: between two lines." : "The lane: told by its shade.";
}

function trackSaid(track) {
  if (track === null) return "";
  if (track.length_m === null) return `The route is ${track.length_px.toFixed(0)} px long, the lane ${track.lane_width_px.toFixed(0)} px wide.`;
  return `${track.length_m.toFixed(2)} m long, the lane ${(100 * track.lane_width_m).toFixed(1)} cm wide, ` +
    `${(1000 * track.metres_per_px).toFixed(3)} mm a pixel.`;
}
