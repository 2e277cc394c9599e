// Loops that are not parallelograms, in the closed forms of pinbound's docs/loops.md: z = F(q) and its derivatives.
//
// z is q, then for each loop its two passive joints, its transmission and, for some loops, the angle `turn`. Beyond a
// toggle, the formulas hold the transmission at its end, as in Python. No robot can reach such q, and `open` names the
// loops.

const sparse = (row) => row.flatMap((c, k) => (c ? [[k, c]] : []));
const total = (row, z) => row.reduce((sum, [k, c]) => sum + c * z[k], 0);

class Linkage {
  constructor(record) {
    Object.assign(this, record);
    this.angles = record.angles.map(sparse);
    this.slides = record.slides.map((two) => two.map(sparse));
    this.rows = record.rows.map(sparse);
    this.isSlide = record.form === "SLIDE";
    this.isArms = record.form === "ARMS";
    const [y, z] = record.lengths;
    this.ends = this.isArms ? [-1, 1].map((s) => y * y + z * z + s * 2 * y * z * record.flat) : null;
  }

  // The vector X, the part of the loop that depends on its inputs.
  moved(z) {
    let [x, y] = [0, 0];
    this.vectors.forEach((vector, k) => {
      let [u, v] = vector.map((start, i) => start + total(this.slides[k][i], z));
      if (this.angles[k].length) {
        const angle = total(this.angles[k], z);
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        [u, v] = [u * c - v * s, u * s + v * c];
      }
      x += u;
      y += v;
    });
    return [x, y];
  }

  turnOf(x, y, z) {
    const back = (angle) => {
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      return Math.atan2(y * c - x * s, x * c + y * s);
    };
    if (this.ahead < 0) return back(this.reference) + this.reference;
    const [u, v] = this.vectors[this.ahead];
    const start = Math.atan2(v, u);
    const lead = total(this.angles[this.ahead], z);
    return back(lead + start) + start + lead;
  }

  held(square) {
    if (this.isArms) return Math.min(Math.max(square, this.ends[0]), this.ends[1]);
    const b = this.lengths[0] ** 2;
    return Math.max(square, b + 0.25 * (this.range[0] - b));
  }

  // Writes passive joints, transmission and `turn` to z.
  solve(z) {
    const [x, y] = this.moved(z);
    const [Y, Z] = this.lengths;
    const { sign } = this;
    let one, other, w, turn;
    if (this.isSlide) {
      const held = Math.min(Math.max(y, -Y * this.flat), Y * this.flat);
      const root = Math.sqrt((Y - held) * (Y + held));
      one = sign * Math.atan2(-held, root) + (sign > 0 ? 0 : Math.PI);
      [other, w] = [-x - sign * root, y / Y];
    } else {
      turn = this.turnOf(x, y, z);
      const square = x * x + y * y;
      const held = this.held(square);
      if (this.isArms) {
        const area = sign * Math.sqrt(((Y + Z) ** 2 - held) * (held - (Y - Z) ** 2));
        one = turn + Math.PI - Math.atan2(area, held - (Z * Z - Y * Y));
        other = one + Math.atan2(area, held - (Y * Y + Z * Z));
        w = (square - (Y * Y + Z * Z)) * (1 / (2 * Y * Z));
      } else {
        [other, w] = [sign * Math.sqrt(held - Y * Y), square];
        one = turn + Math.PI - Math.atan2(Y, other);
      }
    }
    const found = this.mix.map(([a, b], i) => this.offset[i] + a * one + b * other + total(this.rows[i], z));
    found.push(w, turn - this.reference);
    this.columns.forEach((column, i) => (z[column] = found[i]));
  }

