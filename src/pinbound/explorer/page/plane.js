// The plane of two coordinates: the region that Python computed, where it is valid; else a grid that is sampled here,
// and a text that says so.

const LIGHT = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6000", "#000000"];
const DARK = ["#4DA8E0", "#FF8A3D", "#2FC79B", "#E29BC4", "#F2B632", "#8ACFF5", "#C9A227", "#FFFFFF"];
const GRIDS = [24, 48, 96, 144];
const SLICE = 7; // ms of sampling a frame
const SAME = 1e-12; // rad or m
const PAD = { left: 46, right: 14, top: 14, bottom: 38 };

function colour(state, name) {
  const palette = state.isDark() ? DARK : LIGHT;
  return palette[(state.data.colours[name] ?? 0) % palette.length];
}

class Plane {
  constructor(state, element) {
    this.state = state;
    this.element = element;
    this.svg = element.querySelector("svg");
    this.canvas = element.querySelector("canvas");
    this.wide = false;
    this.columns = state.data.regions[0]?.columns ?? [0, Math.min(1, state.robot.n - 1)];
    this.raster = null;
    new ResizeObserver(() => this.resize()).observe(element);
    element.addEventListener("pointerdown", (event) => this.press(event));
    element.addEventListener("pointermove", (event) => this.move(event));
    element.addEventListener("pointerup", (event) => this.release(event));
    element.addEventListener("pointercancel", () => (this.pressed = null));
    element.addEventListener("keydown", (event) => this.key(event));
  }

  // The computed region of these two coordinates, in this order; null if there is none.
  get region() {
    const [i, j] = this.columns;
    return this.state.data.regions.find(({ columns, loops }) => loops && columns[0] === i && columns[1] === j) ?? null;
  }

  get failure() {
    const [i, j] = this.columns;
    return this.state.data.regions.find(({ columns, error }) => error && columns[0] === i && columns[1] === j)?.error;
  }

  // Coordinates that do not have the values for which the region was computed.
  get moved() {
    const { region } = this;
    return region ? region.fixed.filter((k) => Math.abs(this.state.q[k] - region.at[k]) > SAME) : [];
  }

  get isExact() {
    return this.region !== null && !this.moved.length;
  }

  choose(columns) {
    this.columns = columns;
    this.raster = null;
    this.resize();
  }

  resize() {
    const box = this.element.getBoundingClientRect();
    [this.width, this.height] = [box.width, box.height];
    if (this.width < 150 || this.height < 120) return (this.width = 0);
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    [this.canvas.width, this.canvas.height] = [this.width * ratio, this.height * ratio];
    this.ratio = ratio;
    this.frame();
    this.draw();
    this.state.changed();
  }

  // Sets the part of the plane that is shown; both axes have the same scale if both coordinates have the same unit.
  frame() {
    const { coordinates } = this.state.data;
    const shown = this.columns.map((k) => [...coordinates[k].window]);
    const { region } = this;
    if (region && !this.wide) {
      const points = region.loops.flat().flatMap((edge) => edge.points);
      shown.forEach((ends, k) => {
        const [low, high] = [Math.min(...points.map((p) => p[k])), Math.max(...points.map((p) => p[k]))];
        const pad = 0.12 * (high - low || 1);
        [ends[0], ends[1]] = [low - pad, high + pad];
      });
    }
    const inner = [this.width - PAD.left - PAD.right, this.height - PAD.top - PAD.bottom];
    const spans = shown.map(([low, high]) => high - low);
    if (coordinates[this.columns[0]].unit === coordinates[this.columns[1]].unit) {
      const unit = Math.max(spans[0] / inner[0], spans[1] / inner[1]);
      shown.forEach((ends, k) => {
        const extra = 0.5 * (unit * inner[k] - spans[k]);
        [ends[0], ends[1]] = [ends[0] - extra, ends[1] + extra];
      });
    }
    this.shown = shown;
    this.inner = inner;
  }

  toPixels([x, y]) {
    const [[x0, x1], [y0, y1]] = this.shown;
    return [PAD.left + ((x - x0) / (x1 - x0)) * this.inner[0], PAD.top + ((y1 - y) / (y1 - y0)) * this.inner[1]];
  }

