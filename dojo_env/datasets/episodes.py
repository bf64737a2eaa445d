"""What is simulated of an episode: instants apart in time, and which cameras take a picture of each.

It runs in a fork (see `forks`), so that an episode is the same whatever ran before it. No picture is drawn
here; that somebody is in view, and has moved since the last picture, is told by where road users stand.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.controllers import make_controller
from dojo_env.datasets.labelling import NextLink
from dojo_env.local_world import LocalWorld
from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Kind, Snapshot

_MOVED = 0.5
"""Metres that somebody in view must have moved for another picture."""
_WARM_UP = 120.0
"""Seconds until there is traffic, at most a fifth of an episode."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """An instant, and who takes a picture of it.

    Attributes:
        snapshot: everyone on the road.
        links: the signal's link that each vehicle comes to, by SUMO's id.
        shots: the camera's place in the list of cameras, and whether the roads are to be empty.
    """

    snapshot: Snapshot
    links: Mapping[str, NextLink]
    shots: tuple[tuple[int, bool], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """When pictures are taken.

    Attributes:
        interval: seconds from one instant to the next.
        begin: simulated seconds of the episode's begin.
        end: and of its end.
        count: pictures wanted.
        least_pixels: of a road user that counts as in view.
        negatives: share of them with empty roads.
        is_sequential: every instant is taken, by every camera.
        seed: of what is random here, and of SUMO.
    """

    interval: float
    begin: float
    end: float
    count: int
    least_pixels: int
    negatives: float
    is_sequential: bool
    seed: int


def simulate(
    world: LocalWorld, controller: str, cameras: Sequence[Camera], sampling: Sampling
) -> list[Sample]:
    """Simulate an episode until there are as many pictures as wanted, or until its end.

    Args:
        world: of the scenario.
        controller: name of who sets the signals.
        cameras: that take the pictures.
        sampling: when.

    Returns:
        The instants of which pictures are taken, in the order of time.

    Raises:
        SimulationError: SUMO refuses the scenario, or stopped.
    """
    sampler = _Sampler(world.traffic.simulation, cameras, sampling)
    acting, managers = make_controller(controller), world.managers
    world.managers = (*managers, sampler)
    try:
        acting.reset(sampling.seed)
        world.reset(sampling.seed)
        has_ended = False
        while not (has_ended or sampler.is_done):
            has_ended = world.step(acting.act(world.instant))[2]
    finally:
        world.managers = managers
        world.traffic.simulation.close()
    return sampler.samples


class _Sampler(Manager):
    """Looks at the simulation after each of its steps."""

    def __init__(self, simulation: Simulation, cameras: Sequence[Camera], sampling: Sampling) -> None:
        self.samples: list[Sample] = []
        self._simulation, self._cameras, self._sampling = simulation, cameras, sampling
        self._left = sampling.count
        self._random = np.random.default_rng(sampling.seed)
        self._next = sampling.begin + self._draw_start()
        self._last: dict[int, Mapping[int, tuple[float, ...]]] = {}

    @property
    def is_done(self) -> bool:
        """Whether there are as many pictures as wanted."""
        return self._left == 0

    def step(self, turn: Turn) -> None:
        """Take the pictures that are due."""
        simulation = self._simulation
        if self._left == 0 or simulation.time < self._next - 1e-6:
            return
        self._next += self._sampling.interval
        snapshot = simulation.read_snapshot()
        shots = tuple(self._choose(snapshot))[: self._left]
        if shots:
            vehicles = [
                name
                for name, kind in zip(snapshot.ids, snapshot.kinds, strict=True)
                if kind != Kind.PEDESTRIAN
            ]
            links = dict(zip(vehicles, simulation.list_next_links(vehicles), strict=True))
            self.samples.append(Sample(snapshot=snapshot, links=links, shots=shots))
            self._left -= len(shots)

    def _draw_start(self) -> float:
        """Draw when the first picture is due, seconds after the episode's begin, with time left for all."""
        sampling = self._sampling
        length = sampling.end - sampling.begin
        warm = min(_WARM_UP, length / 5)
        needed = 1.5 * sampling.interval * sampling.count / max(len(self._cameras), 1)
        return float(self._random.uniform(warm, max(warm, length - needed)))

    def _choose(self, snapshot: Snapshot) -> Iterator[tuple[int, bool]]:
        for k, camera in enumerate(self._cameras):
            if self._sampling.is_sequential:
                yield k, False
            elif self._random.random() < self._sampling.negatives:
                yield k, True
            elif self._is_new(k, camera, snapshot):
                yield k, False

    def _is_new(self, k: int, camera: Camera, snapshot: Snapshot) -> bool:
        """Tell whether somebody is in view, and anything has changed there since the last picture."""
        rows = np.flatnonzero(_in_view(camera, snapshot, self._sampling.least_pixels))
        places = {int(snapshot.numbers[row]): tuple(snapshot.positions[row].tolist()) for row in rows}
        last = self._last.get(k)
        if not places or (last is not None and not _has_moved(last, places)):
            return False
        self._last[k] = places
        return True


def _in_view(camera: Camera, snapshot: Snapshot, least_pixels: int) -> NDArray[np.bool_]:
    """Tell of whom a camera would see enough, were nothing in between: (n,), from their largest side."""
    pixels, away = camera.project(snapshot.positions + snapshot.sizes * np.array([0.0, 0.0, 0.5]))
    largest = np.sqrt(snapshot.sizes[:, 0] * snapshot.sizes[:, 1:].max(axis=1))
    farthest = np.minimum(camera.far, camera.focal_length * largest / np.sqrt(least_pixels))
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels < [camera.width, camera.height])).all(axis=1)
    return inside & (away > camera.near) & (away < farthest)


def _has_moved(before: Mapping[int, tuple[float, ...]], now: Mapping[int, tuple[float, ...]]) -> bool:
    return before.keys() != now.keys() or any(_distance(before[k], now[k]) > _MOVED for k in now)


def _distance(a: Iterable[float], b: Iterable[float]) -> float:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))
