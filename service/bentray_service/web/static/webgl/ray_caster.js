// Casts refracted rays through a volume on the graphics card: a WebGL2 program, its textures, and the camera of the service.
import { frameOf } from "../scenes/camera.js";

export const MAX_ISOS = 4;
// Cells along each side of a block, of which the range of the field is known.
const BLOCK = 4;

// One triangle that covers the picture.
const VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;
const FRAGMENT = await (await fetch(new URL("./rays.frag", import.meta.url))).text();

// What the shader calls a filter.
const FILTERS = { bspline3: "B_SPLINE_3", "catmull-rom": "CATMULL_ROM" };

export const hasFilter = (name) => name in FILTERS;

const fragmentOf = (filter) => ["#version 300 es", `#define MAX_ISOS ${MAX_ISOS}`, `#define BLOCK ${BLOCK}`, `#define ${FILTERS[filter]}`, FRAGMENT].join("\n");

// As in workers/bentray_workers/rendering/refraction.py, and the defaults of refraction_view.py.
const VIEW_MARGIN = 1.25;
const SQUARES = 16;
const DEPTH = 16;

// Least and greatest coefficient around each block of cells: the field is between them. Two numbers per block, z fastest.
function rangesOf(values, [nx, ny, nz]) {
  const cells = [nx - 3, ny - 3, nz - 3];
  const blocks = cells.map((count) => Math.ceil(count / BLOCK));
  const ranges = new Float32Array(2 * blocks[0] * blocks[1] * blocks[2]);
  let at = 0;
  for (let i = 0; i < blocks[0]; i += 1) {
    for (let j = 0; j < blocks[1]; j += 1) {
      for (let k = 0; k < blocks[2]; k += 1, at += 2) {
        let [low, high] = [Infinity, -Infinity];
        const lastX = Math.min((i + 1) * BLOCK + 3, nx);
        const lastY = Math.min((j + 1) * BLOCK + 3, ny);
        const lastZ = Math.min((k + 1) * BLOCK + 3, nz);
        for (let x = i * BLOCK; x < lastX; x += 1) {
          for (let y = j * BLOCK; y < lastY; y += 1) {
            const row = (x * ny + y) * nz;
            for (let z = row + k * BLOCK; z < row + lastZ; z += 1) {
              const value = values[z];
              if (value < low) low = value;
              if (value > high) high = value;
            }
          }
        }
        ranges[at] = low;
        ranges[at + 1] = high;
      }
    }
  }
  return { ranges, blocks };
}

function programOf(gl, filter) {
  const program = gl.createProgram();
  const shaders = [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragmentOf(filter)]].map(([kind, source]) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    return shader;
  });
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    const reasons = [gl.getProgramInfoLog(program), ...shaders.map((shader) => gl.getShaderInfoLog(shader))];
    throw new Error(reasons.filter(Boolean).join("; ") || "The shader cannot be compiled");
  }
  return program;
}

function texture3d(gl, unit, values, [nx, ny, nz], channels) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_3D, gl.createTexture());
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_3D, name, gl.NEAREST);
  const [stored, given] = channels === 1 ? [gl.R32F, gl.RED] : [gl.RG32F, gl.RG];
  gl.texImage3D(gl.TEXTURE_3D, 0, stored, nz, ny, nx, 0, given, gl.FLOAT, values);
}

// Names of renderers without a graphics card, which are slower than the service.
const SOFTWARE = /SwiftShader|llvmpipe|softpipe|software|Basic Render/i;

const release = (gl) => gl.getExtension("WEBGL_lose_context")?.loseContext();

export function hasGraphicsCard() {
  const gl = document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  release(gl);
  return !SOFTWARE.test(name);
}

// Draws views of a volume on a canvas. values, shape: coefficients of a filter of four nodes, Float32Array (x, y, z), with one
// node before the first one and two after the last one along each axis; spacing: along each axis. Throws where WebGL2 is
// missing or too small.
export function rayCaster(canvas, { values, shape, spacing, filter }) {
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
  if (!gl) throw new Error("No WebGL2");
  if (Math.max(...shape) > gl.getParameter(gl.MAX_3D_TEXTURE_SIZE)) throw new Error("The volume is too large for WebGL2");
  const program = programOf(gl, filter);
  const cells = shape.map((count) => count - 3);
  const unit = Math.min(...spacing);
  const steps = spacing.map((step) => step / unit);
  const extent = cells.map((count, axis) => count * steps[axis]);
  const { ranges, blocks } = rangesOf(values, shape);
  texture3d(gl, 0, values, shape, 1);
  texture3d(gl, 1, ranges, blocks, 2);
  // Uniforms of a kind by their names: "1i" for an integer, "3fv" for three numbers.
  const set = (kind, values) => Object.entries(values).forEach(([name, value]) => gl[`uniform${kind}`](gl.getUniformLocation(program, name), value));
  gl.useProgram(program);
  set("1i", { coefficients: 0, ranges: 1, depth: DEPTH });
  set("3iv", { cells });
  set("3fv", { spacing: steps });
  if (gl.getError() !== gl.NO_ERROR) throw new Error("The volume does not fit into WebGL2");

  // view: as the parameters of refraction.png; iso and index are lists. Returns the time that it took, ms.
  function draw({ width, height, azimuth_deg, elevation_deg, up, zoom, mode, iso, index, outside = 1, surroundings = 0 }) {
    if (gl.isContextLost()) throw new Error("The graphics card was lost");
    const begun = performance.now();
    canvas.width = width;
    canvas.height = height;
    gl.viewport(0, 0, width, height);
    const { right, down, ahead } = frameOf(azimuth_deg, elevation_deg, up);
    const diagonal = Math.hypot(...extent);
    const wide = ((VIEW_MARGIN * Math.max(...extent)) / zoom) * Math.max(1, width / height);
    const light = ahead.map((one, axis) => -one - 0.6 * right[axis] - 0.8 * down[axis]);
    const padded = (list, length) => [...list, ...new Array(length - list.length).fill(0)];
    gl.uniformMatrix3fv(gl.getUniformLocation(program, "frame"), false, [...right, ...down, ...ahead]);
    set("2fv", { field: [wide, (wide * height) / width], pixels: [width, height] });
    set("1f", { away: diagonal, beyond: diagonal, square: (wide * Math.min(1, height / width)) / SQUARES });
    set("1fv", { levels: padded([-1e30, ...iso, 1e30], MAX_ISOS + 2), indices: padded([outside, ...index], MAX_ISOS + 1) });
    set("1i", { layers: iso.length + 1, around: surroundings, lit: mode === "shaded" ? 1 : 0 });
    set("3fv", { towards: light.map((one) => one / Math.hypot(...light)) });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    // Reading waits for the picture.
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now() - begun;
  }

  return {
    canvas,
    draw,
    close: () => release(gl),
  };
}
