// Triangles of bodies and marks, each in the frame of its link: lists of corners and of normals, with three numbers
// each.

class Solid {
  constructor() {
    this.corners = [];
    this.normals = [];
  }

  triangle(a, b, c, na, nb, nc) {
    if (!na) {
      const n = unit3(cross3(minus(b, a), minus(c, a)));
      [na, nb, nc] = [n, n, n];
    }
    this.corners.push(...a, ...b, ...c);
    this.normals.push(...na, ...nb, ...nc);
  }

  // A grid of points and normals from point(i, k), with i around the axis and k along it.
  patch(around, along, point) {
    for (let k = 0; k < along; k++) {
      for (let i = 0; i < around; i++) {
        const [a, b, c, d] = [point(i, k), point(i + 1, k), point(i + 1, k + 1), point(i, k + 1)];
        this.triangle(a[0], b[0], c[0], a[1], b[1], c[1]);
        this.triangle(a[0], c[0], d[0], a[1], c[1], d[1]);
      }
    }
  }

  // Transforms all corners and normals by a rotation (its rows) and a translation.
  placed(rotation, translation) {
    const move = (list, shift) => {
      for (let k = 0; k < list.length; k += 3) {
        const p = [list[k], list[k + 1], list[k + 2]];
        for (let i = 0; i < 3; i++) list[k + i] = dot3(rotation[i], p) + shift[i];
      }
    };
    move(this.corners, translation);
    move(this.normals, [0, 0, 0]);
    return this;
  }
}

const AROUND = 20; // corners of a circle
const DOT = 8; // those of a point without radius, which is drawn a few pixels large

function unit3(a) {
  const size = norm3(a) || 1;
  return [a[0] / size, a[1] / size, a[2] / size];
}

function roundSolid(radius, length, isCapsule, around = AROUND) {
  const solid = new Solid();
  const half = length / 2;
  const rings = Math.ceil((3 * around) / 10);
  const circle = (i) => [Math.cos((2 * Math.PI * i) / around), Math.sin((2 * Math.PI * i) / around)];
  if (length) {
    solid.patch(around, 1, (i, k) => {
      const [c, s] = circle(i);
      return [[radius * c, radius * s, k ? half : -half], [c, s, 0]];
    });
  }
  for (const sign of [-1, 1]) {
    if (!isCapsule) {
      solid.patch(around, 1, (i, k) => {
        const [c, s] = circle(sign * i);
        return [[radius * c * (1 - k), radius * s * (1 - k), sign * half], [0, 0, sign]];
      });
      continue;
    }
    solid.patch(around, rings, (i, k) => {
      const [c, s] = circle(sign * i);
      const [flat, up] = [Math.cos((k * Math.PI) / (2 * rings)), sign * Math.sin((k * Math.PI) / (2 * rings))];
      return [[radius * flat * c, radius * flat * s, radius * up + sign * half], [flat * c, flat * s, up]];
    });
  }
  return solid;
}

function boxSolid([x, y, z]) {
  const solid = new Solid();
  const corner = (bits) => [bits & 1 ? x / 2 : -x / 2, bits & 2 ? y / 2 : -y / 2, bits & 4 ? z / 2 : -z / 2];
  for (const [a, b, c, d] of [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]) {
    solid.triangle(corner(a), corner(b), corner(c));
    solid.triangle(corner(a), corner(c), corner(d));
  }
  return solid;
}

// A capsule from one point to another.
function between(a, b, radius, around = AROUND) {
  const z = unit3(minus(b, a));
  const x = unit3(cross3(Math.abs(z[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], z));
  const y = cross3(z, x);
  const rows = [0, 1, 2].map((i) => [x[i], y[i], z[i]]);
  return roundSolid(radius, norm3(minus(b, a)), true, around).placed(rows, [0, 1, 2].map((i) => 0.5 * (a[i] + b[i])));
}

function decoded(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

function meshSolid(body) {
  const [points, triangles] = [decoded(body.vertices, Float32Array), decoded(body.triangles, Uint32Array)];
  const solid = new Solid();
  const corner = (k) => [points[3 * k], points[3 * k + 1], points[3 * k + 2]];
  for (let k = 0; k < triangles.length; k += 3) solid.triangle(corner(triangles[k]), corner(triangles[k + 1]), corner(triangles[k + 2]));
  return solid;
}

function bodySolid(body) {
  const make = {
    box: () => boxSolid(body.size),
    sphere: () => roundSolid(body.size[0], 0, true),
    cylinder: () => roundSolid(body.size[0], body.size[1], false),
    capsule: () => roundSolid(body.size[0], body.size[1], true),
    mesh: () => meshSolid(body),
  };
  return make[body.shape]().placed(body.rotation, body.translation);
}

// The solid of a mark with its radius; a point of radius zero is drawn as a dot of radius `dot`.
function markSolid(mark, dot) {
  const radius = mark.radius || dot;
  const [first, second] = mark.vertices;
  if (mark.kind === "point") return roundSolid(radius, 0, true, mark.radius ? AROUND : DOT).placed([[1, 0, 0], [0, 1, 0], [0, 0, 1]], first);
  if (mark.kind === "segment") return between(first, second, radius);
  if (mark.kind === "line") {
    const far = (sign) => first.map((part, i) => part + sign * 20 * dot * mark.normal[i]);
    return between(far(-1), far(1), radius);
  }
  if (mark.kind === "plane") {
    const x = unit3(cross3(Math.abs(mark.normal[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], mark.normal));
    const y = cross3(mark.normal, x);
    const rows = [0, 1, 2].map((i) => [x[i], y[i], mark.normal[i]]);
    return boxSolid([40 * dot, 40 * dot, 0.1 * dot]).placed(rows, first);
  }
  const [solid, done] = [new Solid(), new Set()];
  for (const triangle of mark.triangles) {
    const [a, b, c] = triangle.map((k) => mark.vertices[k]);
    if (!mark.radius) {
      solid.triangle(a, b, c);
      continue;
    }
    const n = unit3(cross3(minus(b, a), minus(c, a)));
    solid.triangle(...[a, b, c].map((p) => p.map((part, i) => part + radius * n[i])));
    for (const [i, j] of [[0, 1], [1, 2], [2, 0]].map((ends) => ends.map((k) => triangle[k]).sort((one, two) => one - two))) {
      if (done.has(`${i} ${j}`)) continue;
      done.add(`${i} ${j}`);
      const edge = between(mark.vertices[i], mark.vertices[j], radius);
      solid.corners.push(...edge.corners);
      solid.normals.push(...edge.normals);
    }
  }
  return solid;
}
