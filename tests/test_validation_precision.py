"""Precision: every error in the installed networks is a known, real defect, shown in the validation's README.

`--whole` looks at the large ones, too.
"""

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import networks
import pytest

from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation.runner import run_checks

HERE = Path(__file__).resolve().parent
README = HERE.parent / "dojo_maps" / "validation" / "README.md"
KNOWN: dict[str, dict[str, list[str]]] = json.loads((HERE / "precision.json").read_text(encoding="utf-8"))
ROW = re.compile(
    r"^\| ([\w-]+) \| `([\w.]+)` \| (\d+) \| [^|]{10,} \| !\[[\w-]+\]\(([^)]+)\) \|$", re.MULTILINE
)


def report_of(name: str) -> dict[str, Any]:
    path = networks.installed_networks()[name]
    data = networks.read_network_bytes(path)
    road_map, known = read_network(data, path=path, name=name, sha256="")
    return run_checks(road_map, None, known)


@pytest.mark.sampled(16)
@pytest.mark.parametrize("name", networks.installed_networks())
def test_errors_are_the_known_defects(name: str, request: pytest.FixtureRequest) -> None:
    if name in networks.SLOW and not request.config.getoption("--whole"):
        pytest.skip("large: needs --whole")
    found: dict[str, list[str]] = {}
    for issue in report_of(name)["issues"]:
        if issue["severity"] == "error":
            fault = issue["elements"][0]
            found.setdefault(issue["check"], []).append(f"{fault['kind']} {fault['id']}")
    assert {check: sorted(faults) for check, faults in found.items()} == KNOWN.get(name, {})


def test_readme_shows_every_known_defect_with_a_picture() -> None:
    rows = {
        (row[0], row[1]): (int(row[2]), row[3]) for row in ROW.findall(README.read_text(encoding="utf-8"))
    }
    expected = {
        (name, check): len(faults) for name, checks in KNOWN.items() for check, faults in checks.items()
    }
    assert {key: count for key, (count, _) in rows.items()} == expected
    pictures = {README.parent / picture for _, picture in rows.values()}
    assert pictures == set((README.parent / "pictures").iterdir())
    assert all(picture.read_bytes().startswith(b"\x89PNG") for picture in pictures)


@pytest.mark.parametrize("name", ["ingolstadt7", "ingolstadt21"])
def test_two_pairs_of_conflicting_greens_are_found(name: str) -> None:
    pairs = [i for i in report_of(name)["issues"] if i["check"] == "signals.green_conflict"]
    assert [(pair["elements"][0]["id"], pair["severity"]) for pair in pairs] == [("gneJ210", "error")] * 2
    assert len({pair["message"] for pair in pairs}) == 2


@pytest.mark.parametrize(
    "name", ["cologne1", "cologne3", "cologne8", "grid4x4", "arterial4x4", "ingolstadt1"]
)
def test_no_conflicting_greens_are_found_where_there_are_none(name: str) -> None:
    assert not [i for i in report_of(name)["issues"] if i["check"] == "signals.green_conflict"]


def test_yellow_of_arterial4x4_is_found_too_short() -> None:
    short = [i for i in report_of("arterial4x4")["issues"] if i["check"] == "signals.yellow_short"]
    assert Counter(issue["elements"][0]["id"] for issue in short) == {f"nt{k}": 4 for k in range(1, 17)}
    assert all(issue["measured"] < issue["limit"] - 0.5 for issue in short)
