// Casts refracted rays through a filtered volume: as kernels/bentray_kernels/refraction, in float32. ray_caster.js defines
// MAX_ISOS, BLOCK (cells along each side of a block, of which the range of the field is known), and CATMULL_ROM for that filter.
precision highp float;
precision highp int;
precision highp sampler3D;

// Weights of the four nodes around a point, t of a cell after the second, and their derivatives.
#ifdef CATMULL_ROM
vec4 weights(float t) {
  return 0.5 * vec4(t * (-1.0 + t * (2.0 - t)), 2.0 + t * t * (3.0 * t - 5.0), t * (1.0 + t * (4.0 - 3.0 * t)), t * t * (t - 1.0));
}
vec4 slopes(float t) {
  return 0.5 * vec4(-1.0 + t * (4.0 - 3.0 * t), t * (9.0 * t - 10.0), 1.0 + t * (8.0 - 9.0 * t), t * (3.0 * t - 2.0));
}
#else
vec4 weights(float t) {
  float u = 1.0 - t;
  return vec4(u * u * u / 6.0, 2.0 / 3.0 - 0.5 * t * t * (2.0 - t), 2.0 / 3.0 - 0.5 * u * u * (2.0 - u), t * t * t / 6.0);
}
vec4 slopes(float t) {
  float u = 1.0 - t;
  return vec4(-0.5 * u * u, t * (1.5 * t - 2.0), u * (2.0 - 1.5 * u), 0.5 * t * t);
}
#endif

// Coefficients and ranges of blocks are indexed z, y, x. Lengths are in units of the smallest spacing.
uniform sampler3D coefficients;
uniform sampler3D ranges;
uniform ivec3 cells;
uniform vec3 spacing;
uniform mat3 frame;      // right, down, ahead
uniform vec2 field;      // width and height of the picture
uniform vec2 pixels;
uniform float away;      // of the plane of the camera, and of the backdrop
uniform float beyond;
uniform float square;    // edge of the backdrop's squares
uniform float levels[MAX_ISOS + 2];
uniform float indices[MAX_ISOS + 1];
uniform int layers;
uniform int around;
uniform int depth;
uniform bool lit;
uniform vec3 towards;    // the light

out vec4 colour;

const vec3 BEYOND = vec3(90.0);
const float FAR = 1e30;
const int MAX_STEPS = 4096;

void cellOf(vec3 place, out ivec3 cell, out vec3 t) {
  cell = clamp(ivec3(floor(place)), ivec3(0), cells - 1);
  t = place - vec3(cell);
}

float valueAt(vec3 place) {
  ivec3 cell; vec3 t;
  cellOf(place, cell, t);
  vec4 wx = weights(t.x), wy = weights(t.y), wz = weights(t.z);
  float value = 0.0;
  for (int i = 0; i < 4; i++) {
    float sheet = 0.0;
    for (int j = 0; j < 4; j++) {
      ivec3 at = ivec3(cell.z, cell.y + j, cell.x + i);
      vec4 row = vec4(
        texelFetch(coefficients, at, 0).r, texelFetch(coefficients, at + ivec3(1, 0, 0), 0).r,
        texelFetch(coefficients, at + ivec3(2, 0, 0), 0).r, texelFetch(coefficients, at + ivec3(3, 0, 0), 0).r);
      sheet += wy[j] * dot(wz, row);
    }
    value += wx[i] * sheet;
  }
  return value;
}

