// The world as three.js draws it: sky, ground, the map's meshes and the sun's shadows.
const SUN = new THREE.Vector3(-.52, -.44, .73).normalize();
const SHADOW_SIZE = 2048, STILL = 1, MOVING = 2;
const FAR_GROUND = 30000, SMALL_REACH = 350, DETAIL_REACH = 60;
// Solids, of which only the outside is drawn. What stands up is drawn before the ground that it hides.
const CLOSED = /^(sidewalk|walking_area|island|building|signal|tree)(?!\/(leaves|shelter\/glass))/;
const STANDS = /^(building|signal|tree)/;
const uniforms = {
  eye: { value: new THREE.Vector3() }, sun: { value: SUN }, shadowMatrix: { value: null },
  stillShadows: { value: null }, movingShadows: { value: null }, hasMoving: { value: false },
  lens: { value: 600 }, shadowBias: { value: .0005 }, haze: { value: 60 }
};
const linear = c => { c /= 255; return c <= .04045 ? c / 12.92 : ((c + .055) / 1.055) ** 2.4; };

async function unpack() {
  const text = atob(document.getElementById("data").textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const value = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const types = {
    int8: Int8Array, uint8: Uint8Array, int16: Int16Array, uint16: Uint16Array,
    int32: Int32Array, uint32: Uint32Array, float32: Float32Array
  };
  return { value, array: ([kind, start, count]) => new types[kind](buffer, 4 + length + start, count) };
}

// [coarse, fine]: without a graphics card, what moves is drawn without the finer textures.
function bothMaterials(options) {
  return [{}, { FINE: "" }].map(defines => new THREE.RawShaderMaterial({ glslVersion: THREE.GLSL3, defines, ...options }));
}

function surfaceMaterials(record) {
  const paint = record.surface === "paint", glass = record.surface === "glass";
  const sides = CLOSED.test(record.name) ? {} : { side: THREE.DoubleSide };
  return bothMaterials({
    vertexShader: surfaceVertex(record.surface), fragmentShader: surfaceFragment(record.surface),
    uniforms: { ...uniforms, colour: { value: new THREE.Vector3(...record.colour.map(linear)) } },
    ...sides, transparent: glass, depthWrite: !glass,
    // From kilometres away its centimetre above the road is lost in rounding.
    polygonOffset: paint, polygonOffsetFactor: -1, polygonOffsetUnits: -16
  });
}

function makeMesh(record, array, materials) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(array(record.positions), 4));
  geometry.setAttribute("normal", new THREE.BufferAttribute(array(record.normals), 4, true));
  if (record.spans) geometry.setAttribute("spans", new THREE.BufferAttribute(array(record.spans), 4));
  geometry.setIndex(new THREE.BufferAttribute(array(record.faces), 1));
  if (!materials.has(record.name)) materials.set(record.name, surfaceMaterials(record));
  const mesh = new THREE.Mesh(geometry);
  mesh.userData.materials = materials.get(record.name);
  mesh.position.set(...record.origin);
  mesh.scale.set(...record.scale);
  mesh.name = record.name;
  mesh.updateMatrixWorld();
  mesh.matrixAutoUpdate = false;
  geometry.computeBoundingBox();
  const box = mesh.userData.box = geometry.boundingBox.clone().applyMatrix4(mesh.matrixWorld);
  if (/^(tree|signal|building\/|marking|stop_line|arrow|crossing)/.test(record.name))
    mesh.userData.reach = /\/(leaves|tyre)$/.test(record.name) ? DETAIL_REACH : SMALL_REACH;
  if (STANDS.test(record.name)) mesh.renderOrder = -1;
  if (box.max.z - box.min.z > 4 || STANDS.test(record.name)) mesh.layers.enable(STILL);
  return mesh;
}

function makeSky() {
  const sky = new THREE.Mesh(new THREE.PlaneGeometry(2, 2));
  sky.userData.materials = bothMaterials({ vertexShader: SKY_VERTEX, fragmentShader: SKY_FRAGMENT, uniforms, depthWrite: false });
  sky.frustumCulled = false;
  sky.renderOrder = 5;  // After what is opaque, so that only open sky is computed.
  return sky;
}

// Ground beyond the map's own, to the horizon.
function makeFarGround(low, colour) {
  const geometry = new THREE.BufferGeometry(), rings = [], faces = [];
  for (const radius of [300, 1000, 3000, 9000, FAR_GROUND])
    for (let k = 0; k < 48; k++) rings.push(radius * Math.cos(k * Math.PI / 24), radius * Math.sin(k * Math.PI / 24), 0, 0);
  const count = rings.length / 4;
  rings.push(0, 0, 0, 0);
  for (let k = 0; k < 48; k++) {
    const next = (k + 1) % 48;
    faces.push(count, k, next);
    for (let r = 0; r < 4; r++) {
      const a = 48 * r + k, b = 48 * r + next;
      faces.push(a, a + 48, b + 48, a, b + 48, b);
    }
  }
  const normals = new Int8Array(rings.length).map((_, i) => i % 4 === 2 ? 127 : 0);
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(rings), 4));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 4, true));
  geometry.setIndex(faces);
  const mesh = new THREE.Mesh(geometry);
  mesh.userData.materials = surfaceMaterials({ surface: "grass", colour });
  mesh.position.z = low;
  mesh.frustumCulled = false;
  mesh.renderOrder = 4;
  mesh.name = "terrain";
  return mesh;
}

