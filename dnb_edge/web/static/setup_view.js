// A picture to point into: zoom, pan, a loupe under the finger, markers to drag, a crosshair for the keyboard.
// Knows a canvas and px of its picture (u right, v down, whole numbers in the middle of a px, as everywhere in dnb-edge);
// knows nothing of what the markers mean.

// Within which a press takes hold of a thing; a finger is wider than a mouse's tip.
const REACH_CSS_PX = 22, MOUSE_REACH_CSS_PX = 10;
const LOUPE_CSS_PX = 116;
const LOUPE_TIMES = 3;
const MOST_ZOOM = 24;
const TAP_CSS_PX = 8;

export const COLOURS = Object.freeze({
  good: "#0b7a3b", bad: "#c3161c", warn: "#b26a00", accent: "#0a58a8", best: "#6a25b0", ink: "#16181b", lane: "#00a08a",
});

/** One canvas with its picture. `heard.onTap(px)`, `heard.onDrag(id, px, done)`, `heard.onSelect(id)`, `heard.onDelete(id)`. */
export class PictureView {
  #box; #canvas; #image = null; #size = null; #zoom = 1; #centre = [0, 0]; #pointers = new Map(); #grab = null; #aim = null;
  #cursor = null; #pinch = null; #frame = 0; #items = []; #selected = null; #said; #moved = false;
  /** Whether a tap is wanted. */
  placing = false;