vec3 gradientAt(vec3 place) {
  ivec3 cell; vec3 t;
  cellOf(place, cell, t);
  vec4 wx = weights(t.x), wy = weights(t.y), wz = weights(t.z);
  vec4 dx = slopes(t.x), dy = slopes(t.y), dz = slopes(t.z);
  vec3 gradient = vec3(0.0);
  for (int i = 0; i < 4; i++) {
    vec3 sheet = vec3(0.0);
    for (int j = 0; j < 4; j++) {
      ivec3 at = ivec3(cell.z, cell.y + j, cell.x + i);
      vec4 row = vec4(
        texelFetch(coefficients, at, 0).r, texelFetch(coefficients, at + ivec3(1, 0, 0), 0).r,
        texelFetch(coefficients, at + ivec3(2, 0, 0), 0).r, texelFetch(coefficients, at + ivec3(3, 0, 0), 0).r);
      float value = dot(wz, row);
      sheet += vec3(wy[j] * value, dy[j] * value, wy[j] * dot(dz, row));
    }
    gradient += vec3(dx[i], wx[i], wx[i]) * sheet;
  }
  return gradient / spacing;
}

// Distances at which a ray enters and leaves the grid, and the axes of these faces.
void throughGrid(vec3 place, vec3 along, out float near, out float far, out int faceIn, out int faceOut) {
  near = -FAR; far = FAR; faceIn = 0; faceOut = 0;
  for (int axis = 0; axis < 3; axis++) {
    if (along[axis] == 0.0) {
      if (place[axis] < 0.0 || place[axis] > float(cells[axis])) far = -FAR;
      continue;
    }
    float a = -place[axis] / along[axis], b = (float(cells[axis]) - place[axis]) / along[axis];
    if (min(a, b) > near) { near = min(a, b); faceIn = axis; }
    if (max(a, b) < far) { far = max(a, b); faceOut = axis; }
  }
}

int layerOf(float value) {
  int layer = 0;
  while (layer + 1 < layers && value > levels[layer + 1]) layer++;
  return layer;
}

// First distance after start at which the field leaves an interval, between two samples, then by Illinois' method;
// side is 1 above it, -1 below, 0 if it does not.
float leaveInterval(vec3 place, vec3 along, float start, float stop, float below, float above, out int side) {
  side = 0;
  float speed = length(along);
  // Near the surface steps are short, so that no ray enters and leaves the layer between two samples; h: the next one.
  float shortest = 0.12 / speed, h = 0.01 / speed;
  float a = start, valueA = 0.0;
  bool known = false;
  vec3 over = vec3(1.0) / mix(along, vec3(1e-20), vec3(equal(along, vec3(0.0))));
  for (int n = 0; n < MAX_STEPS && a < stop; n++) {
    vec3 at = place + a * along;
    ivec3 block = clamp(ivec3(floor(at + 1e-4 * along / speed)), ivec3(0), cells - 1) / BLOCK;
    vec2 range = texelFetch(ranges, block.zyx, 0).rg;
    vec3 low = vec3(block * BLOCK), high = low + float(BLOCK);
    vec3 outs = (mix(low, high, vec3(greaterThan(along, vec3(0.0)))) - place) * over;
    outs = mix(outs, vec3(FAR), vec3(equal(along, vec3(0.0))));
    float leave = max(min(outs.x, min(outs.y, outs.z)), a + 1e-3 / speed);
    if (range.x > below && range.y < above) {
      a = leave;
      known = false;
      continue;
    }
    float b = min(min(a + h, leave + 1e-3 / speed), stop);
    float valueB = valueAt(place + b * along);
    if (valueB > below && valueB < above) {
      // The field differs by less than the range of coefficients from node to node.
      float safe = min(valueB - below, above - valueB) / (1.75 * (range.y - range.x) * speed);
      h = max(safe, min(2.0 * h, shortest));
      a = b; valueA = valueB; known = true;
      continue;
    }
    side = valueB >= above ? 1 : -1;
    float target = side > 0 ? above : below;
    if (!known) valueA = a == start ? target : valueAt(place + a * along);
    float fa = valueA - target, fb = valueB - target;
    // On the surface itself the ray starts inside.
    if (fa * fb >= 0.0) fa = -1e-3 * fb;
    for (int turn = 0; turn < 16; turn++) {
      float c = clamp((a * fb - b * fa) / (fb - fa), a, b);
      float fc = valueAt(place + c * along) - target;
      if (fc * fb < 0.0) { a = b; fa = fb; } else fa *= 0.5;
      b = c; fb = fc;
      if (fc == 0.0 || abs(b - a) * speed < 1e-6) break;
    }
    return b;
  }
  return stop;
}

