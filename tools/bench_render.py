"""Frames per second of the raster renderer, beside pybullet's TinyRenderer and Panda3D's software renderer.

    pip install 'traffic-dojo[bench]'
    python tools/bench_render.py [--quick]
    python tools/bench_render.py --imaging

All draw the same frames of 356 x 256 pixels on one core in one run; times are the processor's. `cologne1` at
rush hour is real traffic from SUMO; the other rows place vehicles along the lanes around a signal. `dense` is
cologne1 with thousands of blocks around it: twenty times as many static triangles. The last lines say which
goals hold.

`--imaging` tells instead what each thing that conditions and cameras do to a picture of 640 x 448 pixels
costs, in milliseconds of processor time.
"""

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench_panda import PandaWorld
from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.config import EnvConfig, SensingConfig
from dojo_env.imaging import IMAGING_PRESETS, Imaging
from dojo_env.rendering.bullet import BulletWorld
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import Scene, build_scene
from dojo_env.scenario import find_scenario, open_map
from dojo_env.sensors.eyes import Eyes
from dojo_env.sensors.placement import place_cameras
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Snapshot
from dojo_maps.bundle import Bundle
from dojo_maps.errors import ToolMissingError

RUSH_HOUR = {"cologne1": 35, "cologne8": 35}
"""Vehicles within `NEAR` of the junction that the benchmark waits for."""
NEAR = 100.0
GOALS = {
    "frames a second": 3000.0, "plain frames a second": 10000.0, "times Panda3D": 4.0, "times pybullet": 50.0,
}  # fmt: skip
LIMITS = {"MB an environment": 200.0, "seconds until a first picture": 1.5}


def rush_hour(name: str, signal_position: np.ndarray, wanted: int) -> Snapshot:
    """Run a scenario until this many vehicles are near its first signal, or for as long as it lasts."""
    scenario = find_scenario(name)
    bundle = open_map(scenario)
    simulation = Simulation(bundle.network, EnvConfig(scenario=scenario))
    simulation.start(seed=1)
    best, most = Snapshot(time=0.0), -1
    for second in range(3000):
        simulation.step()
        if second % 20 == 0:
            snapshot = simulation.read_snapshot()
            near = int((np.linalg.norm(snapshot.positions[:, :2] - signal_position, axis=1) < NEAR).sum())
            if near > most:
                best, most = snapshot, near
            if most >= wanted:
                break
    simulation.close()
    return best


