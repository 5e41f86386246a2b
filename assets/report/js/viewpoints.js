// Where the 3D view looks from.

const VIEWPOINTS = {
  /** The object, from where the camera was halfway. */
  object(scene, snapshot) {
    const middle = snapshot.poses[Math.floor(snapshot.poses.length / 2)];
    const center = new THREE.Vector3(...cameraCenter(middle)).normalize();
    const azimuth = Math.atan2(center.x, center.z);
    const elevation = Math.min(Math.max(Math.asin(center.y), 0.2), 0.6);
    const distance = 1.5 * widening(scene);
    return { position: spherical(azimuth, elevation, distance), target: [0, -0.05, 0] };
  },

  /** The object and all cameras, from across their path. */
  cameras(scene, snapshot) {
    const centers = snapshot.poses.map((pose) => new THREE.Vector3(...cameraCenter(pose)));
    const middle = centers.reduce((sum, c) => sum.add(c), new THREE.Vector3()).divideScalar(centers.length);
    const azimuth = Math.atan2(middle.x, middle.z) + 1.15;
    const halfWidth = 0.5 * middle.length() + 0.45;
    const halfHeight = Math.max(0.5 * Math.abs(middle.y) + 0.35, halfWidth / scene.camera.aspect);
    const distance = halfHeight / Math.tan((FIELD_OF_VIEW * Math.PI) / 360) + 0.3;
    const target = middle.multiplyScalar(0.5).toArray();
    const offset = spherical(azimuth, 0.35, distance);
    return { position: offset.map((x, i) => x + target[i]), target };
  },

  /** What the selected frame's camera sees. */
  frame(scene, snapshot) {
    const pose = snapshot.poses[scene.frame];
    const depth = Math.hypot(...cameraCenter(pose));
    const fov = fieldOfView(scene.report.size[1], snapshot.focal[1]);
    return { position: cameraCenter(pose), target: toWorld(pose, [0, 0, depth]), fov };
  },

  top(scene) {
    return { position: [0, 1.9 * widening(scene), 0.001], target: [0, 0, 0] };
  },
};

/** How much farther a camera must stand where a view is higher than wide. */
const widening = (scene) => Math.max(1, 1 / scene.camera.aspect);

function spherical(azimuth, elevation, distance) {
  const horizontal = distance * Math.cos(elevation);
  return [horizontal * Math.sin(azimuth), distance * Math.sin(elevation), horizontal * Math.cos(azimuth)];
}

/** Looks from there until the reader turns the view. */
function lookFrom(scene, viewpoint, snapshot) {
  scene.viewpoint = viewpoint;
  const { position, target, fov = FIELD_OF_VIEW } = VIEWPOINTS[viewpoint](scene, snapshot);
  scene.camera.position.set(...position);
  scene.controls.target.set(...target);
  scene.camera.fov = fov;
  scene.refresh();
}

/** Arrow keys turn the view, + and − move nearer and away. */
function turnByKeys(scene) {
  const { canvas, controls } = scene;
  const turns = {
    ArrowLeft: () => controls.rotateLeft(0.12),
    ArrowRight: () => controls.rotateLeft(-0.12),
    ArrowUp: () => controls.rotateUp(0.12),
    ArrowDown: () => controls.rotateUp(-0.12),
    '+': () => controls.dollyIn(0.9),
    '=': () => controls.dollyIn(0.9),
    '-': () => controls.dollyOut(0.9),
  };
  canvas.addEventListener('keydown', (event) => {
    if (!turns[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    scene.viewpoint = null;
    turns[event.key]();
    scene.requestRender();
  });
}
