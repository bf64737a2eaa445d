// Puts the page together, and lets time pass.
const SPEEDS = [1, 2, 5, 10, .5];

class Clock {
  constructor(view, signals, playback, panels) {
    Object.assign(this, { view, signals, playback, panels });
    this.isRunning = false;
    this.speed = 1;
    this.begin = playback ? playback.begin : 0;
    this.end = playback ? playback.end : Math.max(0, ...signals.map.signals.map((_, s) => signals.cycle(s)));
    this.time = this.begin;
    const slider = by("time");
    Object.assign(slider, { min: this.begin, max: this.end, step: .1, value: this.begin });
    slider.oninput = () => this.set(Number(slider.value));
    by("play").onclick = () => this.run(!this.isRunning);
    by("speed").onclick = () => {
      this.speed = SPEEDS[(SPEEDS.indexOf(this.speed) + 1) % SPEEDS.length];
      by("speed").textContent = `${this.speed}×`;
    };
    by("clock").hidden = !(this.end > this.begin);
    view.beforeDraw.push(now => this.advance(now));
  }

  run(on) {
    this.isRunning = on && this.end > this.begin;
    this.last = null;
    by("play").textContent = this.isRunning ? "❚❚" : "▶";
    by("play").setAttribute("aria-label", this.isRunning ? "pause" : "play");
    this.view.request();
  }

  advance(now) {
    if (this.isRunning) {
      const passed = this.last === null ? 0 : Math.min(.5, (now - this.last) / 1000) * this.speed;
      this.last = now;
      let time = this.time + passed;
      if (time > this.end) time = this.begin;
      this.set(time);
    }
    if (this.playback && (this.isRunning || this.isStale)) {
      this.playback.show(this.time);
      this.view.shadows.follow(this.view.camera.position, this.view.controls.target);
      this.playback.drawShadows(this.view.shadows);
      this.isStale = this.isRunning;
    }
    return this.isRunning;
  }

  set(time) {
    this.time = this.panels.time = Math.min(this.end, Math.max(this.begin, time));
    this.isStale = true;
    by("time").value = this.time;
    const whole = Math.floor(this.time), clock = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
    const text = this.playback ? clock.map(v => String(v).padStart(2, "0")).join(":") : `${this.time.toFixed(1)} s`;
    by("now").textContent = this.playback ? `${text} · ${this.playback.present(this.time)} road users` : `${text} of ${this.end} s`;
    by("time").setAttribute("aria-valuetext", text);
    this.signals.show(this.time);
    this.panels.drawPlan();
    this.view.request();
  }
}