vec3 axisOf(int face) {
  return vec3(face == 0, face == 1, face == 2);
}

bool refracted(inout vec3 direction, vec3 normal, float ratio) {
  float along = dot(direction, normal), cosine = abs(along);
  float passed = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
  direction = passed < 0.0
    ? direction - 2.0 * along * normal
    : ratio * direction + (sqrt(passed) - ratio * cosine) * (along < 0.0 ? -1.0 : 1.0) * normal;
  direction = normalize(direction);
  return passed >= 0.0;
}

vec3 normalOf(vec3 gradient, vec3 direction) {
  float size = length(gradient);
  return size == 0.0 ? direction : gradient / size;
}

vec3 shaded(vec3 normal, vec3 direction) {
  float along = dot(direction, normal), facing = along > 0.0 ? -1.0 : 1.0;
  float cosine = facing * dot(towards, normal);
  float diffuse = 0.0, specular = 0.0;
  if (cosine > 0.0) {
    float mirrored = 2.0 * along * facing * cosine - dot(direction, towards);
    diffuse = 0.7 * cosine;
    specular = 0.2 * pow(max(-mirrored, 0.0), 20.0);
  }
  return min(vec3(220.0, 200.0, 160.0) * (0.1 + diffuse) + 255.0 * specular, 255.0);
}

vec3 behind(vec3 origin, vec3 direction) {
  float across = dot(direction, frame[2]), s = (beyond - dot(origin, frame[2])) / across;
  if (across == 0.0 || !(s > 0.0)) return BEYOND;
  vec3 point = origin + s * direction;
  vec2 place = floor(vec2(dot(point, frame[0]), dot(point, frame[1])) / square + 1024.0);
  return vec3(mod(place.x + place.y, 2.0) == 0.0 ? 255.0 : 40.0);
}

vec3 followed(vec3 origin, vec3 direction) {
  bool entered = false;
  int layer = 0;
  for (int crossed = 0; ; ) {
    vec3 place = origin / spacing + 0.5 * vec3(cells), along = direction / spacing;
    float near, far;
    int faceIn, faceOut, side;
    throughGrid(place, along, near, far, faceIn, faceOut);
    float start = entered ? 0.0 : max(near, 0.0);
    if (!entered) {
      if (!(far > start)) { if (lit) return BEYOND; break; }
      entered = true;
      layer = layerOf(valueAt(place + start * along));
      if (!lit && layer != around && near >= 0.0) {
        origin += start * direction;
        crossed++;
        if (!refracted(direction, axisOf(faceIn), indices[around] / indices[layer])) break;
        continue;
      }
    }
    float s = leaveInterval(place, along, start, far, levels[layer], levels[layer + 1], side);
    if (lit) return side == 0 ? BEYOND : shaded(-normalOf(gradientAt(place + s * along), direction), direction);
    if (side == 0 && layer == around) break;
    if (crossed == depth) return BEYOND;
    origin += s * direction;
    vec3 normal = side == 0 ? axisOf(faceOut) : normalOf(gradientAt(place + s * along), direction);
    int next = side == 0 ? around : layer + side;
    crossed++;
    if (refracted(direction, normal, indices[layer] / indices[next])) {
      layer = next;
      if (side == 0) break;
    }
  }
  return behind(origin, direction);
}

void main() {
  vec2 place = vec2(gl_FragCoord.x, pixels.y - gl_FragCoord.y) / pixels - 0.5;
  vec3 origin = frame[0] * place.x * field.x + frame[1] * place.y * field.y - away * frame[2];
  colour = vec4(floor(followed(origin, frame[2]) + 0.5) / 255.0, 1.0);
}