function depthMaterial(vertexShader) {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader, fragmentShader: SHADOW_FRAGMENT, side: THREE.DoubleSide, colorWrite: false
  });
}

// What the sun sees around a place, kept until the place is far from there.
class Shadows {
  constructor(renderer, scene, isSoftware) {
    this.renderer = renderer;
    this.scene = scene;
    this.camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 1, 2);
    this.camera.up.set(0, 0, 1);
    this.filter = isSoftware ? THREE.NearestFilter : THREE.LinearFilter;
    this.still = this.target();
    this.moving = this.target();
    this.material = depthMaterial(SHADOW_VERTEX);
    uniforms.stillShadows.value = this.still.depthTexture;
    uniforms.movingShadows.value = this.moving.depthTexture;
    uniforms.shadowMatrix.value = this.camera.projectionMatrix.clone();
    this.centre = null;
    this.reach = 0;
    this.draw(this.moving, MOVING, this.material);  // Even an empty one has to be there.
  }

  target() {
    const depthTexture = new THREE.DepthTexture(SHADOW_SIZE, SHADOW_SIZE, THREE.UnsignedIntType);
    depthTexture.compareFunction = THREE.LessEqualCompare;
    depthTexture.minFilter = depthTexture.magFilter = this.filter;
    return new THREE.WebGLRenderTarget(SHADOW_SIZE, SHADOW_SIZE, { depthTexture });
  }

  // `eye` and what it looks at; true if the still shadows were drawn anew.
  follow(eye, at) {
    const away = eye.distanceTo(at), reach = Math.min(900, Math.max(110, 1.5 * away));
    const centre = eye.clone().lerp(at, .8).setZ(at.z);
    if (this.centre && centre.distanceTo(this.centre) < .25 * this.reach && reach < 1.5 * this.reach && reach > .4 * this.reach)
      return false;
    this.centre = centre;
    this.reach = reach;
    const camera = this.camera;
    Object.assign(camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 1, far: 4 * reach + 400 });
    camera.position.copy(centre).addScaledVector(SUN, 2 * reach + 200);
    camera.lookAt(centre);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    uniforms.shadowBias.value = (.1 + reach / 1000) / camera.far;
    uniforms.shadowMatrix.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    this.draw(this.still, STILL, this.material);
    return true;
  }

  draw(target, layer, material) {
    this.camera.layers.set(layer);
    this.scene.overrideMaterial = material;
    this.renderer.setRenderTarget(target);
    this.renderer.clear();
    this.renderer.render(this.scene, this.camera);
    this.renderer.setRenderTarget(null);
    this.scene.overrideMaterial = null;
  }
}

// A mesh of triangles over the ground: x, y, z of each corner, and its red, green, blue and alpha.
function flatMesh(triangles, tints) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(triangles), 3));
  geometry.setAttribute("tint", new THREE.BufferAttribute(new Uint8Array(tints), 4, true));
  const mesh = new THREE.Mesh(geometry, new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader: FLAT_VERTEX, fragmentShader: FLAT_FRAGMENT, transparent: true,
    depthWrite: false, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -40
  }));
  mesh.frustumCulled = false;
  mesh.renderOrder = 8;
  return mesh;
}

// A band along a line of centimetres, as triangles in metres; with `arrow` its end is one.
function band(line, half, lift, arrow) {
  const points = [];
  for (let i = 0; i < line.length; i += 3) {
    const point = [line[i] / 100, line[i + 1] / 100, line[i + 2] / 100 + lift], last = points[points.length - 1];
    if (!last || Math.hypot(point[0] - last[0], point[1] - last[1]) > .02) points.push(point);
  }
  if (points.length < 2) return [];
  const head = arrow ? Math.min(2.4, .4 * lengthOf(points)) : 0, tip = points[points.length - 1];
  if (head) shorten(points, head);
  const sides = points.map((point, i) => {
    const a = points[Math.max(0, i - 1)], b = points[Math.min(points.length - 1, i + 1)];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    return [-(b[1] - a[1]) / length * half, (b[0] - a[0]) / length * half];
  });
  const at = (i, side, wide = 1) => [points[i][0] + side * wide * sides[i][0], points[i][1] + side * wide * sides[i][1], points[i][2]];
  const found = [];
  for (let i = 0; i + 1 < points.length; i++)
    found.push(...at(i, 1), ...at(i, -1), ...at(i + 1, -1), ...at(i, 1), ...at(i + 1, -1), ...at(i + 1, 1));
  if (head) found.push(...at(points.length - 1, 1, 2.6), ...at(points.length - 1, -1, 2.6), ...tip);
  return found;
}

function lengthOf(points) {
  let length = 0;
  for (let i = 1; i < points.length; i++) length += Math.hypot(...points[i].map((v, k) => v - points[i - 1][k]));
  return length;
}

function shorten(points, by) {
  while (points.length > 1) {
    const end = points[points.length - 1], before = points[points.length - 2];
    const length = Math.hypot(...end.map((v, k) => v - before[k]));
    if (length > by || points.length === 2) {
      const share = Math.min(.95, by / length);
      points[points.length - 1] = end.map((v, k) => v + share * (before[k] - v));
      return;
    }
    points.pop();
    by -= length;
  }
}
