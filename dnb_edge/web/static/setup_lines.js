// The start line, the finish line and the sector lines: tapped or dragged on the twin, where they lie down across the lane.

import { ask } from "./setup_api.js";
import { PictureView } from "./setup_view.js";
import { button, trackItems } from "./setup_route.js";

const byId = (id) => document.getElementById(id);

export function linesStep(setup) {
  /** Where a line is while it is dragged: {id, px}. */
  let dragged = null;

  /** The lines as the API wants them; `changes` replaces some. */
  function body(changes) {
    const { lines } = setup.answer.draft;
    const own = (ends_px) => (ends_px === null ? null : { ends_px });
    return { start: own(lines.start_px), finish: own(lines.finish_px), sectors: lines.sectors_px.map((ends_px) => ({ ends_px })), ...changes };
  }

  function keep(changes) { return setup.change(() => ask("PUT", "lines", body(changes))); }

  const startView = new PictureView(byId("start-view"), "The twin, for the start line", {
    onTap(px) { keep({ start: { at_px: px } }); },
    onDrag(id, px, done) {
      dragged = done ? null : { id, px };
      if (done) keep({ [id]: { at_px: px } });
      else drawStart();
    },
  });
  const sectorsView = new PictureView(byId("sectors-view"), "The twin, for sector lines", {
    onTap(px) { keep({ sectors: [...body({}).sectors, { at_px: px }] }); },
    onDrag(id, px, done) {
      dragged = done ? null : { id, px };
      if (done) keep({ sectors: body({}).sectors.map((line, k) => (`sector ${k}` === id ? { at_px: px } : line)) });
      else drawSectors();
    },
    onDelete(id) { without(Number(id.split(" ")[1])); },
  });
  startView.placing = sectorsView.placing = true;

  function without(k) { keep({ sectors: body({}).sectors.filter((_, at) => at !== k) }); }

  /** The start line as drawn, or the one that is proposed. */
  function startEnds() {
    const { draft, track } = setup.answer;
    return draft.lines.start_px ?? track?.lines.find((line) => line.name === "start")?.ends_px ?? null;
  }

  function item(id, ends, colour, text) {
    const points = dragged?.id === id ? moved(ends, dragged.px) : ends;
    return { kind: "line", id, points, colour, text, width: 4, forward: true };
  }

  function drawStart() {
    const { answer } = setup;
    if (answer === null) return;
    const items = [...trackItems(answer.track)];
    const ends = startEnds();
    if (ends !== null) items.push(item("start", ends, answer.draft.lines.start_px === null ? "warn" : "bad", "start"));
    if (answer.draft.lines.finish_px !== null) items.push(item("finish", answer.draft.lines.finish_px, "best", "finish"));
    startView.put(items);
  }

  function drawSectors() {
    const { answer } = setup;
    if (answer === null) return;
    const items = [...trackItems(answer.track)];
    const ends = startEnds();
    if (ends !== null) items.push({ kind: "line", points: ends, colour: "bad", text: "start", width: 3, forward: true });
    answer.draft.lines.sectors_px.forEach((line, k) => items.push({ ...item(`sector ${k}`, line, "accent", `${k + 1}`), forward: false }));
    sectorsView.put(items);
  }

  byId("start-here").addEventListener("click", () => {
    const ends = startEnds();
    if (ends === null) setup.trouble("There is no route yet: finish the route first.");
    else keep({ start: { ends_px: ends } });
  });
  byId("start-flip").addEventListener("click", () => {
    const ends = startEnds();
    if (ends === null) setup.trouble("There is no route yet: finish the route first.");
    else keep({ start: { ends_px: [ends[1], ends[0]] } });
  });
  byId("finish").addEventListener("change", (event) => {
    const { track } = setup.answer;
    if (!event.target.checked) { keep({ finish: null }); return; }
    if (track === null) { event.target.checked = false; return; }
    // Half a lap on: far from the start line, to be dragged from there.
    keep({ finish: { at_px: track.middle_px[Math.floor(track.middle_px.length / 2)] } });
  });

  function pictures(view) {
    const { address, size } = setup.twinAddress();
    view.show(address, size);
  }

  return {
    start: {
      render(answer) {
        pictures(startView);
        byId("finish").checked = answer.draft.lines.finish_px !== null;
        drawStart();
      },
    },
    sectors: {
      render(answer) {
        pictures(sectorsView);
        byId("sector-list").replaceChildren(...answer.draft.lines.sectors_px.map((line, k) => {
          const row = document.createElement("li");
          const [u, v] = [(line[0][0] + line[1][0]) / 2, (line[0][1] + line[1][1]) / 2];
          row.append(`Line ${k + 1} at ${u.toFixed(0)}, ${v.toFixed(0)} px`, button("Delete", () => without(k), `Delete sector line ${k + 1}`));
          return row;
        }));
        drawSectors();
      },
    },
  };
}

function moved(ends, to) {
  const by = [to[0] - (ends[0][0] + ends[1][0]) / 2, to[1] - (ends[0][1] + ends[1][1]) / 2];
  return ends.map(([u, v]) => [u + by[0], v + by[1]]);
}
