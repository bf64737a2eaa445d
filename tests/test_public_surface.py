"""What users import: it is listed, loads late, is typed, and every part of it is explained."""

import ast
import dataclasses
import inspect
import re
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest

import dojo_env
import dojo_maps
from dojo_env import keywords

PACKAGES = {"dojo_maps": dojo_maps, "dojo_env": dojo_env}
NAMES = [f"{package}.{name}" for package, module in PACKAGES.items() for name in module.__all__]
LONGEST_REPR = 200
"""Characters; what a notebook shows of a value is read, not scrolled."""


def find(name: str) -> Any:
    package, _, rest = name.partition(".")
    return getattr(PACKAGES[package], rest)


@pytest.mark.parametrize("package", PACKAGES)
def test_dir_shows_the_public_names(package: str) -> None:
    module = PACKAGES[package]
    shown = {name for name in dir(module) if not name.startswith("__")}
    assert shown == set(module.__all__)
    assert isinstance(module.__version__, str)
    assert (Path(module.__file__).parent / "py.typed").is_file()
    with pytest.raises(AttributeError, match="no attribute 'nothing_of_this_name'"):
        _ = module.nothing_of_this_name


def test_importing_loads_nothing_heavy() -> None:
    code = "import sys, dojo_maps, dojo_env; print(*sorted(m.partition('.')[0] for m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {
        "numba",
        "cv2",
        "torch",
        "onnx",
        "onnxruntime",
        "libsumo",
        "shapely",
        "osmnx",
        "pybullet",
        "osmium",
    }
    assert not heavy & set(done.stdout.split())


@pytest.mark.parametrize("name", NAMES)
def test_public_name_is_explained(name: str) -> None:
    found = find(name)
    if not (inspect.isclass(found) or inspect.isfunction(found)):
        return  # A table of names: the module that holds it explains it.
    problems = [
        f"{where}: {what}" for where, thing in list_explained(name, found) for what in list_lacks(thing)
    ]
    assert not problems, "\n".join(problems)


def list_explained(name: str, found: Any) -> Iterator[tuple[str, Any]]:
    """List a function, or a class with those of its public methods that nothing above it explains."""
    yield name, found
    if not inspect.isclass(found):
        return
    says_all = dataclasses.is_dataclass(found) or getattr(found, "_is_protocol", False)
    known = {"mount"} if name != "dojo_env.SensorSettings" else set()  # Sensors' settings all have it.
    for base in found.__mro__[1:]:
        known |= {member for member in vars(base) if not member.startswith("_")}
    for member, value in vars(found).items():
        function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        is_public = member == "__init__" if member.startswith("_") else member not in known
        if inspect.isfunction(function) and is_public and not (member == "__init__" and says_all):
            yield f"{name}.{member}", function


def list_lacks(thing: Any) -> Iterator[str]:
    """Tell what the explanation of a function or a class lacks."""
    text = inspect.getdoc(thing) or ""
    if not text:
        yield "no docstring"
    elif inspect.isclass(thing):
        yield from list_unexplained(thing, text)
    else:
        tree = ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        arguments = [p for p in inspect.signature(thing).parameters if p not in {"self", "cls", "_options"}]
        said = read_section(text, "Args")
        yield from (f"Args lacks {argument}" for argument in arguments if argument not in said)
        yield from (
            f"Args has {argument}, which is no argument" for argument in said if argument not in arguments
        )
        returned = ast.unparse(tree.returns) if tree.returns else "None"
        if returned not in {"None", "NoReturn"} and not re.search(r"^(Returns|Yields):", text, re.MULTILINE):
            yield f"no Returns, and it returns {returned}"
        if any(isinstance(node, ast.Raise) for node in ast.walk(tree)) and "Raises:" not in text:
            yield "no Raises"


def list_unexplained(thing: type, text: str) -> Iterator[str]:
    """Tell which fields of a class are not explained; a TypedDict's are where its docstring says."""
    if not dataclasses.is_dataclass(thing) or issubclass(thing, Exception):
        return
    said = read_section(text, "Attributes")
    explained = {*said, *re.findall(r"`(\w+)`", text)}
    source = inspect.getsource(thing)
    for field in dataclasses.fields(thing):
        beside = re.search(rf"^    {field.name}: .*\n    \"\"\"", source, re.MULTILINE)
        if field.name not in explained and not field.name.startswith("_") and not beside:
            yield f"Attributes lacks {field.name}"


