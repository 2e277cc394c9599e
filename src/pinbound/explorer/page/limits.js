// How far one coordinate can move from q while the others are fixed, and which boundary or limit ends its motion.
//
// Stops, points that one rotation moves, and prismatic joints have closed forms. Otherwise the coordinate moves in
// steps of clearance / speed. The speed is a proven bound of the rate of the clearance, so no step can pass over a
// contact.

const NEAR = 1e-8; // m: stepping ends at this clearance
const MOST_STEPS = 600;
const MOST_THROUGH = 12000; // steps through loops: one coordinate may have hundreds of parts
const SAMPLES = 400;

class Reach {
  constructor(robot) {
    this.robot = robot;
    this.steps = Boolean(robot.loops) || robot.clearances.some((one) => one.record.ways.some(({ way }) => way === "step"));
    this.through = robot.data.coordinates.map((_, j) => (robot.loops?.rates[j] ? throughLoops(robot, j) : null));
  }

  // The interval around q_j without contact of one boundary, in closed form; null if the interval has no ends, or if
  // there is no closed form.
  span(one, q, j) {
    const { way, rate } = one.record.ways[j];
    if (this.through[j]?.clearances.has(one)) return null;
    return CLOSED[way]?.(one, way === "stop" ? this.robot.program.full(q) : q, j, rate) ?? null;
  }

  // { lower: { value, name, how }, upper: ... }; null if q itself is in contact or outside the limits.
  of(q, j, signed) {
    const { data, clearances } = this.robot;
    const x = q[j];
    const ends = [
      { value: -Infinity, name: "", how: "exact" },
      { value: Infinity, name: "", how: "exact" },
    ];
    const tighten = (side, value, name, how) => {
      if (side ? value < ends[1].value : value > ends[0].value) ends[side] = { value, name, how };
    };
    const through = this.through[j];
    const z = Float64Array.from(this.robot.program.full(q));
    for (const limit of data.limits.linear) {
      if (through?.limits.has(limit)) continue;
      const [low, high] = linearSpan(limit, z, j);
      tighten(0, low, limit.joint, "exact");
      tighten(1, high, limit.joint, "exact");
    }
    for (const { name, limit, where } of data.limits.guarded) {
      if (through?.limits.has(limit)) continue;
      const forbidden = guardedSpan(limit, where, z, j);
      if (!forbidden) continue;
      if (forbidden[0] >= x) tighten(1, forbidden[0], name, "exact");
      else if (forbidden[1] <= x) tighten(0, forbidden[1], name, "exact");
    }
    const stepped = [];
    clearances.forEach((one, k) => {
      const { way, speed } = one.record.ways[j];
      if (through?.clearances.has(one)) return;
      if (way === "step") stepped.push([one, speed, speed ? signed[k] / speed : Infinity]);
      const span = this.span(one, q, j);
      if (!span) return;
      tighten(0, Math.min(span[0], x), one.name, "closed form");
      tighten(1, Math.max(span[1], x), one.name, "closed form");
    });
    stepped.sort((a, b) => a[2] - b[2]);
    const [from, to] = data.coordinates[j].window;
    for (const [one, speed] of stepped) {
      for (const side of [0, 1]) {
        const sign = side ? 1 : -1;
        const open = Number.isFinite(ends[side].value) ? ends[side].value : side ? to : from;
        const end = speed ? stepTo(one, q, j, speed, sign, open) : sampleTo(one, q, j, sign, open);
        if (end) tighten(side, end.value, one.name, end.how);
      }
    }
    const windows = data.coordinates.map((one) => one.window);
    const isInside = windows.every(([low, high], k) => low <= q[k] && q[k] <= high);
    for (const { name, value, rates, turn } of through?.followed ?? []) {
      const speeds = this.robot.loops.speeds(j, rates, q, windows);
      for (const side of [0, 1]) {
        const sign = side ? 1 : -1;
        const open = Number.isFinite(ends[side].value) ? ends[side].value : side ? to : from;
        const end =
          isInside && speeds.every(Number.isFinite)
            ? follow(value, q, j, { speeds, from, to }, sign, open)
            : sampleTo({ at: value, turn }, q, j, sign, open);
        if (end) tighten(side, end.value, name, end.how);
      }
    }
    return { lower: ends[0], upper: ends[1] };
  }
}

