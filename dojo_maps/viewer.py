"""The 3D scene as one web page that opens offline, in any browser with WebGL.

The page holds the meshes and the three.js that the package trimesh brings along, and loads nothing else.
Drag to turn, drag with the right button or with shift to move, wheel to zoom; one and two fingers do the
same; Home shows the whole map again.

It opens with the whole map seen from the south at 45 degrees. `#camera=x,y,z,tx,ty,tz` after the page's
address opens another view: the eye's position and a point it looks at, in metres east, north and up of the
map's origin. A driver's eye 1.5 m above the origin that looks north: `#camera=0,0,1.5,0,20,1.2`.
"""

import base64
import html
import io
import zipfile
from importlib import resources
from pathlib import Path

from dojo_maps.errors import DescriptionError, ToolMissingError
from dojo_maps.input_files import read_bytes
from dojo_maps.whole_file import write_text

_TEMPLATE = "resources/templates/viewer.zip"
_START, _END = "<script>", "THREE.GLTFLoader=GLTFLoader;})();"
"""What trimesh's own page has around three.js and its loader; the page's own code follows."""


def write_view(scene: Path, page: Path, *, title: str) -> None:
    """Write the page that shows a scene.

    Args:
        scene: binary glTF, metres, +Y up, around the map's origin.
        page: the HTML file to write.
        title: shown in the page and in the browser's tab, escaped.

    Raises:
        DescriptionError: the scene is missing or no binary glTF.
        UsageError: the page is a folder, or lies in none.
        WriteError: the page cannot be written.
        ToolMissingError: the installed trimesh has no three.js where it is looked for.
    """
    meshes = read_bytes(scene, error=DescriptionError)
    if not meshes.startswith(b"glTF"):
        raise DescriptionError(scene, "not a binary glTF file; convert the map again")
    encoded = base64.b64encode(meshes).decode("ascii")
    shown = html.escape(title)
    parts = (_HEAD, shown, _STYLE, shown, _BODY, encoded, _NEXT, _read_three(), _NEXT, _SCRIPT, _FOOT)
    write_text(page, "".join(parts))


def _read_three() -> str:
    """Take three.js, under the MIT licence that its first lines name, out of the installed trimesh."""
    try:
        packed = resources.files("trimesh").joinpath(_TEMPLATE).read_bytes()
        with zipfile.ZipFile(io.BytesIO(packed)) as archive:
            text = archive.read(archive.namelist()[0]).decode("utf-8")
        start = text.index(_START) + len(_START)
        return text[start : text.index(_END, start) + len(_END)]
    except (OSError, ImportError, ValueError, IndexError, zipfile.BadZipFile) as error:
        raise ToolMissingError(
            f"the installed package trimesh brings no three.js viewer ({error}): pip install 'trimesh>=5,<6'"
        ) from error


