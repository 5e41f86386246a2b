export { WebGLRenderer, Scene, PerspectiveCamera, BufferGeometry, BufferAttribute, Points, ShaderMaterial, LineSegments, LineBasicMaterial, Color, Vector2, Vector3 } from 'three';
export { OrbitControls } from 'three/addons/controls/OrbitControls.js';
