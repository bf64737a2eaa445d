"""The page of RESCO's scenarios: learners are trained under its settings, once, and measured as rules are."""

from pathlib import Path

import commands  # noqa: F401 - leads to the tools
import pytest

from dojo_env.benchmark.row_runs import find_folder

pytest.importorskip("stable_baselines3")
import compare_resco


@pytest.mark.slow
def test_a_row_learns_under_resco_s_settings_and_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compare_resco, "EPISODES", {"ingolstadt1": 2})
    folder = find_folder("MPLight", "ingolstadt1", tmp_path)
    compare_resco.train_row("MPLight", "ingolstadt1", folder)
    controller = compare_resco.PolicyController(folder)
    assert [controller.settings[name] for name in ("delta_time", "yellow_time", "min_green")] == [10, 3, 7]
    kept = (folder / "policy.pt").stat().st_mtime_ns
    compare_resco.train_row("MPLight", "ingolstadt1", folder)
    assert (folder / "policy.pt").stat().st_mtime_ns == kept
    found = compare_resco.run_all([("MPLight", "ingolstadt1")], 1, 1, policies=tmp_path)
    assert 0.0 < found["MPLight", "ingolstadt1"][0] < 3600.0
