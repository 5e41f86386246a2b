// A cloud as discs that face the viewer.

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

/** As many points as hold `nValues` coordinates; each is so wide that neighbours on a surface overlap. */
function makePoints(nValues, opacity) {
  const geometry = new THREE.BufferGeometry();
  const colors = new Uint8Array((nValues / 3) * 4).fill(255);
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(nValues), 3));
  geometry.setAttribute('color', new THREE.BufferAttribute(colors, 4, true));
  const diameter = 2.3 / Math.sqrt(nValues / 3);
  const uniforms = { diameter: { value: diameter }, pixelsPerUnit: { value: 1 }, opacity: { value: opacity } };
  const material = new THREE.ShaderMaterial({ ...POINT_SHADERS, uniforms, transparent: opacity < 1 });
  const points = new THREE.Points(geometry, material);
  points.frustumCulled = false;
  return points;
}
