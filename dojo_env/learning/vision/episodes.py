"""What the network of lanes learns from: strips of many junctions in all weathers, and what is on them."""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera_presets import CAMERA_PRESETS, LONG_VIEW, PAPER
from dojo_env.conditions import Conditions
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.forks import call_in_fork
from dojo_env.local_world import LocalWorld
from dojo_env.notes import notes_unsaid
from dojo_env.reading import HALTING
from dojo_env.sensors.background import Background
from dojo_env.sensors.lane_network import SEEN
from dojo_env.sensors.strip_geometry import CELL, CELLS, REACH, Strip, build_strips, cut_strips, measure_along
from dojo_env.snapshot import Kind, Lights, Snapshot

BUSES = (Kind.BUS, Kind.ARTICULATED_BUS)
_CARS = (Kind.CAR, Kind.HATCHBACK, Kind.SALOON, Kind.ESTATE)
_DRESSED: tuple[tuple[float, Kind, tuple[float, float, float], Lights], ...] = (
    (0.030, Kind.AMBULANCE, (6.5, 2.2, 2.7), Lights.BLUE),
    (0.010, Kind.FIRE_ENGINE, (8.5, 2.5, 3.2), Lights.BLUE),
    (0.020, Kind.POLICE, (4.8, 1.9, 1.6), Lights.BLUE),
    (0.010, Kind.POLICE, (4.8, 1.9, 1.6), Lights.NONE),
    (0.005, Kind.AMBULANCE, (6.5, 2.2, 2.7), Lights.NONE),
    (0.050, Kind.BUS, (12.0, 2.5, 3.2), Lights.NONE),
    (0.030, Kind.TRUCK, (8.0, 2.5, 3.4), Lights.NONE),
    (0.020, Kind.VAN, (5.5, 2.0, 2.2), Lights.NONE),
)
"""Shares of the cars that are shown as something else: most demands have nobody but cars."""
_PRESETS = [name for name in CAMERA_PRESETS if name != LONG_VIEW]
"""How cameras hang from which it is learned; `LONG_VIEW` lies between `PAPER` and the others."""
_CONTROLLERS = ("queue-pressure", "max-pressure", "cycle", "random")
_WEATHER = (
    ("rain", 0.25, 0.1, 1.0), ("fog", 0.2, 0.003, 0.03), ("noise", 0.5, 1.0, 12.0), ("blur", 0.2, 0.3, 1.2),
    ("dirt", 0.2, 0.1, 0.8), ("drops", 0.15, 0.1, 0.8), ("shake_m", 0.5, 0.05, 0.4),
    ("shake_deg", 0.5, 0.2, 1.5), ("sway_deg", 0.2, 0.05, 0.3),
)  # fmt: skip
"""What may spoil an episode's pictures: in which share of them, and from how much to how much."""
_WARM_UP = 60
"""Seconds until there is traffic."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """An episode to take pictures of.

    Attributes:
        scenario: name or path.
        signals: ids of those that are looked at.
        seed: of SUMO, of the conditions, and of who is shown as what.
        seconds: simulated.
        looks: how often it is looked, twice a second apart each time.
        scale: of the demand.
        controller: who sets the signals.
        preset: how the cameras hang.
        imaging: how they work.
        conditions: light and weather.
    """

    scenario: str
    signals: tuple[str, ...]
    seed: int
    seconds: int
    looks: int
    scale: float = 1.0
    controller: str = "queue-pressure"
    preset: str = PAPER
    imaging: str = "ideal"
    conditions: Conditions


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examples:
    """Strips, and what is on them.

    Attributes:
        strips: (n, rows, columns, 9) colours now, a second before, and of the background.
        places: (n,) row of `geometry`.
        geometry: (m, rows, columns, 6) of each strip that was looked at.
        truth: (n, cells, 4) 1 where there is what `lane_network.SEEN` names.
        shares: (m, cells) what a vehicle there counts; 0 where nothing is in view.
    """

    strips: NDArray[np.uint8]
    places: NDArray[np.int64]
    geometry: NDArray[np.float32]
    truth: NDArray[np.uint8]
    shares: NDArray[np.float64]


def draw_case(junctions: Sequence[tuple[str, Sequence[str]]], *, seed: int, seconds: int, looks: int) -> Case:
    """Draw an episode: half of the time its cameras hang as they usually do here.

    Args:
        junctions: scenarios, and the ids of each one's signals.
        seed: of the episode; it decides everything.
        seconds: simulated.
        looks: how often it is looked.

    Returns:
        The episode, with one to three signals that are looked at.
    """
    draw = np.random.default_rng(seed)
    scenario, signals = junctions[int(draw.integers(len(junctions)))]
    count = int(draw.integers(1, min(3, len(signals)) + 1))
    chosen = sorted(draw.choice(len(signals), count, replace=False))
    return Case(
        scenario=scenario,
        signals=tuple(signals[place] for place in chosen),
        seed=seed,
        seconds=seconds,
        looks=looks,
        scale=round(float(draw.uniform(0.5, 1.6)), 2),
        controller=str(draw.choice(_CONTROLLERS)),
        preset=PAPER if draw.random() < 0.5 else str(draw.choice(_PRESETS)),
        imaging="traffic_camera" if draw.random() < 0.2 else "ideal",
        conditions=draw_conditions(draw),
    )


def draw_conditions(draw: np.random.Generator) -> Conditions:
    """Draw any hour and weather; each of the things that spoil pictures now and then.

    Args:
        draw: numbers; the same generator gives others the next time.

    Returns:
        Light, weather and lenses of an episode.
    """
    spoilt: dict[str, Any] = {
        name: float(draw.uniform(low, high)) for name, share, low, high in _WEATHER if draw.random() < share
    }
    return Conditions(
        hour=float(draw.uniform(0.0, 24.0)),
        overcast=float(draw.uniform(0.0, 1.0)),
        exposure=float(draw.uniform(-0.7, 0.7)),
        **spoilt,
    )


def take_examples(case: Case) -> Examples:
    """Run an episode in a fork, so that it is the same whatever ran before in this process.

    Args:
        case: the episode.

    Returns:
        The strips of all looks at its signals, and what is on them.

    Raises:
        SimulationError: SUMO stopped.
    """
    found: Examples = call_in_fork(_take, case)
    return found


def _take(case: Case) -> Examples:
    draw = np.random.default_rng([case.seed, 1])
    config = build_config(
        scenario=case.scenario,
        ts_ids=case.signals,
        num_seconds=case.seconds,
        delta_time=1,
        additional_sumo_cmd=f"--scale {case.scale:g}",
        conditions=case.conditions,
        cameras=case.preset,
        imaging=case.imaging,
    )
    acting = make_controller(case.controller)
    acting.reset(case.seed)
    times = set(draw.choice(np.arange(_WARM_UP, case.seconds - 1), case.looks, replace=False).tolist())
    with notes_unsaid(), closing(LocalWorld(config)) as world:
        world.reset(case.seed)
        watched = _Watch(world, case)
        for second in range(1, case.seconds):
            world.step(acting.act(world.instant))
            if second in times or second - 1 in times:
                watched.look(is_second=second - 1 in times)
    return watched.collect()


class _Watch:
    """Cuts the strips of an episode's signals, and notes what is on them."""

    def __init__(self, world: LocalWorld, case: Case) -> None:
        self._world, self._seed = world, case.seed
        plans = world.map.plans
        self._strips: list[Strip] = [
            strip
            for signal in case.signals
            for strip in build_strips(world.eyes.scene, plans[signal], world.eyes.cameras(signal))
            if strip.camera is not None
        ]
        self._cameras = list(dict.fromkeys(strip.camera for strip in self._strips if strip.camera))
        self._background = Background()
        self._before: NDArray[np.uint8] | None = None
        self._shone = set[int]()
        self._found: list[NDArray[np.uint8]] = []
        self._truth: list[NDArray[np.uint8]] = []

    def look(self, *, is_second: bool) -> None:
        """Look, and take an example of each strip where one has looked a second ago, too."""
        snapshot = _dress(self._world.instant.snapshot, self._seed)
        pictures = self._world.eyes.look(snapshot, self._cameras)
        seen = {camera: each.rgb for camera, each in zip(self._cameras, pictures, strict=True)}
        now, shining = cut_strips(self._strips, seen), _list_shining(snapshot)
        usual = self._background.add(snapshot.time, now, np.zeros(len(now), bool))
        if is_second and self._before is not None:
            self._found.append(np.concatenate([now, self._before, usual], axis=3))
            urgent = shining | self._shone
            self._truth.append(np.stack([mark_cells(strip, snapshot, urgent) for strip in self._strips]))
        self._before, self._shone = now, shining

    def collect(self) -> Examples:
        """Put all examples together."""
        count = len(self._strips)
        return Examples(
            strips=np.concatenate(self._found),
            places=np.tile(np.arange(count), len(self._found)),
            geometry=np.stack([strip.geometry for strip in self._strips]),
            truth=np.concatenate(self._truth),
            shares=np.stack([strip.shares for strip in self._strips]),
        )