_HEAD = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; img-src data: blob:; connect-src data: blob:">
<title>"""

_STYLE = """</title>
<style>
html, body { margin: 0; height: 100%; overflow: hidden; background: #cfdce6 }
body { font: 14px/1.4 system-ui, sans-serif }
canvas { display: block; touch-action: none; cursor: grab }
#caption { position: fixed; left: 12px; bottom: 10px; max-width: calc(100% - 48px); padding: 6px 12px;
  border-radius: 6px; color: #1d2730; background: rgba(255, 255, 255, .78); pointer-events: none }
#caption b { display: block; font-size: 15px; overflow-wrap: anywhere }
</style>
</head>
<body>
<div id="caption"><b>"""

_BODY = """</b><span id="status">The scene is being loaded…</span></div>
<script type="text/plain" id="scene">"""

_NEXT = "</script>\n<script>"
_FOOT = "</script>\n</body>\n</html>\n"

_SCRIPT = """
"use strict";
const say = text => { document.getElementById("status").textContent = text; };
const FIELD = 45 * Math.PI / 180, STEEPEST = 89.9 * Math.PI / 180;
let renderer, camera, scene, box, pending = false, untouched = true;
const view = { target: new THREE.Vector3(), distance: 100, azimuth: 0, elevation: Math.PI / 4 };

function decodeScene() {
  const text = atob(document.getElementById("scene").textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

// A dome around the eye: haze below the horizon, blue towards the zenith.
function makeSky() {
  const material = new THREE.ShaderMaterial({
    side: THREE.BackSide, depthTest: false, depthWrite: false,
    vertexShader: `varying vec3 way; void main() { way = position;
      gl_Position = projectionMatrix * vec4(mat3(viewMatrix) * position, 1.0); gl_Position.z = 0.0; }`,
    fragmentShader: `varying vec3 way; void main() { float up = normalize(way).y;
      vec3 haze = mix(vec3(.87, .91, .94), vec3(.76, .83, .88), clamp(-up * 1.5, 0.0, 1.0));
      gl_FragColor = vec4(mix(haze, vec3(.36, .58, .84), pow(clamp(up, 0.0, 1.0), .6)), 1.0); }`
  });
  const sky = new THREE.Mesh(new THREE.SphereGeometry(10, 32, 24), material);
  sky.frustumCulled = false;
  sky.renderOrder = -1;
  return sky;
}

// On level ground both lights add up to 1, so that it shows its own colour.
function makeLights() {
  const sun = new THREE.DirectionalLight(0xfff6e6, .5);
  sun.position.set(-.45, 1, .35);
  return [sun, new THREE.HemisphereLight(0xf4f8ff, 0xa8a294, .58)];
}

function axes() {
  const sine = Math.sin(view.azimuth), cosine = Math.cos(view.azimuth);
  const steep = Math.cos(view.elevation);
  return {
    right: new THREE.Vector3(cosine, 0, -sine),
    ahead: new THREE.Vector3(-sine, 0, -cosine),
    back: new THREE.Vector3(steep * sine, Math.sin(view.elevation), steep * cosine)
  };
}

// The nearest place from which every corner of the box is within the picture, top to bottom.
function showAll() {
  view.azimuth = 0;
  view.elevation = Math.PI / 4;
  const { right, back } = axes(), up = new THREE.Vector3().crossVectors(back, right);
  const tall = .97 * Math.tan(FIELD / 2), wide = tall * camera.aspect;
  const centre = box.getCenter(new THREE.Vector3());
  let over = 1, under = 1, beside = 1;
  for (let i = 0; i < 8; i++) {
    const corner = new THREE.Vector3(
      i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z
    ).sub(centre);
    const depth = corner.dot(back), height = corner.dot(up) / tall;
    over = Math.max(over, depth + height);
    under = Math.max(under, depth - height);
    beside = Math.max(beside, depth + Math.abs(corner.dot(right)) / wide);
  }
  // Raised so that it clears both edges alike; then the place on the ground in the picture's middle.
  const raised = (over - under) / 2 * tall, away = Math.max((over + under) / 2, beside);
  const eye = centre.clone().addScaledVector(up, raised).addScaledVector(back, away);
  view.distance = (eye.y - centre.y) / back.y;
  view.target.copy(eye).addScaledVector(back, -view.distance);
}

// #camera=x,y,z,tx,ty,tz in the map's frame, z up; false if there is none.
function showAddress() {
  const values = (location.hash.match(/[#&]camera=([^&]*)/) || ["", ""])[1].split(",").map(parseFloat);
  if (values.length !== 6 || !values.every(Number.isFinite)) return false;
  const [x, y, z, tx, ty, tz] = values;
  const offset = new THREE.Vector3(x - tx, z - tz, ty - y), distance = offset.length();
  if (distance < 1e-3) return false;
  view.target.set(tx, tz, -ty);
  view.distance = distance;
  view.azimuth = Math.atan2(offset.x, offset.z);
  view.elevation = Math.asin(offset.y / distance);
  untouched = false;
  return true;
}

function reach() {
  return box.getSize(new THREE.Vector3()).length();
}

function draw() {
  pending = false;
  view.elevation = Math.min(STEEPEST, Math.max(-STEEPEST, view.elevation));
  camera.position.copy(view.target).addScaledVector(axes().back, view.distance);
  camera.lookAt(view.target);
  // The farther out the near plane, the finer the depths are told apart. Nothing stands higher than the box,
  // and little stands close to an eye high above its target.
  const eye = camera.position;
  camera.near = Math.max(.15, .05 * (eye.y - view.target.y), .8 * (eye.y - box.max.y));
  camera.far = camera.near + 2 * (eye.distanceTo(box.getCenter(new THREE.Vector3())) + reach());
  camera.updateProjectionMatrix();
  renderer.render(scene, camera);
}

function redraw() {
  if (!pending) requestAnimationFrame(draw);
  pending = true;
}

function resize() {
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  if (untouched) showAll();
  redraw();
}

function turn(dx, dy) {
  view.azimuth -= dx * .005;
  view.elevation += dy * .005;
}

function move(dx, dy) {
  const scale = 2 * view.distance * Math.tan(FIELD / 2) / innerHeight, { right, ahead } = axes();
  view.target.addScaledVector(right, -dx * scale);
  view.target.addScaledVector(ahead, dy * scale / Math.max(.25, Math.sin(view.elevation)));
}

function zoom(factor) {
  view.distance = Math.min(10 * reach(), Math.max(.5, view.distance * factor));
}

function listen(canvas) {
  const fingers = new Map();
  const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  canvas.addEventListener("contextmenu", event => event.preventDefault());
  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  for (const end of ["pointerup", "pointercancel"])
    canvas.addEventListener(end, event => fingers.delete(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    const last = fingers.get(event.pointerId);
    if (!last || fingers.size > 2) return;
    const dx = event.clientX - last.x, dy = event.clientY - last.y;
    const before = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    untouched = false;
    if (fingers.size === 2) { move(dx / 2, dy / 2); zoom(before / Math.max(1, spread())); }
    else if (event.shiftKey || event.buttons & 6) move(dx, dy);
    else turn(dx, dy);
    redraw();
  });
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    untouched = false;
    zoom(Math.exp(event.deltaY * (event.deltaMode ? .03 : .001)));
    redraw();
  }, { passive: false });
  addEventListener("keydown", event => {
    if (event.key !== "Home") return;
    untouched = true;
    showAll();
    redraw();
  });
  addEventListener("hashchange", () => { if (showAddress()) redraw(); });
  addEventListener("resize", resize);
}

// Older scenes have no normals; what three.js derives per pixel instead breaks up near the eye. Paint is
// drawn as if it lay nearer, because from kilometres away its centimetre above the road is lost in rounding.
function prepare(mesh) {
  mesh.material = mesh.material.clone();
  if (!mesh.geometry.attributes.normal) {
    mesh.geometry = mesh.geometry.toNonIndexed();
    mesh.geometry.computeVertexNormals();
    mesh.material.flatShading = false;
  }
  mesh.material.polygonOffset = /^(crossing|marking|stop_line|arrow)/.test(mesh.name);
  mesh.material.polygonOffsetFactor = -1;
  mesh.material.polygonOffsetUnits = -16;
}

function start(gltf) {
  gltf.scene.traverse(node => { if (node.isMesh) prepare(node); });
  box = new THREE.Box3().setFromObject(gltf.scene);
  if (box.isEmpty()) box.set(new THREE.Vector3(-1, 0, -1), new THREE.Vector3(1, 0, 1));
  scene.add(makeSky(), ...makeLights(), gltf.scene);
  document.body.appendChild(renderer.domElement);
  listen(renderer.domElement);
  showAddress();
  resize();
  say("Drag to turn, right-drag to move, wheel to zoom, Home for the whole map");
}

try {
  renderer = new THREE.WebGLRenderer({ antialias: true });
  renderer.setPixelRatio(Math.min(2, devicePixelRatio));
  renderer.outputEncoding = THREE.sRGBEncoding;
  camera = new THREE.PerspectiveCamera(FIELD * 180 / Math.PI, 1, .1, 1000);
  scene = new THREE.Scene();
  new THREE.GLTFLoader().parse(decodeScene(), "", start, error => say("The scene cannot be read: " + error));
} catch (error) {
  say("The scene cannot be shown: " + error);
}
"""
