// GJK: the least |x| over all x = a + b, with a in the hull of points A and b in the hull of points B. Each step finds
// the nearest point of at most four such sums by trying all their faces.

// The search ends early if the least is proven to be above `clear`, or if `hit` is reached. Then `size` only tells
// which of the two holds.
function nearestOfHulls(A, B, scale, clear = Infinity, hit = 0) {
  const support = (x, y, z) => {
    const [i, j] = [lowest(A, x, y, z), lowest(B, x, y, z)];
    return { i, j, p: [A[3 * i] + B[3 * j], A[3 * i + 1] + B[3 * j + 1], A[3 * i + 2] + B[3 * j + 2]], weight: 1 };
  };
  let simplex = [support(A[0] + B[0], A[1] + B[1], A[2] + B[2])];
  let best = simplex[0].p;
  let size = norm3(best);
  for (let step = 0; step < 200 && size > hit; step++) {
    const next = support(best[0], best[1], best[2]);
    const least = dot3(best, next.p) / size;
    if (least > clear || size - least <= 2e-16 * scale) break;
    if (simplex.some((one) => one.i === next.i && one.j === next.j)) break;
    const found = nearestOfSimplex([...simplex, next]);
    if (!(found.size < size)) break;
    ({ simplex, best, size } = found);
  }
  return { simplex, r: best, size };
}

function lowest(points, x, y, z) {
  let [found, least] = [0, Infinity];
  for (let k = 0; k < points.length; k += 3) {
    const height = points[k] * x + points[k + 1] * y + points[k + 2] * z;
    if (height < least) [found, least] = [k / 3, height];
  }
  return found;
}

// Faces of at most four points that contain the last point: if this point lowers the least, it is in the nearest face.
const FACES = [1, 2, 3, 4].map((count) =>
  Array.from({ length: 1 << (count - 1) }, (_, bits) =>
    [...Array(count).keys()].filter((k) => k === count - 1 || bits & (1 << k)),
  ),
);

function nearestOfSimplex(points) {
  let [size, best, face] = [Infinity, null, null];
  for (const some of FACES[points.length - 1]) {
    const [a, b, c, d] = some;
    const one = NEAREST[some.length - 1](points[a].p, points[b]?.p, points[c]?.p, points[d]?.p);
    if (!one) continue;
    const length = norm3(one.x);
    if (length < size) [size, best, face] = [length, one, some];
  }
  const simplex = face.map((k, place) => ({ i: points[k].i, j: points[k].j, p: points[k].p, weight: best.weights[place] }));
  return { size, best: best.x, simplex };
}

const NEAREST = [
  (a) => ({ x: a, weights: [1] }),
  (a, b) => {
    const d = minus(b, a);
    const t = -dot3(a, d) / dot3(d, d);
    return t > 0 && t < 1 ? { x: [a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]], weights: [1 - t, t] } : null;
  },
  (a, b, c) => {
    const n = cross3(minus(b, a), minus(c, a));
    const nn = dot3(n, n);
    const u = dot3(cross3(b, c), n) / nn;
    const v = dot3(cross3(c, a), n) / nn;
    const w = dot3(cross3(a, b), n) / nn;
    if (!(u > 0 && v > 0 && w > 0)) return null;
    const t = dot3(a, n) / nn;
    return { x: [t * n[0], t * n[1], t * n[2]], weights: [u, v, w] };
  },
  (a, b, c, d) => {
    const cd = cross3(c, d);
    const ab = cross3(a, b);
    const parts = [dot3(b, cd), -dot3(a, cd), dot3(d, ab), -dot3(c, ab)];
    const sum = parts[0] + parts[1] + parts[2] + parts[3];
    if (!parts.every((part) => part / sum > 0)) return null;
    return { x: [0, 0, 0], weights: parts.map((part) => part / sum) };
  },
];

function minus(a, b) {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

function cross3(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function dot3(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function norm3(a) {
  return Math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

// The least length, or the least height, of r = w + sum_i t_i e_i, with t in the product of two hulls.
class HullSearch {
  constructor(record) {
    this.record = record;
    this.split = record.corners[0].length ? record.corners[0][0].length : 0;
    this.points = record.corners.map((corners) => new Float64Array(3 * corners.length));
  }

  // Whether the separation is above the contact distance; the search ends as soon as this is known.
  isClear(values) {
    const { distance, overlap, is_height: isHeight } = this.record;
    if (isHeight) return this.separation(values) > distance;
    const [A, B, scale] = this.place(values);
    const { size } = nearestOfHulls(A, B, scale, distance + 1e-12 * scale, distance);
    return size > Math.max(distance, overlap);
  }

  // The points of both hulls (w is added to the first hull), and the largest absolute value of their components.
  place(values) {
    const { w, edges, corners } = this.record;
    let scale = 0;
    corners.forEach((rows, side) => {
      const first = side ? this.split : 0;
      rows.forEach((row, k) => {
        for (let i = 0; i < 3; i++) {
          let sum = side ? 0 : values[w[i]];
          for (let m = 0; m < row.length; m++) sum += row[m] * values[edges[first + m][i]];
          this.points[side][3 * k + i] = sum;
          scale = Math.max(scale, Math.abs(sum));
        }
      });
    });
    return [...this.points, scale];
  }

  separation(values) {
    const { is_height: isHeight, overlap } = this.record;
    const [A, B, scale] = this.place(values);
    if (isHeight) {
      const [i, j] = [lowest(A, 1, 0, 0), lowest(B, 1, 0, 0)];
      this.found = { simplex: [{ i, j, weight: 1 }], r: [1, 0, 0], size: 1 };
      return A[3 * i] + B[3 * j];
    }
    this.found = nearestOfHulls(A, B, scale);
    if (Math.max(...this.found.r.map(Math.abs)) <= overlap) this.found = { ...this.found, r: [0, 0, 0], size: 0 };
    return this.found.size;
  }

  // Weights of nodes in the gradient of the separation; null if the separation is zero, where it has no gradient.
  seeds() {
    const { w, edges, corners } = this.record;
    const { simplex, r, size } = this.found;
    if (size === 0) return null;
    const t = new Float64Array(edges.length);
    for (const { i, j, weight } of simplex) {
      corners[0][i].forEach((part, m) => (t[m] += weight * part));
      corners[1][j].forEach((part, m) => (t[this.split + m] += weight * part));
    }
    const unit = r.map((part) => part / size);
    const seeds = w.map((node, i) => [node, unit[i]]);
    edges.forEach((edge, m) => edge.forEach((node, i) => seeds.push([node, t[m] * unit[i]])));
    return seeds;
  }
}
