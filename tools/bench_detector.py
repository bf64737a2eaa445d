"""What a detector finds in traffic cameras' pictures, how well it counts, and what relying on it costs.

Pictures of 1280 x 896 are taken through the approaches' cameras, evenly over an hour under MaxPressure. A
vehicle counts, driven or parked, that is at least 24 px high and more than 60 % visible: neither hidden nor
cut off by the picture's edge. It is found where a box overlaps its own by half (intersection over union), the
best pairs first. People count alike. Riders count apart, found as people or as what they ride, as detectors
learn the two apart.
All other boxes of vehicles are false if they lie by less than half on road users, else doubles: second boxes
on a vehicle, its parts, and boxes that fit it badly. COCO takes doubles for false, too: `precision_coco`.
Neutral is what is less than 24 px high, as with COCO's and KITTI's least sizes, and what lies by half on road
users that are too small or too hidden to count, or on riders, as with COCO's crowds and KITTI's ignored
regions. Each camera also looks at the street without traffic or parked cars: `on_empty` is what is false.
Counts are those of single looks, per lane, beside the true ones and those that perfect boxes would give.

`distinct` is how many different vehicles a recall stands on; with more instants (-n) it grows: -n 8 sees 40
to 60 at each junction from 3 m, the view with the fewest, and -n 24 sees 150, so that two junctions make 300.

With --mixed, a bundle's demand has lorries, buses, coaches, vans and riders among its cars.
With --control, MaxPressure also runs from the truth, from perfect boxes and from the detector, for so long.

    python tools/bench_detector.py nanodet.onnx centernet.onnx --views mast_arm 3,-6 --conditions day rain
    python tools/bench_detector.py nanodet.onnx centernet.onnx --scenarios cologne1 cologne3 one.dojo -n 24
"""

import argparse
import re
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.camera_presets import CAMERA_PRESETS, PAPER
from dojo_env.conditions import read_conditions
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.detectors import Detections, DetectorModel, load_detector
from dojo_env.detectors.measuring import LaneWatch
from dojo_env.detectors.suppression import measure_overlaps
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.rendering.boxes import Boxes
from dojo_env.rendering.outputs import Picture
from dojo_env.scenario import Scenario
from dojo_env.sensors.video_detector import PICTURE, TRUE_BOXES, VideoDetector, list_true_boxes
from dojo_env.snapshot import Kind, Snapshot
from dojo_maps.bundle import DEMAND
from dojo_maps.input_files import read_bytes
from dojo_maps.whole_file import write_json, write_text

VIEWS = (PAPER, "usual", "6,-15", "3,-6")
"""Names of `CAMERA_PRESETS`, or metres above the ground and degrees above the horizon."""
BINS = ((24, 48), (48, 96), (96, 10_000))
"""Pixels of height."""
LEAST_VISIBLE, LEAST_OVERLAP = 0.6, 0.5
PEOPLE = (Kind.PEDESTRIAN, Kind.WHEELCHAIR, Kind.PRAM)
RIDERS = (Kind.BICYCLE, Kind.MOTORCYCLE, Kind.SCOOTER)
HEAVY = {Kind.BUS: {Kind.BUS, Kind.COACH}, Kind.TRUCK: {Kind.TRUCK, Kind.TRAILER, Kind.FIRE_ENGINE}}
"""Kinds that detectors name, and what they stand for."""
MIXED = {"truck": 12, "bus": 12, "coach": 6, "trailer": 6, "delivery": 10, "motorcycle": 8, "bicycle": 8}
"""SUMO's classes that cars become with --mixed, and their percents."""
CONTROLLER = "max-pressure-paper"
"""It needs counts of lanes alone."""


@dataclass
class Tally:
    """What a detector found in the pictures of one view and light; adds up."""

    there: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    right: int = 0
    false: int = 0
    doubles: int = 0
    false_people: int = 0
    on_empty: int = 0
    pictures: int = 0
    seconds: float = 0.0
    vehicles: frozenset[str] = frozenset()
    off_truth: list[float] = field(default_factory=list)
    off_perfect: list[float] = field(default_factory=list)

    def __add__(self, other: "Tally") -> "Tally":
        """Put two together."""
        return Tally(
            **{
                each.name: (
                    self.vehicles | other.vehicles
                    if each.name == "vehicles"
                    else getattr(self, each.name) + getattr(other, each.name)
                )
                for each in fields(self)
            }
        )

    def row(self) -> dict[str, Any]:
        """Give the figures by name."""
        shown = {name: f"{self.found[name]}/{self.there[name]}" for name in sorted(self.there)}
        return {
            "recall": self.found["vehicles"] / max(self.there["vehicles"], 1),
            "precision": self.right / max(self.right + self.false, 1),
            "precision_coco": self.right / max(self.right + self.false + self.doubles, 1),
            **shown,
            "false": self.false,
            "doubles": self.doubles,
            "false_people": self.false_people,
            "on_empty": self.on_empty,
            "counts_off": float(np.mean(self.off_truth or [0.0])),
            "counts_off_perfect": float(np.mean(self.off_perfect or [0.0])),
            "distinct": len(self.vehicles),
            "pictures": self.pictures,
            "ms_a_picture": 1e3 * self.seconds / max(self.pictures, 1),
        }