  toPlane([px, py]) {
    const [[x0, x1], [y0, y1]] = this.shown;
    return [x0 + ((px - PAD.left) / this.inner[0]) * (x1 - x0), y1 - ((py - PAD.top) / this.inner[1]) * (y1 - y0)];
  }

  line(points) {
    return points.map((point) => this.toPixels(point).map((part) => part.toFixed(2)).join(",")).join(" L");
  }

  draw() {
    if (!this.width) return;
    const parts = [this.axes()];
    const { region, state } = this;
    parts.push(`<clipPath id="inside"><rect x="${PAD.left}" y="${PAD.top}" width="${this.inner[0]}" height="${this.inner[1]}"/></clipPath>`);
    if (region) parts.push(this.isExact ? this.exact(region) : this.past(region));
    if (state.data.motion) {
      const points = state.data.motion.waypoints.map((row) => this.columns.map((k) => row[k]));
      parts.push(`<path class="path" clip-path="url(#inside)" d="M${this.line(points)}"/>`);
    }
    const home = this.toPixels(this.columns.map((k) => state.data.home[k]));
    parts.push(`<rect class="home" x="${home[0] - 5}" y="${home[1] - 5}" width="10" height="10"><title>home</title></rect>`);
    parts.push('<g id="cursor"></g>');
    this.svg.innerHTML = parts.join("");
    this.wasExact = this.isExact;
    this.point();
  }

