"""One part of a data set: an episode simulated, drawn, labelled and written into a folder of its own."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from json import dumps
from pathlib import Path
from typing import Any
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.config import EnvConfig, SensingConfig, build_config
from dojo_env.controllers import make_controller
from dojo_env.datasets.cameras import choose_cameras
from dojo_env.datasets.card import count_pictures
from dojo_env.datasets.episodes import Sample, Sampling, simulate
from dojo_env.datasets.formats import FORMATS
from dojo_env.datasets.labelling import OUTPUTS, Instant, Thresholds, Tracks, Ways, without_users
from dojo_env.datasets.labels import PictureLabels
from dojo_env.datasets.settings import CAMERA, DatasetSettings, Job, divide_among
from dojo_env.datasets.weather import draw_conditions
from dojo_env.errors import ConfigError
from dojo_env.forks import call_in_fork
from dojo_env.local_world import LocalWorld
from dojo_env.rendering.outputs import Picture
from dojo_env.sensors.eyes import Eyes
from dojo_maps.errors import WriteError
from dojo_maps.whole_file import write_text

LABELS, COUNTS, TREE = "labels", "counts.json", "tree"
"""Of a part: the lines that hold all of its labels; what there is, counted; the files of the data set."""
_MOST_RUNS = 50
"""Simulations that an episode is continued with, where it gives less pictures than wanted."""
_WORLDS_KEPT = 6
_DEPTH_STEPS, _DEEPEST = 256, 65535
"""Of a metre, and the largest value: depths as KITTI writes them."""
_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.-]+")
_PNG = (
    *(cv2.IMWRITE_PNG_COMPRESSION, 1),
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
    *((cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_AVG) if hasattr(cv2, "IMWRITE_PNG_FILTER") else ()),
)
"""Half the time of OpenCV's own choice, and files as large."""


def make_part(settings: DatasetSettings, job: Job, folder: Path) -> None:
    """Make an episode's part of a data set.

    Args:
        settings: of the data set.
        job: the episode.
        folder: to fill: `TREE` with the data set's files, a file of lines for each that all parts share.

    Raises:
        ConfigError: a setting cannot work with this scenario.
        SimulationError: SUMO refuses the scenario, or stopped.
        WriteError: there is no room.
    """
    made = FORMATS[settings.format]
    tree = folder / TREE
    pictures = tuple(take_pictures(settings, job, tree))
    files = made.write_part(pictures, settings)
    for path, text in files.items():
        (tree / path).parent.mkdir(parents=True, exist_ok=True)
        (tree / path).write_text(text, encoding="utf-8")
    lines = {**made.write_lines(pictures), LABELS: [dumps(each.describe()) for each in pictures]}
    for name, found in lines.items():
        write_text(folder / f"{name}.lines", "".join(f"{line}\n" for line in found))
    write_text(folder / COUNTS, dumps(count_pictures(pictures)))


def scenario_config(settings: DatasetSettings, scenario: str, controller: str = "fixed-time") -> EnvConfig:
    """Settle how a scenario is simulated.

    Args:
        settings: of the data set.
        scenario: its name or path.
        controller: name of who sets the signals.

    Returns:
        The configuration. Where sequences ask for less than a second between frames, that is SUMO's step.

    Raises:
        ConfigError: there is no such scenario, or it cannot be simulated so.
    """
    keywords: dict[str, Any] = {"scenario": scenario, "num_seconds": settings.seconds}
    interval = settings.interval or 1.0
    if FORMATS[settings.format].is_sequential and interval < 1.0:
        keywords |= {"additional_sumo_cmd": f"--step-length {interval:g}", "delta_time": 5.0}
        if abs(5.0 / interval - round(5.0 / interval)) > 1e-6:
            raise ConfigError(f"interval={interval}: five seconds are no whole number of such steps")
    return build_config(**make_controller(controller).complete(keywords))


