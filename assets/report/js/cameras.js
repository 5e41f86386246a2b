// Cameras as frusta. A pose is camera_from_world, three rows of four; x is right, y down, z forward.

/** Depth of a frustum, in diagonals of the object. */
const FRUSTUM_DEPTH = 0.14;

/** From a camera's coordinates to the world's: Rᵀ (x − t). */
function toWorld(pose, [x, y, z]) {
  const [a, b, c] = [x - pose[3], y - pose[7], z - pose[11]];
  return [0, 1, 2].map((i) => pose[i] * a + pose[4 + i] * b + pose[8 + i] * c);
}

const cameraCenter = (pose) => toWorld(pose, [0, 0, 0]);

/** Ends of a frustum's edges: four from the centre, four around the picture, two of the mark above it. */
function frustum(pose, focal, { size, center }) {
  const corner = (u, v) =>
    toWorld(pose, [
      ((u - center[0]) / focal[0]) * FRUSTUM_DEPTH,
      ((v - center[1]) / focal[1]) * FRUSTUM_DEPTH,
      FRUSTUM_DEPTH,
    ]);
  const [w, h] = size;
  const apex = cameraCenter(pose);
  const corners = [corner(0, 0), corner(w, 0), corner(w, h), corner(0, h)];
  const mark = [corner(0.35 * w, -0.06 * h), corner(0.5 * w, -0.25 * h), corner(0.65 * w, -0.06 * h)];
  const around = corners.flatMap((point, i) => [point, corners[(i + 1) % 4]]);
  const rays = corners.flatMap((point) => [apex, point]);
  return [...rays, ...around, mark[0], mark[1], mark[1], mark[2]].flat();
}

const FRUSTUM_VALUES = 20 * 3;

/** All frusta, one after the other, and then the path through their centres. */
function frusta(poses, focal, report) {
  const centers = poses.map(cameraCenter);
  const path = centers.slice(1).flatMap((center, i) => [...centers[i], ...center]);
  return new Float32Array([...poses.flatMap((pose) => frustum(pose, focal, report)), ...path]);
}

/** The vertical field of view, in degrees. */
const fieldOfView = (height, focal) => (2 * Math.atan(height / (2 * focal)) * 180) / Math.PI;