  axes() {
    const { coordinates } = this.state.data;
    const parts = [`<rect class="frame" x="${PAD.left}" y="${PAD.top}" width="${this.inner[0]}" height="${this.inner[1]}"/>`];
    this.columns.forEach((column, k) => {
      const { name, unit } = coordinates[column];
      const factor = FACTORS[unit];
      const [low, high] = this.shown[k].map((end) => end * factor);
      const step = niceStep((high - low) / (k ? this.inner[1] / 50 : this.inner[0] / 70));
      for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) {
        const text = Number(tick.toPrecision(6));
        if (k === 0) {
          const x = this.toPixels([tick / factor, 0])[0];
          parts.push(`<line class="gridline" x1="${x}" x2="${x}" y1="${PAD.top}" y2="${PAD.top + this.inner[1]}"/>`);
          parts.push(`<text class="tick" x="${x}" y="${this.height - 23}" text-anchor="middle">${text}</text>`);
        } else {
          const y = this.toPixels([0, tick / factor])[1];
          parts.push(`<line class="gridline" x1="${PAD.left}" x2="${PAD.left + this.inner[0]}" y1="${y}" y2="${y}"/>`);
          parts.push(`<text class="tick" x="${PAD.left - 5}" y="${y + 4}" text-anchor="end">${text}</text>`);
        }
      }
      const title = `${escape(name)} [${UNITS[unit]}]`;
      if (k === 0) parts.push(`<text x="${PAD.left + this.inner[0]}" y="${this.height - 7}" text-anchor="end">${title}</text>`);
      else parts.push(`<text x="${PAD.left + 5}" y="${PAD.top + 13}">${title}</text>`);
    });
    return parts.join("");
  }

  exact(region) {
    const fill = region.loops.map((loop) => `M${this.line(loop.flatMap((edge) => edge.points))}Z`).join("");
    const parts = [`<g clip-path="url(#inside)"><path class="free" fill-rule="evenodd" d="${fill}"/>`];
    for (const { name, normal, bound } of region.implied) parts.push(this.implied(name, normal, bound, region));
    for (const slit of region.slits) parts.push(`<path class="path" d="M${this.line(slit)}"><title>a cut that no motion crosses</title></path>`);
    const names = [];
    region.loops.flat().forEach((edge, k) => {
      const d = `M${this.line(edge.points)}`;
      const chosen = this.state.chosen === edge.name ? " chosen" : "";
      parts.push(`<path class="rim" d="${d}"/><path class="edge${chosen}" stroke="${colour(this.state, edge.name)}" d="${d}"/>`);
      parts.push(`<path class="hit" data-edge="${k}" d="${d}"><title>${escape(edge.name)}</title></path>`);
      names.push([edge.name, edge.points, chosen]);
    });
    parts.push(...this.names(names, region), "</g>");
    return parts.join("");
  }

  // SVG of the names of edges: inside the region, each name once, and not over each other.
  names(edges, region) {
    const corners = region.corners;
    const centre = this.toPixels([0, 1].map((k) => corners.reduce((sum, p) => sum + p[k], 0) / corners.length));
    const taken = [];
    const done = new Set();
    const parts = [];
    const long = (points) => {
      const [a, b] = [points[0], points[points.length - 1]].map((p) => this.toPixels(p));
      return Math.hypot(a[0] - b[0], a[1] - b[1]) + points.length;
    };
    for (const [name, points] of [...edges].sort((a, b) => long(b[1]) - long(a[1]))) {
      if (done.has(name)) continue;
      const middle = points.length === 2 ? [0, 1].map((k) => 0.5 * (points[0][k] + points[1][k])) : points[points.length >> 1];
      const [x, y] = this.toPixels(middle);
      const away = Math.hypot(centre[0] - x, centre[1] - y) || 1;
      const half = 3.6 * name.length + 4;
      const [from, to] = [points[0], points[points.length - 1]].map((p) => this.toPixels(p));
      if (name.length > 7 && Math.abs(from[1] - to[1]) > Math.max(2 * half, 3 * Math.abs(from[0] - to[0]))) {
        const beside = x + (centre[0] > x ? 14 : -6);
        parts.push(`<text class="name" text-anchor="middle" transform="translate(${beside} ${y}) rotate(-90)">${escape(name)}</text>`);
        taken.push([beside, y, 8]);
        done.add(name);
        continue;
      }
      const place = [x + ((centre[0] - x) / away) * (half + 8), y + ((centre[1] - y) / away) * 16 + 4];
      place[0] = Math.min(Math.max(place[0], PAD.left + half), this.width - PAD.right - half);
      const home = this.toPixels(this.columns.map((k) => this.state.data.home[k]));
      if (Math.abs(place[0] - home[0]) < half + 8 && Math.abs(place[1] - 4 - home[1]) < 16) place[1] = home[1] + (place[1] - 4 < home[1] ? -16 : 24);
      if (taken.some((one) => Math.abs(one[0] - place[0]) < one[2] + half && Math.abs(one[1] - place[1]) < 14)) continue;
      taken.push([...place, half]);
      done.add(name);
      parts.push(`<text class="name" text-anchor="middle" x="${place[0]}" y="${place[1]}">${escape(name)}</text>`);
    }
    return parts;
  }

  // SVG of an implied contact: its line, and its name on or beside the line, away from edges of the region.
  implied(name, normal, bound, region) {
    const [[x0, x1], [y0, y1]] = this.shown;
    const ends = [];
    for (const x of [x0, x1]) {
      const y = (bound - normal[0] * x) / normal[1];
      if (y >= y0 && y <= y1) ends.push([x, y]);
    }
    for (const y of [y0, y1]) {
      const x = (bound - normal[1] * y) / normal[0];
      if (x >= x0 && x <= x1) ends.push([x, y]);
    }
    if (ends.length < 2) return "";
    const [a, b] = [this.toPixels(ends[0]), this.toPixels(ends[1])];
    const half = 3.4 * name.length;
    const edges = region.loops.flat().flatMap(({ points }) => points.slice(1).map((end, k) => [points[k], end].map((p) => this.toPixels(p))));
    const room = (place) => Math.min(...edges.map((edge) => apart(place, half, edge)));
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]].map((one) => one / Math.hypot(b[0] - a[0], b[1] - a[1]));
    const centre = this.toPixels([0, 1].map((k) => region.corners.reduce((sum, p) => sum + p[k], 0) / region.corners.length));
    const outwards = Math.sign((a[0] - centre[0]) * dy - (a[1] - centre[1]) * dx) || 1;
    const aside = outwards * (6 + Math.abs(dy) * half + Math.abs(dx) * 5);
    const places = [0, aside].flatMap((shift) => [0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88].map((share) => {
      const x = a[0] + share * (b[0] - a[0]) + shift * dy;
      const y = a[1] + share * (b[1] - a[1]) - shift * dx;
      const low = this.height - PAD.bottom - 4;
      return [Math.min(Math.max(x, PAD.left + half), this.width - PAD.right - half), Math.min(Math.max(y + 4, PAD.top + 28), low)];
    }));
    const at = places.find((place) => room(place) > 10) ?? places.reduce((best, place) => (room(place) > room(best) ? place : best));
    return `<line class="implied" x1="${a[0]}" y1="${a[1]}" x2="${b[0]}" y2="${b[1]}"/><text class="tick" x="${at[0]}" y="${at[1]}" text-anchor="middle">${escape(name)}</text>`;
  }

  past(region) {
    return region.loops.map((loop) => `<path class="past" clip-path="url(#inside)" d="M${this.line(loop.flatMap((edge) => edge.points))}Z"/>`).join("");
  }

  point() {
    const cursor = this.svg.querySelector("#cursor");
    if (!cursor) return;
    const [x, y] = this.toPixels(this.columns.map((k) => this.state.q[k]));
    cursor.innerHTML =
      `<line class="cross" x1="${x}" x2="${x}" y1="${PAD.top}" y2="${PAD.top + this.inner[1]}"/>` +
      `<line class="cross" x1="${PAD.left}" x2="${PAD.left + this.inner[0]}" y1="${y}" y2="${y}"/>` +
      (this.state.isFree
        ? `<circle class="point" cx="${x}" cy="${y}" r="8"/>`
        : `<path class="point bad" d="M${x},${y - 10} L${x + 10},${y + 8} L${x - 10},${y + 8}Z"/>`);
  }

  // Called once for each frame: draws the point, draws all if `isExact` has changed, and continues the sampling.
  update() {
    if (!this.width) return;
    if (this.wasExact !== this.isExact) this.draw();
    else this.point();
    if (this.isExact) {
      if (this.raster) {
        this.raster = null;
        this.canvas.getContext("2d").clearRect(0, 0, this.canvas.width, this.canvas.height);
      }
      return;
    }
    const held = this.state.data.coordinates.map((_, k) => (this.columns.includes(k) ? 0 : this.state.q[k]));
    const key = JSON.stringify([held, this.columns, this.shown, this.state.isDark(), this.width, this.height]);
    if (this.raster?.key !== key) this.raster = { key, level: 0, row: 0, hits: null };
    this.sample();
  }

  get isSampling() {
    return this.raster !== null && this.raster.level < GRIDS.length;
  }

  sample() {
    const { raster, state } = this;
    const end = performance.now() + SLICE;
    while (this.isSampling && performance.now() < end) {
      const size = GRIDS[raster.level];
      raster.hits ??= new Int16Array(size * size);
      const q = Float64Array.from(state.q);
      for (let column = 0; column < size; column++) {
        const x = this.shown[0][0] + ((column + 0.5) / size) * (this.shown[0][1] - this.shown[0][0]);
        const y = this.shown[1][1] - ((raster.row + 0.5) / size) * (this.shown[1][1] - this.shown[1][0]);
        [q[this.columns[0]], q[this.columns[1]]] = [x, y];
        raster.hits[raster.row * size + column] = this.hit(q);
      }
      if (++raster.row === size) {
        this.paint(size, raster.hits);
        Object.assign(raster, { level: raster.level + 1, row: 0, hits: null, drawn: size });
      }
    }
  }

  // -1: free; -2: outside the limits; else the index of a boundary in contact. The boundary found last is tried first.
  hit(q) {
    const { robot } = this.state;
    if (robot.broken(q).length) return -2;
    this.order ??= robot.clearances.map((_, k) => k);
    const found = robot.contact(q, this.order);
    const place = this.order.indexOf(found);
    if (place > 0) this.order.unshift(...this.order.splice(place, 1));
    return found;
  }

  paint(size, hits) {
    const context = this.canvas.getContext("2d");
    const small = document.createElement("canvas");
    [small.width, small.height] = [size, size];
    const image = new ImageData(size, size);
    const style = getComputedStyle(document.documentElement);
    const [free, card] = ["--free", "--card"].map((name) => parseColour(style.getPropertyValue(name)));
    const names = this.state.data.boundaries.map(({ name }) => parseColour(colour(this.state, name)));
    hits.forEach((hit, k) => {
      const [r, g, b] = hit === -1 ? free : hit === -2 ? card : names[hit].map((part, i) => Math.round(0.45 * part + 0.55 * card[i]));
      image.data.set([r, g, b, 255], 4 * k);
    });
    small.getContext("2d").putImageData(image, 0, 0);
    context.imageSmoothingEnabled = false;
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.drawImage(small, PAD.left * this.ratio, PAD.top * this.ratio, this.inner[0] * this.ratio, this.inner[1] * this.ratio);
  }

  // One sentence about how exact the picture is.
  said() {
    const { data } = this.state;
    const names = this.columns.map((k) => data.coordinates[k].name).join(", ");
    if (this.isExact) return `${this.region.is_exact ? "Exact" : "Computed"} region of (${names}), by Python: ${this.region.said}.`;
    const grid = this.raster?.drawn;
    const sampled = `Sampled${grid ? ` on a ${grid} x ${grid} grid` : ""}: cells are coloured by a boundary in contact, and what is thinner than a cell can be missed`;
    if (!this.region) return `${sampled}. ${this.failure ? `No region was computed: ${this.failure}.` : "No region was computed for this plane."}`;
    const where = this.region.fixed.map((k) => `${data.coordinates[k].name} = ${amount(this.region.at[k], data.coordinates[k].unit)}`);
    return `${sampled}. The computed region (dotted) holds at ${where.join(", ")} only.`;
  }

  place(event) {
    const box = this.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  press(event) {
    if (event.button) return;
    this.pressed = { at: this.place(event), edge: event.target.dataset?.edge };
    this.element.setPointerCapture(event.pointerId);
    if (this.pressed.edge === undefined) this.to(this.pressed.at);
  }

  move(event) {
    if (!this.pressed) return;
    const at = this.place(event);
    if (Math.hypot(at[0] - this.pressed.at[0], at[1] - this.pressed.at[1]) > 4) this.pressed.edge = undefined;
    if (this.pressed.edge === undefined) this.to(at);
  }

  release() {
    if (this.pressed?.edge !== undefined) this.state.choose(this.region.loops.flat()[this.pressed.edge].name);
    this.pressed = null;
  }

  to(pixels) {
    const point = this.toPlane(pixels);
    this.columns.forEach((column, k) => this.state.set(column, point[k]));
  }

  key(event) {
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowDown: [1, -1], ArrowUp: [1, 1] };
    const [k, sign] = steps[event.key] ?? [];
    if (k === undefined) return;
    event.preventDefault();
    const { unit } = this.state.data.coordinates[this.columns[k]];
    this.state.set(this.columns[k], this.state.q[this.columns[k]] + (sign * (event.shiftKey ? 0.1 : 1)) / (unit === "rad" ? FACTORS.rad : 500));
  }
}