def open_world(scenario: Any, view: str, light: str, **keywords: Any) -> LocalWorld:
    """Open a scenario whose approaches' cameras hang as a view has it, see `VIEWS`."""
    seen = {"width": PICTURE[0], "height": PICTURE[1], "conditions": read_conditions(light)}
    if view in CAMERA_PRESETS:
        return LocalWorld(build_config(scenario=scenario, cameras=view, **seen, **keywords))
    try:
        height, pitch = map(float, view.split(","))
    except ValueError:
        known = ", ".join(CAMERA_PRESETS)
        raise ConfigError(f"view {view!r}: expected one of {known}, or height,pitch such as 6,-15") from None
    placed = LocalWorld(build_config(scenario=scenario, **seen))
    lower = CAMERA_PRESETS[PAPER].height - height
    cameras = {
        signal: [
            replace(each, position=(*each.position[:2], each.position[2] - lower), pitch_deg=pitch)
            for each in placed.eyes.cameras(signal)
            if each.name != BEV
        ]
        for signal in placed.signals
    }
    placed.close()
    return LocalWorld(build_config(scenario=scenario, cameras=cameras, **seen, **keywords))


def record(scenario: Any, count: int) -> list[Snapshot]:
    """Take snapshots evenly over an hour under MaxPressure."""
    world = LocalWorld(build_config(scenario=scenario))
    chooser = make_controller(CONTROLLER)
    chooser.reset(1)
    world.reset(1)
    taken, ended = [], False
    while not ended:
        ended = world.step(chooser.act(world.perceive()))[2]
        taken.append(world.instant.snapshot)
    world.close()
    return [taken[round(k)] for k in np.linspace(len(taken) / 10, len(taken) - 1, count)]


def measure_inside(boxes: Boxes, camera: Camera) -> NDArray[np.float64]:
    """Tell which share of each road user lies within the picture, by the rectangle around its box: (k,)."""
    low, high = boxes.projected.min(axis=1), boxes.projected.max(axis=1)
    size = (camera.width, camera.height)
    inside = (high.clip(0, size) - low.clip(0, size)).prod(axis=1) / (high - low).prod(axis=1)
    return np.nan_to_num(inside)  # What reaches behind the camera is cut off.


def pair(overlaps: NDArray[np.float64], counted: NDArray[np.bool_]) -> dict[int, int]:
    """Pair what is counted with what was found: column by row, the best overlaps first."""
    pairs: dict[int, int] = {}
    for flat in np.argsort(-overlaps, axis=None, kind="stable").tolist():
        row, column = divmod(flat, max(overlaps.shape[1], 1))
        if overlaps[row, column] < LEAST_OVERLAP:
            break
        if counted[row] and row not in pairs and column not in pairs.values():
            pairs[row] = column
    return pairs


