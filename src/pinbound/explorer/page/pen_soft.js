// Draws the same as `pen_gl.js` without a graphics processor: triangles are drawn into an array of pixels with a depth
// buffer.

const THIN = 1e-5; // pixels^2: a triangle whose doubled area is smaller covers none

class SoftPen {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.most = 0;
    this.clip = null; // of each corner of a solid x, y, z, w before division, and its shade
    this.shown = null; // of each corner x, y in pixels, depth from -1 to 1, shade
    this.spare = new Float64Array(20); // as shown, of the corners that cutting makes, and of the ends of lines
    this.depth({});
  }

  // At rest, up to two pixels of the canvas for one pixel of the page make edges smooth; during a motion it is one.
  ratios(device) {
    return { still: Math.min(2 * device, 2), moving: 1 };
  }

  // Corners that triangles share are stored once, so that each is transformed only once.
  upload(solids) {
    const parts = solids.map(([solid, link, record]) => {
      const [corners, seen] = [[], new Map()];
      const triangles = Uint32Array.from({ length: solid.corners.length / 3 }, (_, k) => {
        const row = [...solid.corners.slice(3 * k, 3 * k + 3), ...solid.normals.slice(3 * k, 3 * k + 3)].map(Math.fround);
        const key = row.join();
        if (!seen.has(key)) {
          seen.set(key, seen.size);
          corners.push(...row);
        }
        return seen.get(key);
      });
      return { corners: Float32Array.from(corners), triangles, link, record };
    });
    const most = Math.max(4, ...parts.map(({ corners }) => corners.length / 6));
    if (most > this.most) [this.most, this.clip, this.shown] = [most, new Float64Array(5 * most), new Float64Array(4 * most)];
    return { parts };
  }

  begin([width, height], ratio, view, light, paper) {
    const { canvas } = this;
    fitCanvas(canvas, width * ratio, height * ratio);
    if (this.image?.width !== canvas.width || this.image?.height !== canvas.height) {
      this.image = this.context.createImageData(canvas.width, canvas.height);
      this.words = new Uint32Array(this.image.data.buffer);
      this.far = new Float32Array(this.words.length);
    }
    [this.width, this.height] = [canvas.width, canvas.height];
    this.thick = Math.max(1, Math.round(ratio));
    this.view = view;
    this.light = light;
    this.words.fill(packed(...paper));
    this.far.fill(1);
  }

  // The same as GlPen.depth.
  depth({ isAsked = true, isKept = true, isBehind = false }) {
    Object.assign(this, { isAsked, isKept: isAsked && isKept, isBehind });
  }

  solids({ parts }, places, colourOf) {
    for (const part of parts) {
      const shade = colourOf(part);
      if (shade) this.solid(part, places[part.link], shade);
    }
  }

  solid({ corners, triangles }, place, [r, g, b, alpha]) {
    const { clip, shown, light } = this;
    const m = product(this.view, place);
    const [lx, ly, lz] = light;
    this.colour = [255 * r, 255 * g, 255 * b, alpha];
    for (let at = 0, to = 0, k = 0; at < corners.length; at += 6, to += 5, k++) {
      const [x, y, z] = [corners[at], corners[at + 1], corners[at + 2]];
      const [u, v, w] = [corners[at + 3], corners[at + 4], corners[at + 5]];
      const nx = place[0] * u + place[4] * v + place[8] * w;
      const ny = place[1] * u + place[5] * v + place[9] * w;
      const nz = place[2] * u + place[6] * v + place[10] * w;
      clip[to] = m[0] * x + m[4] * y + m[8] * z + m[12];
      clip[to + 1] = m[1] * x + m[5] * y + m[9] * z + m[13];
      clip[to + 2] = m[2] * x + m[6] * y + m[10] * z + m[14];
      clip[to + 3] = m[3] * x + m[7] * y + m[11] * z + m[15];
      clip[to + 4] = 0.62 + 0.38 * Math.abs(nx * lx + ny * ly + nz * lz) * (0.75 + 0.25 * nz);
      this.show(clip, to, shown, 4 * k);
    }
    for (let k = 0; k < triangles.length; k += 3) {
      const [i, j, l] = [triangles[k], triangles[k + 1], triangles[k + 2]];
      const inFront = this.isInFront(i) + this.isInFront(j) + this.isInFront(l);
      if (inFront === 3) this.triangle(shown, 4 * i, 4 * j, 4 * l);
      else if (inFront) this.cut([i, j, l]);
    }
  }

  isInFront(k) {
    return this.clip[5 * k + 2] > -this.clip[5 * k + 3] ? 1 : 0;
  }

  // Converts a corner to pixels.
  show(clip, from, shown, to) {
    const w = clip[from + 3];
    shown[to] = 0.5 * (clip[from] / w + 1) * this.width;
    shown[to + 1] = 0.5 * (1 - clip[from + 1] / w) * this.height;
    shown[to + 2] = clip[from + 2] / w;
    shown[to + 3] = clip[from + 4];
  }

  // Draws a triangle of which one or two corners are in front of the near plane: only the part behind the plane is
  // drawn.
  cut(corners) {
    const { clip, spare } = this;
    const rows = corners.map((k) => clip.subarray(5 * k, 5 * k + 5));
    const kept = [];
    rows.forEach((row, k) => {
      const next = rows[(k + 1) % 3];
      const [a, b] = [row[2] + row[3], next[2] + next[3]];
      if (a > 0) kept.push(row);
      if (a > 0 !== b > 0) kept.push(row.map((part, i) => part + (a / (a - b)) * (next[i] - part)));
    });
    kept.forEach((row, k) => this.show(row, 0, spare, 4 * k));
    for (let k = 2; k < kept.length; k++) this.triangle(spare, 0, 4 * k - 4, 4 * k);
  }

  // Fills one triangle, row by row: depth and shade are linear over the screen.
  triangle(shown, a, b, c) {
    if (shown[b + 1] < shown[a + 1]) [a, b] = [b, a];
    if (shown[c + 1] < shown[b + 1]) [b, c] = [c, b];
    if (shown[b + 1] < shown[a + 1]) [a, b] = [b, a]; // from the top down
    const { width, height, far, words, isAsked, isKept } = this;
    const [ax, ay, cy] = [shown[a], shown[a + 1], shown[c + 1]];
    const [bx, by, cx] = [shown[b] - ax, shown[b + 1] - ay, shown[c] - ax];
    const high = cy - ay;
    const area = bx * high - cx * by;
    if (!(Math.abs(area) > THIN)) return;
    const top = Math.max(0, Math.ceil(ay - 0.5));
    const bottom = Math.min(height - 1, Math.ceil(cy - 0.5) - 1);
    if (top > bottom) return;
    const [zb, zc, sb, sc] = [shown[b + 2] - shown[a + 2], shown[c + 2] - shown[a + 2], shown[b + 3] - shown[a + 3], shown[c + 3] - shown[a + 3]];
    const [zx, zy] = [(zb * high - zc * by) / area, (zc * bx - zb * cx) / area];
    const [sx, sy] = [(sb * high - sc * by) / area, (sc * bx - sb * cx) / area];
    const z0 = shown[a + 2] + (this.isBehind ? 2 * Math.max(Math.abs(zx), Math.abs(zy)) + 2e-6 : 0);
    const s0 = shown[a + 3];
    const [long, upper, lower] = [cx / high, bx / by, (cx - bx) / (high - by)];
    const [r, g, blue, alpha] = this.colour;
    const rest = 1 - alpha;
    for (let y = top; y <= bottom; y++) {
      const down = y + 0.5 - ay;
      const one = long * down;
      const two = down < by ? upper * down : bx + lower * (down - by);
      const start = Math.max(0, Math.ceil(ax + Math.min(one, two) - 0.5));
      const end = y * width + Math.min(width, Math.ceil(ax + Math.max(one, two) - 0.5));
      let z = z0 + zx * (start + 0.5 - ax) + zy * down;
      let s = alpha * (s0 + sx * (start + 0.5 - ax) + sy * down);
      for (let at = y * width + start; at < end; at++, z += zx, s += alpha * sx) {
        if (isAsked && z >= far[at]) continue;
        if (isKept) far[at] = z;
        if (rest === 0) words[at] = 0xff000000 | ((blue * s + 0.5) << 16) | ((g * s + 0.5) << 8) | (r * s + 0.5);
        else {
          const old = words[at];
          const red = r * s + rest * (old & 255) + 0.5;
          const green = g * s + rest * ((old >> 8) & 255) + 0.5;
          words[at] = 0xff000000 | ((blue * s + rest * ((old >> 16) & 255) + 0.5) << 16) | (green << 8) | red;
        }
      }
    }
  }

  strokes(points, [r, g, b]) {
    const { view: m, spare } = this;
    const colour = packed(255 * r, 255 * g, 255 * b);
    for (let first = 0; first < points.length; first += 6) {
      const ends = [0, 3].map((k) => {
        const [x, y, z] = [points[first + k], points[first + k + 1], points[first + k + 2]];
        return [0, 1, 2, 3].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
      });
      const [a, b] = ends.map((end) => end[2] + end[3]);
      if (!(a > 0 || b > 0)) continue;
      if (!(a > 0 && b > 0)) {
        const at = ends[0].map((part, i) => part + (a / (a - b)) * (ends[1][i] - part));
        ends[a > 0 ? 1 : 0] = at;
      }
      ends.forEach((end, k) => this.show(end, 0, spare, 4 * k));
      this.line([...spare.subarray(0, 3)], [...spare.subarray(4, 7)], colour);
    }
  }

  line([ax, ay, az], [bx, by, bz], colour) {
    const { width, height, far, words, thick, isAsked } = this;
    const [dx, dy, dz] = [bx - ax, by - ay, bz - az];
    let [from, to] = [0, 1]; // the part in the picture
    for (const [d, low, high] of [[dx, -ax, width - ax], [dy, -ay, height - ay]]) {
      if (d === 0 && (low > 0 || high < 0)) return;
      if (d === 0) continue;
      const [s, e] = d > 0 ? [low / d, high / d] : [high / d, low / d];
      [from, to] = [Math.max(from, s), Math.min(to, e)];
    }
    const count = Math.ceil(Math.max(Math.abs(dx), Math.abs(dy)) * (to - from));
    const isFlat = Math.abs(dx) > Math.abs(dy);
    for (let step = 0; step <= count; step++) {
      const t = from + ((to - from) * step) / (count || 1);
      const [x, y, z] = [Math.floor(ax + t * dx), Math.floor(ay + t * dy), az + t * dz];
      for (let k = 0; k < thick; k++) {
        const [px, py] = isFlat ? [x, y + k] : [x + k, y];
        if (px < 0 || py < 0 || px >= width || py >= height) continue;
        const at = py * width + px;
        if (isAsked && z >= far[at]) continue;
        far[at] = isAsked ? z : far[at];
        words[at] = colour;
      }
    }
  }

  end() {
    this.context.putImageData(this.image, 0, 0);
  }
}

// A pixel in one 32-bit word, with blue above green above red, as on little-endian machines.
function packed(r, g, b) {
  return (0xff000000 | ((b + 0.5) << 16) | ((g + 0.5) << 8) | (r + 0.5)) >>> 0;
}

function product(a, b) {
  const m = new Float64Array(16);
  for (let j = 0; j < 4; j++) {
    for (let i = 0; i < 4; i++) for (let k = 0; k < 4; k++) m[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  }
  return m;
}