class Stage:
    """A scenario, ready to be simulated and looked at."""

    def __init__(self, settings: DatasetSettings, scenario: str) -> None:
        """Open it."""
        self.world = open_scenario(settings, scenario, "fixed-time")
        bundle = self.world.map.bundle
        self.eyes = Eyes(bundle, SensingConfig(smooth=settings.smooth, parked=settings.parked))
        self.cameras, self._divided = _hang_cameras(settings, scenario, self.world, self.eyes)
        self.ways = Ways(bundle.road_map)
        self.name = self.world.config.scenario.name

    def list_cameras(self, split: str) -> tuple[Camera, ...]:
        """List the cameras that take the pictures of a split.

        Args:
            split: `train`, `val` or `test`.

        Returns:
            Its own cameras where cameras are divided among the splits, else all of them.
        """
        return tuple(self._divided.get(split, self.cameras))


def check_cameras_suffice(settings: DatasetSettings) -> None:
    """See that each scenario has cameras for every split.

    Args:
        settings: of the data set.

    Raises:
        ConfigError: there are fewer cameras than splits that have their own.
    """
    for scenario in dict.fromkeys(settings.scenarios if settings.split_by == CAMERA else ()):
        world = LocalWorld(scenario_config(settings, scenario))
        _hang_cameras(settings, scenario, world, Eyes(world.map.bundle, SensingConfig()))


def _hang_cameras(
    settings: DatasetSettings, scenario: str, world: LocalWorld, eyes: Eyes
) -> tuple[Sequence[Camera], Mapping[str, Sequence[Camera]]]:
    """Choose a scenario's cameras, and divide them among the splits; not at all where every split has all."""
    cameras = choose_cameras(settings.cameras, eyes.scene, world.signals, settings.size)
    if settings.split_by != CAMERA:
        return cameras, {}
    random = np.random.default_rng([settings.seed, crc32(scenario.encode())])
    mixed = [cameras[k] for k in random.permutation(len(cameras))]
    return cameras, divide_among(settings, mixed, "camera")


@lru_cache(maxsize=_WORLDS_KEPT)
def open_scenario(settings: DatasetSettings, scenario: str, controller: str) -> LocalWorld:
    """Open a scenario as a controller wants it.

    Args:
        settings: of the data set.
        scenario: its name or path.
        controller: name of who sets the signals.

    Returns:
        The world, with no episode running. The last few that were opened are kept and given again.

    Raises:
        ConfigError: there is no such scenario, or it cannot be simulated so.
        SimulationError: SUMO refuses the scenario, or stopped.
    """
    world = LocalWorld(scenario_config(settings, scenario, controller))
    world.prepare()
    return world


open_stage = lru_cache(maxsize=2)(Stage)


def take_pictures(settings: DatasetSettings, job: Job, tree: Path) -> Iterator[PictureLabels]:
    """Take all pictures of an episode: simulate, draw, write and label.

    Args:
        settings: of the data set.
        job: the episode.
        tree: folder that stands for the data set's.

    Yields:
        The labels of a picture that is written, in the order of the pictures' numbers.

    Raises:
        ConfigError: the scenario gives too few.
        SimulationError: SUMO refuses the scenario, or stopped.
        WriteError: a picture cannot be written.
    """
    random = np.random.default_rng(job.seed)
    controller = settings.controllers[int(random.integers(len(settings.controllers)))]
    conditions = draw_conditions(settings.conditions, int(random.integers(2**31)))
    stage = open_stage(settings, job.scenario)
    imaging = settings.imaging[int(random.integers(len(settings.imaging)))]
    stage.eyes.config = replace(stage.eyes.config, conditions=conditions, imaging=imaging)
    stage.eyes.reset(int(random.integers(2**31)))
    cameras = stage.list_cameras(job.split)
    shooting = _Shooting(settings, job, tree, stage, controller)
    for run in range(_MOST_RUNS):
        before = shooting.taken
        sampling = _plan_sampling(settings, stage, int(random.integers(2**31)), job.pictures - before)
        samples = call_in_fork(
            simulate, open_scenario(settings, job.scenario, controller), controller, cameras, sampling
        )
        for sample in samples:
            yield from shooting.shoot(sample, run, sampling.seed)
        if shooting.taken == job.pictures:
            return
        if shooting.taken == before:
            break
    raise ConfigError(
        f"{job.scenario}: an episode gives {shooting.taken} of {job.pictures} pictures; let it be longer, or "
        "take more cameras, a shorter interval, or fewer pictures per episode"
    )


