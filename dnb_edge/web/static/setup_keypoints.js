// Keypoints: pairs of taps in the camera's picture and on the twin, with undo; after each change the box says what they come to.

import { ask } from "./setup_api.js";
import { PictureView } from "./setup_view.js";
import { button, trackItems } from "./setup_route.js";
import { metres } from "./setup_twin.js";

const byId = (id) => document.getElementById(id);
const MOST_UNDOS = 200;
const MOST_PAIRS = 60;
const WORDS = { good: "", wrong: "contradicts the others", suspect: "may be wrong", swapped: "seems swapped" };

export function keypointsStep(setup) {
  let pairs = [];
  let past = [], future = [];
  let chosen = null;
  let sending = false, changed = false;
  let revision = null;
  const views = {
    camera_px: new PictureView(byId("camera-view"), "The camera's picture, for keypoints", heard("camera_px")),
    twin_px: new PictureView(byId("keypoint-twin-view"), "The twin, for keypoints", heard("twin_px")),
  };
  for (const view of Object.values(views)) view.placing = true;

  function heard(side) {
    return {
      onTap(px) { set(tapped(side, px)); },
      onDrag(name, px, done) {
        const moved = pairs.map((pair) => (pair.name === name ? { ...pair, [side]: px } : pair));
        if (done) set(moved, name);
        else { pairs = withoutHistory(moved); draw(); }
      },
      onSelect(name) { choose(name); },
      onDelete(name) { without(name); },
    };
  }

  // While a point is dragged nothing is sent and nothing can be undone; `before` is what undo goes back to.
  let before = null;
  function withoutHistory(moved) {
    before ??= pairs;
    return moved;
  }

  /** A tap goes to the chosen or first pair that lacks this side, else it begins a new pair. */
  function tapped(side, px) {
    const lacking = pairs.find((pair) => pair.name === chosen && pair[side] === null) ?? pairs.find((pair) => pair[side] === null);
    if (lacking !== undefined) {
      chosen = lacking.name;
      return pairs.map((pair) => (pair === lacking ? { ...pair, [side]: px } : pair));
    }
    if (pairs.length >= MOST_PAIRS) { setup.trouble(`${MOST_PAIRS} keypoints are enough for any camera.`); return pairs; }
    chosen = freeName();
    return [...pairs, { name: chosen, camera_px: null, twin_px: null, [side]: px }];
  }

  function freeName() {
    let number = 1;
    while (pairs.some((pair) => pair.name === String(number))) number += 1;
    return String(number);
  }

  function set(next, name = chosen) {
    past.push(before ?? pairs);
    past = past.slice(-MOST_UNDOS);
    before = null;
    future = [];
    pairs = next;
    chosen = name;
    told();
  }

  function exchange(one, other) {
    const at = (name) => pairs.find((pair) => pair.name === name)?.twin_px ?? null;
    const places = { [one]: at(other), [other]: at(one) };
    set(pairs.map((pair) => (pair.name in places ? { ...pair, twin_px: places[pair.name] } : pair)));
  }

  function step(from, to) {
    if (from.length === 0) return;
    to.push(pairs);
    pairs = from.pop();
    told();
  }

  function without(name) {
    if (name === null) return;
    chosen = null;
    set(pairs.filter((pair) => pair.name !== name), null);
  }

  function choose(name) {
    chosen = name;
    for (const view of Object.values(views)) view.select(name);
    draw();
  }

  function told() {
    draw();
    changed = true;
    sendAll();
  }

  /** One at a time, and the newest only: who clicks faster than the box computes loses nothing. */
  async function sendAll() {
    if (sending) return;
    sending = true;
    while (changed) {
      changed = false;
      const body = { pairs };
      await setup.change(() => ask("PUT", "keypoints", body));
    }
    sending = false;
    render(setup.answer);
  }

  byId("undo").addEventListener("click", () => step(past, future));
  byId("redo").addEventListener("click", () => step(future, past));
  byId("delete-pair").addEventListener("click", () => without(chosen));
  byId("keypoints").addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
    event.preventDefault();
    if (event.shiftKey) step(future, past);
    else step(past, future);
  });
  byId("limit").addEventListener("change", (event) => {
    const limit_mm = metres(event.target.value);
    if (!(limit_mm > 0)) { setup.trouble("The limit must be a number of millimetres, such as 20."); return; }
    setup.change(() => ask("PUT", "keypoints", { pairs, limit_mm }));
  });
  byId("sigma").addEventListener("click", async () => {
    const map = byId("sigma-map");
    setup.busy(1);
    try {
      const answer = await fetch("/api/v1/setup/sigma.png");
      if (!answer.ok) throw new Error((await answer.json()).error.text);
      if (map.src !== "") URL.revokeObjectURL(map.src);
      map.src = URL.createObjectURL(await answer.blob());
      map.hidden = false;
      map.scrollIntoView({ block: "nearest" });
    } catch (error) {
      setup.trouble(error.message);
    }
    setup.busy(-1);
  });

  function render(answer) {
    if (answer === null) return;
    if (!sending && before === null && revision !== answer.draft.revision) {
      const kept = answer.draft.pairs.map((pair) => ({ ...pair }));
      if (JSON.stringify(kept) !== JSON.stringify(pairs)) { pairs = kept; past = []; future = []; }
      revision = answer.draft.revision;
    }
    const photo = setup.photoAddress(), twin = setup.twinAddress();
    views.camera_px.show(photo.address, photo.size);
    views.twin_px.show(twin.address, twin.size);
    if (document.activeElement !== byId("limit")) byId("limit").value = answer.draft.limit_mm;
    byId("sigma-map").hidden ||= answer.keypoints.camera_to_twin === null;
    words(answer.keypoints);
    if (answer.keypoints.swapped.length === 2) {
      byId("keypoint-words").append(button(`Exchange ${answer.keypoints.swapped.join(" and ")} on the twin`, () => exchange(...answer.keypoints.swapped)));
    }
    facts(answer.keypoints);
    draw();
  }

  function draw() {
    const said = setup.answer?.keypoints ?? { points: [], lane_camera_px: [] };
    const about = new Map(said.points.map((point) => [point.name, point]));
    const colour = (name) => ({ good: "good", wrong: "bad", suspect: "warn", swapped: "bad" })[about.get(name)?.state] ?? "accent";
    for (const [side, view] of Object.entries(views)) {
      const points = pairs.filter((pair) => pair[side] !== null)
        .map((pair) => ({ kind: "point", id: pair.name, at: pair[side], text: pair.name, colour: colour(pair.name) }));
      if (side === "camera_px") {
        view.put([...said.lane_camera_px.map((way) => ({ kind: "way", points: way, colour: "lane", width: 1.5 })), ...points]);
      } else {
        const arrows = pairs.filter((pair) => pair.twin_px !== null && about.get(pair.name)?.put_px)
          .map((pair) => ({ kind: "way", points: [pair.twin_px, about.get(pair.name).put_px], colour: colour(pair.name), width: 2 }));
        view.put([...trackItems(setup.answer?.track ?? null), ...arrows, ...points]);
      }
      view.select(chosen);
    }
    table(about);
    byId("undo").disabled = past.length === 0;
    byId("redo").disabled = future.length === 0;
    byId("delete-pair").disabled = chosen === null;
    byId("next-tap").textContent = nextTap();
  }

  function nextTap() {
    const half = pairs.find((pair) => pair.camera_px === null || pair.twin_px === null);
    if (half === undefined) return `Next: keypoint ${freeName()}, in either picture.`;
    return `Next: keypoint ${half.name} ${half.camera_px === null ? "in the camera's picture" : "on the twin"}.`;
  }

  function table(about) {
    byId("pairs").replaceChildren(...pairs.map((pair) => {
      const point = about.get(pair.name);
      const row = document.createElement("tr");
      row.className = pair.name === chosen ? "is-chosen" : point && point.state !== "good" ? "is-bad" : "";
      const name = document.createElement("th");
      name.scope = "row";
      const choice = button(pair.name, () => choose(pair.name), `Choose keypoint ${pair.name}`);
      name.append(choice, ` ${WORDS[point?.state] ?? ""}`);
      row.append(
        name, cell(number(point?.error_px, 2), true), cell(number(point?.error_mm, 1), true), cell(place(pair.camera_px)), cell(place(pair.twin_px)),
      );
      const last = document.createElement("td");
      last.append(button("Delete", () => without(pair.name), `Delete keypoint ${pair.name}`));
      row.append(last);
      row.addEventListener("click", (event) => { if (!(event.target instanceof HTMLButtonElement)) choose(pair.name); });
      return row;
    }));
  }

  return { render, enter() { draw(); } };
}

