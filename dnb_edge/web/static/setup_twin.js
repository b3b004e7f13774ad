// The twin: given as a file, or made of the camera's picture by the corners of a rectangle on the floor.

import { ask, send } from "./setup_api.js";
import { PictureView } from "./setup_view.js";

const byId = (id) => document.getElementById(id);
const CORNERS = ["top left", "top right", "bottom right", "bottom left"];

export function twinStep(setup) {
  const twin = new PictureView(byId("twin-view"), "The twin");
  let corners = [];
  const photo = new PictureView(byId("flatten-view"), "The camera's picture, for the rectangle's corners", {
    onTap(px) { if (corners.length < 4) { corners.push(px); draw(); } },
    onDrag(id, px) { corners[id] = px; draw(); },
  });
  photo.placing = true;

  function draw() {
    photo.put([
      ...(corners.length > 1 ? [{ kind: "way", points: corners, closed: corners.length === 4, colour: "accent" }] : []),
      ...corners.map((at, id) => ({ kind: "point", id, at, text: CORNERS[id], colour: "accent" })),
    ]);
  }

  byId("twin-file").addEventListener("change", async (event) => {
    const [file] = event.target.files;
    if (file) await setup.change(() => send("twin", file));
    event.target.value = "";
  });
  byId("flatten-undo").addEventListener("click", () => { corners.pop(); draw(); });
  byId("flatten-go").addEventListener("click", () => {
    if (corners.length < 4) { setup.trouble(`Tap the rectangle's ${CORNERS[corners.length]} corner first.`); return; }
    const [width_m, height_m] = ["flatten-width", "flatten-height"].map((id) => metres(byId(id).value));
    if (!(width_m > 0 && height_m > 0)) { setup.trouble("Give the rectangle's width and height in metres."); return; }
    setup.change(() => ask("POST", "twin", { corners_px: corners, width_m, height_m }));
  });
  byId("flatten").addEventListener("toggle", () => { photo.draw(); });

  return {
    render(answer) {
      const { address, size } = setup.twinAddress();
      twin.show(address, size);
      byId("twin-view").hidden = address === null;
      const own = setup.photoAddress();
      photo.show(own.address, own.size);
      if (answer.draft.photo === null) corners = [];
      draw();
    },
  };
}

export function metres(text) { return Number(text.trim().replace(",", ".")); }
