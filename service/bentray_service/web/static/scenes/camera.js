// Cameras as the service has them, and the objects on the ground of a scene of geometry fields: where a camera sees a point of a picture.

// As in bentray_workers.rendering.field_scenes: what the camera looks at, m, its angle, and the objects with their sizes, m.
const VIEW_DEG = 38;
const FRAMINGS = {
  "mirror-ball": { centre: [0, 0.1, 0.55], radius: 1.6, objects: [["Object 1", -0.85, -0.45, 0.85], ["Object 2", 0.85, -0.45, 0.85], ["Ball", 0, 0.65, 1.5]] },
  "two-mirrors": { centre: [0, 0, 0.45], radius: 1.3, objects: [["Object 1", -0.6, 0.1, 1.1], ["Object 2", 0.6, -0.1, 1.1]] },
};

// The movable objects of a scene: { name, x, y, size }, in the order of positions_m.
export function objectsOf(scene) {
  return (FRAMINGS[scene]?.objects ?? []).map(([name, x, y, size]) => ({ name, x, y, size }));
}

const radians = (degrees) => (degrees * Math.PI) / 180;

// The axes of an object that are along x, y and z of the scene, by the one that is up; as in bentray_workers.rendering.up_axis.
const UPRIGHT = {
  z: ["x", "y", "z"], y: ["x", "-z", "y"], x: ["-z", "y", "x"], "-z": ["x", "-y", "-z"], "-y": ["x", "z", "-y"], "-x": ["z", "y", "-x"],
};

// Unit vectors to the right, down and ahead of a camera, in the axes of an object one of which is up.
export function frameOf(azimuthDeg, elevationDeg, up = "z") {
  const [a, e] = [radians(azimuthDeg), radians(elevationDeg)];
  const turned = (vector) => {
    const result = [0, 0, 0];
    UPRIGHT[up].forEach((axis, k) => (result["xyz".indexOf(axis.at(-1))] = axis.length > 1 ? -vector[k] : vector[k]));
    return result;
  };
  return {
    right: turned([-Math.sin(a), Math.cos(a), 0]),
    down: turned([Math.sin(e) * Math.cos(a), Math.sin(e) * Math.sin(a), -Math.cos(e)]),
    ahead: turned([-Math.cos(e) * Math.cos(a), -Math.cos(e) * Math.sin(a), -Math.sin(e)]),
  };
}

const plus = (a, b, by) => a.map((one, axis) => one + by * b[axis]);

// The eye of a camera, whose numbers may be the texts of a form, and the direction in which it sees a point of a square picture, u and v from -1/2 to
// 1/2 right and down.
function rayAt({ scene, azimuth_deg: azimuth, elevation_deg: elevation, zoom }, u, v) {
  const { centre, radius } = FRAMINGS[scene];
  const { right, down, ahead } = frameOf(azimuth, elevation);
  const wide = (2 * Math.tan(radians(VIEW_DEG / 2))) / zoom;
  return { eye: plus(centre, ahead, -radius / Math.sin(radians(VIEW_DEG / 2))), along: plus(plus(ahead, right, u * wide), down, v * wide) };
}

// The place at a height, m, that a point of the picture shows; null beyond the horizon.
export function placeAt(view, u, v, height) {
  const { eye, along } = rayAt(view, u, v);
  const far = (height - eye[2]) / along[2];
  return far > 0 && Number.isFinite(far) ? plus(eye, along, far).slice(0, 2) : null;
}

// The object nearest to the eye that a point of the picture shows, taken as balls; -1 for none.
export function objectAt(view, objects, u, v) {
  const { eye, along } = rayAt(view, u, v);
  const length = Math.hypot(...along);
  let found = -1;
  let nearest = Infinity;
  objects.forEach(({ x, y, size }, number) => {
    const to = [x - eye[0], y - eye[1], size / 2 - eye[2]];
    const far = to.reduce((sum, one, axis) => sum + one * along[axis], 0) / length;
    const apart = Math.sqrt(Math.max(0, to.reduce((sum, one) => sum + one * one, 0) - far * far));
    if (apart < size / 2 && far < nearest) [found, nearest] = [number, far];
  });
  return found;
}
