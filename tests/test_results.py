"""Results that are kept were made with the settings of now, and the README's figures are theirs."""

import json
import re

import pytest
from commands import REPOSITORY, TOOLS

from dojo_env.benchmark import row_runs
from dojo_env.benchmark.rows import find_row

RESULTS = TOOLS / "results"
KEPT = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(RESULTS.glob("*/*/figures.json"))]


@pytest.mark.parametrize("kept", KEPT, ids=lambda kept: f"{kept['scenario']}-{kept['row']}")
def test_kept_row_needs_no_new_run(kept: dict[str, object]) -> None:
    task = row_runs.describe(
        find_row(kept["row"]), kept["scenario"], seeds=kept["seeds"], seconds=kept["seconds"]
    )
    assert row_runs.is_done(task, RESULTS)


def test_readme_tells_what_was_measured() -> None:
    """Travel time and accumulated waiting, published ones in brackets."""
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    (header,) = re.findall(r"^\| travel time / waiting \| (.*) \|$", text, re.MULTILINE)
    scenarios = header.split(" | ")
    figures = {(kept["scenario"], kept["row"]): kept["figures"] for kept in KEPT}
    lines = re.findall(r"^\| ([\w*-]+) \| (\d.*) \|$", text, re.MULTILINE)
    told = {(scenario, row): cell for row, cells in lines
            for scenario, cell in zip(scenarios, cells.split(" | "), strict=True)}  # fmt: skip
    assert len(told) >= 10
    for key, cell in told.items():
        assert cell.split(" (")[0] == write_cell(figures[key]), key


def test_readme_tells_how_policies_do_in_other_light() -> None:
    """Travel time and accumulated waiting again; a row that jams has thousands of seconds of it."""
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    (header,) = re.findall(r"^\| learned on cologne1 \| (.*) \|$", text, re.MULTILINE)
    for name, row in (
        ("PPO-BEV, by day", "PPO-BEV"),
        ("PPO-BEV, in any light", "PPO-BEV random"),
        ("PPO-MV, in any light", "PPO-MV random"),
    ):
        path = RESULTS / "cologne1" / row.replace(" ", "-") / "robustness.json"
        under = json.loads(path.read_text(encoding="utf-8"))["under"]
        (cells,) = re.findall(rf"^\| {name} \| (.*) \|$", text, re.MULTILINE)
        for column, cell in zip(header.split(" | "), cells.split(" | "), strict=True):
            figures = under[column.replace(" ", "-")]["figures"]
            jams = figures["accumulated_waiting"]["mean"] >= 1000
            assert cell == ("jams" if jams else write_cell(figures)), (name, column)


def write_cell(figures: dict[str, dict[str, float]]) -> str:
    """Write travel time and accumulated waiting as the README does."""
    travel, waiting = (figures[name]["mean"] for name in ("travel_time", "accumulated_waiting"))
    return f"{travel:.1f} / {waiting:.0f}"
