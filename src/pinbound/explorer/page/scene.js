// The robot in three dimensions: bodies, marks, and the chosen pair on top. A pen draws them: by WebGL, or on the CPU.

const COARSE = [1, 0.75, 0.5, 0.35]; // share of the full resolution while something moves, finest first
const LATE = 18; // ms: a frame that takes longer lowers the resolution by one step
const EARLY = 12; // ms of drawing, below which a finer step is tried again
const PATIENCE = 20; // frames in time before a finer step is tried; twice as many after each step that came too early

class Scene {
  constructor(state, element) {
    this.state = state;
    this.element = element;
    this.canvas = element.querySelector("canvas");
    this.labels = element.querySelector("#labels");
    this.shows = { bodies: true, marks: state.data.marks.length <= 60 };
    this.fingers = new Map();
    this.measure();
    this.isMoving = false;
    [this.step, this.late, this.inTime, this.patience] = [0, 0, 0, PATIENCE];
    this.prepare();
    new ResizeObserver(() => this.resize()).observe(element);
    element.addEventListener("pointerdown", (event) => this.press(event));
    element.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, (event) => this.fingers.delete(event.pointerId));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * event.deltaY));
    }, { passive: false });
    element.addEventListener("keydown", (event) => this.key(event));
  }

  // Measures the robot at the start: centre and size for the view, and the side that shows most of the robot.
  measure() {
    const { data, robot } = this.state;
    const places = robot.places(data.at);
    const points = places.map((m) => [m[12], m[13], m[14]]);
    const link = Object.fromEntries(data.links.map(({ name }, k) => [name, k]));
    const anchors = [];
    const put = (name, p, list) => list.push(through(places[link[name]], p));
    for (const body of data.bodies) {
      const half = body.size.length ? 0.5 * Math.max(...body.size) : 0;
      const ends = body.vertices ? boundsOf(decoded(body.vertices, Float32Array)) : [0, 1, 2].flatMap((i) => [-half, half].map((part) => body.translation.map((t, k) => t + part * body.rotation[k][i])));
      for (const p of ends) put(body.link, p, points);
    }
    for (const mark of data.marks) for (const p of mark.vertices) put(mark.link, p, mark.kind === "plane" ? [] : (put(mark.link, p, points), anchors));
    const [low, high] = bounds(points);
    this.centre = low.map((part, k) => 0.5 * (part + high[k]));
    this.size = Math.max(0.5 * norm3(minus(high, low)), 1e-3);
    const [a, b] = bounds(anchors.length > 3 ? anchors : points);
    const spread = minus(b, a);
    const isFlat = spread[1] <= spread[0] ? -Math.PI / 2 : 0;
    this.start = { turn: isFlat + 0.35, tilt: 0.2, far: 1, pan: [0, 0] };
    this.points = points;
    this.floor = low[2];
    this.reset();
  }

  // Sets the view to one that the robot at the start fills.
  reset(view = {}) {
    this.view = { ...this.start, pan: [0, 0], ...view };
    this.isFitted = !this.width;
    if (this.width) this.settle();
    this.dirty = true;
  }

  prepare() {
    const { state } = this;
    this.pen = GlPen.of(this.canvas) ?? new SoftPen(this.canvas);
    const link = Object.fromEntries(state.data.links.map(({ name }, k) => [name, k]));
    const dot = 0.011 * this.size;
    this.bodies = this.pen.upload(state.data.bodies.map((body) => [bodySolid(body), link[body.link], body]));
    this.marks = this.pen.upload(state.data.marks.map((mark) => [markSolid(mark, dot), link[mark.link], mark]));
  }

  settle() {
    this.isFitted = true;
    for (let turn = 0; turn < 4; turn++) this.fit();
  }

  fit() {
    const m = this.matrix();
    const seen = this.points.map((p) => {
      const w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
      return [0, 1].map((i) => (m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]) / w);
    });
    const ends = [0, 1].map((i) => [Math.min(...seen.map((p) => p[i])), Math.max(...seen.map((p) => p[i]))]);
    const open = 0.26 * this.view.far * 1.08;
    const across = this.width / this.height;
    const unit = open / (0.26 * Math.min(1, across));
    this.view.pan[0] += 0.5 * (ends[0][0] + ends[0][1]) * unit * 0.26 * across;
    this.view.pan[1] += 0.5 * (ends[1][0] + ends[1][1]) * unit * 0.26;
    const half = Math.max(...ends.map(([low, high]) => 0.5 * (high - low)), 1e-3);
    this.view.far = Math.min(Math.max(this.view.far * (half / 0.86), 0.05), 6);
  }

  resize() {
    const box = this.element.getBoundingClientRect();
    [this.width, this.height] = [box.width, box.height];
    if (this.width && (!this.isFitted || !this.isSized)) this.settle();
    this.isSized = this.width > 0;
    this.dirty = true;
    this.state.changed();
  }

  // Pixels of the canvas for one pixel of the page: fewer during a motion with late frames, all at rest.
  get ratio() {
    const { still, moving } = this.pen.ratios(window.devicePixelRatio || 1);
    return this.isMoving ? moving * COARSE[this.step] : still;
  }

  // Called after each frame of a motion: `gap` is the time to the next frame [ms], `spent` the page's own share of it
  // [ms].
  pace(gap, spent) {
    if (gap > LATE) {
      this.inTime = 0;
      if (++this.late < 3 || this.step === COARSE.length - 1) return;
      [this.step, this.late, this.patience] = [this.step + 1, 0, 2 * this.patience];
    } else {
      this.late = 0;
      if (spent > EARLY || ++this.inTime < this.patience) return;
      [this.step, this.inTime] = [Math.max(this.step - 1, 0), 0];
    }
  }

  // Called during a motion: the page draws fast, and once at full resolution after the motion has stopped.
  moving() {
    this.isMoving = true;
    this.dirty = true;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      this.isMoving = false;
      this.dirty = true;
      this.state.changed();
    }, SETTLED);
  }

  // The matrix from the root's frame to the screen.
  matrix() {
    const { turn, tilt, far, pan } = this.view;
    const back = [Math.cos(tilt) * Math.cos(turn), Math.cos(tilt) * Math.sin(turn), Math.sin(tilt)];
    const right = [-Math.sin(turn), Math.cos(turn), 0];
    const up = cross3(back, right);
    const [aspect, open] = [this.width / this.height, 0.26]; // tangent of half the angle of view
    const distance = (far * this.size * 1.08) / (open * Math.min(1, aspect));
    const rows = [right, up, back].map((axis, k) => [...axis, -dot3(axis, this.centre) - (k < 2 ? pan[k] * this.size : distance)]);
    const [near, beyond] = [Math.max(0.02 * distance, distance - 6 * this.size), distance + 8 * this.size];
    const [a, b] = [(beyond + near) / (beyond - near), (2 * beyond * near) / (beyond - near)];
    const x = rows[0].map((part) => part / (open * aspect));
    const y = rows[1].map((part) => part / open);
    const z = rows[2].map((part, k) => -a * part - (k === 3 ? b : 0));
    const w = rows[2].map((part) => -part);
    this.light = unit3([back[0] + 0.5 * right[0] + 0.4 * up[0], back[1] + 0.5 * right[1] + 0.4 * up[1], back[2] + 0.5 * right[2] + 0.4 * up[2]]);
    return [0, 1, 2, 3].flatMap((k) => [x[k], y[k], z[k], w[k]]);
  }

  draw() {
    const { pen, state } = this;
    this.dirty = false;
    if (!this.width) return;
    const places = state.robot.places(state.q);
    const view = this.matrix();
    const dark = state.isDark();
    if (this.paperIsDark !== dark) { // to ask for a style lets the browser work out all of them: not in every frame
      this.paper = parseColour(getComputedStyle(document.documentElement).getPropertyValue("--card"));
      this.paperIsDark = dark;
    }
    pen.begin([this.width, this.height], this.ratio, view, this.light, this.paper);
    const chosen = state.boundary;
    const touched = new Set(state.touching.flatMap((one) => one.record.links));
    pen.strokes(this.ground(), dark ? [0.24, 0.3, 0.36, 1] : [0.84, 0.87, 0.9, 1]);
    if (this.shows.bodies) {
      pen.solids(this.bodies, places, ({ record }) => {
        if (touched.has(record.link)) return dark ? [0.86, 0.5, 0.33, 1] : [0.9, 0.6, 0.42, 1];
        return dark ? [0.55, 0.62, 0.69, 1] : [0.7, 0.75, 0.8, 1];
      });
    }
    pen.strokes(this.skeleton(places), dark ? [0.75, 0.8, 0.85, 1] : [0.25, 0.31, 0.37, 1]);
    const pair = chosen ? chosen.record.marks : [];
    if (this.shows.marks) {
      const names = new Set(pair);
      for (const isSolid of [true, false]) {
        pen.depth({ isBehind: true, isKept: isSolid }); // a mark that lies in the faces of its body stays behind them
        pen.solids(this.marks, places, ({ record }) => {
          const shade = names.has(record.name) ? null : markColour(record, dark, this.shows.bodies);
          return shade && (shade[3] === 1) === isSolid ? shade : null;
        });
      }
      pen.depth({});
    }
    this.labels.textContent = "";
    if (chosen) {
      const [r, g, b] = parseColour(colour(state, chosen.name)).map((part) => part / 255);
      for (const alpha of [1, 0.4]) {
        if (alpha < 1) pen.depth({ isAsked: false });
        pen.solids(this.marks, places, ({ record }) => (pair.includes(record.name) ? [r, g, b, alpha] : null));
      }
      const ends = nearestMarks(state, places, pair);
      if (ends) pen.strokes(ends.flat(), [r, g, b, 1]);
      pen.depth({});
      this.name(view, places, pair);
    }
    pen.end();
  }

  ground() {
    const step = niceStep(this.size / 3);
    const [x0, y0] = [0, 1].map((k) => Math.round(this.centre[k] / step) * step);
    const points = [];
    for (let k = -5; k <= 5; k++) {
      points.push(x0 + k * step, y0 - 5 * step, this.floor, x0 + k * step, y0 + 5 * step, this.floor);
      points.push(x0 - 5 * step, y0 + k * step, this.floor, x0 + 5 * step, y0 + k * step, this.floor);
    }
    return points;
  }

  skeleton(places) {
    const { links } = this.state.data;
    this.parents ??= links.map(({ parent }) => links.findIndex(({ name }) => name === parent));
    const joints = links.flatMap((_, k) => (this.parents[k] < 0 ? [] : [...places[this.parents[k]].slice(12, 15), ...places[k].slice(12, 15)]));
    this.pins ??= (this.state.data.loops?.pins ?? []).map(({ link, xyz }) => [links.findIndex(({ name }) => name === link), xyz]);
    return [...joints, ...this.pins.flatMap(([k, xyz]) => [...places[k].slice(12, 15), ...through(places[k], xyz)])];
  }

  // Writes the names of the chosen marks beside them.
  name(view, places, pair) {
    const { data } = this.state;
    const seen = pair.map((name) => {
      const mark = data.marks.find((one) => one.name === name);
      const m = places[data.links.findIndex((one) => one.name === mark.link)];
      const p = through(m, [0, 1, 2].map((i) => mark.vertices.reduce((sum, v) => sum + v[i], 0) / mark.vertices.length));
      const w = view[3] * p[0] + view[7] * p[1] + view[11] * p[2] + view[15];
      const [x, y] = [0, 1].map((i) => (view[i] * p[0] + view[4 + i] * p[1] + view[8 + i] * p[2] + view[12 + i]) / w);
      return { name, x: 0.5 * (x + 1) * this.width, y: 0.5 * (1 - y) * this.height };
    });
    if (seen.length === 2 && Math.abs(seen[0].y - seen[1].y) < 22 && Math.abs(seen[0].x - seen[1].x) < 90) {
      const [upper, lower] = seen[0].y <= seen[1].y ? seen : [seen[1], seen[0]];
      const middle = 0.5 * (upper.y + lower.y);
      [upper.y, lower.y] = [middle - 12, middle + 12];
    }
    for (const { name, x, y } of seen) {
      const label = document.createElement("span");
      label.textContent = name;
      label.style.left = `${Math.min(Math.max(x, 0), this.width)}px`;
      label.className = x > 0.6 * this.width ? "left" : "";
      label.style.top = `${Math.min(Math.max(y, 10), this.height - 10)}px`;
      this.labels.append(label);
    }
  }

  press(event) {
    this.element.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    if (this.fingers.size === 2) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const [was, is] = [before, [event.clientX, event.clientY]].map(([x, y]) => Math.hypot(x - other[0], y - other[1]));
      this.zoom(was / Math.max(is, 1));
    }
    if (this.fingers.size === 2 || event.shiftKey) {
      const unit = (0.6 * this.view.far) / this.height;
      this.view.pan = [this.view.pan[0] - 2 * dx * unit, this.view.pan[1] + 2 * dy * unit];
    } else {
      this.view.turn -= 0.008 * dx;
      this.view.tilt = Math.min(Math.max(this.view.tilt + 0.008 * dy, -1.55), 1.55);
    }
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    this.moving();
    this.state.changed();
  }

  zoom(factor) {
    this.view.far = Math.min(Math.max(this.view.far * factor, 0.05), 6);
    this.moving();
    this.state.changed();
  }

  key(event) {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    const by = turns[event.key];
    if (by) {
      event.preventDefault();
      this.view.turn += by[0];
      this.view.tilt = Math.min(Math.max(this.view.tilt + by[1], -1.55), 1.55);
      this.zoom(1);
    } else if (event.key === "+" || event.key === "-") this.zoom(event.key === "+" ? 0.9 : 1.1);
  }
}

