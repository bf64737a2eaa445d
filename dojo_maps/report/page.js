"use strict";
// Everything that comes from the map is put in by textContent and setAttribute, never as markup.
const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
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

// Shapes come as whole centimetres around the map's origin, y north; the picture's y runs down.
const pairs = (flat) => {
  const found = [];
  for (let k = 0; k < flat.length; k += 2) found.push(flat[k] / 100 + "," + -flat[k + 1] / 100);
  return found.join(" ");
};
const shapes = new Map();
const ground = draw("g", { id: "ground" });
for (const [kind, id, flat] of data.areas) {
  if (flat.length > 4) draw("polygon", { class: kind, points: pairs(flat) }, ground);
  shapes.set(kind + " " + id, [{ area: flat.length > 4, points: pairs(flat), width: 1 }]);
}
for (const [kind, id, road, width, flat] of data.lanes) {
  const points = pairs(flat);
  draw("polyline", { class: "lane " + kind, points, "stroke-width": width }, ground);
  shapes.set("lane " + id, [{ points, width }]);
  const key = "road " + road;
  shapes.set(key, (shapes.get(key) || []).concat({ points, width }));
}
for (const [id, flat] of data.connections) shapes.set("connection " + id, [{ points: pairs(flat), width: 0.8 }]);
for (const [id, junctions] of data.signals)
  shapes.set("signal " + id, junctions.flatMap((name) => shapes.get("junction " + name) || []));

const map = byId("map");
map.append(ground);
const hits = draw("g", {}, map);
const markers = draw("g", {}, map);
const [x0, y0, x1, y1] = data.bounds;
let box;
const show = (wanted) => {
  box = wanted;
  map.setAttribute("viewBox", box.join(" "));
  const radius = Math.max(box[2] / 180, 0.4);
  for (const marker of markers.children) marker.setAttribute("r", radius);
};
const showAll = () => show([x0 - 10, -y1 - 10, x1 - x0 + 20, y1 - y0 + 20]);

const highlight = (issue, parent) => {
  issue.elements.slice().reverse().forEach((element, index, all) => {
    const first = index === all.length - 1 ? " first" : "";
    for (const shape of shapes.get(element.kind + " " + element.id) || []) {
      const name = "hit" + (shape.area ? " area" : "") + first;
      draw(shape.area ? "polygon" : "polyline",
        { class: name, points: shape.points, "stroke-width": shape.area ? 0.2 : shape.width }, parent);
    }
  });
  draw("circle", { class: "spot", cx: issue.at[0], cy: -issue.at[1], r: 3 }, parent);
};

const paint = (issue, picture) => {
  if (picture.childElementCount) return;
  picture.setAttribute("viewBox", [issue.at[0] - 40, -issue.at[1] - 25, 80, 50].join(" "));
  draw("use", { href: "#ground" }, picture);
  highlight(issue, picture);
};
const seen = new IntersectionObserver((entries) => {
  for (const entry of entries) if (entry.isIntersecting) paint(data.issues[entry.target.dataset.issue], entry.target);
});

const copy = (text, label) => {
  const button = make("button", label);
  button.type = "button";
  button.title = text;
  button.addEventListener("click", (event) => {
    event.stopPropagation();
    const done = () => { button.textContent = "copied"; setTimeout(() => { button.textContent = label; }, 1500); };
    const area = make("textarea", text);
    document.body.append(area);
    area.select();
    if (document.execCommand("copy")) done();
    area.remove();
  });
  return button;
};

const list = byId("list");
const rows = data.issues.map((issue, k) => {
  const row = make("li");
  row.id = "issue-" + k;
  const head = make("p");
  head.append(make("strong", issue.severity, issue.severity), " ", make("span", issue.check, "check"));
  row.append(head, make("p", issue.message));
  if (issue.measured !== null && issue.limit !== null)
    row.append(make("p", "measured " + issue.measured + ", limit " + issue.limit));
  row.append(make("p", issue.hint, "hint"));
  const picture = draw("svg", { class: "picture", "data-issue": k });
  seen.observe(picture);
  row.append(picture);
  const buttons = make("p");
  buttons.append(copy(issue.selection.join("\n") + "\n", "copy netedit selection"),
    copy(issue.position.slice(0, 2).join(","), "copy position"));
  row.append(buttons);
  row.addEventListener("click", () => choose(k));
  list.append(row);
  const marker = draw("circle", { class: "marker " + issue.severity, cx: issue.at[0], cy: -issue.at[1] }, markers);
  draw("title", {}, marker).textContent = issue.check + ": " + issue.message;
  marker.addEventListener("click", () => choose(k));
  return { row, marker, issue };
});

const choose = (k) => {
  for (const other of list.querySelectorAll(".chosen")) other.classList.remove("chosen");
  rows[k].row.classList.add("chosen");
  rows[k].row.scrollIntoView({ block: "nearest" });
  hits.replaceChildren();
  highlight(rows[k].issue, hits);
  const [x, y] = rows[k].issue.at;
  const height = 60, width = height * map.clientWidth / Math.max(map.clientHeight, 1);
  show([x - width / 2, -y - height / 2, width, height]);
};

const fill = (select, values, all) => {
  select.append(new Option(all, ""));
  for (const value of values) select.append(new Option(value, value));
};
const form = byId("filters");
fill(form.elements.check, [...new Set(data.issues.map((issue) => issue.check))], "every check");
fill(form.elements.junction, [...new Set(data.issues.flatMap((issue) => issue.junctions))].sort(), "every junction");
const filter = () => {
  const wanted = (name) => form.elements[name].checked;
  let shown = 0;
  for (const { row, marker, issue } of rows) {
    const fits = wanted(issue.severity)
      && [issue.check, ""].includes(form.elements.check.value)
      && (!form.elements.junction.value || issue.junctions.includes(form.elements.junction.value));
    row.hidden = !fits;
    marker.style.display = fits ? "" : "none";
    shown += fits;
  }
  byId("shown").textContent = shown + " of " + rows.length + " shown";
};
form.addEventListener("input", filter);

const table = byId("checks");
for (const check of data.checks) {
  const row = make("tr");
  row.append(make("td", check.id, "check"), make("td", check.status), make("td", String(check.count)),
    make("td", check.reason || check.title));
  table.append(row);
}

const place = (event) => {
  const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
  return [at.x, at.y];
};
const zoom = (factor, x, y) =>
  show([x - (x - box[0]) * factor, y - (y - box[1]) * factor, box[2] * factor, box[3] * factor]);
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(event.deltaY > 0 ? 1.25 : 0.8, ...place(event));
}, { passive: false });
let held = null;
map.addEventListener("pointerdown", (event) => { held = place(event); });
map.addEventListener("pointermove", (event) => {
  if (!held || !event.buttons) return;
  const [x, y] = place(event);
  show([box[0] + held[0] - x, box[1] + held[1] - y, box[2], box[3]]);
});
window.addEventListener("pointerup", () => { held = null; });
byId("in").addEventListener("click", () => zoom(0.7, box[0] + box[2] / 2, box[1] + box[3] / 2));
byId("out").addEventListener("click", () => zoom(1.4, box[0] + box[2] / 2, box[1] + box[3] / 2));
byId("all").addEventListener("click", showAll);

byId("counts").textContent = Object.entries(data.counts).map(([name, count]) => count + " " + name + "s").join(", ");
showAll();
filter();
const asked = /^#issue-(\d+)$/.exec(location.hash);
if (asked && rows[asked[1]]) choose(Number(asked[1]));
