"use strict";
// Everything that comes from the map is put in by textContent and setAttribute, never as markup.
const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const SEVERITIES = ["error", "warning", "note"];
const MOST_NAMES = 6;
const byId = (id) => document.getElementById(id);
const make = (tag, text, name) => {
  const node = document.createElement(tag);
  if (text !== undefined) node.textContent = text;
  if (name) node.className = name;
  return node;
};
const draw = (tag, attributes, parent) => {
  const node = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (parent) parent.append(node);
  return node;
};
const several = (count, name) => count + " " + name + (count === 1 ? "" : "s");
const short = (value) => String(Number(value.toPrecision(3)));

// Shapes come as whole centimetres around the map's origin, y north; the picture's y runs down.
const toPath = (flat, close) => {
  let path = "";
  for (let k = 0; k < flat.length; k += 2) path += (k ? "L" : "M") + flat[k] / 100 + " " + -flat[k + 1] / 100;
  return path + (close ? "Z" : "");
};
const boxOf = (flat) => {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (let k = 0; k < flat.length; k += 2) {
    const x = flat[k] / 100, y = -flat[k + 1] / 100;
    if (x < box[0]) box[0] = x;
    if (y < box[1]) box[1] = y;
    if (x > box[2]) box[2] = x;
    if (y > box[3]) box[3] = y;
  }
  return box;
};
const shapes = new Map();
const ground = [];
const keep = (name, shape) => shapes.set(name, (shapes.get(name) || []).concat(shape));
const shapeOf = (kind, flat, width) => ({ kind, path: toPath(flat, !width), box: boxOf(flat), width });
for (const [kind, id, flat] of data.areas) {
  const shape = shapeOf(kind, flat, flat.length > 4 ? 0 : 1);
  if (flat.length > 4) ground.push(shape);
  if (flat.length) keep(kind + " " + id, shape);
}
for (const [kind, id, road, width, flat] of data.lanes) {
  const shape = shapeOf("lane " + kind, flat, width);
  ground.push(shape);
  keep("lane " + id, shape);
  keep("road " + road, shape);
}
for (const [id, flat] of data.connections) keep("connection " + id, shapeOf("way", flat, 0.9));
for (const [id, junctions] of data.signals)
  for (const name of junctions) keep("signal " + id, shapes.get("junction " + name) || []);

// Shapes of one kind and width make one path; lanes are drawn twice, so that a line stays between them.
const drawGround = (parent, chosen) => {
  const paths = new Map();
  for (const shape of chosen) {
    const key = shape.kind + "|" + shape.width;
    paths.set(key, (paths.get(key) || "") + shape.path);
  }
  for (const [pass, inset] of [["area", 0], ["casing", 0], ["top", 0.18]])
    for (const [key, path] of paths) {
      const [kind, width] = key.split("|");
      if ((pass === "area") === (width !== "0")) continue;
      const name = kind + (pass === "casing" ? " casing" : "");
      draw("path", { class: name, d: path, "stroke-width": Math.max(width - inset, 0.1) }, parent);
    }
};

const map = byId("map");
const defs = draw("defs", {}, map);
const arrow = draw("marker", { id: "arrow", viewBox: "0 0 6 6", refX: 5, refY: 3, markerWidth: 2.2, markerHeight: 2.2, orient: "auto" }, defs);
draw("path", { d: "M0 0L6 3L0 6Z", fill: "context-stroke" }, arrow);
drawGround(draw("g", {}, map), ground);
const hits = draw("g", {}, map);
const markers = draw("g", {}, map);
const [x0, y0, x1, y1] = data.bounds;
let box;
const NICE = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
const showScale = () => {
  const pixels = Math.min(map.clientWidth / box[2], map.clientHeight / box[3]) || 1;
  const metres = NICE.filter((value) => value * pixels < 140).pop() || 1;
  byId("bar").style.width = metres * pixels + "px";
  byId("length").textContent = metres < 1000 ? metres + " m" : metres / 1000 + " km";
  for (const marker of markers.children) marker.setAttribute("r", 5.5 / pixels);
};
const show = (wanted) => {
  box = wanted;
  map.setAttribute("viewBox", box.join(" "));
  showScale();
};
const showAll = () => show([x0 - 10, -y1 - 10, x1 - x0 + 20, y1 - y0 + 20]);

const shapesOf = (element) => shapes.get(element.kind + " " + element.id) || [];
const highlight = (issue, parent) => {
  issue.elements.slice().reverse().forEach((element, index, all) => {
    const first = index === all.length - 1 ? " first" : "";
    for (const shape of shapesOf(element)) {
      const way = shape.kind === "way";
      const name = "hit" + (shape.width ? "" : " area") + (way ? " way" : "") + (element.kind === "signal" ? " signal" : first);
      const hit = draw("path", { class: name, d: shape.path, "stroke-width": shape.width || 0.4 }, parent);
      if (way) hit.setAttribute("marker-end", "url(#arrow)");
    }
  });
  draw("circle", { class: "spot", cx: issue.at[0], cy: -issue.at[1], r: 3 }, parent);
};

