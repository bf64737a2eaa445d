// The part of three.js that the page uses. README.md says how three.min.js is made of it.
export {
  AdditiveBlending, BufferAttribute, BufferGeometry, DataTexture, DepthTexture, DoubleSide, GLSL3,
  InstancedBufferAttribute, InstancedBufferGeometry, LessEqualCompare, LinearFilter, LinearSRGBColorSpace,
  Mesh, NearestFilter, OrthographicCamera, PerspectiveCamera, PlaneGeometry, Points, RawShaderMaterial,
  Raycaster, Scene, UnsignedIntType, Vector2, Vector3, WebGLRenderTarget, WebGLRenderer
} from "three";
export { MapControls } from "three/addons/controls/MapControls.js";
