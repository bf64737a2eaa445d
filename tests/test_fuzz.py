"""A sample of damaged inputs of every kind; all of them: `python tools/fuzz.py --count 10000 --jobs 2`."""

import subprocess
import sys
from pathlib import Path

import pytest
from commands import TOOLS
from conftest import command_environment

CHECK = """
import sys
from pathlib import Path
import fuzz
with_defect = fuzz.Kind(
    files=[Path(sys.argv[1])], name="a.txt", mutate=fuzz.damage_bytes, beside={{}},
    run=lambda folder, chance: {problem},
)
print(fuzz.run_trial({{"kind": with_defect}}, "kind", 1, Path(sys.argv[2])).problem)
"""


@pytest.mark.slow
def test_damaged_inputs_of_every_kind_end_fairly(request: pytest.FixtureRequest) -> None:
    count = 2 * request.config.getoption("--fuzz")
    done = subprocess.run(
        [sys.executable, str(TOOLS / "fuzz.py"), "--count", str(count)],
        env=command_environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{count} damaged inputs" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "found"),
    [
        ("1 // 0", "a traceback"),
        ("3", "0 lines of error"),
        ("print('dojo-maps: a', file=sys.stderr) or print('b', file=sys.stderr) or 3", "2 lines of error"),
        ("print('dojo-env: a defect of this program', file=sys.stderr) or 4", "a defect"),
        ("__import__('os').abort()", "ended with -6"),
        ("(folder / 'x.tmp').touch() or 0", "left behind: x.tmp"),
        (
            "(folder / 'out.dojo').mkdir() or print('dojo-maps: a', file=sys.stderr) or 3",
            "half written: out.dojo",
        ),
        ("5", "the damage was not noticed"),
    ],
)
def test_what_does_not_end_fairly_is_found(tmp_path: Path, problem: str, found: str) -> None:
    (tmp_path / "good").write_text("a good input", encoding="utf-8")
    script = CHECK.format(problem=problem)
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "good"), str(tmp_path / "place")],
        env=command_environment(PYTHONPATH=f"{TOOLS}:{TOOLS.parent}"), capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert done.stdout.startswith(found)
