"""Repair of broken and hostile networks: a refusal in one line, or a network that is no worse."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from damage import DAMAGES, ODDITIES, fuzz

from dojo_maps.errors import DojoError
from dojo_maps.repair.fixing import describe, patch_of
from dojo_maps.repair.rounds import fix_network

pytestmark = pytest.mark.sampled(4)


def check_ends_fairly(data: bytes) -> None:
    try:
        fixed = fix_network(data, Path("hostile.net.xml"))
    except DojoError as error:
        assert 10 < len(str(error)) < 1000
        return
    for text in patch_of(fixed).values():
        ET.fromstring(text)  # noqa: S314 - our own
    assert all(line.isprintable() for line in describe(fixed))
    for check, (_, errors) in fixed.after.counts.items():
        uncovered = any(made.edit.uncovers for made in fixed.made)
        assert uncovered or errors <= fixed.before.counts.get(check, (0, 0))[1]
    if not fixed.made:
        assert fixed.after.data == data


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["cologne1", "RiLSA1-rilsa1", "fkk_in-ingolstadt"])
def test_fix_ends_fairly_on_a_network_damaged_at_random(name: str, request: pytest.FixtureRequest) -> None:
    fuzz(name, request.config.getoption("--fuzz") // 2, check_ends_fairly)


@pytest.mark.parametrize("name", [*DAMAGES, *ODDITIES])
def test_fix_ends_fairly_on_a_damaged_or_odd_network(name: str, network_path: Callable[[str], Path]) -> None:
    check_ends_fairly({**DAMAGES, **ODDITIES}[name](network_path("bare").read_bytes()))


@pytest.mark.parametrize(
    "name", ["strange_names", "rough_shapes", "two_programs", "slope", "left_hand", "far_away"]
)
def test_fix_ends_fairly_on_a_network_built_for_the_tests(
    name: str, network_path: Callable[[str], Path]
) -> None:
    check_ends_fairly(network_path(name).read_bytes())