// Around an issue: its first element if that is not too large, at least 50 m, at most 160 m high.
const frame = (issue, aspect) => {
  const [x, y] = [issue.at[0], -issue.at[1]];
  let reach = 22;
  for (const { box: b } of issue.elements.slice(0, 1).flatMap(shapesOf)) {
    const far = Math.max((b[2] - x) / aspect, (x - b[0]) / aspect, b[3] - y, y - b[1]) + 8;
    if (far < 80) reach = Math.max(reach, far);
  }
  return [x - reach * aspect, y - reach, 2 * reach * aspect, 2 * reach];
};
const paint = (issue, picture) => {
  if (picture.childElementCount) return;
  const [x, y, width, height] = frame(issue, 2.4);
  picture.setAttribute("viewBox", [x, y, width, height].join(" "));
  const near = ground.filter(({ box: b }) => b[0] < x + width + 5 && b[2] > x - 5 && b[1] < y + height + 5 && b[3] > y - 5);
  drawGround(picture, near);
  highlight(issue, picture);
};
const seen = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    const picture = target.querySelector(".picture");
    if (isIntersecting) paint(data.issues[picture.dataset.issue], picture);
  }
}, { rootMargin: "400px" });

const copy = (text, label) => {
  const button = make("button", label);
  button.type = "button";
  button.title = text;
  button.addEventListener("click", (event) => {
    event.stopPropagation();
    const area = make("textarea", text);
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    button.textContent = done ? "copied" : "select it from the tooltip";
    setTimeout(() => { button.textContent = label; }, 1500);
  });
  return button;
};

const nameElements = (issue) => {
  const names = make("p", undefined, "elements");
  issue.elements.slice(0, MOST_NAMES).forEach((element, k) => {
    const chip = make("span", undefined, k ? "chip" : "chip fault");
    chip.append(make("i", element.kind.replace("_", " ")), " " + element.id);
    names.append(chip);
  });
  if (issue.elements.length > MOST_NAMES) names.append(make("span", "and " + (issue.elements.length - MOST_NAMES) + " more"));
  return names;
};
const measure = (issue) => {
  const line = make("p", undefined, "measure");
  if (issue.measured !== null) line.append("measured ", make("b", short(issue.measured)));
  if (issue.limit !== null) line.append(issue.measured !== null ? ", limit " : "limit ", make("b", short(issue.limit)));
  return line;
};

const list = byId("list");
const makeRow = (issue, k) => {
  const row = make("li", undefined, issue.severity);
  row.id = "issue-" + k;
  row.tabIndex = 0;
  const head = make("p");
  head.append(make("strong", issue.severity, "badge " + issue.severity), make("span", issue.check, "check"));
  const picture = draw("svg", { class: "picture", "data-issue": k, role: "img", "aria-label": issue.message });
  seen.observe(row);
  const buttons = make("p", undefined, "copies");
  buttons.append(copy(issue.selection.join("\n") + "\n", "copy netedit selection"),
    copy(issue.position.slice(0, 2).map((value) => value.toFixed(2)).join(","), "copy position"));
  if (issue.lonlat) buttons.append(copy(issue.lonlat[1].toFixed(6) + "," + issue.lonlat[0].toFixed(6), "copy lat, lon"));
  row.append(head, make("p", issue.message, "message"));
  if (issue.measured !== null || issue.limit !== null) row.append(measure(issue));
  row.append(make("p", "→ " + issue.hint, "hint"), picture, nameElements(issue), buttons);
  row.addEventListener("click", () => choose(k));
  const marker = draw("circle", { class: "marker " + issue.severity, cx: issue.at[0], cy: -issue.at[1], "data-issue": k });
  draw("title", {}, marker).textContent = issue.check + ": " + issue.message;
  marker.addEventListener("click", () => choose(k));
  const text = [issue.check, issue.message, ...issue.elements.map((element) => element.kind + " " + element.id)].join("\n").toLowerCase();
  return { row, marker, issue, text };
};
const rows = data.issues.map(makeRow);
for (const severity of SEVERITIES) list.append(...rows.filter(({ issue }) => issue.severity === severity).map(({ row }) => row));
for (const severity of SEVERITIES.slice().reverse())
  markers.append(...rows.filter(({ issue }) => issue.severity === severity).map(({ marker }) => marker));

const choose = (k) => {
  for (const other of document.querySelectorAll(".chosen")) other.classList.remove("chosen");
  const { row, marker, issue } = rows[k];
  row.classList.add("chosen");
  marker.classList.add("chosen");
  row.scrollIntoView({ block: "nearest" });
  hits.replaceChildren();
  highlight(issue, hits);
  show(frame(issue, map.clientWidth / Math.max(map.clientHeight, 1)));
  history.replaceState(null, "", "#issue-" + k);
};
list.addEventListener("keydown", (event) => {
  const step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
  let row = event.target.closest("li");
  if (!row || (!step && (event.key !== "Enter" || event.target !== row))) return;
  event.preventDefault();
  if (step) do row = row[step]; while (row && row.hidden);
  if (!row) return;
  row.focus({ preventScroll: true });
  choose(Number(row.id.slice("issue-".length)));
});