function words(said) {
  const lines = [];
  if (said.over_limit !== null) lines.push(["warn", said.over_limit]);
  for (const text of said.notes) lines.push(["warn", text]);
  for (const text of said.advice) lines.push(["accent", text]);
  byId("keypoint-words").replaceChildren(...lines.map(([kind, text]) => {
    const line = document.createElement("p");
    line.className = `notice notice--${kind}`;
    line.textContent = text;
    return line;
  }));
}

function facts(said) {
  const rows = said.mean_px === null ? [] : [
    ["Mean", both(said.mean_px, said.mean_mm)],
    ["Greatest", both(said.max_px, null)],
    ["Mean, each left out in turn", said.leave_one_out_px === null ? "needs five keypoints" : both(said.leave_one_out_px, said.leave_one_out_mm)],
    ["One sigma on the track", `half of it under ${said.sigma_p50.toFixed(1)} ${said.sigma_unit}, 95 % under ${said.sigma_p95.toFixed(1)} ${said.sigma_unit}`],
  ];
  byId("keypoint-facts").replaceChildren(...rows.flatMap(([name, value]) => {
    const title = document.createElement("dt"), text = document.createElement("dd");
    title.textContent = name;
    text.textContent = value;
    return [title, text];
  }));
}

function both(px, mm) { return `${px.toFixed(2)} twin px${mm === null ? "" : `, ${mm.toFixed(1)} mm`}`; }
function number(value, digits) { return value === null || value === undefined ? "–" : value.toFixed(digits); }
function place(px) { return px === null ? "not yet" : `${px[0].toFixed(1)}, ${px[1].toFixed(1)}`; }

function cell(text, isNumber = false) {
  const made = document.createElement("td");
  if (isNumber) made.className = "number";
  made.textContent = text;
  return made;
}
