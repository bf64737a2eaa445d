"""Defects planted in real networks are repaired, and a network that SUMO refused loads again.

`pytest tests/test_repair_mutants.py --whole` takes every network; by default one runs.
"""

import logging
import random
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree as ET

import mutations
import networks
import pytest
from test_repair import load_in_sumo

from dojo_maps.repair.repairs import REPAIRS
from dojo_maps.repair.rounds import Fixed, fix_network

NETWORKS = (
    "cologne1", "fkk_in-ingolstadt", "cologne8", "ingolstadt1", "ingolstadt7", "grid4x4", "RiLSA1-rilsa1",
    "fokr_bs_demo-fokr_bs", "hiking",
)  # fmt: skip
LEAST_REPAIRED = 0.9
# Curls and swapped lanes can be found, but what was meant cannot be told; a length can be wrong, too.
NOT_REPAIRED = ("swap_lanes", "loop_lane", "misname_crossed_road", "move_signal", "shorten_edge")


def _plant(name: str, kind: mutations.Kind) -> tuple[mutations.Planted, bytes] | None:
    data = networks.read_network_bytes(networks.installed_networks()[name])
    net = mutations.Net(ET.fromstring(data))  # noqa: S314 - an installed file
    try:
        planted = kind(net, random.Random(f"{name} {kind.__name__}"))  # noqa: S311 - no secret
    except mutations.NoPlaceError:
        return None
    return planted, ET.tostring(net.root, encoding="utf-8")


def _count(fixed: Fixed, check: str) -> tuple[int, int]:
    return fixed.before.counts.get(check, (0, 0))[0], fixed.after.counts.get(check, (0, 0))[0]


@pytest.mark.slow
def test_planted_defects_are_repaired(request: pytest.FixtureRequest) -> None:
    chosen = NETWORKS if request.config.getoption("--whole") else NETWORKS[:1]
    tally, left = Counter[bool](), []
    for name in chosen:
        for kind in mutations.KINDS:
            planted = None if kind.__name__ in NOT_REPAIRED else _plant(name, kind)
            if planted is None or planted[0].check not in REPAIRS:
                continue
            check = planted[0].check
            fixed = fix_network(planted[1], Path("mutant.net.xml"), [check])
            before, after = _count(fixed, check)
            tally[after < before] += 1
            if after >= before:
                left.append(f"{name} {kind.__name__}: {check} {before} -> {after}")
    logging.getLogger(__name__).info("%s of %s planted defects repaired", tally[True], tally.total())
    assert tally.total() >= 12 * len(chosen)
    assert tally[True] >= LEAST_REPAIRED * tally.total(), "\n".join(left)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "kind", ["cut_state", "misname_via", "dangle_connection", "drop_request", "duplicate_edge"]
)
def test_network_that_sumo_refuses_loads_once_it_is_repaired(kind: str, tmp_path: Path) -> None:
    planted = _plant("cologne1", next(k for k in mutations.KINDS if k.__name__ == kind))
    assert planted is not None
    path = tmp_path / "mutant.net.xml"
    path.write_bytes(planted[1])
    with pytest.raises(AssertionError):
        load_in_sumo(path)
    path.write_bytes(fix_network(planted[1], path).after.data)
    load_in_sumo(path)