// The clearances, contacts of stops, and limits of passive joints that depend on a coordinate through loops. Each is a
// function of q that is positive where q is allowed. It has a bound of its rate in each part of the coordinate's
// window.
function throughLoops(robot, j) {
  const { loops, data, clearances, program } = robot;
  const passive = Array.from({ length: program.n }, (_, k) => k).filter((k) => k >= robot.n && loops.moves(j, k));
  const isMoved = (row) => passive.some((k) => row[k]);
  const found = { clearances: new Set(), limits: new Set(), followed: [] };
  const add = (name, value, speeds, turn) => found.followed.push({ name, value, rates: speeds, turn });
  const sizes = (rows) => Array.from({ length: program.n }, (_, k) => Math.max(...rows.map((row) => Math.abs(row[k]))));
  for (const one of clearances) {
    const { ways, stop, speeds } = one.record;
    if (!passive.some((k) => ways[k].way !== "none")) continue;
    found.clearances.add(one);
    if (stop) {
      const row = { coefficients: stop.coefficients, offset: 0, lower: stop.gap[0], upper: stop.gap[1] };
      add(one.name, (q) => room(row, program.full(q)), sizes([row.coefficients]));
    } else add(one.name, (q) => one.at(q), speeds);
  }
  for (const limit of data.limits.linear) {
    if (!isMoved(limit.coefficients)) continue;
    found.limits.add(limit);
    const [w, turn] = [2, 3].map((place) => loops.linkages.some(({ columns }) => limit.coefficients[columns[place]]));
    if (w && data.limits.linear.some((other) => other !== limit && other.joint === limit.joint)) continue; // where it toggles is known
    const value = (q) => room(limit, program.full(q));
    add(limit.joint, value, sizes([limit.coefficients]), turn ? (q) => dot(limit.coefficients, program.full(q)) : undefined);
  }
  for (const { name, limit, where } of data.limits.guarded) {
    if (![limit, ...where].some((part) => isMoved(part.coefficients))) continue;
    found.limits.add(limit);
    const value = (q) => {
      const z = program.full(q);
      return Math.max(room(limit, z), ...where.map((part) => -room(part, z)));
    };
    add(name, value, sizes([limit, ...where].map((part) => part.coefficients)));
  }
  return found;
}

// The distance of a sum of coordinates from its nearest limit; negative outside the limits.
function room(limit, z) {
  const value = dot(limit.coefficients, z) + limit.offset;
  return Math.min(limit.lower === null ? Infinity : value - limit.lower, limit.upper === null ? Infinity : limit.upper - value);
}

// Like stepTo, with one bound for each part of the window: a step continues through parts until the clearance is used
// up.
function follow(value, q, j, { speeds, from, to }, sign, end) {
  const x = q[j];
  const size = (to - from) / speeds.length;
  let at = x;
  let found = null;
  for (let step = 0; ; step++) {
    q[j] = at;
    let left = value(q);
    if (left <= NEAR || step === MOST_THROUGH) {
      found = { value: at, how: left <= NEAR ? "stepped" : "at least" };
      break;
    }
    let cell = Math.min(Math.max(Math.floor((at - from) / size), 0), speeds.length - 1);
    while (left > 0 && cell >= 0 && cell < speeds.length && sign * (at - end) < 0) {
      const border = from + (sign > 0 ? cell + 1 : cell) * size;
      const used = speeds[cell] * Math.max(sign * (border - at), 0);
      if (used >= left) at += (sign * left) / speeds[cell];
      else {
        at = sign > 0 ? Math.max(at, border) : Math.min(at, border);
        cell += sign;
      }
      left -= used;
    }
    if (sign * (at - end) >= 0 || (left > 0 && (cell < 0 || cell >= speeds.length))) break;
  }
  q[j] = x;
  return found;
}

function linearSpan({ coefficients, offset, lower, upper }, q, j) {
  const c = coefficients[j];
  if (!c) return [-Infinity, Infinity];
  let rest = offset;
  coefficients.forEach((one, k) => (rest += k === j ? 0 : one * q[k]));
  const ends = [lower === null ? -Infinity : (lower - rest) / c, upper === null ? Infinity : (upper - rest) / c];
  if (c > 0) return ends;
  return [upper === null ? -Infinity : ends[1], lower === null ? Infinity : ends[0]];
}

