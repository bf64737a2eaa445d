"""The bundle on disk: one folder per map, written whole or not at all, and read back with care."""

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dojo_maps.consistency import check_description
from dojo_maps.description import RoadMap
from dojo_maps.errors import DescriptionError, UsageError
from dojo_maps.input_files import is_there, read_bytes
from dojo_maps.safe_json import read_json
from dojo_maps.serialization import check_format, from_json
from dojo_maps.whole_file import replaced_folder

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
JUNCTION_BLOCKER = "60"
"""SUMO's `ignore-junction-blocker` for generated demand: seconds after which vehicles drive on past one that
stands inside a junction. Two of them may wait for each other for ever, and everybody behind them."""
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
    """A converted map on disk; a notebook shows its overview and a line about it.

    Attributes:
        folder: that holds it.
        road_map: the description, as map.json has it.
    """

    folder: Path
    road_map: RoadMap

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        shown: dict[str, Any] = {"text/plain": repr(self)}
        overview = self.folder / OVERVIEW
        if overview.is_file():
            shown["image/png"] = read_bytes(overview)
        return shown

    def __repr__(self) -> str:
        """Tell where it is and how much it holds."""
        return f"Bundle({str(self.folder)!r}, {self.road_map!r})"

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

        Returns:
            One per layer of the scene; their faces tell the ids that they belong to.

        Raises:
            DescriptionError: the scene is missing or broken.
        """
        from dojo_maps.meshes.gltf_reader import read_scene  # noqa: PLC0415 - few need it

        return read_scene(self.scene)


def read_bundle(folder: Path | str) -> Bundle:
    """Read a bundle's description, to look at it.

    Args:
        folder: of the bundle.

    Returns:
        The bundle, its description as map.json has it.

    Raises:
        DescriptionError: the folder is not a bundle, or its map.json is not a valid description.
    """
    path, value = _read_description(Path(folder))
    return Bundle(folder=path.parent, road_map=from_json(value, path=path))


def open_bundle(folder: Path | str) -> Bundle:
    """Read a bundle to act on it: its parts fit each other, and what its network says comes from the network.

    Args:
        folder: of the bundle.

    Returns:
        The bundle, its description as its network has it.

    Raises:
        DescriptionError: the folder is not a bundle, a part of it is missing, or two contradict each other.
        SourceError: the network cannot be read.
    """
    from dojo_maps.sources.sumo_net import read_network  # noqa: PLC0415 - who only looks at a bundle reads none

    path, value = _read_description(Path(folder))
    check_format(value, path)
    network = path.parent / NETWORK
    if not network.is_file():
        raise DescriptionError(folder, f"it has no {NETWORK}; convert the map again")
    data = read_bytes(network)
    described, _ = read_network(data, path=network, name="", sha256="")
    road_map = check_description(value, described, path)
    if road_map.source.network_sha256 not in ("", hashlib.sha256(data).hexdigest()):
        raise DescriptionError(path, f"{NETWORK} has changed since; convert the map again")
    return Bundle(folder=path.parent, road_map=road_map)


def _read_description(folder: Path) -> tuple[Path, Any]:
    """Read map.json as JSON values; returns also its path."""
    path = folder / DESCRIPTION
    if not is_there(path):
        raise DescriptionError(
            folder, f"not a bundle: it has no {DESCRIPTION}; make one with dojo-maps convert"
        )
    return path, read_json(path, error=DescriptionError)


def write_json(path: Path, value: Any) -> None:
    """Write JSON values, compact, UTF-8, numbers in full precision.

    Args:
        path: of the file.
        value: to write.
    """
    path.write_text(
        json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8"
    )


@contextmanager
def replace_bundle(folder: Path) -> Iterator[Path]:
    """Give a new folder to fill, and put it in the place of `folder` only once all went well.

    Files in an older bundle that are not part of the format, such as saved cameras, move along.

    Args:
        folder: of the bundle.

    Yields:
        The new folder, to be filled.

    Raises:
        UsageError: `folder` exists and is something else than a bundle.
        WriteError: it cannot be written.
    """
    check_replaceable(folder)
    with replaced_folder(folder, keeps=lambda entry: entry.name not in _OURS) as fresh:
        yield fresh


def check_replaceable(folder: Path) -> None:
    """Refuse a target that is not a bundle, before any work is done and so that nothing of a user's is lost.

    Args:
        folder: where a bundle is wanted.

    Raises:
        UsageError: the target is a file, or a folder with other things in it, or its parent is missing.
    """
    if not (is_there(folder.parent) and folder.parent.is_dir()):
        raise UsageError(f"{folder.parent}: no such folder; make it first or choose another with -o")
    is_link = os.path.islink(folder)  # noqa: PTH114 - of a name that is too long it says no
    if is_link or (is_there(folder) and not folder.is_dir()):
        raise UsageError(f"{folder}: exists and is not a folder; choose another with -o")
    if is_there(folder) and any(folder.iterdir()) and not (folder / DESCRIPTION).is_file():
        raise UsageError(f"{folder}: exists and is not a bundle; it stays as it is, choose another with -o")