// Bodies would hide marks inside them: where bodies are drawn, marks with a size are more transparent.
function markColour(record, dark, overBodies) {
  const [r, g, b] = dark ? [0.93, 0.95, 0.97] : [0.11, 0.15, 0.19];
  const isBody = record.radius > 0 || record.kind === "hull" || record.kind === "plane";
  const alpha = !isBody ? 1 : overBodies ? 0.22 : 0.5;
  return [r, g, b, alpha];
}

// The two nearest points of the chosen marks' cores, in the root's frame; null for lines and planes.
function nearestMarks({ data }, places, names) {
  const marks = names.map((name) => data.marks.find((one) => one.name === name));
  if (marks.some(({ kind }) => kind === "line" || kind === "plane")) return null;
  const [A, B] = marks.map(({ vertices, link }) => {
    const m = places[data.links.findIndex((one) => one.name === link)];
    return vertices.map((p) => through(m, p));
  });
  const found = nearestOfHulls(Float64Array.from(A.flat()), Float64Array.from(B.flat().map((part) => -part)), 1);
  const sum = (points, key) => [0, 1, 2].map((i) => found.simplex.reduce((total, one) => total + one.weight * points[one[key]][i], 0));
  return [sum(A, "i"), sum(B, "j")];
}

function through(m, p) {
  return [0, 1, 2].map((i) => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]);
}

function bounds(points) {
  return [Math.min, Math.max].map((pick) => [0, 1, 2].map((k) => points.reduce((end, p) => pick(end, p[k]), points[0][k])));
}

function boundsOf(list) {
  const points = [];
  for (let k = 0; k < list.length; k += 3) points.push([list[k], list[k + 1], list[k + 2]]);
  return bounds(points);
}