def match(told: Detections, picture: Picture, scenario: str, tally: Tally) -> None:
    """Count what was found of the road users of one picture, and what was found where nobody is."""
    boxes = picture.boxes
    heights = boxes.picture[:, 3] - boxes.picture[:, 1]
    seen = boxes.visible * measure_inside(boxes, picture.camera)
    counted = (heights >= BINS[0][0]) & (seen > LEAST_VISIBLE)
    are_people, ride = np.isin(boxes.kinds, PEOPLE), np.isin(boxes.kinds, RIDERS)
    overlaps = measure_overlaps(boxes.picture.astype(float), told.boxes)
    by_person = told.kinds == Kind.PEDESTRIAN
    pairs = pair(np.where(by_person, 0.0, overlaps), counted & ~are_people & ~ride)
    tally.right += len(pairs)
    pairs |= pair(np.where(by_person, overlaps, 0.0), counted & are_people)
    pairs |= pair(overlaps, counted & ride)
    for row in np.flatnonzero(counted).tolist():
        names = ["people"] if are_people[row] else ["riders"] if ride[row] else ["vehicles"]
        if names == ["vehicles"]:
            names += next([f"{a}-{b} px"] for a, b in BINS if a <= heights[row] < b)
            tally.vehicles |= {f"{scenario} {boxes.ids[row]}"}
        tally.there.update(names)
        tally.found.update(names if row in pairs else ())
        for name, kinds in HEAVY.items():
            if boxes.kinds[row] in kinds:
                tally.there[name.name.lower()] += 1
                tally.found[name.name.lower()] += row in pairs
            if boxes.kinds[row] in kinds and row in pairs:
                tally.there[f"{name.name.lower()}, named"] += 1
                tally.found[f"{name.name.lower()}, named"] += int(told.kinds[pairs[row]] == name)
    wrong = told.boxes[:, 3] - told.boxes[:, 1] >= BINS[0][0]
    wrong &= measure_covered(told.boxes, picture, ~counted | ride) < LEAST_OVERLAP
    wrong[list(pairs.values())] = False
    is_double = measure_covered(told.boxes, picture, ~are_people) >= LEAST_OVERLAP
    tally.false += int((wrong & ~by_person & ~is_double).sum())
    tally.doubles += int((wrong & ~by_person & is_double).sum())
    tally.false_people += int((wrong & by_person).sum())


