"""A trained policy as a controller: the same figures as in its evaluation, wherever a controller may act."""

import json
from pathlib import Path

import pytest
from commands import SHORT, run_env

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

KINDS = {
    "features": ["--scenario", "two-way"],
    "pictures": ["--scenario", "two-way", "--observation", "multi_view", "--size", "36x48",
                 "--background-subtraction"],
    "shared": ["--scenario", "cologne3", "--agents", "shared"],
    "independent": ["--scenario", "cologne3", "--agents", "independent"],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", KINDS)
def test_policy_gives_its_figures_as_a_controller(kind: str, tmp_path: Path) -> None:
    folder, size = tmp_path / "run", [f"--{name}={value}" for name, value in SHORT.items()]
    done = run_env("train", *KINDS[kind], *size, "--set", "n_steps=60", "batch_size=60", "--out", folder)
    assert done.returncode == 0, done.stderr
    found = []
    for command in (
        ("evaluate", folder, "--json", tmp_path / "a.json"),
        ("run", "--scenario", KINDS[kind][1], "--controller", folder / "policy.pt", "--seconds", 300,
         "--json", tmp_path / "b.json"),
    ):  # fmt: skip
        done = run_env(*command, "--seeds", 2)
        assert done.returncode == 0, done.stderr
        kept = json.loads(Path(command[-1]).read_text())
        episodes = kept["episodes"] if command[0] == "run" else kept["evaluations"][0]["episodes"]
        found.append([{key: each[key] for key in ("travel_time", "queue", "arrived")} for each in episodes])
    assert found[0] == found[1]


@pytest.mark.slow
def test_policy_for_one_signal_is_refused_where_there_are_several(tmp_path: Path) -> None:
    folder, size = tmp_path / "run", [f"--{name}={value}" for name, value in SHORT.items()]
    done = run_env("train", "--scenario", "two-way", *size, "--set", "n_steps=60", "batch_size=60",
                   "--out", folder)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "60 of 60 steps" in done.stderr
    for scenario, words in (("cologne3", "there are 3"), ("ingolstadt1", "weights of another policy")):
        done = run_env("run", "--scenario", scenario, "--controller", folder, "--seconds", 60)
        assert done.returncode == (2 if scenario == "cologne3" else 3), done.stderr
        assert words in done.stderr.strip().splitlines()[-1]
    done = run_env("run", "--scenario", "cologne1", "--controller", folder, "--seconds", 60)
    assert "trained on two-way" in done.stderr  # Which has as many lanes and phases.
    done = run_env("run", "--scenario", "two-way", "--controller", tmp_path / "none.pt")
    assert done.returncode == 3
    assert "no training; dojo-env train --out FOLDER makes one" in done.stderr
