"""Which 3D models stand for which vehicle types, in place of our own: what users say of them.

The files are read where pictures are made; see `rendering.model_files`.
"""

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError, ModelError
from dojo_maps.input_files import is_there
from dojo_maps.safe_toml import read_toml

SUMO = "sumo:"
"""Before the name of one of SUMO's own models."""
FRONTS = ("+z", "-z", "+x", "-x", "+y", "-y")
SUFFIXES = (".glb", ".gltf", ".obj")
_MAX_BYTES = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleModel:
    """A 3D model.

    Attributes:
        file: glTF, GLB or OBJ; or `sumo:` and the name of one of SUMO's own, such as `sumo:tram`.
        front: the axis that it faces along.
        up: the axis that points up, `y` or `z`.
    """

    file: Path
    front: str = "+z"
    up: str = "y"

    def __post_init__(self) -> None:
        """Find SUMO's own, and refuse what cannot be read.

        Raises:
            ConfigError: an axis has no such name, both are one, or the file is missing or of another format.
        """
        name = str(self.file)
        path = _find_sumo_model(name.removeprefix(SUMO)) if name.startswith(SUMO) else Path(self.file)
        object.__setattr__(self, "file", path)
        if path.suffix.lower() not in SUFFIXES:
            raise ModelError(path, f"not one of {', '.join(SUFFIXES)}; export the model as one of these")
        if not is_there(path):
            raise ModelError(path, "no such file")
        if self.front not in FRONTS or self.up not in ("y", "z") or self.up == self.front[1]:
            raise ConfigError(
                f"model {path.name}: front={self.front!r}, up={self.up!r}: expected one of "
                f"{', '.join(FRONTS)}, and y or z, of two axes"
            )


def settle_models(models: "Mapping[str, Any] | Path | str") -> Mapping[str, VehicleModel]:
    """Bring what a user says into models by vehicle type.

    Args:
        models: by SUMO's vehicle type, each a file, a `VehicleModel`, or a table with its fields; or a TOML
            file of these, whose paths count from its folder.

    Returns:
        A model by vehicle type.

    Raises:
        ConfigError: something of it cannot be.
    """
    if isinstance(models, str | Path):
        path = Path(models)
        table = read_toml(path, most=_MAX_BYTES, error=ModelError)
        return {name: _settle(name, value, path.parent) for name, value in table.items()}
    if not isinstance(models, Mapping):
        raise ConfigError(f"models={models!r}: expected files by vehicle type, or a TOML file of these")
    return {name: _settle(name, value, Path()) for name, value in models.items()}


def _settle(name: str, value: Any, folder: Path) -> VehicleModel:
    if isinstance(value, VehicleModel):
        return value
    given = dict(value) if isinstance(value, Mapping) else {"file": value}
    known = [each.name for each in fields(VehicleModel)]
    if not isinstance(given.get("file"), str | Path) or set(given) - set(known):
        raise ConfigError(f"model of {name!r}: {value!r}: expected a file, or a table of {', '.join(known)}")
    if not str(given["file"]).startswith(SUMO):
        given["file"] = folder / given["file"]
    return VehicleModel(**given)


def _find_sumo_model(name: str) -> Path:
    found = importlib.util.find_spec("sumo")
    folder = Path((found.submodule_search_locations or [""])[0] if found else "") / "data" / "3D"
    names = sorted(path.stem for path in folder.glob("*.obj"))
    if name not in names:
        raise ConfigError(f"SUMO has no model {name!r}; there are {', '.join(names) or 'none'}")
    return folder / f"{name}.obj"
