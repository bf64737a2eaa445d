// Signals: what each shows at a time, as lamps, as ways across the junction and as a plan.
const RED = [232, 52, 40], YELLOW = [250, 186, 36], GREEN = [40, 196, 96], DARK = 12;
const COLOUR = { r: RED, R: RED, s: RED, u: YELLOW, y: YELLOW, Y: YELLOW, o: YELLOW, g: GREEN, G: GREEN };
const css = colour => `rgb(${colour.join(",")})`;

// Which lamps the links of a head light; the most permissive link decides. Letters are SUMO's.
function litLamps(letters, count) {
  const has = wanted => [...wanted].some(letter => letters.includes(letter));
  if (!letters) return [];
  if (has("gG")) return [count - 1];
  if (count === 2) return /^[oO]+$/.test(letters) ? [] : [0];
  if (has("yo")) return [1];
  if (has("u")) return [0, 1];
  return /^O+$/.test(letters) ? [] : [0];
}

class Signals {
  constructor(map, view, playback) {
    this.map = map;
    this.view = view;
    this.playback = playback;
    this.shownStates = map.signals.map(() => null);
    this.recorded = map.signals.map(signal => playback ? playback.signalColumn(signal.id) : -1);
    this.addLamps();
    this.addWays();
  }

  addLamps() {
    const triangles = [], tints = [], glow = [], headings = [], lamps = [];
    this.map.signals.forEach((signal, s) => signal.heads.forEach(([links, heading, places]) => {
      const count = places.length / 3, c = Math.cos(heading), n = Math.sin(heading);
      for (let k = 0; k < count; k++) {
        const [x, y, z] = places.slice(3 * k, 3 * k + 3).map(v => v / 100);
        lamps.push({ signal: s, links, count, k, colour: count === 2 ? [RED, GREEN][k] : [RED, YELLOW, GREEN][k] });
        glow.push(x + .03 * c, y + .03 * n, z);
        headings.push(c, n);
        for (let i = 0; i < 10; i++) {
          const corner = j => { const a = j * Math.PI / 5; return [x - .1 * n * Math.cos(a), y + .1 * c * Math.cos(a), z + .1 * Math.sin(a)]; };
          triangles.push(x, y, z, ...corner(i), ...corner(i + 1));
          tints.push(...Array(3).fill([0, 0, 0, 255]).flat());
        }
      }
    }));
    this.lamps = lamps;
    this.lampMesh = flatMesh(triangles, tints);
    this.lampMesh.material.depthWrite = true;
    this.lampMesh.renderOrder = 3;
    this.lampMesh.userData.layer = "signals";
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(glow), 3));
    geometry.setAttribute("heading", new THREE.BufferAttribute(new Float32Array(headings), 2));
    geometry.setAttribute("tint", new THREE.BufferAttribute(new Uint8Array(4 * lamps.length), 4, true));
    this.glow = new THREE.Points(geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: GLOW_VERTEX, fragmentShader: GLOW_FRAGMENT, uniforms,
      transparent: true, depthWrite: false, blending: THREE.AdditiveBlending
    }));
    this.glow.frustumCulled = false;
    this.glow.renderOrder = 9;
    this.glow.userData.layer = "signals";
    if (lamps.length) this.view.scene.add(this.lampMesh, this.glow);
  }

  addWays() {
    const triangles = [], tints = [];
    this.ways = [];
    const add = (signal, link, points) => {
      if (signal < 0 || link < 0 || !points.length) return;
      this.ways.push({ signal, link, first: tints.length / 4, count: points.length / 3 });
      triangles.push(...points);
      tints.push(...Array(points.length / 3 * 4).fill(0));
    };
    for (const [, , , signal, link, line] of this.map.connections) add(signal, link, band(line, .42, .07, true));
    for (const [, , signal, link, , line, width] of this.map.crossings) add(signal, link, band(line, .3 * width / 100, .06, false));
    this.wayMesh = flatMesh(triangles, tints);
    this.wayMesh.userData.layer = "movements";
    if (this.ways.length) this.view.scene.add(this.wayMesh);
  }

  program(s) {
    return this.map.signals[s].programs[0];
  }

  cycle(s) {
    const program = this.program(s);
    return program ? program.phases.reduce((sum, phase) => sum + phase[0], 0) : 0;
  }

  phase(s, time) {
    const program = this.program(s), cycle = this.cycle(s);
    if (!program || !(cycle > 0)) return 0;
    let at = ((time - program.offset) % cycle + cycle) % cycle, k = 0;
    while (k + 1 < program.phases.length && at >= program.phases[k][0]) at -= program.phases[k++][0];
    return k;
  }

  state(s, time) {
    if (this.recorded[s] >= 0) return this.playback.signalState(this.recorded[s], time);
    const program = this.program(s);
    return program && program.phases.length ? program.phases[this.phase(s, time)][1] : "";
  }

  show(time) {
    const changed = this.map.signals.map((_, s) => {
      const state = this.state(s, time), is = state !== this.shownStates[s];
      this.shownStates[s] = state;
      return is;
    });
    if (!changed.some(Boolean)) return;
    this.paintLamps(changed);
    this.paintWays(changed);
  }

  paintLamps(changed) {
    const face = this.lampMesh.geometry.attributes.tint, glow = this.glow.geometry.attributes.tint;
    this.lamps.forEach((lamp, i) => {
      if (!changed[lamp.signal]) return;
      const letters = lamp.links.map(link => this.shownStates[lamp.signal][link] ?? "").join("");
      const lit = litLamps(letters, lamp.count).includes(lamp.k);
      const tint = lit ? lamp.colour : lamp.colour.map(v => DARK + .16 * v);
      for (let v = 30 * i; v < 30 * i + 30; v++) face.array.set(tint, 4 * v);
      glow.array.set([...lamp.colour, lit ? 255 : 0], 4 * i);
    });
    face.needsUpdate = glow.needsUpdate = true;
  }

  // Only who may go has a way; who must yield has a paler one.
  paintWays(changed) {
    const tints = this.wayMesh.geometry.attributes.tint;
    for (const way of this.ways) {
      if (!changed[way.signal]) continue;
      const letter = this.shownStates[way.signal][way.link] ?? "r", colour = COLOUR[letter] ?? RED;
      const alpha = colour === RED ? 0 : letter === "g" ? 105 : 175;
      for (let v = way.first; v < way.first + way.count; v++) tints.array.set([...colour, alpha], 4 * v);
    }
    tints.needsUpdate = true;
  }

  // Links that always show the same are one row of the plan.
  rows(s, from, to) {
    const links = this.map.signals[s].links, step = (to - from) / 160, rows = new Map();
    const states = Array.from({ length: 160 }, (_, i) => this.state(s, from + (i + .5) * step));
    for (const [index, kind, , , direction] of links) {
      const letters = states.map(state => state[index] ?? "O").join("");
      if (!rows.has(letters)) rows.set(letters, { letters, links: [] });
      rows.get(letters).links.push([index, kind, direction]);
    }
    return [...rows.values()];
  }

  drawPlan(canvas, s, time) {
    const [from, to] = this.recorded[s] >= 0 ? [time - 60, time + 60] : [0, this.cycle(s) || 1];
    const rows = this.rows(s, from, to), context = canvas.getContext("2d"), ratio = Math.min(2, devicePixelRatio);
    const left = 54, tall = 15, width = 300, height = tall * rows.length + 16;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    canvas.style.height = `${height}px`;
    context.scale(ratio, ratio);
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "middle";
    rows.forEach((row, r) => {
      const y = r * tall;
      context.fillStyle = "#43525f";
      const name = row.links[0][1] === "pedestrian" ? "walk" : [...new Set(row.links.map(link => link[2]))].join("");
      context.fillText(`${name} ${row.links.map(link => link[0]).join(",")}`, 0, y + tall / 2, left - 6);
      const step = (width - left) / row.letters.length;
      [...row.letters].forEach((letter, i) => {
        const colour = COLOUR[letter], go = colour === GREEN || colour === YELLOW;
        context.fillStyle = colour ? css(colour) : "#c6cdd3";
        context.globalAlpha = letter === "g" ? .55 : 1;
        context.fillRect(left + i * step, y + (go ? 2 : 6), step + .4, go ? tall - 4 : 3);
      });
      context.globalAlpha = 1;
    });
    context.fillStyle = "#43525f";
    context.fillText(`${Math.round(from)} s`, left, height - 6);
    context.textAlign = "right";
    context.fillText(`${Math.round(to)} s`, width, height - 6);
    const cycle = to - from, at = this.recorded[s] >= 0 ? .5 : (((time - this.program(s).offset) % cycle + cycle) % cycle) / cycle;
    context.fillStyle = "#10202c";
    context.fillRect(left + at * (width - left) - 1, 0, 2, tall * rows.length);
  }
}
