"""The bundle on disk: one folder per map, written whole or not at all, and read back with care."""

import contextlib
import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dojo_maps.description import RoadMap
from dojo_maps.errors import DescriptionError, UsageError
from dojo_maps.serialization import from_json
from dojo_maps.whole_file import work_folder

if TYPE_CHECKING:
    from dojo_maps.meshes.mesh import Mesh

DESCRIPTION = "map.json"
SCENE = "scene.glb"
NETWORK = "network.net.xml"
REPORT = "report.json"
REPORT_PAGE = "report.html"
OVERVIEW = "overview.png"
ENRICHMENT = "enrichment.json"
DEMAND = "demand.rou.xml"
BASE_NETWORK = "base.net.xml"
"""The network as it was imported, where edits that the bundle keeps have changed it."""
EDITS = "edits"
"""The kept edits, which move along when the bundle is made anew."""
EXPORTS = "exports"
_OURS = {
    DESCRIPTION,
    SCENE,
    NETWORK,
    REPORT,
    REPORT_PAGE,
    OVERVIEW,
    ENRICHMENT,
    DEMAND,
    BASE_NETWORK,
    EXPORTS,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """A converted map on disk."""

    folder: Path
    road_map: RoadMap

    @property
    def network(self) -> Path:
        """The SUMO network that the description speaks of."""
        return self.folder / NETWORK

    @property
    def scene(self) -> Path:
        """The meshes, as binary glTF."""
        return self.folder / SCENE

    def read_meshes(self) -> "tuple[Mesh, ...]":
        """Read the meshes of the scene: metres, x east, y north, z up, around the map's origin.

        Raises:
            DescriptionError: the scene is missing or broken.
        """
        from dojo_maps.meshes.gltf_reader import read_scene  # noqa: PLC0415 - few need it

        return read_scene(self.scene)


def read_bundle(folder: Path | str) -> Bundle:
    """Read a bundle's description.

    Raises:
        DescriptionError: the folder is not a bundle, or its map.json is not a valid description.
    """
    folder = Path(folder)
    path = folder / DESCRIPTION
    if not path.is_file():
        raise DescriptionError(
            folder, f"not a bundle: it has no {DESCRIPTION}; make one with dojo-maps convert"
        )
    try:
        value = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise DescriptionError(path, f"not readable as JSON ({error}); convert the map again") from error
    return Bundle(folder=folder, road_map=from_json(value, path=path))


def write_json(path: Path, value: Any) -> None:
    """Write JSON values, compact, UTF-8, numbers in full precision."""
    path.write_text(
        json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8"
    )


@contextlib.contextmanager
def replace_bundle(folder: Path) -> Iterator[Path]:
    """Give a new folder to fill, and put it in the place of `folder` only once all went well.

    Files in an older bundle that are not part of the format, such as saved cameras, move along.

    Raises:
        UsageError: `folder` exists and is something else than a bundle, or cannot be written.
    """
    check_replaceable(folder)
    with contextlib.ExitStack() as stack:
        try:
            work = stack.enter_context(work_folder(folder.parent, f".{folder.name}."))
        except OSError as error:
            raise UsageError(
                f"{folder.parent}: cannot be written ({error.strerror}); choose another with -o"
            ) from error
        fresh = work / "new"
        fresh.mkdir()
        yield fresh
        _swap(fresh, folder, work / "old")


def check_replaceable(folder: Path) -> None:
    """Refuse a target that is not a bundle, before any work is done and so that nothing of a user's is lost.

    Raises:
        UsageError: the target is a file, or a folder with other things in it, or its parent is missing.
    """
    if not folder.parent.is_dir():
        raise UsageError(f"{folder.parent}: no such folder; make it first or choose another with -o")
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise UsageError(f"{folder}: exists and is not a folder; choose another with -o")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / DESCRIPTION).is_file():
        raise UsageError(f"{folder}: exists and is not a bundle; it stays as it is, choose another with -o")


def _swap(fresh: Path, folder: Path, old: Path) -> None:
    if not folder.exists():
        fresh.rename(folder)
        return
    for entry in folder.iterdir():
        if entry.name not in _OURS:
            copy = shutil.copytree if entry.is_dir() and not entry.is_symlink() else shutil.copy2
            copy(entry, fresh / entry.name)
    try:
        folder.rename(old)
        fresh.rename(folder)
    except BaseException:
        # An interruption may come right after either step.
        if not folder.exists():
            old.rename(folder)
        raise
