"""Errors arrive whole where another process raised them."""

import inspect
import pickle
import pkgutil

import pytest
from conftest import import_ours

import dojo_env
import dojo_maps
from dojo_maps.errors import DojoError, SourceError


def _error_classes() -> set[type[DojoError]]:
    modules = [
        module
        for package in (dojo_maps, dojo_env)
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        if not found.name.endswith("__main__") and (module := import_ours(found.name)) is not None
    ]
    members = (value for module in modules for value in vars(module).values())
    return {value for value in members if inspect.isclass(value) and issubclass(value, DojoError)}


@pytest.mark.parametrize("kind", sorted(_error_classes(), key=lambda kind: kind.__qualname__))
def test_an_error_says_the_same_on_the_other_side_of_a_pipe(kind: type[DojoError]) -> None:
    error = kind("a.xml", "is cut short", "line 3") if issubclass(kind, SourceError) else kind("it broke")
    arrived = pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    assert (type(arrived), str(arrived), vars(arrived)) == (kind, str(error), vars(error))


def test_a_name_out_of_a_file_makes_no_endless_line() -> None:
    endless = "x" * 100_000
    assert len(str(SourceError(endless, f"{endless} is no lane", element=endless))) < 1300
