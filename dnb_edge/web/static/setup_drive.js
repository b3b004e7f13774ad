// The test drive: where the box finds cars, on the live picture and on the twin.

import { sentence } from "./board_health.js";
import { follow, Line } from "./live.js";
import { blob } from "./setup_aim.js";
import { trackItems } from "./setup_route.js";
import { PictureView } from "./setup_view.js";

const byId = (id) => document.getElementById(id);
const KEPT = 90;
const AGAIN_MS = 2000;
const PICTURE_MS = 400;

export function driveStep(setup) {
  const views = { camera: null, twin: null };
  let line = null;
  let going = 0;
  let seen = [], observations = 0, laps = 0, last = null, up = null, phase = null, health = null;

  function begin() {
    views.camera ??= new PictureView(byId("drive-camera"), "The camera's picture, live");
    views.twin ??= new PictureView(byId("drive-twin"), "The twin");
    seen = []; observations = 0; laps = 0; last = null;
    line = follow({
      onState(state) { up = state !== null; phase = state?.phase ?? null; said(state?.reason ?? null); },
      onLine(how) { if (how === Line.RECONNECTING) said("The line to the box is broken: it comes back by itself."); },
      onEvent(event, { past }) { if (!past) heard(event); },
    });
  }

  function heard(event) {
    if (event.event === "observation") {
      observations += 1;
      last = Date.now();
      seen = [...seen.slice(1 - KEPT), event];
      draw();
    } else if (event.event === "lap") laps += 1;
    else if (event.event === "health") health = event;
    else return;
    said(null);
  }

  function said(reason) {
    const place = byId("drive-said");
    const ago = last === null ? null : (Date.now() - last) / 1000;
    let kind = "", text;
    if (up === false) [kind, text] = ["bad", "The timing service is not running: it comes back by itself."];
    else if (reason !== null) [kind, text] = ["warn", sentence(reason)];
    else if (phase === "setup") [kind, text] = ["", "The box gives pictures only: save first, then it races."];
    else if (ago === null) text = "No car is found yet: put one on the track and drive.";
    else if (ago > 2) [kind, text] = ["warn", "The car is not found any more: is it in the picture, and on the floor?"];
    else [kind, text] = ["good", "The car is found. Drive a whole lap: the dots should follow it everywhere, on the twin, too."];
    place.className = `notice${kind === "" ? "" : ` notice--${kind}`}`;
    place.textContent = text;
    facts();
  }

  function facts() {
    const latest = seen.at(-1);
    const rows = [["Observations", String(observations)], ["Laps", String(laps)]];
    if (latest) rows.push(["Sure to", `${Math.round(100 * latest.confidence)} %`]);
    if (health?.fps !== undefined && health.fps !== null) rows.push(["Frames a second", health.fps.toFixed(1)]);
    byId("drive-facts").replaceChildren(...rows.flatMap(([name, value]) => {
      const title = document.createElement("dt"), text = document.createElement("dd");
      title.textContent = name;
      text.textContent = value;
      return [title, text];
    }));
  }

  function draw() {
    const { answer } = setup;
    if (answer === null || views.twin === null) return;
    const dots = (at) => seen.map((one, k) => ({ kind: "point", at: at(one), colour: k === seen.length - 1 ? "bad" : "warn" }));
    const { address, size } = setup.twinAddress();
    views.twin.show(address, size);
    const metres_per_px = answer.track?.metres_per_px ?? null;
    const onTwin = metres_per_px === null || size === null ? [] : dots(({ track_m: [x, y] }) => [x / metres_per_px, size[1] - y / metres_per_px]);
    views.twin.put([...trackItems(answer.track), ...onTwin]);
    const ways = answer.keypoints.lane_camera_px;
    const own = answer.draft.photo;
    const shown = views.camera.size ?? null;
    const times = own === null || shown === null ? 1 : shown[0] / own.width_px;
    views.camera.put([
      ...ways.map((way) => ({ kind: "way", points: way.map(([u, v]) => [u * times, v * times]), colour: "lane", width: 1.5 })),
      ...dots(({ camera_px }) => camera_px),
    ]);
  }

  async function pictures(turn) {
    while (going === turn) {
      try {
        const image = await createImageBitmap(await blob("/api/v1/picture.jpg"));
        if (going !== turn) return;
        views.camera.size = [image.width, image.height];
        views.camera.showImage(image, views.camera.size);
        draw();
        await pause(PICTURE_MS);
      } catch {
        await pause(AGAIN_MS); // the line above says what is wrong
      }
    }
  }

  return {
    enter() { going += 1; begin(); pictures(going); said(null); draw(); },
    leave() { going += 1; line?.close(); line = null; },
    render() { draw(); },
  };
}

function pause(ms) { return new Promise((resolve) => { setTimeout(resolve, ms); }); }