def _plan_sampling(settings: DatasetSettings, stage: Stage, seed: int, count: int) -> Sampling:
    sumo = stage.world.config.sumo
    return Sampling(
        interval=settings.interval or 1.0,
        begin=sumo.begin,
        end=sumo.end,
        count=count,
        least_pixels=settings.least_pixels,
        negatives=settings.negatives or 0.0,
        is_sequential=FORMATS[settings.format].is_sequential,
        seed=seed,
    )


class _Shooting:
    """Takes the pictures of one episode, one after the other."""

    def __init__(
        self, settings: DatasetSettings, job: Job, tree: Path, stage: Stage, controller: str
    ) -> None:
        self.taken = 0
        self._settings, self._job, self._tree, self._stage = settings, job, tree, stage
        self._controller, self._cameras = controller, stage.list_cameras(job.split)
        self._tracks = Tracks()
        self._frames: Counter[str] = Counter()
        self._thresholds = Thresholds(
            least_pixels=settings.least_pixels, least_visible=settings.least_visible
        )
        self._sequences = [
            f"{_plain(stage.name)}-{job.number:06d}-{k:02d}-{_plain(camera.name)}"
            for k, camera in enumerate(self._cameras)
        ]

    def shoot(self, sample: Sample, run: int, seed: int) -> Iterator[PictureLabels]:
        """Take an instant's pictures.

        Args:
            sample: the instant.
            run: which of the episode's simulations it is of.
            seed: of that.
        """
        stage = self._stage
        self._tracks.run = run
        for is_empty in (False, True):
            places = [k for k, empty in sample.shots if empty is is_empty]
            if not places:
                continue
            snapshot = without_users(sample.snapshot) if is_empty else sample.snapshot
            scene = stage.eyes.scene
            everyone = snapshot if is_empty else snapshot.joined(scene.parked)
            instant = Instant(everyone, sample.links, stage.ways, scene)
            for k in places:
                (picture,) = stage.eyes.look(snapshot, [self._cameras[k]], OUTPUTS, parked=not is_empty)
                yield self._keep(picture, instant, snapshot, k, run=run, seed=seed, is_empty=is_empty)

    def _keep(
        self,
        picture: Picture,
        instant: Instant,
        snapshot: Any,
        k: int,
        *,
        run: int,
        seed: int,
        is_empty: bool,
    ) -> PictureLabels:
        """Write a picture and its depths, and label it."""
        settings, job = self._settings, self._job
        sequence = self._sequences[k] + (f"-{run}" if run else "")
        self._frames[sequence] += 1
        number, frame = job.first + self.taken, self._frames[sequence]
        place, depth = FORMATS[settings.format].place(job.split, sequence, frame, number)
        file, depth = f"{place}.{settings.picture}", f"{depth}.png" if settings.depth else ""
        _write(self._tree / file, cv2.cvtColor(picture.rgb, cv2.COLOR_RGB2BGR), settings.quality)
        if depth:
            steps = np.rint(picture.depth * np.float32(_DEPTH_STEPS))
            _write(self._tree / depth, np.where(steps <= _DEEPEST, steps, 0).astype(np.uint16), 0)
        self.taken += 1
        return PictureLabels(
            number=number,
            file=file,
            depth=depth,
            split=job.split,
            scenario=self._stage.name,
            episode=job.number,
            sequence=sequence,
            frame=frame,
            seed=seed,
            controller=self._controller,
            time=snapshot.time,
            camera=picture.camera,
            conditions=self._stage.eyes.conditions,
            imaging=self._stage.eyes.imaging,
            signals=dict(snapshot.signals),
            is_empty=is_empty,
            objects=instant.label(picture, self._tracks, self._thresholds),
        )


def _write(path: Path, picture: NDArray[Any], quality: int) -> None:
    """Write a picture, blue first, or depths."""
    options: Sequence[int] = (cv2.IMWRITE_JPEG_QUALITY, quality)
    if path.suffix == ".png":
        options = _PNG
    is_made, data = cv2.imencode(path.suffix, picture, options)
    if not is_made:
        raise WriteError(f"{path}: cannot be written as a picture")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.tobytes())


def _plain(name: str) -> str:
    """Make a name that is safe as a file's."""
    return _NOT_PLAIN.sub("_", name).strip(".")[:60] or "_"