  constructor(box, label, heard = {}) {
    this.#box = box;
    this.heard = heard;
    this.#canvas = document.createElement("canvas");
    this.#canvas.className = "frame view__canvas";
    this.#canvas.tabIndex = 0;
    this.#canvas.setAttribute("role", "application");
    this.#canvas.setAttribute("aria-label", `${label}. Arrow keys move the crosshair or the chosen point, Shift for a tenth of a pixel, ` +
      "Enter sets a point, plus and minus zoom, Delete deletes.");
    this.#said = document.createElement("p");
    this.#said.className = "visually-hidden";
    this.#said.setAttribute("aria-live", "polite");
    const tools = document.createElement("div");
    tools.className = "toolbar view__tools";
    tools.append(
      tool("+", "Zoom in", () => this.zoomBy(1.6)), tool("−", "Zoom out", () => this.zoomBy(1 / 1.6)),
      tool("⤢", "Show all", () => this.fit()),
      tool("←", "Move the chosen point left", () => this.#nudge(-1, 0)), tool("→", "Move the chosen point right", () => this.#nudge(1, 0)),
      tool("↑", "Move the chosen point up", () => this.#nudge(0, -1)), tool("↓", "Move the chosen point down", () => this.#nudge(0, 1)),
    );
    box.classList.add("view");
    box.append(this.#canvas, tools, this.#said);
    this.#listen();
    new ResizeObserver(() => this.draw()).observe(this.#canvas);
  }

  get canvas() { return this.#canvas; }
  get selected() { return this.#selected; }

  /** Shows the picture at `address`, which has `size` px; null for none. */
  show(address, size) {
    if (address === null) { this.#image = null; this.#box.dataset.address = ""; this.draw(); return; }
    if (this.#box.dataset.address === address) return;
    this.#box.dataset.address = address;
    const image = new Image();
    image.decoding = "async";
    image.onload = () => {
      const first = this.#image === null || String(this.#size) !== String(size);
      this.#image = image;
      this.#size = size;
      if (first) { this.#shape(); this.fit(); }
      this.draw();
    };
    image.onerror = () => { this.#image = null; this.draw(); };
    image.src = address;
  }

  /** Shows a picture that is loaded already, such as a live one. */
  showImage(image, size) {
    const first = this.#image === null || String(this.#size) !== String(size);
    this.#image = image;
    this.#size = size;
    if (first) { this.#shape(); this.fit(); }
    this.draw();
  }

  /** What is drawn on it: {kind: "line"|"way"|"point"|"arrow", ...}; points and lines with an `id` can be chosen and dragged. */
  put(items) { this.#items = items; this.draw(); }

  select(id) {
    if (this.#selected === id) return;
    this.#selected = id;
    this.draw();
  }

  fit() {
    if (this.#size === null) return;
    this.#zoom = 1;
    this.#centre = [this.#size[0] / 2, this.#size[1] / 2];
    this.draw();
  }

  zoomBy(times, at = null) {
    if (this.#size === null) return;
    const before = at === null ? null : this.#toPicture(at);
    this.#zoom = Math.min(MOST_ZOOM, Math.max(1, this.#zoom * times));
    if (before !== null) {
      const after = this.#toPicture(at);
      this.#centre = [this.#centre[0] + before[0] - after[0], this.#centre[1] + before[1] - after[1]];
    }
    this.#keepIn();
    this.draw();
  }

  /** Brings a place into the middle of the view. */
  lookAt(px, zoom = this.#zoom) {
    this.#zoom = Math.min(MOST_ZOOM, Math.max(1, zoom));
    this.#centre = [px[0] + 0.5, px[1] + 0.5];
    this.#keepIn();
    this.draw();
  }

  /** Where a place of the picture is on the page, CSS px from the canvas's corner: for tests and for help. */
  where(px) { return this.#toCss([px[0] + 0.5, px[1] + 0.5]); }

  /** As high as the picture wants, within what the style sheet lets it. */
  #shape() { this.#canvas.style.aspectRatio = `${this.#size[0]} / ${this.#size[1]}`; }

  draw() {
    if (this.#frame !== 0) return;
    this.#frame = requestAnimationFrame(() => { this.#frame = 0; this.#draw(); });
  }

  #scale() {
    const [width, height] = this.#size;
    return Math.min(this.#canvas.clientWidth / width, this.#canvas.clientHeight / height) * this.#zoom;
  }

  // Picture coordinates here have whole numbers at px corners, as canvases have; what comes in and goes out has them in the middle.
  #toCss([x, y]) {
    const scale = this.#scale();
    return [(x - this.#centre[0]) * scale + this.#canvas.clientWidth / 2, (y - this.#centre[1]) * scale + this.#canvas.clientHeight / 2];
  }

  #toPicture([x, y]) {
    const scale = this.#scale();
    return [(x - this.#canvas.clientWidth / 2) / scale + this.#centre[0], (y - this.#canvas.clientHeight / 2) / scale + this.#centre[1]];
  }

  #keepIn() {
    this.#centre = this.#centre.map((at, k) => Math.min(this.#size[k], Math.max(0, at)));
    if (this.#zoom === 1) this.#centre = [this.#size[0] / 2, this.#size[1] / 2];
  }

  #px(css) {
    const [x, y] = this.#toPicture(css);
    return this.#within([x - 0.5, y - 0.5]);
  }

  #within([u, v]) {
    const round = (x) => Math.round(x * 100) / 100;
    return [round(Math.min(this.#size[0] - 0.5, Math.max(-0.5, u))), round(Math.min(this.#size[1] - 0.5, Math.max(-0.5, v)))];
  }

  #listen() {
    const canvas = this.#canvas;
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", (event) => this.#cancel(event));
    canvas.addEventListener("pointerleave", () => { if (this.#pointers.size === 0) { this.#aim = null; this.draw(); } });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      if (this.#size === null) return;
      event.preventDefault();
      this.zoomBy(Math.exp(-event.deltaY / 400), this.#at(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.#key(event));
    canvas.addEventListener("blur", () => { this.#cursor = null; this.draw(); });
  }

  #at(event) {
    const box = this.#canvas.getBoundingClientRect();
    return [event.clientX - box.left - this.#canvas.clientLeft, event.clientY - box.top - this.#canvas.clientTop];
  }

  #down(event) {
    if (this.#size === null || this.#image === null) return;
    const at = this.#at(event);
    this.#canvas.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, at);
    this.#cursor = null;
    if (this.#pointers.size === 2) {
      this.#grab = null;
      this.#aim = null;
      this.#pinch = this.#span();
      this.draw();
      return;
    }
    this.#moved = false;
    const pan = event.button !== 0;
    const item = pan ? null : this.#itemAt(at, event.pointerType === "mouse" ? MOUSE_REACH_CSS_PX : REACH_CSS_PX);
    if (item !== null) {
      const place = this.#toCss(middle(item).map((x) => x + 0.5));
      this.#grab = { kind: "item", id: item.id, offset: [place[0] - at[0], place[1] - at[1]], from: at };
      this.select(item.id);
      this.heard.onSelect?.(item.id);
    } else {
      this.#grab = { kind: pan || !this.placing ? "pan" : "place", from: at };
    }
    this.#aimAt(at);
  }

  #move(event) {
    if (this.#size === null) return;
    const at = this.#at(event);
    if (!this.#pointers.has(event.pointerId)) {
      if (event.pointerType === "mouse" && this.placing) { this.#aim = at; this.draw(); }
      return;
    }
    const before = this.#pointers.get(event.pointerId);
    this.#pointers.set(event.pointerId, at);
    if (this.#pinch !== null) {
      if (this.#pointers.size === 2) this.#pinched();
      return;
    }
    if (this.#grab === null) return;
    if (Math.hypot(at[0] - this.#grab.from[0], at[1] - this.#grab.from[1]) > TAP_CSS_PX) this.#moved = true;
    if (this.#grab.kind === "pan") {
      const scale = this.#scale();
      this.#centre = [this.#centre[0] - (at[0] - before[0]) / scale, this.#centre[1] - (at[1] - before[1]) / scale];
      this.#keepIn();
    }
    if (this.#grab.kind === "item" && this.#moved) {
      this.heard.onDrag?.(this.#grab.id, this.#px(plus(at, this.#grab.offset)), false);
    }
    this.#aimAt(at);
  }

  #up(event) {
    const at = this.#at(event);
    const grab = this.#grab;
    this.#pointers.delete(event.pointerId);
    if (this.#pinch !== null) {
      if (this.#pointers.size === 0) this.#pinch = null;
      this.#grab = null;
      return;
    }
    this.#grab = null;
    if (event.pointerType !== "mouse") this.#aim = null;
    this.draw();
    if (grab === null) return;
    if (grab.kind === "item" && this.#moved) this.heard.onDrag?.(grab.id, this.#px(plus(at, grab.offset)), true);
    const inside = at[0] >= 0 && at[1] >= 0 && at[0] < this.#canvas.clientWidth && at[1] < this.#canvas.clientHeight;
    // Who drags out of the picture does not mean it.
    if (grab.kind === "place" && inside) this.heard.onTap?.(this.#px(at));
    if (grab.kind === "pan" && !this.#moved && event.button === 0) { this.select(null); this.heard.onSelect?.(null); }
  }

  #cancel(event) {
    this.#pointers.delete(event.pointerId);
    this.#grab = null;
    this.#aim = null;
    if (this.#pointers.size === 0) this.#pinch = null;
    this.draw();
  }

  #aimAt(at) {
    if (this.#grab?.kind === "item") this.#aim = plus(at, this.#grab.offset);
    else this.#aim = this.#grab?.kind === "place" ? at : null;
    this.draw();
  }

  #span() {
    const [a, b] = [...this.#pointers.values()];
    return { apart: Math.hypot(a[0] - b[0], a[1] - b[1]), at: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
  }

  #pinched() {
    const now = this.#span();
    const scale = this.#scale();
    this.#centre = [this.#centre[0] - (now.at[0] - this.#pinch.at[0]) / scale, this.#centre[1] - (now.at[1] - this.#pinch.at[1]) / scale];
    this.zoomBy(now.apart / Math.max(1, this.#pinch.apart), now.at);
    this.#pinch = now;
  }

  #key(event) {
    if (this.#size === null) return;
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (way !== undefined) {
      const step = event.shiftKey ? 0.1 : 1;
      if (this.#chosen() !== null) this.#nudge(way[0] * step, way[1] * step);
      else this.#moveCursor(way, event.shiftKey);
    } else if (event.key === "Enter" || event.key === " ") {
      if (!this.placing) return;
      if (this.#cursor === null) this.#moveCursor([0, 0], false);
      this.heard.onTap?.(this.#within(this.#cursor));
    } else if (event.key === "+" || event.key === "=") this.zoomBy(1.6, this.#cursorCss());
    else if (event.key === "-") this.zoomBy(1 / 1.6, this.#cursorCss());
    else if (event.key === "0") this.fit();
    else if (event.key === "Escape") { this.select(null); this.heard.onSelect?.(null); this.#cursor = null; this.draw(); }
    else if ((event.key === "Delete" || event.key === "Backspace") && this.#selected !== null) this.heard.onDelete?.(this.#selected);
    else return;
    event.preventDefault();
  }

  #cursorCss() { return this.#cursor === null ? null : this.#toCss(this.#cursor.map((x) => x + 0.5)); }

  #moveCursor(way, fine) {
    const step = fine ? 1 : Math.max(1, 12 / this.#scale());
    const from = this.#cursor ?? this.#px([this.#canvas.clientWidth / 2, this.#canvas.clientHeight / 2]);
    this.#cursor = this.#within([from[0] + way[0] * step, from[1] + way[1] * step]);
    this.#say(`${this.#cursor[0].toFixed(0)}, ${this.#cursor[1].toFixed(0)} px`);
    this.draw();
  }

  #nudge(du, dv) {
    const item = this.#chosen();
    if (item === null) return;
    const at = middle(item);
    const to = this.#within([at[0] + du, at[1] + dv]);
    this.#say(`${to[0]}, ${to[1]} px`);
    this.heard.onDrag?.(item.id, to, true);
  }

  #chosen() { return this.#items.find((item) => item.id !== undefined && item.id === this.#selected) ?? null; }

  #say(text) { this.#said.textContent = text; }

  #itemAt(at, reach) {
    let best = null, least = reach;
    for (const item of this.#items) {
      if (item.id === undefined) continue;
      const ends = item.kind === "point" ? [item.at, item.at] : item.points;
      const [a, b] = ends.map((end) => this.#toCss([end[0] + 0.5, end[1] + 0.5]));
      const apart = apartFrom(at, a, b);
      if (apart < least) { least = apart; best = item; }
    }
    return best;
  }

  #draw() {
    const canvas = this.#canvas;
    const ratio = globalThis.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    canvas.dataset.shown = this.#image === null || this.#size === null ? "no" : "yes";
    if (this.#image === null || this.#size === null) return;
    this.#paint(pen, (at) => this.#toCss(at), this.#scale());
    const cursor = this.#cursorCss();
    if (cursor !== null) cross(pen, cursor, 14);
    if (this.#aim !== null) this.#loupe(pen, this.#aim);
    else if (cursor !== null) this.#loupe(pen, cursor);
  }

  #paint(pen, toCss, scale) {
    const [x, y] = toCss([0, 0]);
    pen.imageSmoothingEnabled = scale < 3;
    pen.drawImage(this.#image, x, y, this.#size[0] * scale, this.#size[1] * scale);
    for (const item of this.#items) paintItem(pen, item, (px) => toCss([px[0] + 0.5, px[1] + 0.5]), item.id !== undefined && item.id === this.#selected);
  }

  #loupe(pen, at) {
    const [u, v] = this.#toPicture(at);
    const scale = this.#scale() * LOUPE_TIMES;
    const half = LOUPE_CSS_PX / 2;
    const left = at[0] > this.#canvas.clientWidth / 2;
    const middleAt = [left ? half + 6 : this.#canvas.clientWidth - half - 6, half + 6];
    pen.save();
    pen.beginPath();
    pen.arc(middleAt[0], middleAt[1], half, 0, 2 * Math.PI);
    pen.fillStyle = "#000";
    pen.fill();
    pen.clip();
    this.#paint(pen, ([x, y]) => [(x - u) * scale + middleAt[0], (y - v) * scale + middleAt[1]], scale);
    cross(pen, middleAt, 16);
    pen.restore();
    pen.beginPath();
    pen.arc(middleAt[0], middleAt[1], half, 0, 2 * Math.PI);
    pen.lineWidth = 3;
    pen.strokeStyle = "#fff";
    pen.stroke();
    pen.lineWidth = 1;
    pen.strokeStyle = "#000";
    pen.stroke();
  }
}

function paintItem(pen, item, at, chosen) {
  const colour = COLOURS[item.colour] ?? COLOURS.accent;
  if (item.kind === "point") {
    const [x, y] = at(item.at);
    const size = chosen ? 9 : 7;
    pen.beginPath();
    pen.arc(x, y, size, 0, 2 * Math.PI);
    stroked(pen, colour, chosen ? 3 : 2);
    pen.beginPath();
    pen.moveTo(x - 3, y); pen.lineTo(x + 3, y); pen.moveTo(x, y - 3); pen.lineTo(x, y + 3);
    stroked(pen, colour, 1);
    if (item.text) label(pen, item.text, x + size + 3, y - size, colour);
    return;
  }
  const points = item.points.map(at);
  if (points.length < 2) return;
  pen.beginPath();
  points.forEach(([x, y], k) => (k === 0 ? pen.moveTo(x, y) : pen.lineTo(x, y)));
  if (item.closed) pen.closePath();
  if (item.dashed) pen.setLineDash([6, 5]);
  stroked(pen, colour, chosen ? 5 : item.width ?? 2);
  pen.setLineDash([]);
  if (item.kind === "arrow") head(pen, points.at(-2), points.at(-1), colour);
  if (item.forward) forwardArrow(pen, points, colour);
  if (item.text) label(pen, item.text, points[0][0] + 6, points[0][1] - 8, colour);
}

// Standing at the first end and looking to the second, cars drive to the left: up on the track plane, where v points down.
function forwardArrow(pen, [a, b], colour) {
  const along = [b[0] - a[0], b[1] - a[1]];
  const length = Math.hypot(...along) || 1;
  const from = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const reach = Math.max(26, Math.min(60, length * 0.6));
  const to = [from[0] + (along[1] / length) * reach, from[1] - (along[0] / length) * reach];
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  stroked(pen, colour, 3);
  head(pen, from, to, colour);
}

function head(pen, from, to, colour) {
  const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
  pen.beginPath();
  for (const turn of [2.6, -2.6]) {
    pen.moveTo(...to);
    pen.lineTo(to[0] + 11 * Math.cos(angle + turn), to[1] + 11 * Math.sin(angle + turn));
  }
  stroked(pen, colour, 3);
}

function stroked(pen, colour, width) {
  pen.lineJoin = pen.lineCap = "round";
  pen.lineWidth = width + 2;
  pen.strokeStyle = "rgb(255 255 255 / 85%)";
  pen.stroke();
  pen.lineWidth = width;
  pen.strokeStyle = colour;
  pen.stroke();
}

function label(pen, text, x, y, colour) {
  pen.font = "700 13px system-ui, sans-serif";
  pen.textBaseline = "middle";
  pen.lineWidth = 4;
  pen.strokeStyle = "#fff";
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
}

function cross(pen, [x, y], size) {
  pen.beginPath();
  pen.moveTo(x - size, y); pen.lineTo(x - 3, y); pen.moveTo(x + 3, y); pen.lineTo(x + size, y);
  pen.moveTo(x, y - size); pen.lineTo(x, y - 3); pen.moveTo(x, y + 3); pen.lineTo(x, y + size);
  stroked(pen, "#c3161c", 1);
}

function middle(item) {
  if (item.kind === "point") return item.at;
  const [a, b] = item.points;
  return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
}

function plus(a, b) { return [a[0] + b[0], a[1] + b[1]]; }

function apartFrom(p, a, b) {
  const ab = [b[0] - a[0], b[1] - a[1]];
  const length2 = ab[0] ** 2 + ab[1] ** 2;
  const share = length2 === 0 ? 0 : Math.min(1, Math.max(0, ((p[0] - a[0]) * ab[0] + (p[1] - a[1]) * ab[1]) / length2));
  return Math.hypot(p[0] - a[0] - share * ab[0], p[1] - a[1] - share * ab[1]);
}

function tool(text, name, run) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = "button button--icon";
  made.textContent = text;
  made.setAttribute("aria-label", name);
  made.title = name;
  made.addEventListener("click", run);
  return made;
}
