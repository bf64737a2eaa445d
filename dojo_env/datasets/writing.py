"""Writing a data set: episode by episode, in processes or on a cluster, resumable, and whole in the end.

FOLDER/dataset.json       settings, versions, inputs: who goes on must have the same
FOLDER/parts/000012/      an episode's part, whole or not there
FOLDER/...                the data set's own files, once all parts are there; then `parts` is removed
"""

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, Unpack

from dojo_env.datasets.cameras import check_cameras
from dojo_env.datasets.card import add_counts, write_card
from dojo_env.datasets.cluster import run_on_cluster
from dojo_env.datasets.formats import FORMATS
from dojo_env.datasets.parts import (
    COUNTS,
    LABELS,
    TREE,
    check_cameras_suffice,
    make_part,
    scenario_config,
)
from dojo_env.datasets.settings import DatasetSettings, Job, Plan
from dojo_env.datasets.workers import run_calls
from dojo_env.errors import ConfigError, DatasetError
from dojo_env.keywords import DatasetKeywords
from dojo_env.scenario import open_map
from dojo_maps.errors import WriteError
from dojo_maps.input_files import opened, sha256_of
from dojo_maps.safe_json import read_json
from dojo_maps.whole_file import replaced, replaced_folder, write_json, write_text

DATASET, CARD, PARTS, ALL_LABELS = "dataset.json", "README.md", "parts", "labels.jsonl"
_FORMAT, _VERSION = "dojo-dataset", 1
_PACKAGES = ("traffic-dojo", "eclipse-sumo", "libsumo", "numba", "numpy", "opencv-python-headless")
_BYTES_A_PIXEL = {"jpg": 0.5, "png": 2.0}
"""At most, usually, with labels; depths take as much as a JPEG."""
_LEFT_FREE = 200_000_000
"""Bytes that are left free on the disk."""


def write_dataset(
    folder: str | Path,
    settings: DatasetSettings | None = None,
    *,
    jobs: int | None = None,
    ray: str | None = None,
    on_stage: Callable[[str], None] = lambda _stage: None,
    **keywords: Unpack[DatasetKeywords],
) -> dict[str, Any]:
    """Write a data set, or go on with one of the same settings that was interrupted.

    The same settings give the same bytes, in however many processes, and however often it was interrupted.

    Args:
        folder: to make, or to go on in.
        settings: of the data set; None makes them of `keywords`.
        jobs: processes at once; None takes one per core.
        ray: HOST:PORT of a Ray cluster, or `local`; None works in processes of this machine.
        on_stage: told now and then how far it is.
        keywords: as `DatasetSettings` has them.

    Returns:
        What `dataset.json` holds: `settings`, `versions`, `scenarios`, and `counts` of all there is.

    Raises:
        ConfigError: a setting cannot work, or the folder holds something else.
        SimulationError: SUMO refuses a scenario, or stopped.
        WriteError: there is no room.
    """
    folder = Path(folder)
    settings = settings if settings is not None else _build_settings(keywords)
    plan = Plan(settings=settings)
    facts = _describe(settings, on_stage)
    check_cameras_suffice(settings)
    known = _begin(folder, facts)
    if known["complete"]:
        return known
    missing = [job for job in plan.jobs if not (folder / PARTS / job.name).is_dir()]
    _check_room(folder, settings, sum(job.pictures for job in missing))
    done = settings.pictures - sum(job.pictures for job in missing)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = cores if jobs is None else jobs
    for job in _run(folder, settings, missing, count, ray):
        done += job.pictures
        on_stage(f"{done:,} of {settings.pictures:,} pictures")
        _check_room(folder, settings, job.pictures * count)
    return _finish(folder, plan, facts)


def _build_settings(keywords: Mapping[str, Any]) -> DatasetSettings:
    try:
        return DatasetSettings(**keywords)
    except TypeError as error:
        raise ConfigError(f"data set: {error}") from error


def _run(
    folder: Path, settings: DatasetSettings, missing: list[Job], count: int, ray: str | None
) -> Iterator[Job]:
    """Make the parts that are missing; yields each episode when its part is there."""
    if count < 1:
        raise ConfigError(f"jobs={count}: expected at least 1")
    parts = folder / PARTS
    parts.mkdir(exist_ok=True)
    if ray is not None and missing:
        yield from run_on_cluster(settings, missing, parts, ray, count)
        return
    for place in run_calls([(_make_part, (settings, job, parts)) for job in missing], count):
        yield missing[place]


