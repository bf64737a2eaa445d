"""The house stays in order: imports run one way, modules stay short, nothing unwelcome is read or run."""

import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
MODULES = sorted(
    path for room in ("dojo_maps", "dojo_env", "tools") for path in (REPOSITORY / room).rglob("*.py")
)


def test_imports_run_one_way() -> None:
    command = [str(Path(sys.executable).parent / "lint-imports")]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_module_stays_short(module: Path) -> None:
    assert len(module.read_text().splitlines()) <= 330
