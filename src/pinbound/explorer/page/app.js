// The page: one state, which is drawn once for each frame.

const element = (id) => document.getElementById(id);
const SETTLED = 140; // ms after the last change in which limits that take long are found
const QUICK = 5; // ms: limits that take less are found while dragging

class State {
  constructor(data) {
    this.data = data;
    this.robot = new Robot(data);
    this.reach = new Reach(this.robot);
    this.q = Float64Array.from(data.at);
    this.chosen = null;
    this.frames = 0;
    this.spent = 0;
    this.limitsTake = this.reach.steps ? Infinity : 0;
    this.dark = window.matchMedia("(prefers-color-scheme: dark)");
    this.theme = null;
  }

  isDark() {
    return this.theme ? this.theme === "dark" : this.dark.matches;
  }

  get boundary() {
    return this.robot.clearances.find(({ name }) => name === this.chosen) ?? null;
  }

  get isFree() {
    return !this.touching.length && !this.broken.length;
  }

  start() {
    this.look();
    this.plane = new Plane(this, element("plane"));
    this.scene = new Scene(this, element("scene"));
    this.panels = new Panels(this);
    this.player = this.data.motion ? new Player(this) : null;
    this.dark.addEventListener("change", () => this.paint());
    this.paint();
  }

  // Updates clearances, limits and open loops for the present q.
  look() {
    this.signed = this.robot.evaluate(this.q);
    this.touching = this.robot.clearances.filter((_, k) => !(this.signed[k] > 0));
    this.broken = this.robot.broken(this.q);
    this.open = this.robot.open(this.q);
  }

  set(column, value) {
    const [low, high] = this.data.coordinates[column].window;
    this.q[column] = Math.min(Math.max(value, low), high);
    this.moved = performance.now();
    this.changed();
  }

  setAll(q) {
    this.q.set(q);
    this.moved = performance.now();
    this.changed();
  }

  choose(name) {
    this.chosen = name;
    this.plane.draw();
    this.panels.detail();
    this.scene.dirty = true;
    this.changed();
  }

  paint() {
    document.documentElement.dataset.theme = this.isDark() ? "dark" : "light";
    this.plane.draw();
    this.panels.swatches();
    this.scene.dirty = true;
    this.changed();
  }

  changed() {
    if (this.waits) return;
    this.waits = true;
    requestAnimationFrame((now) => {
      this.waits = false;
      this.frame();
      if (this.scene.isMoving) requestAnimationFrame((next) => this.scene.pace(next - now, this.took));
    });
  }

  frame() {
    const start = performance.now();
    if (this.moved !== this.drawn || !this.panels.hasLimits) {
      if (this.moved !== this.drawn) this.look();
      this.panels.values();
      const late = start - (this.moved ?? -Infinity) > SETTLED;
      if (this.limitsTake < QUICK || late) {
        const before = performance.now();
        this.panels.limits();
        this.limitsTake = performance.now() - before;
      } else {
        this.panels.waiting();
        clearTimeout(this.timer);
        this.timer = setTimeout(() => this.changed(), SETTLED + 10);
      }
      if (this.moved !== this.drawn) this.scene.moving();
      this.drawn = this.moved;
      this.scene.dirty = true;
    }
    this.plane.update();
    if (this.scene.dirty) this.scene.draw();
    this.panels.said();
    this.frames++;
    this.took = performance.now() - start;
    this.spent += this.took;
    if (this.plane.isSampling) this.changed();
  }
}

class Panels {
  constructor(state) {
    this.state = state;
    this.hasLimits = false;
    const { data } = state;
    element("joints").style.setProperty("--name", `${1 + Math.max(3, ...data.coordinates.map(({ name }) => name.length))}ch`);
    this.rows = data.coordinates.map((one, k) => this.row(one, k));
    element("choice").innerHTML =
      '<option value="">none</option>' + data.boundaries.map(({ name }) => `<option value="${escape(name)}">${escape(name)}</option>`).join("");
    element("choice").addEventListener("change", (event) => state.choose(event.target.value || null));
    element("go-home").addEventListener("click", () => state.setAll(data.home));
    element("theme").addEventListener("click", () => {
      state.theme = state.isDark() ? "light" : "dark";
      state.paint();
    });
    element("watched").textContent = `Coverage: ${data.coverage.summary}.${data.coverage.is_complete ? "" : " What is not watched may touch where this page says free."}`;
    this.nearest = [0, 1, 2, 3].map(() => {
      const item = document.createElement("li");
      element("nearest").append(item);
      const button = this.button(item, "", () => state.choose(button.dataset.name));
      return button;
    });
    const missing = data.missing.join(". ");
    if (missing) element("missing").textContent = `${missing}.`;
    this.planeBar();
    this.sceneBar();
    this.statements();
    this.edges();
    this.detail();
  }

