"""What a detector finds in traffic cameras' pictures, how well it counts, and what relying on it costs.

Pictures of 1280 x 896 are taken through the approaches' cameras, evenly over an hour under MaxPressure. A
vehicle counts that is at least 24 px high and more than 60 % visible, driven or parked. It is found where a
box overlaps its own by half (intersection over union), the best pairs first. A false alarm is a box on no
road user at all. Counts are those of single looks, per lane, beside the true ones and those that perfect
boxes would give.

With --control, MaxPressure also runs from the truth, from perfect boxes and from the detector, for so long.

    python tools/bench_detector.py nanodet.onnx centernet.onnx --views mast_arm 3,-6 --conditions day rain
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dojo_env.camera import BEV
from dojo_env.camera_presets import CAMERA_PRESETS, PAPER
from dojo_env.conditions import read_conditions
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.detectors import Detections, DetectorModel, load_detector
from dojo_env.detectors.measuring import LaneWatch
from dojo_env.detectors.suppression import measure_overlaps
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.sensors.video_detector import PICTURE, TRUE_BOXES, VideoDetector, list_true_boxes
from dojo_env.snapshot import Kind, Snapshot
from dojo_maps.whole_file import write_json

VIEWS = (PAPER, "usual", "6,-15", "3,-6")
"""Names of `CAMERA_PRESETS`, or metres above the ground and degrees above the horizon."""
BINS = ((24, 48), (48, 96), (96, 10_000))
"""Pixels of height."""
LEAST_VISIBLE, LEAST_OVERLAP, TOUCHING = 0.6, 0.5, 0.3
PEOPLE = (Kind.PEDESTRIAN, Kind.WHEELCHAIR, Kind.PRAM)
HEAVY = {Kind.BUS: {Kind.BUS, Kind.COACH}, Kind.TRUCK: {Kind.TRUCK, Kind.TRAILER, Kind.FIRE_ENGINE}}
"""Kinds that detectors name, and what they stand for."""
CONTROLLER = "max-pressure-paper"
"""It needs counts of lanes alone."""


@dataclass
class Tally:
    """What a detector found in the pictures of one view and light."""

    there: Counter[tuple[int, int]] = field(default_factory=Counter)
    found: Counter[tuple[int, int]] = field(default_factory=Counter)
    heavy: int = 0
    named: int = 0
    right: int = 0
    false: int = 0
    pictures: int = 0
    seconds: float = 0.0
    vehicles: set[str] = field(default_factory=set)
    off_truth: list[float] = field(default_factory=list)
    off_perfect: list[float] = field(default_factory=list)

    def row(self) -> dict[str, Any]:
        """Give the figures by name."""
        there, found = sum(self.there.values()), sum(self.found.values())
        return {
            "recall": found / max(there, 1),
            "precision": self.right / max(self.right + self.false, 1),
            "by_height": {f"{a}-{b}": f"{self.found[a, b]}/{self.there[a, b]}" for a, b in BINS},
            "heavy_named": f"{self.named}/{self.heavy}",
            "counts_off": float(np.mean(self.off_truth or [0.0])),
            "counts_off_perfect": float(np.mean(self.off_perfect or [0.0])),
            "vehicles": len(self.vehicles),
            "pictures": self.pictures,
            "ms_a_picture": 1e3 * self.seconds / max(self.pictures, 1),
        }


def open_world(scenario: str, view: str, light: str, **keywords: Any) -> LocalWorld:
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


def record(scenario: str, count: int) -> list[Snapshot]:
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


def match(found: Detections, boxes: Any, tally: Tally) -> None:
    """Count what was found of the vehicles of one picture, and what was found where nobody is."""
    found = found.take(found.kinds != Kind.PEDESTRIAN)
    heights = boxes.picture[:, 3] - boxes.picture[:, 1]
    counted = ~np.isin(boxes.kinds, PEOPLE) & (heights >= BINS[0][0]) & (boxes.visible > LEAST_VISIBLE)
    overlaps = measure_overlaps(boxes.picture.astype(float), found.boxes)
    pairs: dict[int, int] = {}
    for flat in np.argsort(-overlaps, axis=None, kind="stable").tolist():
        row, column = divmod(flat, max(len(found), 1))
        if overlaps[row, column] < LEAST_OVERLAP:
            break
        if counted[row] and row not in pairs and column not in pairs.values():
            pairs[row] = column
    for row in np.flatnonzero(counted).tolist():
        size = next((a, b) for a, b in BINS if a <= heights[row] < b)
        tally.there[size] += 1
        tally.found[size] += row in pairs
        tally.vehicles.add(boxes.ids[row])
        name = next((name for name, kinds in HEAVY.items() if boxes.kinds[row] in kinds), None)
        if name is not None and row in pairs:
            tally.heavy += 1
            tally.named += int(found.kinds[pairs[row]] == name)
    touched = overlaps.max(axis=0, initial=0.0) >= TOUCHING
    tally.right += len(pairs)
    tally.false += int((~touched).sum())


def look(model: DetectorModel, scenario: str, snapshots: Sequence[Snapshot], view: str, light: str) -> Tally:
    """Let a detector look at each signal's approaches in each snapshot."""
    world = open_world(scenario, view, light)
    tally, road_map = Tally(), world.map.bundle.road_map
    for signal in world.signals:
        cameras = [each for each in world.eyes.cameras(signal) if each.name != BEV]
        lanes = world.map.plans[signal].lanes
        watches = [LaneWatch(cameras, road_map, lanes) for _ in range(2)]
        for snapshot in snapshots:
            pictures = world.eyes.look(snapshot, cameras, ("rgb", "boxes"))
            begin = time.perf_counter()
            found = [model.detect(picture.rgb) for picture in pictures]
            tally.seconds += time.perf_counter() - begin
            tally.pictures += len(pictures)
            for each, picture in zip(found, pictures, strict=True):
                match(each, picture.boxes, tally)
            perfect = [list_true_boxes(picture.boxes) for picture in pictures]
            counts = []
            for watch, seen in zip(watches, (found, perfect), strict=True):
                watch.reset()
                counts.append(watch.update(snapshot.time, seen).vehicles)
            true = np.array([snapshot.lanes.count(lane) for lane in lanes])
            tally.off_truth += np.abs(counts[0] - true).tolist()
            tally.off_perfect += np.abs(counts[0] - counts[1]).tolist()
    world.close()
    return tally