// The interval of the coordinate that a rule with conditions forbids, or null.
function guardedSpan(limit, where, q, j) {
  let [low, high] = [-Infinity, Infinity];
  for (const part of where) {
    if (!part.coefficients[j]) {
      if (!holds(part, q)) return null;
      continue;
    }
    const span = linearSpan(part, q, j);
    [low, high] = [Math.max(low, span[0]), Math.min(high, span[1])];
  }
  if (!limit.coefficients[j]) return holds(limit, q) || !(low <= high) ? null : [low, high];
  const kept = linearSpan(limit, q, j);
  if (Number.isFinite(kept[0])) high = Math.min(high, kept[0]);
  else low = Math.max(low, kept[1]);
  return low < high ? [low, high] : null;
}

const CLOSED = {
  stop({ record }, q, j) {
    const { coefficients, gap } = record.stop;
    return linearSpan({ coefficients, offset: 0, lower: gap[0], upper: gap[1] }, q, j);
  },

  // f = a + b cos(d) + s sin(d), d = rate (q_j - x); three values at distances of a third of a turn give a, b and s.
  // The boundary is free where f > target.
  turn(one, q, j, rate) {
    const x = q[j];
    const [f0, f1, f2] = [0, 1, 2].map((k) => measured(one, q, j, x + (k * 2 * Math.PI) / (3 * rate)));
    q[j] = x;
    const [a, b, s] = [(f0 + f1 + f2) / 3, (2 * f0 - f1 - f2) / 3, (f1 - f2) / Math.sqrt(3)];
    const [size, k] = [Math.hypot(b, s), target(one) - a];
    if (k <= -size) return null;
    const half = 2 * Math.atan2(Math.sqrt(Math.max(size - k, 0)), Math.sqrt(size + k)); // cos(half) = k / size
    const middle = Math.atan2(s, b);
    const ends = [(middle - half) / rate, (middle + half) / rate];
    return [x + Math.min(...ends), x + Math.max(...ends)];
  },

  // The squared distance is f = a + b y + c y^2, a height is f = a + b y; y = q_j - x.
  slide(one, q, j) {
    const x = q[j];
    const [f0, up, down] = [0, 1, -1].map((k) => measured(one, q, j, x + k));
    q[j] = x;
    const [b, c, f] = [(up - down) / 2, one.record.is_height ? 0 : (up + down) / 2 - f0, f0 - target(one)];
    let roots;
    if (c <= 1e-14 * Math.abs(f0)) roots = b ? [-f / b] : [];
    else {
      const room = b * b - 4 * c * f;
      if (room <= 0) return null;
      const t = -0.5 * (b + (b < 0 ? -1 : 1) * Math.sqrt(room));
      roots = t ? [t / c, f / t] : [0, 0];
    }
    const below = roots.filter((y) => y <= 0);
    const above = roots.filter((y) => y >= 0);
    return [below.length ? x + Math.max(...below) : -Infinity, above.length ? x + Math.min(...above) : Infinity];
  },
};

function measured(one, q, j, value) {
  q[j] = value;
  const separation = one.at(q) + one.record.distance;
  return one.record.is_height ? separation : separation * separation;
}

function target({ record }) {
  return record.is_height ? record.distance : record.distance ** 2;
}

function stepTo(one, q, j, speed, sign, end) {
  const x = q[j];
  let value = x;
  let found = null;
  for (let step = 0; ; step++) {
    q[j] = value;
    const clearance = one.at(q);
    if (clearance <= NEAR || step === MOST_STEPS) {
      found = { value, how: clearance <= NEAR ? "stepped" : "at least" };
      break;
    }
    value += (sign * clearance) / speed;
    if (sign * (value - end) >= 0) break;
  }
  q[j] = x;
  return found;
}

// The angle `turn`, if there is one, jumps by a whole turn at its cut; the motion ends there.
function sampleTo(one, q, j, sign, end) {
  const x = q[j];
  let found = null;
  let turn = one.turn?.(q);
  const isFree = () => {
    if (!(one.at(q) > 0)) return false;
    if (!one.turn) return true;
    const now = one.turn(q);
    if (Math.abs(now - turn) > Math.PI) return false;
    turn = now;
    return true;
  };
  for (let k = 1; k <= SAMPLES && !found; k++) {
    q[j] = x + ((end - x) * k) / SAMPLES;
    if (isFree()) continue;
    let [free, hit] = [x + ((end - x) * (k - 1)) / SAMPLES, q[j]];
    for (let half = 0; half < 60; half++) {
      q[j] = 0.5 * (free + hit);
      if (isFree()) free = q[j];
      else hit = q[j];
    }
    found = { value: free, how: "sampled" };
  }
  q[j] = x;
  return found;
}
