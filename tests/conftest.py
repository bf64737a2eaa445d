"""Shared by the acceptance tests: networks by name, and each conversion run once for all tests."""

import contextlib
import fcntl
import importlib
import json
import os
import random
import signal
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import forked
import networks
import pytest
from hypothesis import HealthCheck, settings
from oracle import ExpectedMap, read_expected
from scene_reader import Scene, read_scene

REPOSITORY = Path(__file__).resolve().parents[1]
# Whoever starts the tests in the background has SIGINT ignored, and with it all commands that they interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# How long an example takes depends on what else the machine does.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")
NO_GENERATED = "--no-generated"
_FIRST = (
    "test_ray", "test_train", "test_learned_rows", "test_benchmark", "test_robustness", "test_env_encoders",
)  # fmt: skip
"""Files of the tests that train policies or load encoders."""
_LAST = (
    "test_calibration", "test_camera", "test_datasets", "test_detectors", "test_env_", "test_event",
    "test_films", "test_imaging", "test_rendering", "test_sensor",
)  # fmt: skip
"""Files of the tests that draw: when they begin, one worker has compiled the kernels for all."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--whole", action="store_true", help="every case of the long suites, on every network")
    parser.addoption("--fuzz", type=int, default=6, help="how many damaged copies of a network to convert")
    parser.addoption("--interruptions", type=int, default=4, help="how many commands to interrupt at random")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "slow: takes two seconds or more; -m 'not slow' leaves it out, --whole runs all of them",
    )
    config.addinivalue_line(
        "markers",
        "sampled(count): without --whole, only so many of a test's cases run, chosen by a seed; with 0, none",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "network" in metafunc.fixturenames:
        everything = metafunc.config.getoption("--whole")
        installed = list(networks.installed_networks()) if everything else networks.default_sample()
        # The scope puts all tests of a network in a row, so that what is read for one serves the next.
        names = [*networks.BUILDERS, *installed]
        metafunc.parametrize("network", names, indirect=True, scope="session")
    if "fuzz_seed" in metafunc.fixturenames:
        metafunc.parametrize("fuzz_seed", range(metafunc.config.getoption("--fuzz")))
    if "interruption_seed" in metafunc.fixturenames:
        metafunc.parametrize("interruption_seed", range(metafunc.config.getoption("--interruptions")))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is sampled away, and begin with what takes longest.

    So no worker is left alone with it in the end. What draws comes last.
    """
    left_out = set() if config.getoption("--whole") else _choose_left_out(items)
    if not config.getoption("--whole") and not config.getoption("file_or_dir"):
        left_out |= _choose_slow(items)
    if left_out:
        config.hook.pytest_deselected(items=[item for item in items if item in left_out])
    items[:] = sorted(
        (item for item in items if item not in left_out),
        key=lambda item: 0 if item.path.stem.startswith(_FIRST) else 1 + item.path.stem.startswith(_LAST),
    )


def _choose_left_out(items: list[pytest.Item]) -> set[pytest.Item]:
    """Choose by place among a test's cases: tests with the same cases, as networks, keep the same ones."""
    families: dict[str, list[pytest.Item]] = {}
    for item in items:
        families.setdefault(item.nodeid.partition("[")[0], []).append(item)
    left_out: set[pytest.Item] = set()
    for cases in families.values():
        mark = cases[0].get_closest_marker("sampled")
        if mark is not None:
            chance = random.Random(networks.SAMPLE_SEED)  # noqa: S311 - the same on every run
            left_out.update(chance.sample(cases, max(0, len(cases) - mark.args[0])))
    return left_out


def _choose_slow(items: list[pytest.Item]) -> set[pytest.Item]:
    """Choose which of the slow tests a run of all tests leaves out: five in six, spread over the files."""
    slow = [item for item in items if item.get_closest_marker("slow")]
    return set(slow) - set(slow[::6])


def import_ours(name: str) -> ModuleType | None:
    """Import a module of this project; None where a package of an extra that it needs is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if str(error.name).startswith("dojo_"):
            raise
        return None


@lru_cache(maxsize=4)
def read_strict_json(path: Path) -> Any:
    """Read JSON as its standard has it: UTF-8, and no NaN or Infinity. Copy what you want to change."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{path} holds {constant}, which is not JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