def _make_part(settings: DatasetSettings, job: Job, parts: Path) -> None:
    with replaced_folder(parts / job.name) as folder:
        make_part(settings, job, folder)


def _describe(settings: DatasetSettings, on_stage: Callable[[str], None]) -> dict[str, Any]:
    """Tell what the data set's bytes depend on; maps are converted here where they have not been."""
    files = check_cameras(settings.cameras)
    scenarios = []
    for name in settings.scenarios:
        scenario = scenario_config(settings, name).scenario
        bundle = open_map(scenario, on_stage=on_stage)
        scenarios.append(
            {
                "name": scenario.name,
                "licence": scenario.licence,
                "map_sha256": bundle.road_map.source.sha256,
                "routes_sha256": [sha256_of(path) for path in scenario.routes],
            }
        )
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "settings": settings.describe(),
        "command": settings.command(),
        "versions": {name: _version(name) for name in _PACKAGES},
        "scenarios": scenarios,
        "cameras_sha256": [sha256_of(file) for file in files],
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def _begin(folder: Path, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Make the folder, or see that it holds such a data set.

    Raises:
        ConfigError: it holds something else.
    """
    path = folder / DATASET
    if not path.exists():
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"{folder}: holds something else; choose an empty folder, or a new one")
        known = {**facts, "complete": False}
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WriteError(f"{folder}: cannot be made ({error.strerror or error})") from error
        write_json(path, known)
        return known
    known = read_json(path, error=DatasetError)
    if not isinstance(known, dict) or known.get("format") != _FORMAT or "complete" not in known:
        raise DatasetError(path, "does not describe a data set")
    for name, value in facts.items():
        if known.get(name) != value:
            raise ConfigError(
                f"{folder}: holds a data set of other {_differing(name, known.get(name), value)}; "
                "choose another folder, or give the same"
            )
    return known


def _differing(name: str, known: Any, wanted: Any) -> str:
    """Name what differs, as closely as it can be named."""
    if isinstance(known, dict) and isinstance(wanted, dict):
        for key, value in wanted.items():
            if known.get(key) != value:
                return f"{name}: {key} {str(known.get(key))[:80]}, not {str(value)[:80]}"
    return name


def _check_room(folder: Path, settings: DatasetSettings, pictures: int) -> None:
    """See that the disk has room.

    Raises:
        WriteError: it has not.
    """
    width, height = settings.size
    a_pixel = _BYTES_A_PIXEL[settings.picture or "jpg"] + (_BYTES_A_PIXEL["jpg"] if settings.depth else 0.0)
    needed = int(pictures * width * height * a_pixel) + _LEFT_FREE
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise WriteError(
            f"{folder}: {free / 1e9:.1f} GB are free and {needed / 1e9:.1f} GB may be needed; make room, "
            "then run the same command again"
        )


def _finish(folder: Path, plan: Plan, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Put the data set together from its parts; interrupted, it may be done again."""
    parts = [folder / PARTS / job.name for job in plan.jobs]

    def lines(name: str) -> Iterator[str]:
        for part in parts:
            path = part / f"{name}.lines"
            if path.exists():
                with opened(path, error=DatasetError) as file:
                    for line in file:
                        yield line.decode("utf-8").rstrip("\n")

    wholes = FORMATS[plan.settings.format].finish(plan.settings, lines)
    for name, pieces in (*wholes, (ALL_LABELS, (f"{line}\n" for line in lines(LABELS)))):
        with replaced(folder / name, parents=True) as fresh, fresh.open("w", encoding="utf-8") as file:
            file.writelines(pieces)
    counts = add_counts(read_json(part / COUNTS, error=DatasetError) for part in parts)
    write_text(folder / CARD, write_card(facts, counts))
    for part in parts:
        tree = part / TREE
        for path in sorted(tree.rglob("*")):
            if path.is_file():
                target = folder / path.relative_to(tree)
                target.parent.mkdir(parents=True, exist_ok=True)
                path.replace(target)
    known = {**facts, "complete": True, "counts": counts}
    write_json(folder / DATASET, known)
    shutil.rmtree(folder / PARTS, ignore_errors=True)
    return known