  row({ name, unit, window: [low, high] }, k) {
    const { state } = this;
    const row = document.createElement("div");
    row.className = "joint";
    const factor = FACTORS[unit];
    const id = `joint-${k}`;
    row.innerHTML = `<label for="${id}">${escape(name)}</label>
      <div class="track"><span class="band"></span><input id="${id}" type="range" min="${low * factor}" max="${high * factor}" step="0.01"></div>
      <div class="number"><input type="number" step="1" aria-label="${escape(name)} in ${UNITS[unit]}"><span>${UNITS[unit]}</span></div>
      <div class="ends"></div>`;
    element("joints").append(row);
    const [range, number] = row.querySelectorAll("input");
    range.addEventListener("input", () => state.set(k, range.valueAsNumber / factor));
    number.addEventListener("change", () => Number.isFinite(number.valueAsNumber) && state.set(k, number.valueAsNumber / factor));
    return { range, number, band: row.querySelector(".band"), ends: row.querySelector(".ends"), factor, unit, low, high };
  }

  values() {
    const { state } = this;
    this.rows.forEach(({ range, number, factor }, k) => {
      range.value = state.q[k] * factor;
      if (document.activeElement !== number) number.value = (state.q[k] * factor).toFixed(3);
    });
    const verdict = element("verdict");
    let text;
    if (state.open.length) {
      text = `▲ Not free: loop ${state.open.join(", ")} cannot be closed here, so no robot has these values. The picture shows its pin open`;
    } else if (state.isFree) {
      const least = state.signed.length ? state.signed.indexOf(Math.min(...state.signed)) : -1;
      text = least < 0 ? "● Free: no boundary is marked, and limits are kept" : `● Free: smallest clearance ${millimetres(state.signed[least])}, ${state.data.boundaries[least].name}`;
    } else {
      const names = [...state.touching.map(({ name }) => name), ...state.broken.map((name) => `limit of ${name}`)];
      text = `▲ Not free: ${names.slice(0, 4).join(", ")}${names.length > 4 ? ` and ${names.length - 4} more` : ""}`;
    }
    if (verdict.textContent !== text) verdict.textContent = text;
    verdict.className = state.isFree ? "good" : "bad";
    const order = [...state.signed.keys()].sort((a, b) => state.signed[a] - state.signed[b]);
    this.nearest.forEach((button, k) => {
      const one = state.open.length ? undefined : order[k];
      button.parentElement.hidden = one === undefined;
      if (one === undefined) return;
      button.dataset.name = state.data.boundaries[one].name;
      button.textContent = `${button.dataset.name}: ${millimetres(state.signed[one])}`;
    });
    this.numbers();
  }

  waiting() {
    this.hasLimits = false;
    for (const { ends, band } of this.rows) {
      if (!ends.classList.contains("waits")) ends.textContent = "limits are found when the robot stands still ...";
      ends.classList.add("waits");
      band.style.opacity = 0.35;
    }
  }

