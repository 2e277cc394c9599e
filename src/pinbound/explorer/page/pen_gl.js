// Draws solids and lines by WebGL 2 on a graphics processor; without one, `pen_soft.js` draws the same.

const VERTEX = `#version 300 es
in vec3 corner; in vec3 normal; uniform mat4 place; uniform mat4 view; out vec3 facing;
void main() { facing = mat3(place) * normal; gl_Position = view * place * vec4(corner, 1.0); }`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec3 facing; uniform vec4 colour; uniform vec3 light; uniform float flat_; out vec4 seen;
void main() {
  vec3 n = normalize(facing + vec3(1e-9));
  float shade = mix(0.62 + 0.38 * abs(dot(n, light)) * (0.75 + 0.25 * n.z), 1.0, flat_);
  seen = vec4(colour.rgb * shade * colour.a, colour.a);
}`;
const STILL = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

class GlPen {
  // The pen of a canvas; null without WebGL 2, and if WebGL runs on the CPU, which takes many times longer.
  static of(canvas) {
    if (isSlow(document.createElement("canvas"))) return null;
    const gl = canvas.getContext("webgl2", { antialias: true });
    return gl ? new GlPen(gl) : null;
  }

  constructor(gl) {
    this.gl = gl;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "corner");
    gl.bindAttribLocation(program, 1, "normal");
    gl.linkProgram(program);
    gl.useProgram(program);
    this.at = Object.fromEntries(["place", "view", "colour", "light", "flat_"].map((name) => [name, gl.getUniformLocation(program, name)]));
    this.lines = gl.createBuffer();
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.polygonOffset(2, 4);
    gl.clearColor(0, 0, 0, 0);
  }

  // Pixels of the canvas for one pixel of the page, at rest and during a motion.
  ratios(device) {
    const still = Math.min(device, 2);
    return { still, moving: still };
  }

  // One buffer for many solids; each part has the index of its first corner and the number of its corners.
  upload(solids) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const total = solids.reduce((sum, [solid]) => sum + solid.corners.length / 3, 0);
    const data = new Float32Array(6 * total);
    let first = 0;
    const parts = solids.map(([solid, link, record]) => {
      const count = solid.corners.length / 3;
      for (let k = 0; k < count; k++) {
        data.set(solid.corners.slice(3 * k, 3 * k + 3), 6 * (first + k));
        data.set(solid.normals.slice(3 * k, 3 * k + 3), 6 * (first + k) + 3);
      }
      first += count;
      return { first: first - count, count, link, record };
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    for (const [index, offset] of [[0, 0], [1, 12]]) {
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 24, offset);
    }
    return { array, parts };
  }

  begin([width, height], ratio, view, light) {
    const { gl } = this;
    fitCanvas(gl.canvas, width * ratio, height * ratio);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.at.view, false, view);
    gl.uniform3fv(this.at.light, light);
  }

  // isAsked: nearer pixels hide it; isKept: it hides pixels that are drawn later; isBehind: its depth is increased a
  // little.
  depth({ isAsked = true, isKept = true, isBehind = false }) {
    const { gl } = this;
    (isAsked ? gl.enable : gl.disable).call(gl, gl.DEPTH_TEST);
    (isBehind ? gl.enable : gl.disable).call(gl, gl.POLYGON_OFFSET_FILL);
    gl.depthMask(isKept);
  }

  solids({ array, parts }, places, colourOf) {
    const { gl } = this;
    gl.bindVertexArray(array);
    gl.uniform1f(this.at.flat_, 0);
    for (const part of parts) {
      const shade = colourOf(part);
      if (!shade) continue;
      gl.uniform4fv(this.at.colour, shade);
      gl.uniformMatrix4fv(this.at.place, false, places[part.link]);
      gl.drawArrays(gl.TRIANGLES, part.first, part.count);
    }
  }

  strokes(points, shade) {
    const { gl } = this;
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lines);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttrib3f(1, 0, 0, 1);
    gl.uniform1f(this.at.flat_, 1);
    gl.uniform4fv(this.at.colour, shade);
    gl.uniformMatrix4fv(this.at.place, false, STILL);
    gl.drawArrays(gl.LINES, 0, points.length / 3);
  }

  end() {}
}

// Whether WebGL 2 is missing or is done in software. A separate canvas is used, because a canvas keeps its first
// context.
function isSlow(canvas) {
  const gl = canvas.getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!gl) return true;
  const unmasked = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(unmasked ? unmasked.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

function fitCanvas(canvas, width, height) {
  [width, height] = [Math.max(1, Math.round(width)), Math.max(1, Math.round(height))];
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
