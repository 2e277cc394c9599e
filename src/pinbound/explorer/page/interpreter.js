// Evaluates the graph of pinbound's reduced paths: values forward, gradients backward. It has no kinematics of its own.

const KINDS = "kqcs+-*/r?h";
const OPERANDS = { k: 0, q: 1, c: 1, s: 1, "+": 2, "-": 2, "*": 2, "/": 2, r: 1, "?": 4, h: 1 };

class Program {
  // record: { n, kinds: one letter for each node, args: all operands in one list, constants, angles }
  // With loops, the n coordinates are those of z = F(q).
  constructor(record, loops = null) {
    const size = record.kinds.length;
    this.n = record.n;
    this.loops = loops;
    this.size = size;
    this.angles = record.angles.map((row) => Float64Array.from(row));
    this.kind = new Uint8Array(size);
    this.args = new Int32Array(4 * size);
    this.values = new Float64Array(size);
    this.slopes = new Float64Array(size);
    let arg = 0;
    let constant = 0;
    for (let k = 0; k < size; k++) {
      const letter = record.kinds[k];
      this.kind[k] = KINDS.indexOf(letter);
      for (let i = 0; i < OPERANDS[letter]; i++) this.args[4 * k + i] = record.args[arg++];
      if (letter === "k") this.values[k] = record.constants[constant++];
    }
    this.all = Int32Array.from({ length: size }, (_, k) => k);
  }

  // Numbers of all nodes that the given nodes need; operands are before the nodes that use them.
  needed(outputs) {
    const seen = new Set();
    const stack = [...outputs];
    while (stack.length) {
      const k = stack.pop();
      if (seen.has(k)) continue;
      seen.add(k);
      const letter = KINDS[this.kind[k]];
      if ("kqcs".includes(letter)) continue;
      for (let i = 0; i < OPERANDS[letter]; i++) stack.push(this.args[4 * k + i]);
    }
    return Int32Array.from([...seen].sort((a, b) => a - b));
  }

  angle(index, q) {
    const row = this.angles[index];
    let sum = 0;
    for (let j = 0; j < row.length; j++) if (row[j] !== 0) sum += row[j] * q[j];
    return sum;
  }

  full(q) {
    return this.loops ? this.loops.at(q) : q;
  }

  run(given, nodes = this.all) {
    const { kind, args, values } = this;
    const q = this.full(given);
    for (let i = 0; i < nodes.length; i++) {
      const k = nodes[i];
      const a = args[4 * k];
      const b = args[4 * k + 1];
      switch (kind[k]) {
        case 0: break;
        case 1: values[k] = q[a]; break;
        case 2: values[k] = Math.cos(this.angle(a, q)); break;
        case 3: values[k] = Math.sin(this.angle(a, q)); break;
        case 4: values[k] = values[a] + values[b]; break;
        case 5: values[k] = values[a] - values[b]; break;
        case 6: values[k] = values[a] * values[b]; break;
        case 7: values[k] = values[a] / values[b]; break;
        case 8: values[k] = Math.sqrt(values[a]); break;
        case 9: values[k] = values[a] < values[b] ? values[args[4 * k + 2]] : values[args[4 * k + 3]]; break;
        case 10: values[k] = values[a]; break;
      }
    }
    return values;
  }

  // The gradient over q of sum_i weight_i node_i, after run(q, nodes). The derivative of a hold is zero.
  gradient(given, seeds, nodes = this.all) {
    const { kind, args, values, slopes } = this;
    const q = this.full(given);
    for (let i = 0; i < nodes.length; i++) slopes[nodes[i]] = 0;
    for (const [k, weight] of seeds) slopes[k] += weight;
    const found = new Float64Array(this.n);
    for (let i = nodes.length - 1; i >= 0; i--) {
      const k = nodes[i];
      const s = slopes[k];
      if (s === 0) continue;
      const a = args[4 * k];
      const b = args[4 * k + 1];
      switch (kind[k]) {
        case 1: found[a] += s; break;
        case 2: this.turn(found, a, -s * Math.sin(this.angle(a, q))); break;
        case 3: this.turn(found, a, s * Math.cos(this.angle(a, q))); break;
        case 4: slopes[a] += s; slopes[b] += s; break;
        case 5: slopes[a] += s; slopes[b] -= s; break;
        case 6: {
          const [x, y] = [values[a], values[b]];
          slopes[a] += s * y;
          slopes[b] += s * x;
          break;
        }
        case 7: slopes[a] += s / values[b]; slopes[b] -= (s * values[k]) / values[b]; break;
        case 8: slopes[a] += (0.5 * s) / values[k]; break;
        case 9: slopes[values[a] < values[b] ? args[4 * k + 2] : args[4 * k + 3]] += s; break;
      }
    }
    return this.loops ? this.loops.chain(given, found) : found;
  }

