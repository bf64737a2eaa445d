"""Public names of a package that load the modules they live in when they are first used."""

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any

DISTRIBUTION = "traffic-dojo"


def read_version() -> str:
    """Tell the version of this project, as it is installed.

    Returns:
        The version, or that it is not installed.
    """
    from importlib import metadata  # noqa: PLC0415 - it takes longer than all else here

    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "(not installed)"


def attach(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make the `__getattr__` and `__dir__` of a package whose names load lazily.

    Args:
        package: its name.
        homes: the names, with spaces between, by the module they live in, without the package's name.

    Returns:
        Both functions. `__version__` is among the names.
    """
    places = {name: home for home, names in homes.items() for name in names.split()}

    def find(name: str) -> Any:
        if name == "__version__":
            return read_version()
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{package}.{places[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    def list_names() -> list[str]:
        own = [name for name in vars(sys.modules[package]) if name.startswith("__")]
        return sorted({*own, *places, "__version__"})

    return find, list_names
