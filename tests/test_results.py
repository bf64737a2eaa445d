"""Results that are kept were made with the settings of now, and the README's figures are theirs."""

import json
import re
import shutil
from pathlib import Path

import pytest
from commands import REPOSITORY, TOOLS

import insert_figures
import robustness
from dojo_env.benchmark import row_runs
from dojo_env.benchmark.rows import find_row

RESULTS = TOOLS / "results"
KEPT = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(RESULTS.glob("*/*/figures.json"))]


@pytest.mark.parametrize("kept", KEPT, ids=lambda kept: f"{kept['scenario']}-{kept['row']}")
def test_kept_row_needs_no_new_run(kept: dict[str, object]) -> None:
    names = ("seeds", "seconds", "trainings")
    asked = {name: kept[name] for name in names if name in kept}
    task = row_runs.describe(find_row(kept["row"]), kept["scenario"], **asked)
    assert row_runs.is_done(task, RESULTS)


@pytest.mark.parametrize("row", ["Learned", "Learned-vision"])
def test_figures_that_other_weights_made_are_old(row: str, tmp_path: Path) -> None:
    task = row_runs.describe(find_row(row), "cologne1", seeds=5, seconds=3600)
    folder = row_runs.find_folder(row, "cologne1", tmp_path)
    shutil.copytree(row_runs.find_folder(row, "cologne1", RESULTS), folder)
    assert row_runs.is_done(task, tmp_path)
    path = folder / row_runs.FIGURES
    kept = json.loads(path.read_text(encoding="utf-8"))
    kept["weights"][-1] = "0" * 64
    path.write_text(json.dumps(kept), encoding="utf-8")
    assert not row_runs.is_done(task, tmp_path)


def test_the_matrix_is_of_what_was_measured(tmp_path: Path) -> None:
    names = shutil.ignore_patterns("pictures", "resco", "*.csv", "*.md")
    results = shutil.copytree(RESULTS, tmp_path / "results", ignore=names)
    text = robustness.write_matrix(results)
    assert text == (RESULTS / "matrix.md").read_text(encoding="utf-8")
    assert text in (RESULTS / "README.md").read_text(encoding="utf-8")


def test_documents_tell_what_was_measured() -> None:
    """The tables are those that `tools/insert_figures.py` writes out of the kept results."""
    for document in insert_figures.DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        assert insert_figures.insert_figures(text, ("rows", "light")) == text, document
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^\| [\w*-]+ \| \d", readme, re.MULTILINE)) >= 10
    assert "| jams |" in readme


def test_wrong_figure_is_put_right() -> None:
    figures = next(
        kept["figures"] for kept in KEPT if (kept["scenario"], kept["row"]) == ("two-way", "PPO-F")
    )
    travel, waiting = (figures[name]["mean"] for name in ("travel_time", "accumulated_waiting"))
    text = (
        "<!-- figures: rows -->\n| row | two-way |\n|---|---|\n| PPO-F | 1.0 / 2 (3.0 / 4) |\n<!-- end -->\n"
    )
    expected = text.replace("1.0 / 2", f"{travel:.1f} / {waiting:.0f}")
    assert insert_figures.insert_figures(text, ("rows",)) == expected