def _list_shining(snapshot: Snapshot) -> set[int]:
    """List the numbers of those whose blue lights are lit; they flash."""
    return set(snapshot.numbers[(snapshot.lights & Lights.BLUE) > 0].tolist())


def mark_cells(strip: Strip, snapshot: Snapshot, urgent: AbstractSet[int] = frozenset()) -> NDArray[np.uint8]:
    """Tell what is on a strip.

    Args:
        strip: of a lane.
        snapshot: everyone on the road.
        urgent: numbers of those who flash blue.

    Returns:
        (cells, 4) 1 where a front is in the cell: of who stands, of who moves, of a bus, of who is urgent.
    """
    marks = np.zeros((CELLS, len(SEEN)), np.uint8)
    rows = np.array([row for row, lane in enumerate(snapshot.lanes) if lane in strip.sources], int)
    if not len(rows):
        return marks
    along, _ = measure_along(strip.line, snapshot.positions[rows])
    for row, distance in zip(rows[along < REACH], along[along < REACH], strict=True):
        cell, kind = int(distance / CELL), snapshot.kinds[row]
        marks[cell, 0 if snapshot.speeds[row] < HALTING else 1] = 1
        marks[cell, 2] |= kind in BUSES
        marks[cell, 3] |= int(snapshot.numbers[row]) in urgent
    return marks


