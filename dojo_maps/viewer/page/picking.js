// What is where on the map, by its outlines; and what is marked there.
const MARK = [255, 140, 0, 150];

function inRing(ring, x, y) {
  let inside = false;
  for (let i = 0, j = ring.length - 3; i < ring.length; j = i, i += 3) {
    const [ax, ay, bx, by] = [ring[i] / 100, ring[i + 1] / 100, ring[j] / 100, ring[j + 1] / 100];
    if ((ay > y) !== (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

// Metres from a place to a line of centimetres, up and aside, and how high the line is there.
function awayFrom(line, x, y) {
  let best = Infinity, height = 0;
  for (let i = 0; i + 5 < line.length; i += 3) {
    const [ax, ay, bx, by] = [line[i] / 100, line[i + 1] / 100, line[i + 3] / 100, line[i + 4] / 100];
    const dx = bx - ax, dy = by - ay, share = Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    const away = Math.hypot(x - ax - share * dx, y - ay - share * dy);
    if (away < best) { best = away; height = (line[i + 2] + share * (line[i + 5] - line[i + 2])) / 100; }
  }
  return [best, height];
}

function middleOf(line) {
  const k = 3 * Math.floor(line.length / 6);
  return line.slice(k, k + 3).map(v => v / 100);
}

class Atlas {
  constructor(map, view) {
    this.map = map;
    this.view = view;
    this.ray = new THREE.Raycaster();
    this.mark = null;
    this.signalAt = map.signals.map(signal => {
      const head = signal.heads[0], junction = map.junctions.find(each => signal.junctions.includes(each[0]));
      if (junction && junction[2].length >= 9) return centreOf(junction[2]);
      return head ? head[2].slice(0, 3).map(v => v / 100) : [0, 0, 0];
    });
  }

  // Where a pixel's ray meets the ground, or null.
  ground(px, py) {
    const at = new THREE.Vector2(2 * px / innerWidth - 1, 1 - 2 * py / innerHeight);
    this.ray.setFromCamera(at, this.view.camera);
    const found = this.ray.intersectObjects(this.view.scene.children.filter(each => each.userData.isGround && each.visible), false)[0];
    return found ? found.point : null;
  }

  signalNear(px, py) {
    let best = null, least = 18;
    this.map.signals.forEach((signal, s) => signal.heads.forEach(([, , places]) => {
      const p = this.view.project(...places.slice(0, 3).map(v => v / 100));
      const away = p ? Math.hypot(p[0] - px, p[1] - py) : Infinity;
      if (away < least) { least = away; best = s; }
    }));
    return best;
  }

  at(point) {
    const { x, y, z } = point, map = this.map;
    const lanes = map.lanes.map((lane, k) => [k, ...awayFrom(lane[8], x, y)])
      .filter(([k, away, height]) => away <= map.lanes[k][4] / 200 + .05 && Math.abs(height - z) < 3);
    if (lanes.length) return { kind: "lane", index: lanes.sort((a, b) => a[1] - b[1])[0][0] };
    for (const kind of ["crossing", "junction"]) {
      const index = map[`${kind}s`].findIndex(each => inRing(each[kind === "crossing" ? 4 : 2], x, y));
      if (index >= 0) return { kind, index };
    }
    return null;
  }

  // All that has a word in its name: [{kind, index, label}].
  find(words) {
    const wanted = words.trim().toLowerCase(), found = [], map = this.map;
    if (!wanted) return found;
    const has = text => text.toLowerCase().includes(wanted), streets = new Set();
    map.roads.forEach(([, name], index) => {
      if (name && has(name) && !streets.has(name)) { streets.add(name); found.push({ kind: "street", index, label: name }); }
    });
    const lists = [["signal", map.signals, each => each.id], ["junction", map.junctions, each => each[0]], ["road", map.roads, each => each[0]],
      ["lane", map.lanes, each => each[0]], ["crossing", map.crossings, each => each[0]]];
    for (const [kind, list, id] of lists) list.forEach((each, index) => { if (has(id(each))) found.push({ kind, index, label: id(each) }); });
    const rank = each => each.label.toLowerCase() === wanted ? 0 : each.label.toLowerCase().startsWith(wanted) ? 1 : 2;
    return found.sort((a, b) => rank(a) - rank(b)).slice(0, 40);
  }

  lanesOf({ kind, index }) {
    const { lanes, roads } = this.map;
    if (kind === "lane") return [lanes[index]];
    if (kind === "road") return lanes.filter(lane => lane[1] === index);
    if (kind === "street") return lanes.filter(lane => roads[lane[1]][1] === roads[index][1]);
    return [];
  }

  placeOf(thing) {
    if (thing.kind === "signal") return this.signalAt[thing.index];
    if (thing.kind === "junction") return centreOf(this.map.junctions[thing.index][2]);
    if (thing.kind === "crossing") return middleOf(this.map.crossings[thing.index][5]);
    const lanes = this.lanesOf(thing);
    return lanes.length ? middleOf(lanes.reduce((a, b) => a[6] > b[6] ? a : b)[8]) : null;
  }

  show(thing) {
    this.clear();
    if (!thing) return;
    const triangles = this.lanesOf(thing).flatMap(lane => band(lane[8], lane[4] / 200, .09, false));
    if (thing.kind === "lane")
      for (const [from, , , , , line] of this.map.connections) if (from === thing.index) triangles.push(...band(line, .3, .12, true));
    const ring = thing.kind === "junction" ? this.map.junctions[thing.index][2] : thing.kind === "crossing" ? this.map.crossings[thing.index][4] : null;
    if (ring && ring.length >= 9) triangles.push(...band([...ring, ...ring.slice(0, 3)], .25, .1, false));
    if (triangles.length) this.mark = flatMesh(triangles, Array(triangles.length / 3).fill(MARK).flat());
    if (this.mark) this.view.scene.add(this.mark);
    this.view.request();
  }

  clear() {
    if (!this.mark) return;
    this.view.scene.remove(this.mark);
    this.mark.geometry.dispose();
    this.mark = null;
    this.view.request();
  }
}

function centreOf(ring) {
  const sum = [0, 0, 0], count = Math.max(1, ring.length / 3);
  ring.forEach((v, i) => { sum[i % 3] += v / 100 / count; });
  return sum;
}

// A line that a person draws over the ground, and how long it is.
class Measure {
  constructor(view, say) {
    this.view = view;
    this.say = say;
    this.points = [];
    this.isOn = false;
    this.mesh = null;
  }

  toggle() {
    this.isOn = !this.isOn;
    this.points = [];
    this.drawn();
    return this.isOn;
  }

  add(point) {
    this.points.push(point.x * 100, point.y * 100, point.z * 100);
    this.drawn();
  }

  length() {
    const points = [];
    for (let i = 0; i < this.points.length; i += 3) points.push(this.points.slice(i, i + 3).map(v => v / 100));
    return lengthOf(points);
  }

  drawn() {
    if (this.mesh) { this.view.scene.remove(this.mesh); this.mesh.geometry.dispose(); this.mesh = null; }
    const triangles = band(this.points, Math.max(.08, 1.5 * this.view.metresPerPixel()), .15, false);
    if (triangles.length) {
      this.mesh = flatMesh(triangles, Array(triangles.length / 3).fill([230, 30, 110, 255]).flat());
      this.mesh.material.depthTest = false;
      this.view.scene.add(this.mesh);
    }
    this.say(!this.isOn ? "" : this.points.length < 6 ? "Click places to measure between them; Esc ends" : `${this.length().toFixed(2)} m`);
    this.view.request();
  }
}