// #camera=x,y,z,tx,ty,tz; false if the address has none that makes sense.
function lookByAddress(view) {
  const values = (location.hash.match(/[#&]camera=([^&]*)/)?.[1] ?? "").split(",").map(parseFloat);
  if (values.length !== 6 || !values.every(v => Number.isFinite(v) && Math.abs(v) < 1e6)) return false;
  const eye = values.slice(0, 3), at = values.slice(3);
  if (Math.hypot(...eye.map((v, k) => v - at[k])) < .01) return false;
  // The controls turn around what is looked at, so that has to be some way off.
  const away = Math.hypot(...eye.map((v, k) => v - at[k]));
  view.look(eye, away < 2 ? eye.map((v, k) => v + 2 * (at[k] - v) / away) : at);
  return true;
}

function listen(canvas, view, atlas, panels, clock, measure, playback) {
  let pressed = null;
  canvas.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
  canvas.addEventListener("click", event => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 5) return;
    const point = atlas.ground(event.clientX, event.clientY);
    if (measure.isOn) { if (point) measure.add(point); return; }
    const signal = atlas.signalNear(event.clientX, event.clientY);
    const user = point && playback && !playback.hidden ? playback.near(point.x, point.y, clock.time) : null;
    if (user !== null) panels.select({ kind: "user", id: user });
    else panels.select(signal !== null ? { kind: "signal", index: signal } : point && atlas.at(point));
  });
  const next = step => {
    const count = panels.map.signals.length;
    if (count) panels.goTo({ kind: "signal", index: (panels.signal + step + count) % count });
  };
  by("next").onclick = () => next(1);
  by("previous").onclick = () => next(-1);
  by("whole").onclick = () => view.showAll();
  by("compass").onclick = () => view.faceNorth();
  const toggleMeasure = () => by("measure").setAttribute("aria-pressed", String(measure.toggle()));
  by("measure").onclick = toggleMeasure;
  by("help").onclick = () => { by("keys").hidden = !by("keys").hidden; };
  const zoom = factor => {
    const at = view.controls.target, eye = view.camera.position;
    view.look(eye.clone().sub(at).multiplyScalar(factor).add(at).toArray(), at.toArray());
  };
  const keys = {
    Home: () => view.showAll(), n: () => next(1), p: () => next(-1), m: toggleMeasure, " ": () => clock.run(!clock.isRunning),
    "+": () => zoom(.8), "-": () => zoom(1.25), "/": () => by("search").focus(), "?": () => by("help").click(),
    Escape: () => { if (measure.isOn) toggleMeasure(); panels.select(null); by("keys").hidden = true; },
    ",": () => clock.set(clock.time - 1), ".": () => clock.set(clock.time + 1)
  };
  addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|BUTTON|SELECT)$/.test(event.target.tagName) && event.key !== "Escape") return;
    const action = keys[event.key];
    if (action) { event.preventDefault(); action(); }
  });
  view.controls.listenToKeyEvents(canvas);
  addEventListener("hashchange", () => lookByAddress(view));
}

function show({ value, array }) {
  const map = value.map, canvas = by("scene"), view = new View(canvas, map.bounds), materials = new Map();
  let low = 0, colour = [116, 142, 92];
  for (const record of value.meshes) {
    const mesh = makeMesh(record, array, materials);
    mesh.userData.isGround = /^(terrain|road|junction|sidewalk|walking_area|island|crossing|rail)/.test(record.name);
    view.add(mesh);
    if (record.name === "terrain") {
      mesh.geometry.computeBoundingBox();
      low = Math.min(low, mesh.position.z + mesh.geometry.boundingBox.min.z * mesh.scale.z);
      colour = record.colour;
    }
  }
  const far = makeFarGround(low - .12, colour);
  far.userData.isGround = true;
  view.add(makeSky());
  view.add(far);
  const playback = value.playback ? new Playback(value.playback, array, view) : null;
  const signals = new Signals(map, view, playback), atlas = new Atlas(map, view);
  const panels = new Panels(map, view, atlas, signals, playback);
  const clock = new Clock(view, signals, playback, panels);
  const measure = new Measure(view, text => { by("measured").textContent = text; by("measured").hidden = !text; });
  listen(canvas, view, atlas, panels, clock, measure, playback);
  const number = name => parseFloat(location.hash.match(new RegExp(`[#&]${name}=([^&]*)`))?.[1]);
  clock.set(Number.isFinite(number("time")) ? number("time") : clock.begin);
  view.resize();
  if (!lookByAddress(view)) panels.standAt(0);
  const wanted = location.hash.match(/[#&]find=([^&]*)/)?.[1];
  const thing = wanted && atlas.find(decodeURIComponent(wanted))[0];
  if (thing) panels.goTo(thing);
  if (playback) view.onShadows = () => playback.drawShadows(view.shadows);
  if (playback) clock.run(!/[#&]time=/.test(location.hash));
  view.afterDraw.push(function first() {
    view.afterDraw.splice(view.afterDraw.indexOf(first), 1);
    document.documentElement.dataset.firstPicture = String(Math.round(performance.now()));
    by("status").hidden = true;
  });
  window.dojoView = { view, clock, panels };
}

const fail = error => { by("status").textContent = `The map cannot be shown: ${error.message ?? error}`; by("status").hidden = false; };
if (typeof DecompressionStream === "undefined") fail("this browser is too old; use one of 2023 or later");
else unpack().then(show).catch(fail);
