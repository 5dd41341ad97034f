export {
  BufferAttribute, BufferGeometry, DoubleSide, GLSL3, LineSegments, Mesh, PerspectiveCamera, Points, RawShaderMaterial, Scene, Sphere,
  Vector2, Vector3, Vector4, WebGLRenderer,
} from 'three';
export { TrackballControls } from 'three/examples/jsm/controls/TrackballControls.js';
