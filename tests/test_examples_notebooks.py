"""Every notebook runs from its first cell to its last, and what should show itself does."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY, command_environment

pytest.importorskip("IPython")
pytest.importorskip("matplotlib")

NOTEBOOKS = REPOSITORY / "examples" / "notebooks"
SHOWN = {
    "maps": ["image/png", "image/svg+xml", "text/html", "text/html"],
    "seeing": ["image/png", "text/html", *["image/png"] * 6, "text/html"],
}
"""What the cells show beside text, in their order."""
RUN = """
import json, sys
from IPython.core.interactiveshell import InteractiveShell

shell, kinds = InteractiveShell(), []
for cell in json.load(open(sys.argv[1], encoding="utf-8"))["cells"]:
    if cell["cell_type"] == "code":
        done = shell.run_cell("".join(cell["source"]))
        done.raise_error()
        shown, _ = shell.display_formatter.format(done.result)
        kinds += [kind for kind in shown if kind != "text/plain"]
print(json.dumps(kinds))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", SHOWN)
def test_notebook_runs(name: str, tmp_path: Path) -> None:
    environment = command_environment(IPYTHONDIR=str(tmp_path / "ipython"))
    done = subprocess.run(
        [sys.executable, "-c", RUN, NOTEBOOKS / f"{name}.ipynb"], cwd=tmp_path, env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr + done.stdout
    assert json.loads(done.stdout.splitlines()[-1]) == SHOWN[name]


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebook_is_kept_without_outputs(path: Path) -> None:
    assert path.stem in SHOWN
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None
