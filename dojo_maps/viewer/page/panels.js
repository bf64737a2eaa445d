// What stands over the picture. All text of the map is set as text, never as markup.
const by = id => document.getElementById(id);

function make(tag, text, attributes = {}) {
  const element = document.createElement(tag);
  if (text) element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

const DIRECTIONS = { s: "straight on", l: "left", r: "right", t: "turn back", L: "half left", R: "half right", T: "turn back" };
const LAYERS = [
  ["lanes", "Lanes", /^(road|junction|rail)/], ["sidewalks", "Sidewalks", /^(sidewalk|walking_area|island)/],
  ["crossings", "Crossings", /^crossing/], ["markings", "Markings", /^(marking|stop_line|arrow)/],
  ["buildings", "Buildings", /^building/], ["trees", "Trees", /^tree/], ["signals", "Signals", /^signal/],
  ["movements", "Movements with green", null], ["traffic", "Traffic", null], ["names", "Street names", null],
  ["issues", "Findings", null]
];

class Panels {
  constructor(map, view, atlas, signals, playback) {
    Object.assign(this, { map, view, atlas, signals, playback });
    this.selected = null;
    this.signal = map.signals.length ? 0 : -1;
    this.layers = Object.fromEntries(LAYERS.map(([id]) => [id, id !== "issues"]));
    this.addLayers();
    this.addSearch();
    this.addLabels();
    this.addIssues();
    by("close").onclick = () => this.select(null);
    view.afterDraw.push(() => this.placeLabels());
  }

  addLayers() {
    const counts = ["error", "warning", "note"].map(severity => [severity, this.map.issues.filter(each => each.severity === severity).length]);
    const found = counts.filter(([, count]) => count).map(([severity, count]) => `${count} ${severity}${count > 1 ? "s" : ""}`).join(", ");
    for (const [id, title] of LAYERS) {
      if (id === "traffic" && !this.playback || id === "issues" && !this.map.issues.length) continue;
      const label = make("label"), box = make("input", "", { type: "checkbox", id: `layer-${id}` });
      box.checked = this.layers[id];
      box.onchange = () => this.setLayer(id, box.checked);
      label.append(box, ` ${title}${id === "issues" ? ` (${found})` : ""}`);
      by("layers").append(label);
    }
  }

  setLayer(id, on) {
    this.layers[id] = on;
    const pattern = LAYERS.find(each => each[0] === id)[2];
    for (const mesh of this.view.scene.children)
      if (mesh.userData.layer === id || pattern && pattern.test(mesh.name)) mesh.visible = on;
    if (id === "traffic") this.playback.hidden = !on;
    const box = by(`layer-${id}`);
    if (box) box.checked = on;
    by("list").hidden = !(this.layers.issues && this.map.issues.length);
    this.view.shadows.centre = null;
    this.view.request();
  }

  addSearch() {
    const input = by("search"), results = by("results");
    const close = () => { results.replaceChildren(); input.setAttribute("aria-expanded", "false"); };
    const choose = thing => { close(); input.blur(); this.goTo(thing); };
    input.oninput = () => {
      close();
      for (const thing of this.atlas.find(input.value).slice(0, 12)) {
        const item = make("button", thing.label, { type: "button", role: "option" });
        item.append(make("small", thing.kind));
        item.onclick = () => choose(thing);
        results.append(item);
      }
      if (input.value.trim() && !results.children.length) results.append(make("p", "nothing has this in its name or id"));
      input.setAttribute("aria-expanded", "true");
    };
    by("find").onsubmit = event => {
      event.preventDefault();
      const first = this.atlas.find(input.value)[0];
      if (first) choose(first);
    };
    by("find").onkeydown = event => {
      const items = [...results.querySelectorAll("button")], at = items.indexOf(document.activeElement);
      if (event.key === "Escape") close();
      if (event.key === "ArrowDown") (items[at + 1] ?? items[0])?.focus();
      if (event.key === "ArrowUp") (items[at - 1] ?? input).focus();
      if (event.key.startsWith("Arrow")) event.preventDefault();
    };
    input.onblur = () => setTimeout(() => { if (!by("find").contains(document.activeElement)) close(); }, 200);
  }

  goTo(thing) {
    const place = this.atlas.placeOf(thing);
    if (thing.kind === "signal") this.standAt(thing.index);
    else if (place) this.view.flyTo(...place);
    this.select(thing);
  }

  standAt(s) {
    const seen = this.map.signals[s]?.view;
    if (seen) this.view.fly(seen.slice(0, 3), seen.slice(3));
    else if (this.atlas.signalAt[s]) this.view.flyTo(...this.atlas.signalAt[s]);
    else this.view.showAll();
  }

  select(thing) {
    this.selected = thing;
    if (thing?.kind === "signal") this.signal = thing.index;
    this.atlas.show(thing);
    by("info").hidden = !thing;
    if (thing) this.describe(thing);
    this.view.request();
  }

  describe(thing) {
    const { title, rows, ids, signal } = this.facts(thing);
    by("what").textContent = title;
    by("facts").replaceChildren(...rows.filter(row => row[1] !== "").flatMap(([name, text]) => [make("dt", name), make("dd", String(text))]));
    const selection = ids.join("\n"), copy = by("copy");
    copy.hidden = !ids.length;
    copy.textContent = "Copy for netedit";
    copy.title = selection;
    copy.onclick = async () => { await copyText(selection); copy.textContent = "Copied"; };
    by("plan").hidden = signal === undefined;
    if (signal !== undefined) { this.signal = signal; this.drawPlan(); }
  }

  facts(thing) {
    const { kind, index } = thing, map = this.map;
    if (kind === "user") return { title: "Road user", rows: [["id", thing.id]], ids: [] };
    if (kind === "issue") {
      const issue = map.issues[index];
      return {
        title: issue.check, ids: issue.elements.filter(([what]) => what in NETEDIT).map(([what, id]) => `${NETEDIT[what]}:${id}`),
        rows: [[issue.severity, issue.message], ["what to do", issue.hint], ...issue.elements.map(([what, id]) => [what, id])]
      };
    }
    if (kind === "lane") return this.laneFacts(index);
    if (kind === "junction") {
      const [id, type] = map.junctions[index], s = map.signals.findIndex(each => each.junctions.includes(id));
      return {
        title: `Junction ${id}`, ids: [`junction:${id}`], signal: s < 0 ? undefined : s,
        rows: [["kind", type], ["signal", s < 0 ? "" : map.signals[s].id], ...this.signalRows(s)]
      };
    }
    if (kind === "crossing") {
      const [id, junction, s, link] = map.crossings[index];
      return { title: `Crossing ${id}`, ids: [`crossing:${id}`], signal: s < 0 ? undefined : s, rows: [["junction", junction], ["signal", s < 0 ? "" : `${map.signals[s].id}, link ${link}`]] };
    }
    if (kind === "signal") return { title: `Signal ${map.signals[index].id}`, ids: map.signals[index].junctions.map(id => `junction:${id}`), rows: this.signalRows(index), signal: index };
    const roads = kind === "road" ? [map.roads[index]] : map.roads.filter(road => road[1] === map.roads[index][1]);
    return {
      title: kind === "road" ? `Road ${roads[0][0]}` : map.roads[index][1], ids: roads.map(road => `edge:${road[0]}`),
      rows: kind === "road" ? [["street", roads[0][1]], ["kind", roads[0][2]], ["from", roads[0][3]], ["to", roads[0][4]]] : [["roads", roads.map(road => road[0]).join(", ")]]
    };
  }

  laneFacts(index) {
    const map = this.map, [id, r, number, kind, width, speed, length, classes] = map.lanes[index], road = map.roads[r];
    const ways = map.connections.filter(each => each[0] === index);
    const s = ways.find(each => each[3] >= 0)?.[3];
    return {
      title: `Lane ${id}`, ids: [`lane:${id}`, `edge:${road[0]}`], signal: s,
      rows: [
        ["street", road[1]], ["road", road[0]], ["index", number], ["kind", kind], ["for", classes], ["limit", `${speed} km/h`],
        ["length", `${length} m`], ["width", `${(width / 100).toFixed(2)} m`], ["signal", s === undefined ? "" : map.signals[s].id],
        ["leads", ways.map(each => `${DIRECTIONS[each[2]] ?? each[2]} to ${map.lanes[each[1]][0]}${each[4] < 0 ? "" : ` (link ${each[4]})`}`).join("\n")]
      ]
    };
  }

  signalRows(s) {
    const program = this.map.signals[s]?.programs[0];
    if (!program) return [];
    const greens = program.phases.filter(phase => /[gG]/.test(phase[1])).length;
    return [["program", `${program.id}, ${program.kind}`], ["cycle", `${this.signals.cycle(s)} s, ${program.phases.length} phases, ${greens} with green`], ["offset", `${program.offset} s`]];
  }

  drawPlan() {
    if (by("plan").hidden || this.signal < 0 || !this.signals.program(this.signal)) return;
    this.signals.drawPlan(by("chart"), this.signal, this.time);
    const phase = this.signals.phase(this.signal, this.time), recorded = this.signals.recorded[this.signal] >= 0;
    by("phase").textContent = recorded ? "as recorded" : `phase ${phase}: ${this.signals.state(this.signal, this.time)}`;
  }

  addLabels() {
    const names = new Map();
    for (const lane of this.map.lanes) {
      const name = this.map.roads[lane[1]][1];
      if (name && !(names.get(name)?.[6] > lane[6])) names.set(name, lane);
    }
    this.labels = [...names].map(([name, lane]) => ({ element: make("span", name, { class: "street" }), at: middleOf(lane[8]), layer: "names", reach: 600 }));
    by("labels").append(...this.labels.map(label => label.element));
  }

  addIssues() {
    const marks = { error: "!", warning: "!", note: "i" };
    this.map.issues.slice(0, 500).forEach((issue, index) => {
      const choose = () => { this.view.flyTo(...issue.position, 35); this.select({ kind: "issue", index }); };
      const pin = make("button", marks[issue.severity] ?? "?", { type: "button", class: `pin ${issue.severity}`, title: issue.message, "aria-label": `${issue.severity}: ${issue.message}` });
      pin.onclick = () => this.select({ kind: "issue", index });
      this.labels.push({ element: pin, at: issue.position, layer: "issues", reach: Infinity });
      by("labels").append(pin);
      const item = make("li"), button = make("button", issue.message, { type: "button", class: issue.severity });
      button.onclick = choose;
      item.append(button);
      by("findings").append(item);
    });
    by("list").hidden = true;
  }

  placeLabels() {
    const eye = this.view.camera.position, taken = [];
    const reach = Math.max(600, 3 * eye.distanceTo(this.view.controls.target));
    for (const { element, at, layer, reach: most } of this.labels) {
      const [x, y, z] = at, away = Math.hypot(x - eye.x, y - eye.y, z - eye.z);
      const p = this.layers[layer] && away < Math.max(most, reach) ? this.view.project(x, y, z + (layer === "names" ? 3 : .5)) : null;
      const wide = layer === "names" ? 4 * element.textContent.length : 8;
      const fits = p && p[0] > 0 && p[0] < innerWidth && p[1] > 0 && p[1] < innerHeight &&
        (layer === "issues" || !taken.some(([a, b, c]) => Math.abs(a - p[0]) < c + wide && Math.abs(b - p[1]) < 20));
      element.hidden = !fits;
      if (!fits) continue;
      taken.push([...p, wide]);
      element.style.transform = `translate(-50%, -100%) translate(${p[0].toFixed(1)}px, ${p[1].toFixed(1)}px)`;
    }
    const metres = this.view.metresPerPixel(), exponent = 10 ** Math.floor(Math.log10(120 * metres));
    const length = [5, 2, 1].map(k => k * exponent).find(each => each / metres <= 140) ?? exponent;
    by("bar").style.width = `${length / metres}px`;
    by("length").textContent = length >= 1000 ? `${length / 1000} km` : `${length} m`;
    const at = this.view.controls.target, turn = Math.atan2(at.x - eye.x, at.y - eye.y);
    by("needle").style.transform = `rotate(${-turn}rad)`;
  }
}

const NETEDIT = { lane: "lane", road: "edge", junction: "junction", crossing: "crossing" };

async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = make("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
}