def crowd(base: Snapshot, count: int, centre: np.ndarray) -> Snapshot:
    """The vehicles nearest to a place, or copies of them beside each other where there are too few."""
    order = np.argsort(np.linalg.norm(base.positions[:, :2] - centre, axis=1), kind="stable")
    rows = np.resize(order, count) if len(order) else np.empty(0, dtype=int)
    moved = base.positions[rows].copy()
    moved[:, :2] += 0.7 * (np.arange(count) // max(1, len(order)))[:, None]
    columns = ("kinds", "headings", "slopes", "sizes", "colours", "lights", "speeds")
    return replace(
        base,
        ids=tuple(f"v{k}" for k in range(count)),
        numbers=np.arange(1, count + 1, dtype=np.int32),
        positions=moved,
        lanes=tuple(base.lanes[k] for k in rows),
        types=tuple(base.types[k] for k in rows),
        **{name: getattr(base, name)[rows] for name in columns},
    )


def densify(scene: Scene, times: int) -> Scene:
    """Put blocks on the map until it has this many times its triangles."""
    generator = np.random.default_rng(1)
    count = (times - 1) * len(scene.faces) // 12
    low, high = scene.vertices.min(axis=0)[:2], scene.vertices.max(axis=0)[:2]
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    faces = np.array([(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7),
                      (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)])  # fmt: skip
    places = np.column_stack([generator.uniform(low, high, (count, 2)), np.full(count, -0.5)])
    sizes = generator.uniform(0.2, 0.6, (count, 1, 3))
    vertices = (places[:, None] + corners * sizes).reshape(-1, 3)
    more = (faces + 8 * np.arange(count)[:, None, None]).reshape(-1, 3) + len(scene.vertices)
    same = np.zeros(len(more), dtype=int)
    return replace(
        scene,
        vertices=np.concatenate([scene.vertices, vertices]),
        faces=np.concatenate([scene.faces, more.astype(np.int32)]),
        normals=np.concatenate([scene.normals, np.tile([0.0, 0.0, 1.0], (len(more), 1))]),
        semantics=np.concatenate([scene.semantics, scene.semantics[same]]),
        surfaces=np.concatenate([scene.surfaces, scene.surfaces[same]]),
        colours=np.concatenate([scene.colours, scene.colours[same]]),
        things=np.concatenate([scene.things, scene.things[same]]),
    )


def milliseconds(draw: Callable[[], object], budget: float) -> float:
    """Time one call: the median processor time of as many as fit a budget of seconds, five at least."""
    draw()
    taken: list[float] = []
    end = time.perf_counter() + budget
    while len(taken) < 5 or time.perf_counter() < end:
        start = time.process_time()
        draw()
        taken.append(time.process_time() - start)
    return 1000 * statistics.median(taken)


SPOILT = {
    **{f"rain={k}": Conditions(rain=k) for k in (0.3, 0.9)},
    "noise=4": Conditions(noise=4.0), "blur=0.6": Conditions(blur=0.6), "dirt=0.5": Conditions(dirt=0.5),
    "drops=0.5": Conditions(drops=0.5), "sway_deg=0.1": Conditions(sway_deg=0.1),
    "dropped=1": Conditions(dropped=1.0),
    "auto_exposure=1": Imaging(auto_exposure=1.0), "vignetting=0.3": Imaging(vignetting=0.3),
    "glare=0.5": Imaging(glare=0.5), "shot_noise=2, read_noise=0.3": Imaging(shot_noise=2.0, read_noise=0.3),
    "jpeg_quality=75": Imaging(jpeg_quality=75), "h264_kbps=1000": Imaging(h264_kbps=1000.0),
    "shutter_s=0.01, readout_s=0.016": Imaging(shutter_s=0.01, readout_s=0.016),
    **{name: body for name, body in IMAGING_PRESETS.items() if name != "ideal"},
}  # fmt: skip
"""What may be done to a picture, each alone, and all that a camera does."""


def report_imaging(bundle: Bundle, snapshot: Snapshot, camera: Camera) -> None:
    """Print what each artefact costs beside the perfect picture."""
    camera = replace(camera, width=640, height=448)
    times = iter(range(10**9))

    def cost(conditions: Conditions, imaging: Imaging, hung: Camera = camera) -> float:
        eyes = Eyes(bundle, SensingConfig(conditions=conditions, imaging=imaging))
        eyes.reset(1)
        return milliseconds(lambda: eyes.look(replace(snapshot, time=float(next(times))), [hung]), 1.5)

    def tell(name: str, taken: float) -> None:
        print(f"{name:<33}{taken:7.2f} ms{taken - perfect:+8.2f} ms", flush=True)

    perfect = cost(Conditions(), Imaging())
    tell("perfect", perfect)
    bent = replace(camera, distortion=(-0.2, 0.03, 0.0, 0.0))
    tell("distortion", cost(Conditions(), Imaging(), bent))
    for name, what in SPOILT.items():
        is_state = isinstance(what, Conditions)
        tell(name, cost(what if is_state else Conditions(), Imaging() if is_state else what))


def several(cameras: Sequence[Camera], count: int) -> tuple[Camera, ...]:
    """Take this many cameras, the same ones under other names where there are too few."""
    return tuple(replace(cameras[k % len(cameras)], name=f"c{k}") for k in range(count))


def drawing(renderer: Renderer, snapshot: Snapshot, cameras: Sequence[Camera]) -> Callable[[], object]:
    """Draw two like instants in turn: of the one before, the road users are in place already."""
    instants = itertools.cycle((snapshot, replace(snapshot)))
    return lambda: renderer.render(next(instants), cameras)


def compare(
    label: str, scene: Scene, snapshot: Snapshot, cameras: Sequence[Camera], budget: float
) -> dict[str, float]:
    """Draw the same frames with each renderer, and print a row."""
    renderer = Renderer(scene)
    start = time.perf_counter()
    renderer.render(snapshot, cameras)
    first = time.perf_counter() - start
    raster = milliseconds(drawing(renderer, snapshot, cameras), budget)
    row = {"raster": raster / len(cameras)}
    for name, world in (("bullet", BulletWorld), ("panda3d", PandaWorld)):
        try:
            peer = world(scene)
        except ToolMissingError as error:
            print(f"  {name}: {error}", file=sys.stderr)
            continue
        row[name] = milliseconds(lambda peer=peer: peer.render(snapshot, cameras), budget) / len(cameras)
        peer.close()
    mine = row["raster"]
    peers = "".join(f"  {name} {row[name]:7.2f} ms = {row[name] / mine:5.1f} x" for name in list(row)[1:])
    print(
        f"{label:<19} {len(cameras):>2} cameras {len(snapshot.ids):>4} vehicles {len(scene.faces):>6} faces:"
        f" {mine:6.3f} ms a camera = {1000 / mine:5.0f} frames/s; first {first:4.1f} s;{peers}",
        flush=True,
    )
    return row


_MEMORY = """
import json, sys
def measure():
    rows = dict(line.split(":") for line in open("/proc/self/smaps_rollup").read().splitlines()[1:])
    return {name: int(rows[name].split()[0]) / 1024 for name in ("Rss", "Pss")}
import libsumo, numpy
alone = measure()
if sys.argv[1:]:
    import pathlib
    from dojo_env.rendering.renderer import Renderer
    from dojo_env.rendering.scene import build_scene
    from dojo_env.sensors.placement import place_cameras
    from dojo_env.snapshot import Snapshot
    from dojo_maps.bundle import read_bundle
    scene = build_scene(read_bundle(sys.argv[1]))
    renderer = Renderer(scene)
    renderer.render(Snapshot(time=0.0), place_cameras(scene, scene.road_map.signals[0].id))
print(json.dumps([alone, measure()]))
"""
_FIRST = """
import sys, time
import gymnasium, dojo_env
env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario=sys.argv[1], observation="bev")
env.reset(seed=1)
print(time.process_time())
"""


def in_process(script: str, *arguments: object, **environment: str) -> str:
    """Run a script in a process of its own, which keeps its modules compiled as an installed package does."""
    command = [sys.executable, "-c", script, *map(str, arguments)]
    known = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(  # noqa: S603 - our own script
        command, env={**known, **environment}, check=True, capture_output=True, text=True
    ).stdout


def report_costs(bundle: Path) -> dict[str, float]:
    """Print what an environment adds to libsumo, and the time from a process's start to a first picture."""
    in_process(_MEMORY, bundle)
    alone, drawing = json.loads(in_process(_MEMORY, bundle))
    added = {name: drawing[name] - alone[name] for name in alone}
    print(f"memory beside libsumo: {added['Rss']:.0f} MB, {added['Pss']:.0f} MB with shared pages divided")
    with tempfile.TemporaryDirectory() as cache:
        cold = float(in_process(_FIRST, "cologne1", NUMBA_CACHE_DIR=cache))
        warm = min(float(in_process(_FIRST, "cologne1", NUMBA_CACHE_DIR=cache)) for _ in range(3))
    print(
        f"process until the first picture: {cold:.1f} s where kernels are compiled, {warm:.2f} s after that"
    )
    return {"MB an environment": added["Rss"], "seconds until a first picture": warm}


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer rows, less time for each")
    parser.add_argument("--imaging", action="store_true", help="what cameras and weather do to pictures")
    options = parser.parse_args()
    quick = options.quick
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    budget = 0.5 if quick else 2.0
    goal: dict[str, float] = {}
    for name in ("cologne1",) if quick else ("cologne1", "cologne8"):
        bundle = open_map(find_scenario(name))
        scene = build_scene(bundle)
        signal = scene.road_map.signals[0]
        cameras = place_cameras(scene, signal.id)
        centre = np.mean([head.position for head in signal.heads], axis=0)[:2]
        real = rush_hour(name, centre, RUSH_HOUR[name])
        if options.imaging:
            report_imaging(bundle, real, cameras[0])
            return
        goal = goal or compare(f"{name}, rush hour", scene, real, cameras, budget)
        for cameras_wanted in (1, 4, 5, 16):
            for vehicles in (35,) if quick else (0, 35, 100, 200):
                views = several(cameras, cameras_wanted)
                compare(name, scene, crowd(real, vehicles, centre), views, budget / 2)
        if name == "cologne1":
            dense = compare("dense", densify(scene, 20), real, cameras, budget)["raster"]
            print(f"twenty times the static triangles: {dense / goal['raster']:.2f} times the time")
            plain = milliseconds(drawing(Renderer(scene, look="plain"), real, cameras), budget) / len(cameras)
            costs = report_costs(bundle.folder)
    reached = {"frames a second": 1000 / goal["raster"], "plain frames a second": 1000 / plain}
    peers = {"panda3d": "times Panda3D", "bullet": "times pybullet"}
    reached |= {shown: goal[name] / goal["raster"] for name, shown in peers.items() if name in goal}
    for goals, values, sign in ((GOALS, reached, 1), (LIMITS, costs, -1)):
        for what, value in values.items():
            word = "holds " if sign * value >= sign * goals[what] else "MISSED"
            print(f"{word}  {what}: {value:,.4g}, goal {goals[what]:,.4g}")


if __name__ == "__main__":
    main()