@dataclass(frozen=True)
class Conversion:
    """One run of the command, and where its bundle should be."""

    network: str
    bundle: str
    status: int
    stdout: str
    stderr: str

    @property
    def folder(self) -> Path:
        return Path(self.bundle)

    @property
    def description(self) -> dict[str, Any]:
        return read_strict_json(self.folder / "map.json")

    @property
    def report(self) -> dict[str, Any]:
        return read_strict_json(self.folder / "report.json")

    @property
    def expected(self) -> ExpectedMap:
        return read_expected(Path(self.network))

    @property
    def scene(self) -> Scene:
        x, y = self.description["origin"]
        return read_scene(self.folder / "scene.glb", (x, y))


def command_environment(**changes: str) -> dict[str, str]:
    """The environment in which the command is run: this checkout first."""
    paths = [str(REPOSITORY), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), **changes}


def dojo_maps(
    *arguments: object, cwd: Path | None = None, env: dict[str, str] | None = None, timeout: float = 300
) -> subprocess.CompletedProcess[str]:
    """Run the real command line."""
    return forked.run([*map(str, arguments)], cwd=cwd, env=env or command_environment(), timeout=timeout)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    with path.open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all workers of this run."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base) / "shared"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def environment_cache(shared_folder: Path) -> Iterator[Path]:
    """Keep converted maps among the tests' own files, and compiled kernels for the next run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DOJO_CACHE", str(shared_folder / "cache"))
        patch.setenv("NUMBA_CACHE_DIR", str(REPOSITORY / ".pytest_cache" / "kernels"))
        patch.setenv("SB3_LOGDIR", str(shared_folder / "logs"))  # else a folder in /tmp for each model
        yield shared_folder / "cache"


@pytest.fixture(scope="session")
def network_path(shared_folder: Path) -> Callable[[str], Path]:
    """Find or build a network by its name."""
    installed = networks.installed_networks()

    def find(name: str) -> Path:
        if name in installed:
            return installed[name]
        folder = shared_folder / "networks" / name
        folder.mkdir(parents=True, exist_ok=True)
        note = folder / "path.txt"
        with locked(folder / "lock"):
            if not note.exists():
                note.write_text(str(networks.BUILDERS[name](folder)), encoding="utf-8")
        return Path(note.read_text(encoding="utf-8"))

    return find


@pytest.fixture(scope="session")
def converted(shared_folder: Path, network_path: Callable[[str], Path]) -> Callable[..., Conversion]:
    """Convert a network, by name or path, once per set of flags; fail the test if that does not work."""

    def convert(network: str | Path, *flags: str) -> Conversion:
        path = network if isinstance(network, Path) else network_path(network)
        name = "_".join([path.parent.name, path.name.split(".")[0], *flags]).replace(" ", "_")
        folder = shared_folder / "bundles" / name
        folder.mkdir(parents=True, exist_ok=True)
        note, bundle = folder / "conversion.json", folder / "out.dojo"
        with locked(folder / "lock"):
            if not note.exists():
                done = dojo_maps("convert", path, "-o", bundle, *flags, timeout=900)
                result = Conversion(str(path), str(bundle), done.returncode, done.stdout, done.stderr)
                note.write_text(json.dumps(asdict(result)), encoding="utf-8")
        result = Conversion(**json.loads(note.read_text(encoding="utf-8")))
        # Python itself ends with 1 after a traceback, so the status alone does not tell.
        if result.status not in {0, 1} or "Traceback" in result.stderr:
            pytest.fail(f"convert {path.name} ended with {result.status}: {result.stderr[-2000:]}")
        return result

    return convert


@pytest.fixture(scope="session")
def network(request: pytest.FixtureRequest) -> str:
    """The name of one of the networks under test."""
    return request.param


@pytest.fixture
def conversion(network: str, converted: Callable[..., Conversion]) -> Conversion:
    """A network converted with everything that is generated to look at."""
    return converted(network)


@pytest.fixture
def plain_conversion(network: str, converted: Callable[..., Conversion]) -> Conversion:
    """A network converted as it is."""
    return converted(network, NO_GENERATED)
