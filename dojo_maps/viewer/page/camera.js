// Where the eye is and how it moves; when pictures are drawn, and how finely.
const FIELD = 50, SLOW_FRAME = 55, REST = 350;

// Whether the processor draws, as on machines without a graphics card.
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

class View {
  constructor(canvas, bounds) {
    this.isSoftware = isSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, powerPreference: "high-performance", antialias: !this.isSoftware });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD, 1, .5, FAR_GROUND);
    this.camera.up.set(0, 0, 1);
    this.bounds = bounds;
    this.size = Math.max(60, Math.hypot(bounds[2] - bounds[0], bounds[3] - bounds[1]));
    this.controls = new THREE.MapControls(this.camera, canvas);
    Object.assign(this.controls, {
      enableDamping: false, screenSpacePanning: false, zoomToCursor: true, minDistance: 2,
      maxDistance: 4 * this.size, maxPolarAngle: .495 * Math.PI, keyPanSpeed: 40
    });
    this.controls.addEventListener("change", () => this.request());
    this.shadows = new Shadows(this.renderer, this.scene, this.isSoftware);
    this.beforeDraw = [];
    this.afterDraw = [];
    this.ratio = 1;
    this.isFine = false;
    this.frames = 0;
    this.pending = this.isResting = false;
    this.rest = 0;
    this.flight = null;
    addEventListener("resize", () => this.resize());
  }

  resize() {
    this.camera.aspect = innerWidth / innerHeight;
    this.camera.updateProjectionMatrix();
    this.setRatio(this.ratio);
    this.request();
  }

  setRatio(ratio) {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(innerWidth, innerHeight, false);
  }

  look(eye, at) {
    this.flight = null;
    this.camera.position.set(...eye);
    this.controls.target.set(...at);
    this.controls.update();
    this.request();
  }

  fly(eye, at) {
    if (this.isSoftware || matchMedia("(prefers-reduced-motion: reduce)").matches) return this.look(eye, at);
    this.flight = {
      from: [this.camera.position.clone(), this.controls.target.clone()],
      to: [new THREE.Vector3(...eye), new THREE.Vector3(...at)], start: performance.now()
    };
    this.request();
  }

  flyTo(x, y, z, away = 55) {
    const back = this.camera.position.clone().sub(this.controls.target).setZ(0);
    if (back.lengthSq() < 1) back.set(0, -1, 0);
    back.normalize().multiplyScalar(.78 * away);
    this.fly([x + back.x, y + back.y, z + .62 * away], [x, y, z]);
  }

  // From the south, so near that all corners of the map are just within the picture.
  showAll() {
    const [west, south, east, north] = this.bounds, x = (west + east) / 2, y = (south + north) / 2, wide = Math.tan(FIELD * Math.PI / 360);
    const sine = Math.sin(.9), cosine = Math.cos(.9);
    let away = 30;
    for (const [dx, dy] of [[west - x, south - y], [east - x, south - y], [west - x, north - y], [east - x, north - y]]) {
      const depth = -dy * cosine, up = Math.abs(dy * sine) / wide, aside = Math.abs(dx) / wide / this.camera.aspect;
      away = Math.max(away, depth + 1.3 * up, depth + 1.1 * aside);
    }
    this.fly([x, y - cosine * away, sine * away], [x, y, 0]);
  }

  faceNorth() {
    const at = this.controls.target, eye = this.camera.position, across = Math.hypot(eye.x - at.x, eye.y - at.y);
    this.fly([at.x, at.y - Math.max(.01, across), eye.z], [at.x, at.y, at.z]);
  }

  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(now => this.frame(now));
  }

  frame(now) {
    this.pending = false;
    this.advanceFlight(now);
    let moving = this.flight !== null;
    for (const each of this.beforeDraw) moving = each(now) || moving;
    const fine = this.isResting && !moving;
    this.isResting = false;
    this.measure(now);
    this.draw(fine ? this.finest() : this.ratio, fine);
    clearTimeout(this.rest);
    if (moving) this.request();
    else if (!fine) this.rest = setTimeout(() => { this.isResting = true; this.request(); }, REST);
  }

  advanceFlight(now) {
    if (!this.flight) return;
    const { from, to, start } = this.flight, share = Math.min(1, (now - start) / 900), ease = share * share * (3 - 2 * share);
    this.camera.position.lerpVectors(from[0], to[0], ease);
    this.controls.target.lerpVectors(from[1], to[1], ease);
    this.controls.update();
    if (share === 1) this.flight = null;
  }

  // What rests is drawn as finely as it can be shown; on a processor alone, smoothed by drawing it larger.
  finest() {
    return this.isSoftware ? Math.max(1.5, Math.min(2, devicePixelRatio)) : Math.min(2, devicePixelRatio);
  }

  // Pictures in a row tell how fast they can be drawn.
  measure(now) {
    const took = now - (this.lastFrame ?? now);
    this.lastFrame = now;
    if (took <= 0 || took > 250) return;
    this.average = .8 * (this.average ?? took) + .2 * took;
    const most = Math.min(this.isSoftware ? 1 : 2, devicePixelRatio);
    if (this.average > SLOW_FRAME) this.ratio = Math.max(.4, .85 * this.ratio);
    else if (this.average < SLOW_FRAME / 2) this.ratio = Math.min(most, 1.1 * this.ratio);
  }

  draw(ratio, fine) {
    if (Math.abs(this.renderer.getPixelRatio() - ratio) > .05) this.setRatio(ratio);
    const eye = this.camera.position, away = eye.distanceTo(this.controls.target);
    this.camera.near = Math.max(.4, .02 * away, .25 * (eye.z - 80));
    this.camera.far = Math.max(4000, 12 * away, 2 * this.size);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    uniforms.eye.value.copy(eye);
    uniforms.haze.value = Math.max(60, 1.6 * away);
    this.setFine(fine || !this.isSoftware);
    uniforms.lens.value = this.renderer.domElement.height / 2 / Math.tan(FIELD * Math.PI / 360);
    if (this.shadows.follow(eye, this.controls.target)) this.onShadows?.();
    if (this.isSoftware) this.leaveOut(fine);
    this.renderer.render(this.scene, this.camera);
    this.frames++;
    for (const each of this.afterDraw) each();
  }

  // What is small and far is not drawn while something moves.
  leaveOut(fine) {
    for (const mesh of this.scene.children) if (mesh.userData.reach) {
      const isShown = fine || mesh.userData.box.distanceToPoint(this.camera.position) < mesh.userData.reach;
      if (isShown) mesh.layers.enable(0); else mesh.layers.disable(0);
    }
  }

  add(mesh) {
    mesh.material = mesh.userData.materials[this.isFine ? 1 : 0];
    this.scene.add(mesh);
  }

  setFine(fine) {
    if (fine === this.isFine) return;
    this.isFine = fine;
    for (const mesh of this.scene.children) if (mesh.userData.materials) mesh.material = mesh.userData.materials[fine ? 1 : 0];
  }

  // Pixels from the window's corner, or null for what is behind the eye.
  project(x, y, z) {
    const p = new THREE.Vector3(x, y, z).project(this.camera);
    return p.z > 1 ? null : [(p.x + 1) / 2 * innerWidth, (1 - p.y) / 2 * innerHeight];
  }

  metresPerPixel() {
    return 2 * this.camera.position.distanceTo(this.controls.target) * Math.tan(FIELD * Math.PI / 360) / innerHeight;
  }
}