def control(
    model: str | None, scenario: str, view: str, light: str, seconds: int, seed: int
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


def list_rows(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Measure, one detector, scenario, view and light after the other."""
    models = {path: load_detector(path) for path in options.detectors}
    for scenario in options.scenarios:
        snapshots = record(scenario, options.n) if options.n else []
        for light in options.conditions:
            for view in options.views:
                where = {"scenario": scenario, "view": view, "light": light}
                for path, model in models.items() if snapshots else ():
                    found = look(model, scenario, snapshots, view, light)
                    yield {"detector": path.name, **where, **found.row()}
                for name in ("truth", TRUE_BOXES, *map(str, models)) if options.control else ():
                    for seed in range(options.seeds):
                        told = control(
                            None if name == "truth" else name,
                            scenario, view, light, options.control, seed,
                        )  # fmt: skip
                        yield {"control": Path(name).name, **where, "seed": seed, **told}


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
    add("--control", type=int, default=0, metavar="S", help="seconds to control by the detector")
    add("--seeds", type=int, default=1, metavar="N", help="of the controlled episodes")
    add("--json", type=Path, metavar="FILE", help="also write the figures")
    options = parser.parse_args()
    rows = []
    for row in list_rows(options):
        rows.append(row)
        print("  ".join(map(tell, row, row.values())), flush=True)
    if options.json:
        write_json(options.json, {"rows": rows})


def tell(name: str, value: Any) -> str:
    """Write a figure with its name."""
    return f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"


if __name__ == "__main__":
    main()