def _dress(snapshot: Snapshot, seed: int) -> Snapshot:
    """Show some cars as something else, always the same; who stands where longer ones do is left out."""
    values = snapshot.__getstate__()
    kinds, sizes, lights = (values[name].copy() for name in ("kinds", "sizes", "lights"))
    kept = np.ones(len(kinds), bool)
    for row in np.flatnonzero(np.isin(kinds, _CARS)).tolist():
        chance = np.random.default_rng([seed, int(snapshot.numbers[row])]).random()
        for share, kind, size, shine in _DRESSED:
            chance -= share
            if chance < 0:
                kinds[row], sizes[row] = kind, size
                lights[row] |= shine * int((snapshot.time + snapshot.numbers[row]) % 2 < 1)  # Once in 2 s.
                kept &= ~_is_covered(snapshot, row, size[0])
                break
    rows = np.flatnonzero(kept)
    values |= {"kinds": kinds, "sizes": sizes, "lights": lights}
    arrays = {name: each[rows] for name, each in values.items() if isinstance(each, np.ndarray)}
    texts = {
        name: tuple(values[name][row] for row in rows) for name in ("ids", "lanes", "types") if values[name]
    }
    return Snapshot.trusted(**{**values, **arrays, **texts})


def _is_covered(snapshot: Snapshot, row: int, length: float) -> NDArray[np.bool_]:
    """Tell who is on the ground that a road user would cover, were it as long as that."""
    heading = snapshot.headings[row]
    behind = (snapshot.positions[row] - snapshot.positions)[:, :2]
    along = behind @ [np.cos(heading), np.sin(heading)]
    aside = np.abs(behind @ [-np.sin(heading), np.cos(heading)])
    return (along > 0) & (along < length + 0.5) & (aside < 1.5)
