"""Validation of broken and hostile networks: a report, or one clear error, in bounded time and memory."""

import json
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import command_environment
from damage import DAMAGES, ENDLESS, LARGE, ODDITIES, fuzz, network_of, written

from dojo_maps.errors import SourceError
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation.runner import run_checks

pytestmark = pytest.mark.sampled(4)

SECONDS, MEMORY = 60.0, 3 << 30
MILLION = 1_000_000


def check_ends_fairly(data: bytes) -> None:
    """Either a refusal that can be read, or a report that JSON can hold and in which no check crashed."""
    try:
        road_map, known = read_network(data, path=Path("hostile.net.xml"), name="hostile", sha256="")
    except SourceError as error:
        assert 10 < len(str(error)) < 1000
        return
    report = run_checks(road_map, None, known)
    json.dumps(report, allow_nan=False)
    crashed = [check for check in report["checks"] if check["status"] == "crashed"]
    assert not crashed


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["cologne1", "RiLSA1-rilsa1", "fkk_in-ingolstadt"])
def test_validate_ends_fairly_on_a_network_damaged_at_random(
    name: str, request: pytest.FixtureRequest
) -> None:
    fuzz(name, request.config.getoption("--fuzz"), check_ends_fairly)


@pytest.mark.parametrize("name", [*DAMAGES, *ODDITIES])
def test_validate_ends_fairly_on_a_damaged_or_odd_network(
    name: str, network_path: Callable[[str], Path]
) -> None:
    check_ends_fairly({**DAMAGES, **ODDITIES}[name](network_path("bare").read_bytes()))


@pytest.mark.parametrize("name", [*ENDLESS, *LARGE])
def test_validate_ends_fairly_on_shapes_that_are_endless_or_large(name: str) -> None:
    check_ends_fairly({**ENDLESS, **LARGE}[name]())


@pytest.mark.sampled(1)
@pytest.mark.parametrize("step", [0.001, 0.1, 10.0])
def test_validate_takes_or_refuses_a_million_positions_in_a_lane(step: float, tmp_path: Path) -> None:
    path = tmp_path / "long.net.xml"
    path.write_bytes(network_of(written([(k * step, k % 2) for k in range(MILLION)])))

    def bound_memory() -> None:
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))

    done = subprocess.run(
        [sys.executable, "-m", "dojo_maps.cli", "validate", path],
        env=command_environment(OPENBLAS_NUM_THREADS="1"),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
        preexec_fn=bound_memory,
    )
    assert done.returncode in {0, 1, 3}, done.stderr[-500:]
    assert "not enough memory" not in done.stderr