const FACTORS = { rad: 180 / Math.PI, m: 1000 };
const UNITS = { rad: "deg", m: "mm" };

function amount(value, unit, digits = unit === "rad" ? 3 : 2) {
  if (!Number.isFinite(value)) return "none";
  return `${(value * FACTORS[unit]).toFixed(digits).replace(/^-(0\.0*)$/, "$1")} ${UNITS[unit]}`;
}

function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= rough * 0.999);
}

// Distance [pixels] of an edge from the middle line of a name, whose width is 2 half; 17 points of the line are
// compared.
function apart([x, y], half, [from, to]) {
  const along = [to[0] - from[0], to[1] - from[1]];
  const square = along[0] ** 2 + along[1] ** 2 || 1;
  let least = Infinity;
  for (let k = -8; k <= 8; k += 1) {
    const p = [x + (k / 8) * half - from[0], y - 4 - from[1]];
    const share = Math.min(Math.max((p[0] * along[0] + p[1] * along[1]) / square, 0), 1);
    least = Math.min(least, Math.hypot(p[0] - share * along[0], p[1] - share * along[1]));
  }
  return least;
}

function parseColour(text) {
  const hex = text.trim().slice(1);
  return [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));
}

function escape(text) {
  return String(text).replace(/[&<>"']/g, (letter) => `&#${letter.charCodeAt(0)};`);
}