  // Writes the directional derivatives of these values to `way`, which holds the derivatives of the entries of z.
  slope(z, way) {
    let [x, y, dx, dy] = [0, 0, 0, 0];
    this.vectors.forEach((vector, k) => {
      let [u, v] = vector.map((start, i) => start + total(this.slides[k][i], z));
      let [du, dv] = this.slides[k].map((row) => total(row, way));
      if (this.angles[k].length) {
        const angle = total(this.angles[k], z);
        const rate = total(this.angles[k], way);
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        [u, v] = [u * c - v * s, u * s + v * c];
        [du, dv] = [c * du - s * dv - v * rate, s * du + c * dv + u * rate];
      }
      [x, y, dx, dy] = [x + u, y + v, dx + du, dy + dv];
    });
    const [Y, Z] = this.lengths;
    const { sign } = this;
    let one, other, w, turn;
    if (this.isSlide) {
      const held = Math.min(Math.max(y, -Y * this.flat), Y * this.flat);
      const moves = (held === y ? dy : 0) / Math.sqrt((Y - held) * (Y + held));
      [one, other, w] = [-sign * moves, sign * held * moves - dx, dy / Y];
    } else {
      const square = x * x + y * y;
      const change = 2 * (x * dx + y * dy);
      const held = this.held(square);
      const kept = held === square ? change : 0;
      turn = (x * dy - y * dx) / held;
      if (this.isArms) {
        const moves = (sign * kept) / Math.sqrt(((Y + Z) ** 2 - held) * (held - (Y - Z) ** 2));
        one = turn + (moves * (held + (Z * Z - Y * Y))) / (2 * held);
        [other, w] = [one - moves, change * (1 / (2 * Y * Z))];
      } else {
        other = (sign * 0.5 * kept) / Math.sqrt(held - Y * Y);
        [one, w] = [turn + (Y * other) / held, change];
      }
    }
    const found = this.mix.map(([a, b], i) => a * one + b * other + total(this.rows[i], way));
    found.push(w, turn);
    this.columns.forEach((column, i) => (way[column] = found[i]));
  }

  closes(z) {
    const w = z[this.columns[2]];
    const [low, high] = this.range;
    return w >= low && (high === null || w <= high);
  }
}

class Loops {
  constructor(record, n) {
    this.record = record;
    this.n = n;
    this.linkages = record.linkages.map((one) => new Linkage(one));
    this.toggles = new Map(record.linkages.flatMap((one) => one.columns.slice(2).map((k) => [record.names[k], one.name])));
    this.z = new Float64Array(record.names.length);
    this.last = new Float64Array(n).fill(NaN);
    this.rates = record.rates;
  }

  // z at q; the next call uses the same array.
  at(q) {
    const { z, last, n } = this;
    let same = true;
    for (let j = 0; j < n; j++) {
      if (q[j] !== last[j]) same = false;
      z[j] = last[j] = q[j];
    }
    if (!same) for (const one of this.linkages) one.solve(z);
    return z;
  }

  // The gradient over q of a function with the gradient g over z.
  chain(q, g) {
    const z = this.at(q);
    const found = g.slice(0, this.n);
    this.rates.forEach((rates, j) => {
      if (!rates) return;
      const way = new Float64Array(z.length);
      way[j] = 1;
      for (const one of this.linkages) one.slope(z, way);
      for (let k = this.n; k < z.length; k++) if (g[k]) found[j] += g[k] * way[k];
    });
    return found;
  }

  // Names of the loops that cannot be closed at q.
  open(q) {
    const z = this.at(q);
    return this.linkages.filter((one) => !one.closes(z)).map(({ name }) => name);
  }

  // Bounds of the rate of a function along q_j, one for each part, from its rates over z; NaN where no bound is known.
  // If one other coordinate moves the same loops, the bounds hold for the part of its window that contains its present
  // value.
  speeds(j, speeds, q, windows) {
    const { cells, rows, other, of } = this.rates[j];
    let row = 0;
    if (rows > 1) {
      const [low, high] = windows[other];
      row = Math.min(Math.max(Math.floor(((q[other] - low) / (high - low)) * rows), 0), rows - 1);
    }
    return Float64Array.from({ length: cells }, (_, cell) => {
      let sum = speeds[j] ?? NaN;
      for (const k in of) if (speeds[k] !== 0) sum += (speeds[k] ?? NaN) * (of[k][row * cells + cell] ?? NaN);
      return sum;
    });
  }

  moves(j, k) {
    return Boolean(this.rates[j] && this.rates[j].of[k]);
  }
}
