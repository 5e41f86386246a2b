// The cloud and the cameras in 3D.

/** How long the cloud takes from one snapshot to the next, in milliseconds. */
const TRANSITION = 320;
const FIELD_OF_VIEW = 35;

const POINT_SHADERS = {
  vertexShader: `
    attribute vec4 color;
    uniform float diameter;
    uniform float pixelsPerUnit;
    varying vec3 tint;
    varying float depth;
    void main() {
      vec4 inCamera = modelViewMatrix * vec4(position, 1.0);
      depth = -inCamera.z - length(modelViewMatrix[3].xyz);
      tint = color.rgb;
      gl_PointSize = max(diameter * pixelsPerUnit / -inCamera.z, 1.5);
      // A surface that is seen hides points that lie behind it by less than the cloud tells.
      inCamera.xyz *= 1.0 + (1.0 - color.a) * 1.5 * diameter / -inCamera.z;
      gl_Position = projectionMatrix * inCamera;
    }`,
  fragmentShader: `
    uniform float opacity;
    varying vec3 tint;
    varying float depth;
    void main() {
      vec2 fromCenter = gl_PointCoord - 0.5;
      if (dot(fromCenter, fromCenter) > 0.25) discard;
      gl_FragColor = vec4(tint * mix(1.0, 0.62, smoothstep(-0.4, 0.5, depth)), opacity);
    }`,
};

class Scene3D {
  constructor(canvas, report) {
    this.canvas = canvas;
    this.report = report;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { minDistance: 0.2, maxDistance: 30, enableDamping: true });
    this.controls.addEventListener('change', () => this.requestRender());
    this.controls.addEventListener('start', () => (this.viewpoint = null));

    const first = report.snapshots[0];
    this.cloud = this.addPoints(first.cloud.length, 1);
    this.cameras = this.addLines(frusta(first.poses, first.focal, report));
    this.selected = this.addLines(new Float32Array(FRUSTUM_VALUES));
    this.selected.renderOrder = 1;
    this.trueCameras = report.truth?.poses && this.addLines(frusta(report.truth.poses, first.focal, report));
    if (report.truth?.cloud) this.addTrueCloud(report.truth.cloud);
    this.frame = 0;
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  /** As many points as hold `n_values` coordinates; each about as wide as their spacing. */
  addPoints(nValues, opacity) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(nValues), 3));
    geometry.setAttribute('color', new THREE.BufferAttribute(new Uint8Array((nValues / 3) * 4).fill(255), 4, true));
    const diameter = 2.3 / Math.sqrt(nValues / 3);
    const uniforms = { diameter: { value: diameter }, pixelsPerUnit: { value: 1 }, opacity: { value: opacity } };
    const material = new THREE.ShaderMaterial({ ...POINT_SHADERS, uniforms, transparent: opacity < 1 });
    const points = new THREE.Points(geometry, material);
    points.frustumCulled = false;
    this.scene.add(points);
    return points;
  }

  addTrueCloud(values) {
    this.trueCloud = this.addPoints(values.length, 0.55);
    this.trueCloud.geometry.attributes.position.array.set(values);
    const { array } = this.trueCloud.geometry.attributes.color;
    for (let i = 0; i < array.length; i++) array[i] = i % 4 === 3 ? 255 : 128;
    this.trueCloud.visible = false;
  }

  addLines(values) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(values, 3));
    const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ transparent: true }));
    lines.frustumCulled = false;
    this.scene.add(lines);
    return lines;
  }

  /** Moves cloud and cameras to a snapshot. */
  show(snapshot, animate) {
    const goals = [
      [this.cloud.geometry.attributes.position, snapshot.cloud],
      [this.cameras.geometry.attributes.position, frusta(snapshot.poses, snapshot.focal, this.report)],
    ];
    this.motion = goals.map(([attribute, goal]) => ({ attribute, from: attribute.array.slice(), goal }));
    this.started = animate ? performance.now() : -Infinity;
    this.requestRender();
  }

  colorPoints(bytes) {
    const { color } = this.cloud.geometry.attributes;
    color.array.set(bytes);
    color.needsUpdate = true;
    this.requestRender();
  }

  selectFrame(frame) {
    this.frame = frame;
    this.markSelected();
    this.requestRender();
  }

  markSelected() {
    const { position } = this.selected.geometry.attributes;
    const start = this.frame * FRUSTUM_VALUES;
    position.array.set(this.cameras.geometry.attributes.position.array.subarray(start, start + FRUSTUM_VALUES));
    position.needsUpdate = true;
  }

  /** Colours of what is no point, as CSS has them now. */
  setTheme({ background, accent, strong, truth }) {
    this.scene.background = new THREE.Color(background);
    this.cameras.material.color.set(accent);
    this.selected.material.color.set(strong);
    this.trueCameras?.material.color.set(truth);
    this.requestRender();
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / Math.max(clientHeight, 1);
    this.refresh();
  }

  refresh() {
    this.camera.updateProjectionMatrix();
    const pixels = this.renderer.getDrawingBufferSize(new THREE.Vector2()).y;
    const pixelsPerUnit = pixels / (2 * Math.tan((this.camera.fov * Math.PI) / 360));
    for (const points of [this.cloud, this.trueCloud]) {
      if (points) points.material.uniforms.pixelsPerUnit.value = pixelsPerUnit;
    }
    this.requestRender();
  }

  requestRender() {
    this.pending ??= requestAnimationFrame((now) => {
      this.pending = null;
      this.advance(now);
      this.controls.update();
      this.fadeCameras();
      this.renderer.render(this.scene, this.camera);
    });
  }

  /** Frusta are not to be looked through: they vanish for a viewer who is near them, or looks along them. */
  fadeCameras() {
    const { array } = this.cameras.geometry.attributes.position;
    const eye = this.camera.position.clone().sub(this.controls.target);
    const apex = new THREE.Vector3();
    let opacity = 1;
    for (let i = 0; i < this.report.frames.length; i++) {
      apex.fromArray(array, i * FRUSTUM_VALUES).sub(this.controls.target);
      const beside = apex.angleTo(eye) / 0.3 - 0.6;
      const behind = eye.length() / apex.length() - 1.8;
      opacity = Math.min(opacity, Math.max(beside, behind, 0));
    }
    for (const lines of [this.cameras, this.selected, this.trueCameras]) {
      if (lines) lines.material.opacity = opacity;
    }
  }

  advance(now) {
    if (!this.motion) return;
    const time = Math.min(Math.max((now - this.started) / TRANSITION, 0), 1);
    const share = time * time * (3 - 2 * time);
    for (const { attribute, from, goal } of this.motion) {
      for (let i = 0; i < goal.length; i++) attribute.array[i] = from[i] + (goal[i] - from[i]) * share;
      attribute.needsUpdate = true;
    }
    this.markSelected();
    if (time === 1) this.motion = null;
    else this.requestRender();
  }
}