def read_section(text: str, title: str) -> list[str]:
    """List the names that a section of a docstring explains."""
    found = re.search(rf"^{title}:\n((?:    .*\n?|\n)+)", text, re.MULTILINE)
    return re.findall(r"^    \*{0,2}(\w+):", found[1], re.MULTILINE) if found else []


@pytest.mark.parametrize(
    ("settings", "record"),
    [
        (keywords.EpisodeSettings, dojo_env.EpisodeConfig),
        (keywords.SignalSettings, dojo_env.SignalConfig),
        (keywords.TrafficSettings, dojo_env.TrafficConfig),
        (keywords.SensingSettings, dojo_env.SensingConfig),
        (keywords.DatasetKeywords, dojo_env.DatasetSettings),
    ],
)
def test_keywords_are_the_fields_of_the_settings(settings: Any, record: Any) -> None:
    """A field that is added to the settings is added to `keywords`, too: editors complete from there."""
    fields = [field.name for field in dataclasses.fields(record) if field.init]
    assert sorted(settings.__optional_keys__) == sorted(fields)


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Give a value of each public class, by its name."""
    folder = tmp_path_factory.mktemp("values")
    recording = dojo_env.record(folder / "out", "actuated", scenario="two-way", num_seconds=5)
    bundle, report = dojo_maps.convert("two-way", folder / "two-way.dojo")
    config = dojo_env.build_config(scenario="two-way", observation="bev", num_seconds=20)
    env = dojo_env.TrafficSignalEnv(config)
    env.reset(seed=1)
    view = env.instant.signals[env.signal]
    pictures = next(dojo_env.replay(recording)).pictures
    seen = {picture.camera: picture for picture in pictures}
    usual = [dojo_env.Conditions, dojo_env.Imaging, dojo_env.CameraSensor, dojo_env.Detector]
    usual += [dojo_env.EventCamera, dojo_maps.ConvertOptions, dojo_maps.DemandOptions]
    known = [
        bundle, bundle.road_map, report, recording, recording[3], pictures[0], pictures[0].camera,
        config, config.episode, config.signals, config.traffic, config.sensing, config.scenario,
        env, env.instant, view, view.plan, view.lanes,
        next(dojo_env.replay(recording, cameras=())), dojo_env.film(recording, folder / "x.webm"),
        dojo_env.parallel_env(config), dojo_env.make_controller("max-pressure"),
        dojo_env.BackgroundSubtraction(gymnasium.make("dojo_env/TrafficSignal-v0", config=config)),
        dojo_env.Site(name="x", signal="t", plan=view.plan, eyes=None, decision_interval=5.0),
        dojo_env.Look(snapshot=recording[3], pictures=seen),
        dojo_env.Training(scenario="two-way", algorithm="dqn", observation="features"),
        dojo_env.DatasetSettings(scenarios=("two-way",) * 50, pictures=10),
        dojo_env.Lidar(name="roof", position=(0.0, 0.0, 5.0)), dojo_env.VideoDetector(model="nothing.onnx"),
        *(each() for each in usual),
    ]  # fmt: skip
    env.close()
    return {type(value).__name__: value for value in known}


@pytest.mark.slow
def test_values_tell_themselves_in_a_line(values: dict[str, Any]) -> None:
    for value in values.values():
        assert len(repr(value)) <= LONGEST_REPR, repr(value)[:1000]
        assert "\n" not in repr(value)


@pytest.mark.slow
def test_a_value_of_each_public_class_is_tried(values: dict[str, Any]) -> None:
    classes = [found for found in map(find, NAMES) if inspect.isclass(found)]
    no_values = (Exception, dict)
    tried = {kind for value in values.values() for kind in type(value).__mro__}
    untried = [
        found.__name__
        for found in classes
        if found not in tried
        and not issubclass(found, no_values)
        and not getattr(found, "_is_protocol", False)
    ]
    assert untried == ["PolicyController"]  # It needs a training.


def test_records_tell_what_is_not_usual() -> None:
    assert repr(dojo_env.Conditions()) == "Conditions()"
    assert repr(dojo_env.Conditions(hour=20)) == "Conditions(hour=20)"
    long = dojo_env.Scenario(map=Path(__file__), name="x" * 500, routes=(Path(__file__),) * 30)
    assert repr(long).startswith("Scenario(map=")
    assert repr(long).endswith("...)")