  limits() {
    const { state } = this;
    this.hasLimits = true;
    const hows = new Set();
    this.found = this.rows.map((row, k) => {
      const { band, ends, unit, low, high } = row;
      ends.classList.remove("waits");
      if (!state.isFree) {
        band.style.opacity = 0;
        ends.textContent = state.open.length ? "no limits: a loop cannot be closed here" : "no limits: this configuration is not free";
        return null;
      }
      const found = state.reach.of(Float64Array.from(state.q), k, state.signed);
      const [from, to] = [Math.max(found.lower.value, low), Math.min(found.upper.value, high)];
      band.style.opacity = 1;
      band.style.left = `${(100 * (from - low)) / (high - low)}%`;
      band.style.width = `${(100 * Math.max(to - from, 0)) / (high - low)}%`;
      const say = ({ value, name, how }) => {
        if (how !== "exact") hows.add(how);
        return `<b>${amount(value, unit)}</b>${name ? ` (${escape(name)}${how === "exact" || how === "closed form" ? "" : `, ${how}`})` : ""}`;
      };
      ends.innerHTML = `from ${say(found.lower)} to ${say(found.upper)}`;
      return found;
    });
    const words = {
      "closed form": "Contacts are closed forms of the reduced paths.",
      stepped: `Stepped: by clearance over a proven bound of its speed, so that no contact is stepped over; the end is at most ${1e9 * NEAR} nm of clearance away from contact${state.robot.loops ? `, or ${NEAR} rad or m from a limit of a passive joint` : ""}.`,
      "at least": "At least: the coordinate can go this far; further was not looked.",
      sampled: `Sampled: ${SAMPLES} values; a contact between two of them can be missed.`,
    };
    element("joints-said").textContent = `How far each can move, the others standing still. ${[...hows].map((how) => words[how]).join(" ")}`;
  }

  planeBar() {
    const { state } = this;
    const { coordinates } = state.data;
    const bar = element("plane-bar");
    if (coordinates.length < 2) {
      element("plane-card").hidden = true;
      return;
    }
    const options = coordinates.map(({ name }, k) => `<option value="${k}">${escape(name)}</option>`).join("");
    bar.innerHTML = `<label for="across">across</label><select id="across">${options}</select><label for="upward">up</label><select id="upward">${options}</select>
      <button id="wide" type="button" aria-pressed="false">All limits</button><button id="back" type="button">Back to the computed values</button>`;
    const selects = [element("across"), element("upward")];
    const show = () => selects.forEach((select, k) => (select.value = state.plane.columns[k]));
    show();
    selects.forEach((select, k) =>
      select.addEventListener("change", () => {
        const columns = [...state.plane.columns];
        const value = Number(select.value);
        if (columns[1 - k] === value) columns[1 - k] = columns[k];
        columns[k] = value;
        state.plane.choose(columns);
        show();
        this.edges();
      }),
    );
    element("wide").addEventListener("click", () => {
      state.plane.wide = !state.plane.wide;
      element("wide").setAttribute("aria-pressed", state.plane.wide);
      state.plane.resize();
    });
    element("back").addEventListener("click", () => {
      const { region } = state.plane;
      for (const k of region.fixed) state.q[k] = region.at[k];
      state.setAll(Float64Array.from(state.q));
    });
  }

  sceneBar() {
    const { state } = this;
    const { scene } = state;
    const views = { Start: {}, Front: { turn: 0, tilt: 0 }, Side: { turn: -Math.PI / 2, tilt: 0 }, Top: { turn: -Math.PI / 2, tilt: 1.55 } };
    for (const [name, view] of Object.entries(views)) {
      this.button(element("scene-bar"), name, () => {
        scene.reset(view);
        state.changed();
      });
    }
    for (const what of ["bodies", "marks"]) {
      const button = this.button(element("scene-bar"), what[0].toUpperCase() + what.slice(1), () => {
        scene.shows[what] = !scene.shows[what];
        button.setAttribute("aria-pressed", scene.shows[what]);
        scene.dirty = true;
        state.changed();
      });
      button.setAttribute("aria-pressed", scene.shows[what]);
    }
  }