def measure_covered(
    found: NDArray[np.float64], picture: Picture, users: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Tell which share of each of the found boxes (n, 4) lies on the boxes of some road users: (n,)."""
    covered = np.zeros(picture.rgb.shape[:2], dtype=bool)
    for left, top, right, bottom in picture.boxes.picture[users]:
        covered[top:bottom, left:right] = True
    whole = found.round().clip(0, np.tile(covered.shape[::-1], 2)).astype(int)
    parts = [covered[top:bottom, left:right] for left, top, right, bottom in whole]
    return np.array([part.mean() if part.size else 1.0 for part in parts])


def look(
    models: Mapping[str, DetectorModel], scenario: Any, snapshots: Sequence[Snapshot], view: str, light: str
) -> dict[str, Tally]:
    """Let detectors look at each signal's approaches in each snapshot."""
    world = open_world(scenario, view, light)
    tallies, road_map = {name: Tally() for name in models}, world.map.bundle.road_map
    for signal in world.signals:
        cameras = [each for each in world.eyes.cameras(signal) if each.name != BEV]
        lanes = world.map.plans[signal].lanes
        watch = LaneWatch(cameras, road_map, lanes)

        def count(at: float, seen: Sequence[Detections], watch: LaneWatch = watch) -> NDArray[np.float64]:
            watch.reset()
            return watch.update(at, seen).vehicles

        empty = world.eyes.look(Snapshot(time=0.0), cameras, ("rgb", "boxes"), parked=False)
        for snapshot in snapshots:
            pictures = world.eyes.look(snapshot, cameras, ("rgb", "boxes"))
            perfect = count(snapshot.time, [list_true_boxes(picture.boxes) for picture in pictures])
            true = np.array([snapshot.lanes.count(lane) for lane in lanes])
            for name, model in models.items():
                tally, begin = tallies[name], time.perf_counter()
                found = [model.detect(picture.rgb) for picture in pictures]
                tally.seconds += time.perf_counter() - begin
                tally.pictures += len(pictures)
                for each, picture in zip(found, pictures, strict=True):
                    match(each, picture, world.config.scenario.name, tally)
                counts = count(snapshot.time, found)
                tally.off_truth += np.abs(counts - true).tolist()
                tally.off_perfect += np.abs(counts - perfect).tolist()
        for name, model in models.items():
            alone = Tally()
            for picture in empty:
                match(model.detect(picture.rgb), picture, "", alone)
            tallies[name].on_empty += alone.false
    world.close()
    return tallies


def mix(scenario: str, folder: Path) -> Scenario:
    """Give a bundle's demand other vehicles, too: which ones, follows from their ids."""
    bundle = Path(scenario)
    lots = [name for name, percent in MIXED.items() for _ in range(percent)]

    def change(found: re.Match[str]) -> str:
        lot = crc32(found[1].encode()) % 100
        return f'<vehicle id="{found[1]}" type="{f"mixed_{lots[lot]}" if lot < len(lots) else "car"}"'

    text = read_bytes(bundle / DEMAND).decode()
    text = re.sub(r'<vehicle id="([^"]+)" type="car"', change, text)
    types = "".join(f'<vType id="mixed_{name}" vClass="{name}"/>' for name in MIXED)
    routes = folder / f"{bundle.stem}.rou.xml"
    write_text(routes, text.replace("<routes>", f"<routes>{types}", 1))
    return Scenario(name=f"{bundle.stem}, mixed", map=bundle, routes=(routes,))


def control(
    model: str | None, scenario: Any, view: str, light: str, seconds: int, seed: int
) -> dict[str, float]:
    """Run MaxPressure by a detector, or where there is none by the truth: travel time, errors per lane."""
    chooser = make_controller(CONTROLLER)
    seen = "features" if model is None else VideoDetector(model=model)
    world = open_world(scenario, view, light, observation=seen, num_seconds=seconds, **chooser.settings)
    chooser.reset(seed)
    world.reset(seed)
    errors: dict[str, list[float]] = {"counts_off": [], "queues_off": []}
    ended = False
    while not ended:
        told = world.perceive()
        for signal, each in told.signals.items():
            true = world.instant.signals[signal].lanes
            errors["counts_off"] += np.abs(each.lanes.vehicles - true.vehicles).tolist()
            errors["queues_off"] += np.abs(each.lanes.halting - true.halting).tolist()
        ended = world.step(chooser.act(told))[2]
    figures = world.metrics()
    world.close()
    return {
        **{name: float(figures[name]) for name in ("travel_time", "travel_time_all", "queue")},
        **{name: float(np.mean(values)) for name, values in errors.items()},
    }


def list_rows(options: argparse.Namespace, folder: Path) -> Iterator[dict[str, Any]]:
    """Measure, one scenario, light and view after the other; at last all scenarios together."""
    models = {path.name: load_detector(path) for path in options.detectors}
    total: dict[tuple[str, str, str], Tally] = {}
    for name in options.scenarios:
        scenario = mix(name, folder) if options.mixed else name
        snapshots = record(scenario, options.n) if options.n else []
        for light, view in product(options.conditions, options.views):
            where = {"scenario": Path(name).stem, "view": view, "light": light}
            seen = look(models, scenario, snapshots, view, light) if snapshots else {}
            for detector, tally in seen.items():
                yield {"detector": detector, **where, **tally.row()}
                key = (detector, view, light)
                total[key] = total.get(key, Tally()) + tally
            for told in list_controlled(options, scenario, view, light) if options.control else ():
                yield {**where, **told}
    for (detector, view, light), tally in total.items() if len(options.scenarios) > 1 else ():
        yield {"detector": detector, "scenario": "all", "view": view, "light": light, **tally.row()}


def list_controlled(
    options: argparse.Namespace, scenario: Any, view: str, light: str
) -> Iterator[dict[str, Any]]:
    """Control by the truth, by perfect boxes and by each detector."""
    for name in ("truth", TRUE_BOXES, *map(str, options.detectors)):
        for seed in range(options.seeds):
            model = None if name == "truth" else name
            told = control(model, scenario, view, light, options.control, seed)
            yield {"control": Path(name).name, "seed": seed, **told}


def main() -> None:
    """Print a line for each measurement."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("detectors", type=Path, nargs="+", metavar="FILE", help=".onnx, or .json that names one")
    add("--scenarios", nargs="+", default=["cologne1"], metavar="NAME")
    add("--views", nargs="+", default=VIEWS, metavar="VIEW", help="a preset of cameras, or H,PITCH")
    add("--conditions", nargs="+", default=["day"], metavar="NAME", help="day, dusk, rain, night, ...")
    add("-n", type=int, default=8, metavar="N", help="instants; each is seen by all cameras")
    add("--mixed", action="store_true", help="with lorries, buses and riders; scenarios are bundles' folders")
    add("--control", type=int, default=0, metavar="S", help="seconds to control by the detector")
    add("--seeds", type=int, default=1, metavar="N", help="of the controlled episodes")
    add("--json", type=Path, metavar="FILE", help="also write the figures")
    options = parser.parse_args()
    for name in options.scenarios if options.mixed else ():
        if not (Path(name) / DEMAND).is_file():
            parser.error(f"--mixed: {name} is no bundle with a demand; make one with dojo-maps demand")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for row in list_rows(options, Path(folder)):
            rows.append(row)
            print("  ".join(map(tell, row, row.values())), flush=True)
    if options.json:
        write_json(options.json, {"rows": rows})


def tell(name: str, value: Any) -> str:
    """Write a figure with its name."""
    return f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"


if __name__ == "__main__":
    main()
