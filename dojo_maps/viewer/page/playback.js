// A recorded episode: everybody between two instants, as instances of their models.
const DETAILED = 55;

class Playback {
  constructor(value, array, view) {
    this.view = view;
    this.times = value.times;
    this.ids = value.ids;
    this.signals = value.signals;
    this.states = value.states;
    this.shown = array(value.shown);
    for (const name of ["counts", "users", "places", "headings", "slopes", "poses", "lights", "sizes"]) this[name] = array(value[name]);
    this.starts = [0];
    for (const count of this.counts) this.starts.push(this.starts[this.starts.length - 1] + count);
    this.row = new Int32Array(this.ids.length);
    this.materials = this.makeMaterials(value, array(value.colours));
    this.batches = value.models.map(levels => levels.map(level => this.makeBatch(array(level[0]), array(level[1]))));
    uniforms.hasMoving.value = true;
  }

  makeMaterials(value, colours) {
    const rows = Math.max(1, Math.ceil(colours.length / 3 / 1024)), pixels = new Uint8Array(4 * 1024 * rows);
    for (let i = 0; i < colours.length / 3; i++) pixels.set([...colours.subarray(3 * i, 3 * i + 3), 255], 4 * i);
    const texture = new THREE.DataTexture(pixels, 1024, rows);
    texture.needsUpdate = true;
    const parts = value.palette.length;
    return bothMaterials({
      vertexShader: userVertex(parts), fragmentShader: USER_FRAGMENT, side: THREE.DoubleSide,
      uniforms: {
        ...uniforms, colours: { value: texture }, ownColours: { value: value.ownColours },
        palette: { value: value.palette.map(colour => new THREE.Vector3(...colour.map(linear))) },
        own: { value: value.own }, lamp: { value: value.lit }
      }
    });
  }

  makeBatch(corners, faces) {
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 4));
    geometry.setIndex(new THREE.BufferAttribute(faces, 1));
    const mesh = new THREE.Mesh(geometry);
    mesh.userData.materials = this.materials;
    mesh.frustumCulled = false;
    mesh.layers.enable(MOVING);
    mesh.userData.layer = "traffic";
    mesh.visible = false;
    return { geometry, mesh, count: 0, room: 0 };
  }

  grow(batch) {
    batch.room = Math.max(8, 2 * batch.room);
    for (const [name, width] of [["where", 4], ["turned", 4], ["size", 3]]) {
      const attribute = new THREE.InstancedBufferAttribute(new Float32Array(width * batch.room), width);
      const old = batch.geometry.attributes[name];
      if (old) attribute.array.set(old.array);
      batch.geometry.setAttribute(name, attribute);
    }
    if (!batch.mesh.parent) this.view.add(batch.mesh);
  }

  get begin() { return this.times[0]; }
  get end() { return this.times[this.times.length - 1]; }

  instant(time) {
    let low = 0, high = this.times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time) low = middle; else high = middle - 1;
    }
    return low;
  }

  signalColumn(id) { return this.signals.indexOf(id); }

  signalState(column, time) { return this.states[this.shown[this.instant(time) * this.signals.length + column]] ?? ""; }

  present(time) { return this.counts[this.instant(time)]; }

  show(time) {
    const k = this.instant(time), next = Math.min(k + 1, this.times.length - 1);
    const share = next === k ? 0 : Math.min(1, (time - this.times[k]) / (this.times[next] - this.times[k]));
    for (const levels of this.batches) for (const batch of levels) batch.count = 0;
    this.row.fill(-1);
    for (let r = this.starts[next]; r < this.starts[next + 1]; r++) this.row[this.users[r]] = r;
    const eye = this.view.camera.position;
    for (let r = this.starts[k]; r < this.starts[k + 1]; r++) this.place(r, this.row[this.users[r]], share, eye);
    for (const levels of this.batches) for (const { geometry, mesh, count } of levels) {
      mesh.visible = count > 0 && !this.hidden;
      geometry.instanceCount = count;
      if (count) for (const name of ["where", "turned", "size"]) geometry.attributes[name].needsUpdate = true;
    }
  }

  place(r, s, share, eye) {
    if (s < 0) { if (share > .5) return; s = r; }
    const p = this.places, x = (p[3 * r] + share * (p[3 * s] - p[3 * r])) / 100, y = (p[3 * r + 1] + share * (p[3 * s + 1] - p[3 * r + 1])) / 100;
    const z = (p[3 * r + 2] + share * (p[3 * s + 2] - p[3 * r + 2])) / 100;
    // The shorter way round.
    const turn = ((this.headings[s] - this.headings[r] + 98304) % 65536 - 32768) * share;
    const heading = (this.headings[r] + turn) * Math.PI / 32768;
    const away = Math.hypot(x - eye.x, y - eye.y, z - eye.z), user = this.users[r];
    const batch = this.batches[this.poses[share > .5 ? s : r]][away < DETAILED ? 0 : 1];
    if (batch.count === batch.room) this.grow(batch);
    const i = batch.count++, { where, turned, size } = batch.geometry.attributes;
    where.array.set([x, y, z, this.lights[r]], 4 * i);
    turned.array.set([Math.cos(heading), Math.sin(heading), this.slopes[r] / 200, user], 4 * i);
    size.array.set(this.sizes.subarray(3 * user, 3 * user + 3), 3 * i);
  }

  // The id of the road user at a place of the ground, by where it was at the last instant; null for none.
  near(x, y, time) {
    const k = this.instant(time);
    for (let r = this.starts[k]; r < this.starts[k + 1]; r++) {
      const user = this.users[r], heading = this.headings[r] * Math.PI / 32768, [length, width] = this.sizes.subarray(3 * user, 3 * user + 2);
      const dx = x - this.places[3 * r] / 100, dy = y - this.places[3 * r + 1] / 100;
      const along = dx * Math.cos(heading) + dy * Math.sin(heading), aside = Math.abs(dy * Math.cos(heading) - dx * Math.sin(heading));
      if (along < .6 && along > -length - .6 && aside < width / 2 + .5) return this.ids[user];
    }
    return null;
  }

  drawShadows(shadows) {
    this.shadowMaterial ??= depthMaterial(USER_SHADOW_VERTEX);
    shadows.draw(shadows.moving, MOVING, this.shadowMaterial);
  }
}