  button(parent, text, act) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.addEventListener("click", act);
    parent.append(button);
    return button;
  }

  edges() {
    const { state } = this;
    const { region } = state.plane;
    const names = region ? [...new Set(region.loops.flat().map(({ name }) => name))] : [];
    element("edges").innerHTML = names
      .map((name) => `<li><button type="button" data-name="${escape(name)}"><span class="swatch"></span>${escape(name)}</button></li>`)
      .join("");
    for (const button of element("edges").querySelectorAll("button")) button.addEventListener("click", () => state.choose(button.dataset.name));
    this.swatches();
  }

  swatches() {
    for (const button of element("edges").querySelectorAll("button")) {
      button.querySelector(".swatch").style.background = colour(this.state, button.dataset.name);
      button.setAttribute("aria-pressed", button.dataset.name === this.state.chosen);
    }
  }

  // The chosen boundary or limit: marks, formula, contact, and its present value.
  detail() {
    const { state } = this;
    this.swatches();
    const { boundary, chosen } = state;
    element("choice").value = boundary ? chosen : "";
    const box = element("detail");
    if (!chosen) {
      box.innerHTML = '<p>Click an edge of the region, or choose a boundary, and its two marks light up in the robot.</p>';
      return;
    }
    if (!boundary) {
      const limit = state.data.limits.linear.find(({ joint }) => `${joint} lower` === chosen || `${joint} upper` === chosen);
      const unit = this.unitOf(limit?.joint);
      const loop = state.robot.loops?.toggles.get(limit?.joint ?? chosen);
      const what = loop
        ? limit?.joint.endsWith(" turn")
          ? `is the cut of loop ${escape(loop)}: beyond it a passive joint is counted in another turn.`
          : `is where loop ${escape(loop)} toggles: its two assemblies meet there, and beyond it the loop cannot be closed.`
        : `is a joint limit or a rule, no contact${limit && this.solved[limit.joint] ? `: ${escape(limit.joint)} = ${escape(this.solved[limit.joint])} is passive` : ""}.`;
      box.innerHTML = `<p><b>${escape(chosen)}</b> ${what}</p>${
        limit && !loop ? `<table><tr><th>limits</th><td>${amount(limit.lower ?? -Infinity, unit)} to ${amount(limit.upper ?? Infinity, unit)}</td></tr></table>` : ""
      }`;
      return;
    }
    const one = boundary.record;
    const row = (head, text) => `<tr><th>${head}</th><td>${text}</td></tr>`;
    const contact = (one.contacts ?? []).map(({ text, angle, half_width: half, smallest }) => {
      if (half === null) return `never: the distance is at least ${millimetres(smallest)}`;
      return `${escape(text)} = ${amount(angle, "rad", 6)}${half ? ` ± ${amount(half, "rad", 6)}` : ""}, every turn`;
    });
    const solved = Object.entries(one.solved ?? {}).map(([name, text]) => `${escape(name)} = ${escape(text)}`);
    const formula = one.formula.map((line) => `<div class="formula">${line}</div>`).join("");
    box.innerHTML = `<table>
      ${row("marks", `${escape(one.marks[0])} on ${escape(one.links[0])}; ${escape(one.marks[1])} on ${escape(one.links[1])}`)}
      ${row("kind", `${escape(one.kind)}; depends on ${escape(one.coordinates.join(", ") || "nothing")}`)}
      ${row("contact", one.contacts ? contact.join("; ") : "a curve in several angles")}
      ${row("contact at", one.stop ? `alignment of two arms (a stop): limits ${one.stop.gap.map((end) => amount(end, "rad", 6)).join(" to ")}` : `${one.is_height ? "height" : "distance"} ${millimetres(one.distance)}`)}
      ${solved.length ? row("passive", `${solved.join("; ")}, solved from the loop`) : ""}
      ${row("now", '<span id="now"></span>')}
      ${row("slope", '<span id="slope"></span>')}
    </table>${formula ? `<h3>Vector between the marks [mm]</h3>${formula}` : '<p class="soft">No formula is on the page: it is long, its nearest points are searched for, or boundaries are many; <code>pinbound derive</code> prints it.</p>'}`;
    this.numbers();
  }

  unitOf(joint) {
    const { coordinates, loops } = this.state.data;
    return coordinates.find(({ name }) => name === joint)?.unit ?? loops?.units[joint] ?? "rad";
  }

  get solved() {
    return this.state.data.loops?.solved ?? {};
  }

  numbers() {
    const { boundary } = this.state;
    if (!boundary || !element("now")) return;
    if (this.state.open.length) {
      for (const id of ["now", "slope"]) element(id).textContent = "none: a loop cannot be closed here";
      return;
    }
    const { value, gradient } = boundary.gradient(this.state.q);
    element("now").textContent = `signed clearance ${millimetres(value, 6)} (${value > 0 ? "free" : "contact"})`;
    const slopes = gradient
      ? [...gradient].map((slope, k) => {
          const { name, unit } = this.state.data.coordinates[k];
          return slope ? `${name}: ${unit === "rad" ? `${((1000 * slope) / FACTORS.rad).toFixed(4)} mm/deg` : `${slope.toFixed(4)} mm/mm`}` : "";
        })
      : ["none: a distance of zero has a kink"];
    element("slope").textContent = slopes.filter(Boolean).join("; ");
  }

  said() {
    const { plane } = this.state;
    if (!plane.width) return;
    const text = plane.said();
    if (element("plane-said").textContent !== text) element("plane-said").textContent = text;
    const title = `Region of (${plane.columns.map((k) => this.state.data.coordinates[k].name).join(", ")})`;
    if (element("plane-title").textContent !== title) element("plane-title").textContent = title;
    element("plane").setAttribute("aria-label", title);
    if (element("back")) element("back").hidden = !plane.moved.length;
  }

  statements() {
    const { data } = this.state;
    const list = (items) => (items.length ? `<ul>${items.map((item) => `<li>${escape(item)}</li>`).join("")}</ul>` : "");
    const open = data.coverage.open.map(({ links, status, reason }) => `${links.join(" - ")}: ${status}; ${reason}`);
    const hows = [
      "Clearances, slopes, contacts and places of links are evaluated here from the same reduced paths as in Python, in double precision: they equal Python's to a billionth of a millimetre (1e-12 m).",
      "Regions with named edges were computed in Python. Straight edges are exact; curved ones say how exact they are. They hold for the values of the other coordinates that are stated, and are dotted elsewhere.",
      "A sampled region is a picture: each cell is asked at its middle. It proves nothing between the middles, nor that parts are connected.",
      "Free means that every marked pair is apart and every limit kept. It does not mean that the robot can get there from home, but for stops, which know on which side home is.",
      "Positions in the picture are rounded for drawing; numbers are not.",
    ];
    if (data.loops) {
      const solved = Object.entries(this.solved).map(([name, text]) => `${name} = ${text}`);
      hows.push(
        `Passive joints of loops that are not parallelograms are solved here in closed form, in the assembly of home, as in Python: ${solved.join(", ")}. Sliders move the other joints.`,
        "Where a loop cannot be closed, the page says so and has no numbers: no robot is there. Limits through loops are stepped by proven bounds of the loop's speed; where no bound is known they are sampled, and called so.",
      );
    }
    element("said").innerHTML = `<h3>How</h3>${list(hows)}
      <h3>What is watched</h3><p>${escape(data.coverage.summary)}.</p>
      ${open.length ? `<details><summary>${open.length} pairs of links are not watched, or in part</summary>${list(open)}</details>` : ""}
      ${data.assumptions.length ? `<details><summary>${data.assumptions.length} assumptions about this robot</summary>${list(data.assumptions)}</details>` : ""}
      ${data.notes.length ? `<details><summary>${data.notes.length} notes from reading it</summary>${list(data.notes)}</details>` : ""}`;
  }
}

