// The track from above, drawn: lane, lines, the path of the running lap, the best one's, the ghost and the cars. Knows a canvas
// and metres on the track plane (x to the right, y up); what is where, others tell.

const MARGIN_PX = 14;
const LEAST_LANE_PX = 10;
/** Cars beside the shown one, in the order of their numbers. */
const OTHERS = ["--good", "--warn", "--bad", "--best", "--ink-soft"];

export class TrackMap {
  #canvas;
  #ground = document.createElement("canvas");
  #scenery = null;
  #view = null;
  #colours = null;
  #stale = true;
  #painted = "";

  constructor(canvas) {
    this.#canvas = canvas;
    new ResizeObserver(() => this.restyle()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.restyle());
    document.addEventListener("themechange", () => this.restyle());
  }

  /** What stands still; null where there is no race. */
  set scenery(scenery) {
    this.#scenery = scenery;
    this.#stale = true;
    this.#canvas.parentElement.classList.toggle("is-empty", scenery === null);
    if (scenery !== null) this.#canvas.style.aspectRatio = String(Math.min(2.2, Math.max(0.8, aspect(scenery))));
  }

  /** Size or colours may have changed. */
  restyle() {
    this.#stale = true;
  }

  /** Paint, where anything has changed: `cars` is [{place, path, best, ghost, shown, number, label}], places as Traces gives them. */
  paint(cars) {
    if (this.#scenery === null) return;
    const seen = JSON.stringify(cars.map((car) => [car.number, car.shown, car.place, car.path.length, car.best?.length, car.ghost]));
    if (seen === this.#painted && !this.#stale) return;
    if (this.#stale && !this.#prepare()) return;
    this.#painted = seen;
    const context = this.#canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    context.drawImage(this.#ground, 0, 0);
    context.lineJoin = "round";
    context.lineCap = "round";
    const unit = this.#view.ratio;
    for (const car of cars.filter((one) => one.shown)) {
      this.#line(context, car.best, this.#colours.best, 2 * unit, 0.9);
      const here = car.place !== null && car.place.fresh ? [car.place] : [];
      this.#line(context, [...car.path, ...here], this.#colours.path, 3 * unit, 1);
      if (car.ghost !== null) this.#dot(context, car.ghost, this.#colours.best, 7 * unit, true);
    }
    for (const car of cars) if (car.place !== null) this.#car(context, car, unit);
  }

  #prepare() {
    const box = this.#canvas.getBoundingClientRect();
    if (box.width < 1 || box.height < 1) return false;
    const ratio = Math.min(3, globalThis.devicePixelRatio || 1);
    const [width, height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    for (const canvas of [this.#canvas, this.#ground]) {
      canvas.width = width;
      canvas.height = height;
    }
    this.#view = fit(this.#scenery, width, height, ratio);
    const style = getComputedStyle(this.#canvas);
    const colour = (name) => style.getPropertyValue(name).trim();
    this.#colours = {
      lane: colour("--asphalt"), centre: colour("--ink-soft"), line: colour("--ink"), edge: colour("--edge"), path: colour("--accent"),
      best: colour("--best"), car: colour("--ink"), rim: colour("--surface"), others: OTHERS.map(colour),
    };
    this.#drawGround();
    this.#stale = false;
    return true;
  }

  #drawGround() {
    const context = this.#ground.getContext("2d");
    const { scale, ratio } = this.#view;
    context.lineJoin = "round";
    context.lineCap = "round";
    const lane_px = Math.max(LEAST_LANE_PX * ratio, (this.#scenery.lane_width_m ?? 0) * scale);
    this.#centreline(context);
    context.lineWidth = lane_px + 2 * ratio;
    context.strokeStyle = this.#colours.edge;
    context.stroke();
    context.lineWidth = lane_px;
    context.strokeStyle = this.#colours.lane;
    context.stroke();
    context.setLineDash([3 * ratio, 9 * ratio]);
    context.lineWidth = ratio;
    context.strokeStyle = this.#colours.centre;
    context.stroke();
    context.setLineDash([]);
    for (const line of this.#scenery.lines) this.#crossLine(context, line, ratio);
  }

  #centreline(context) {
    context.beginPath();
    for (const point of this.#scenery.centreline_m) context.lineTo(...this.#at(point));
    if (this.#scenery.closed) context.closePath();
  }

  #crossLine(context, line, ratio) {
    context.beginPath();
    context.moveTo(...this.#at(line.start_m));
    context.lineTo(...this.#at(line.end_m));
    context.lineCap = "butt";
    context.lineWidth = (line.name === "start" ? 6 : 2) * ratio;
    context.strokeStyle = line.name === "start" ? this.#colours.rim : this.#colours.line;
    context.stroke();
    if (line.name === "start") {
      context.setLineDash([4 * ratio, 4 * ratio]);
      context.strokeStyle = this.#colours.line;
      context.stroke();
      context.setLineDash([]);
    }
    context.lineCap = "round";
  }

  #line(context, points, colour, width, alpha) {
    if (points === null || points.length < 2) return;
    const { scale, left, top } = this.#view;
    context.beginPath();
    for (const point of points) context.lineTo(left + point.x * scale, top - point.y * scale);
    context.globalAlpha = alpha;
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.stroke();
    context.globalAlpha = 1;
  }

  #dot(context, point, colour, radius, hollow) {
    context.beginPath();
    context.arc(...this.#at(point), radius, 0, 2 * Math.PI);
    context.lineWidth = 2 * this.#view.ratio;
    context.strokeStyle = hollow ? colour : this.#colours.rim;
    context.fillStyle = hollow ? this.#colours.rim : colour;
    context.fill();
    context.stroke();
  }

  #car(context, car, unit) {
    const colour = car.shown ? this.#colours.car : this.#colours.others[(car.number - 1) % this.#colours.others.length];
    context.globalAlpha = car.place.fresh ? 1 : 0.45;
    this.#dot(context, [car.place.x, car.place.y], colour, (car.shown ? 9 : 7) * unit, false);
    const [x, y] = this.#at([car.place.x, car.place.y]);
    if (car.label !== null) {
      context.font = `700 ${11 * unit}px system-ui, sans-serif`;
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillStyle = this.#colours.rim;
      context.fillText(car.label, x, y);
    }
    context.globalAlpha = 1;
  }

  #at([x, y]) {
    const { scale, left, top } = this.#view;
    return [left + x * scale, top - y * scale];
  }
}

function bounds(scenery) {
  const half = (scenery.lane_width_m ?? 0) / 2;
  const ends = scenery.lines.flatMap((line) => [line.start_m, line.end_m]);
  const extent = (axis) => {
    const route = scenery.centreline_m.map((point) => point[axis]);
    const across = ends.map((point) => point[axis]);
    return [Math.min(Math.min(...route) - half, ...across), Math.max(Math.max(...route) + half, ...across)];
  };
  const [x0, x1] = extent(0);
  const [y0, y1] = extent(1);
  return { x0, x1, y0, y1 };
}

function aspect(scenery) {
  const { x0, x1, y0, y1 } = bounds(scenery);
  return (x1 - x0 || 1) / (y1 - y0 || 1);
}

/** The scale and the shift that put the whole track into the middle of a canvas. */
function fit(scenery, width, height, ratio) {
  const { x0, x1, y0, y1 } = bounds(scenery);
  const margin = MARGIN_PX * ratio;
  const scale = Math.min((width - 2 * margin) / (x1 - x0 || 1), (height - 2 * margin) / (y1 - y0 || 1));
  return { scale, ratio, left: (width - scale * (x0 + x1)) / 2, top: (height + scale * (y0 + y1)) / 2 };
}