const tally = (values) => {
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) || 0) + 1);
  return counts;
};
const fill = (select, counts, all) => {
  select.append(new Option(all, ""));
  for (const [value, count] of counts) select.append(new Option(value + " (" + count + ")", value));
};
const form = byId("filters");
const fields = form.elements;
fill(fields.check, tally(data.issues.map((issue) => issue.check)), "every check");
fill(fields.junction, [...tally(data.issues.flatMap((issue) => issue.junctions))].sort(([a], [b]) => (a < b ? -1 : 1)), "every junction");
for (const severity of SEVERITIES) byId("count-" + severity).textContent = data.counts[severity];
const filter = () => {
  const words = fields.text.value.toLowerCase().split(/\s+/);
  let shown = 0;
  for (const { row, marker, issue, text } of rows) {
    const fits = fields[issue.severity].checked
      && (!fields.check.value || issue.check === fields.check.value)
      && (!fields.junction.value || issue.junctions.includes(fields.junction.value))
      && words.every((word) => text.includes(word));
    row.hidden = !fits;
    marker.style.display = fits ? "" : "none";
    shown += fits;
  }
  byId("shown").textContent = shown + " of " + several(rows.length, "issue") + " shown";
  byId("none").hidden = shown > 0;
  byId("none").textContent = rows.length ? "No issue fits these filters." : "No issue was found.";
};
form.addEventListener("input", filter);
form.addEventListener("reset", () => setTimeout(filter));
form.addEventListener("submit", (event) => event.preventDefault());

const table = byId("checks");
for (const check of data.checks) {
  const row = make("tr", undefined, check.status);
  row.append(make("td", check.id, "check"), make("td", check.status), make("td", String(check.count), "number"),
    make("td", check.reason || check.title));
  table.append(row);
}
const states = tally(data.checks.map((check) => check.status));
byId("states").textContent = several(data.checks.length, "check") + ": " + [...states].map(([name, count]) => count + " " + name).join(", ");
byId("demand").hidden = !data.demand;
if (data.demand) {
  const counts = data.demand.counts || [];
  const met = counts.length ? "; GEH below 5 for " + Math.round(data.demand.geh_below_5 * 100) + " % of " + several(counts.length, "count") : "";
  byId("traffic").textContent = several(data.demand.vehicles, "vehicle") + ", " + several(data.demand.bicycles, "bicycle") + ", " + several(data.demand.walkers, "walker") + met;
  const head = make("tr");
  head.append(...["from, to", "class", "begin", "counted", "modelled", "GEH"].map((name) => make("th", name)));
  if (counts.length) byId("counts").append(head);
  for (const count of counts) {
    const row = make("tr", undefined, count.geh < 5 ? "" : "crashed");
    row.append(make("td", count.from_edge + (count.to_edge ? " → " + count.to_edge : "")), make("td", count.class),
      ...[count.begin, count.count, count.modelled, count.geh].map((value) => make("td", String(value), "number")));
    byId("counts").append(row);
  }
}
byId("excluded").hidden = !data.excluded.length;
byId("reasons").textContent = several(data.excluded.length, "issue") + " left out";
for (const issue of data.excluded) byId("left-out").append(make("li", issue.check + ": " + issue.message + ". " + issue.reason));

const place = (event) => {
  const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
  return [at.x, at.y];
};
const zoom = (factor, x, y) => {
  const width = Math.min(Math.max(box[2] * factor, 2), 50 * (x1 - x0 + 20));
  const by = width / box[2];
  show([x - (x - box[0]) * by, y - (y - box[1]) * by, box[2] * by, box[3] * by]);
};
const zoomMiddle = (factor) => zoom(factor, box[0] + box[2] / 2, box[1] + box[3] / 2);
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(event.deltaY > 0 ? 1.25 : 0.8, ...place(event));
}, { passive: false });
let held = null;
map.addEventListener("pointerdown", (event) => { held = place(event); });
map.addEventListener("pointermove", (event) => {
  const [x, y] = place(event);
  byId("place").textContent = (x + data.origin[0]).toFixed(1) + ", " + (data.origin[1] - y).toFixed(1);
  if (held && event.buttons) show([box[0] + held[0] - x, box[1] + held[1] - y, box[2], box[3]]);
});
window.addEventListener("pointerup", () => { held = null; });
window.addEventListener("resize", showScale);
byId("in").addEventListener("click", () => zoomMiddle(0.7));
byId("out").addEventListener("click", () => zoomMiddle(1.4));
byId("all").addEventListener("click", showAll);

showAll();
filter();
const asked = /^#issue-(\d+)$/.exec(location.hash);
if (asked && rows[asked[1]]) choose(Number(asked[1]));