class Player {
  constructor(state) {
    this.state = state;
    this.motion = state.data.motion;
    element("motion-card").hidden = false;
    const { motion } = this;
    const good = motion.verdict === "certified";
    const at = (time) => (motion.is_timed ? `time ${round(time)}` : `waypoint ${round(time)}`);
    const first = motion.first_contact;
    const words = good
      ? `proven clear at every moment; the smallest clearance is at least ${motion.lower === null ? "none" : `${(Math.floor(1e6 * motion.lower) / 1000).toFixed(3)} mm`}${motion.tightest ? `, ${motion.tightest.name} near ${at(motion.tightest.time)}` : ""}.`
      : first
        ? `${first.name} is violated at ${at(first.after)}, and nothing before ${at(first.before)}.`
        : `${motion.open.length} parts are open: ${motion.open.slice(0, 3).map(({ name, start, end }) => `${name} from ${at(start)} to ${at(end)}`).join("; ")}.`;
    element("motion-verdict").innerHTML = `<span class="badge ${good ? "good" : "bad"}">${escape(motion.verdict)}</span> ${escape(motion.name)}: ${escape(words)}`;
    element("motion-said").textContent = `The verdict is a certificate made in Python over the whole motion (${motion.coverage}). The curve below the clock samples the smallest clearance and proves nothing. ${motion.notes.join(". ")}`;
    element("play").addEventListener("click", () => this.toggle());
    element("clock").addEventListener("input", (event) => this.show(event.target.valueAsNumber));
    this.share = 0;
    const [start, end] = [motion.times[0], motion.times[motion.times.length - 1]];
    this.span = [start, end - start];
    this.lasts = motion.is_timed ? Math.min(Math.max(end - start, 2), 30) : Math.min(Math.max(motion.times.length - 1, 3), 12);
    this.trace();
    new ResizeObserver(() => this.trace()).observe(element("trace"));
    element("clock-said").textContent = at(start);
    this.at = at;
  }