  turn(found, index, slope) {
    const row = this.angles[index];
    for (let j = 0; j < row.length; j++) found[j] += slope * row[j];
  }
}

// One boundary: its signed clearance [m] (positive is free) and its gradient.
class Clearance {
  constructor(program, record) {
    this.program = program;
    this.record = record;
    this.name = record.name;
    const hull = record.hull;
    this.nodes = program.needed(hull ? [...hull.w, ...hull.edges.flat()] : [record.value]);
    if (hull) this.search = new HullSearch(hull);
  }

  // The signed clearance, after program.run(q) or run(q, this.nodes).
  read() {
    if (!this.search) return this.program.values[this.record.value];
    return this.search.separation(this.program.values) - this.record.distance;
  }

  isClear() {
    return this.search ? this.search.isClear(this.program.values) : this.program.values[this.record.value] > 0;
  }

  at(q) {
    this.program.run(q, this.nodes);
    return this.read();
  }

  gradient(q) {
    const value = this.at(q);
    const seeds = this.search ? this.search.seeds() : [[this.record.value, 1]];
    return { value, gradient: seeds ? this.program.gradient(q, seeds, this.nodes) : null };
  }
}

// The robot of the page: clearances, limits, placements of links.
class Robot {
  constructor(data) {
    this.data = data;
    this.n = data.coordinates.length;
    this.loops = data.loops ? new Loops(data.loops, this.n) : null;
    this.program = new Program(data.program, this.loops);
    this.clearances = data.boundaries.map((one) => new Clearance(this.program, one));
    this.watched = this.program.needed(
      data.boundaries.flatMap((one) => (one.hull ? [...one.hull.w, ...one.hull.edges.flat()] : [one.value])),
    );
    this.placed = this.program.needed(data.links.flatMap((one) => [...one.o, ...one.x, ...one.y]));
    this.signed = new Float64Array(this.clearances.length);
  }

  // All signed clearances at q [m].
  evaluate(q) {
    this.program.run(q, this.watched);
    for (let k = 0; k < this.clearances.length; k++) this.signed[k] = this.clearances[k].read();
    return this.signed;
  }

  // The index of the first boundary, in the given order, that is in contact at q; -1 if all are clear.
  contact(q, order) {
    this.program.run(q, this.watched);
    for (const k of order) if (!this.clearances[k].isClear()) return k;
    return -1;
  }

  // Placements of all links: origin [m] and rotation, column by column, as a matrix of WebGL.
  places(q) {
    const v = this.program.run(q, this.placed);
    return this.data.links.map(({ o, x, y }) => {
      const [a, b, c, d, e, f] = [v[x[0]], v[x[1]], v[x[2]], v[y[0]], v[y[1]], v[y[2]]];
      return [a, b, c, 0, d, e, f, 0, b * f - c * e, c * d - a * f, a * e - b * d, 0, v[o[0]], v[o[1]], v[o[2]], 1];
    });
  }

  // Names of the loops that cannot be closed at q.
  open(q) {
    return this.loops ? this.loops.open(q) : [];
  }

  // Names of the joint limits and rules that q violates; the test and its tolerance are those of Python.
  broken(given) {
    const { rows, guarded, roundoff } = this.data.limits;
    const q = this.program.full(given);
    const keeps = rows.every(({ coefficients, low, high, is_sum }) => {
      let [value, size] = [0, 0];
      coefficients.forEach((c, j) => {
        value += c * q[j];
        size += Math.abs(c * q[j]);
      });
      const rounding = is_sum ? roundoff * (q.length + 2) * size : 0;
      return low - rounding <= value && value <= high + rounding;
    });
    const names = keeps ? [] : this.data.limits.linear.filter((one) => !holds(one, q)).map((one) => one.joint);
    if (!keeps && !names.length) names.push("a joint limit");
    for (const one of guarded) if (!holds(one.limit, q) && one.where.every((part) => holds(part, q))) names.push(one.name);
    return [...new Set(names)];
  }
}

const GRANTED = 1e-12; // rad or m: tolerances.LIMIT

function holds(limit, q) {
  const value = dot(limit.coefficients, q) + limit.offset;
  return (limit.lower === null || value >= limit.lower - GRANTED) && (limit.upper === null || value <= limit.upper + GRANTED);
}

function dot(a, b) {
  let sum = 0;
  for (let j = 0; j < a.length; j++) sum += a[j] * b[j];
  return sum;
}