  q(share) {
    const { times, waypoints } = this.motion;
    const time = this.span[0] + share * this.span[1];
    let k = times.findIndex((one) => one >= time);
    if (k < 0) k = times.length - 1;
    if (k === 0) return waypoints[0];
    const u = (time - times[k - 1]) / (times[k] - times[k - 1] || 1);
    return waypoints[k].map((value, j) => (1 - u) * waypoints[k - 1][j] + u * value);
  }

  show(share) {
    this.share = share;
    element("clock").value = share;
    element("clock-said").textContent = this.at(this.span[0] + share * this.span[1]);
    this.state.setAll(this.q(share));
    this.now();
  }

  toggle() {
    this.runs = !this.runs;
    element("play").textContent = this.runs ? "Pause" : "Play";
    if (!this.runs) return;
    if (this.share >= 1) this.share = 0;
    let before = performance.now();
    const tick = (now) => {
      if (!this.runs) return;
      this.show(Math.min(this.share + Math.max(now - before, 0) / (1000 * this.lasts), 1));
      before = now;
      if (this.share >= 1) this.toggle();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  trace() {
    const svg = element("trace");
    const { width, height } = svg.getBoundingClientRect();
    if (!width) return;
    if (!this.least) {
      const count = 240;
      this.least = Array.from({ length: count + 1 }, (_, k) => {
        const q = this.q(k / count);
        const least = Math.min(...this.state.robot.evaluate(q));
        return this.state.robot.open(q).length ? Math.min(least, 0) : least; // where a loop cannot be closed nothing is free
      });
      this.state.look();
    }
    const [low, high] = [Math.min(0, ...this.least), Math.max(0, ...this.least)];
    this.box = { left: 52, width: width - 60, height };
    const y = (value) => 8 + ((high - value) / (high - low || 1)) * (height - 24);
    const points = this.least.map((value, k) => `${this.box.left + (k / (this.least.length - 1)) * this.box.width},${y(value)}`);
    svg.setAttribute("aria-label", `Smallest clearance over the motion, sampled: from ${millimetres(Math.min(...this.least))} to ${millimetres(Math.max(...this.least))}`);
    svg.innerHTML = `<line class="zero" x1="${this.box.left}" x2="${width - 8}" y1="${y(0)}" y2="${y(0)}"/><path class="curve" d="M${points.join(" L")}"/>
      <text class="tick" x="${this.box.left - 5}" y="${y(high) + 8}" text-anchor="end">${(1000 * high).toPrecision(3)}</text>
      <text class="tick" x="${this.box.left - 5}" y="${y(0) + 4}" text-anchor="end">0 mm</text><line class="now" y1="2" y2="${height - 12}"/>`;
    this.now();
  }

  now() {
    const line = element("trace").querySelector(".now");
    const x = this.box ? this.box.left + this.share * this.box.width : 0;
    for (const end of ["x1", "x2"]) line?.setAttribute(end, x);
  }
}

function millimetres(value, digits = 3) {
  return Number.isFinite(value) ? `${(1000 * value).toFixed(digits)} mm` : "none";
}

function round(value) {
  return Number(value.toPrecision(6));
}

window.pinbound = new State(JSON.parse(element("data").textContent));
window.pinbound.start();
