"""Several signals learning together: one size for all, the same result after an interruption."""

import contextlib
from pathlib import Path

import commands  # noqa: F401 - it finds the tools' modules
import numpy as np
import pytest
from test_train import interrupt, train

import dojo_env
from dojo_env.lane_features import place_features

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
agents = pytest.importorskip("dojo_env.learning.joint_signals")

SIZE = [
    *("--scenario", "cologne3", "--processes", "1"),
    *("--seconds", "120", "--steps", "72", "--every", "1"),
]
PPO, DQN = (
    ["--set", "n_steps=24", "batch_size=24"],
    ["--set", "learning_starts=30", "batch_size=24"],
)
KINDS = {
    "shared": ["--agents", "shared", *PPO],
    "independent": ["--agents", "independent", *PPO],
    "independent FRAP": ["--agents", "independent", "--observation", "movements", "--network", "frap", *PPO],
    "MPLight": ["--row", "MPLight", *DQN],
    "CoLight": ["--row", "CoLight", *DQN],
    "MAPPO": ["--row", "MAPPO", *PPO],
}


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", KINDS)
def test_interrupted_run_goes_on_to_the_same_result(kind: str, tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    arguments = [*SIZE, *KINDS[kind]]
    done = train(*arguments, "--out", whole)
    assert done.returncode == 0, done.stderr
    interrupt(cut, *arguments)
    done = train(*arguments, "--out", cut, "--resume")
    assert done.returncode == 0, done.stderr
    assert (cut / "curve.csv").read_bytes() == (whole / "curve.csv").read_bytes()
    a, b = (torch.load(folder / "policy.pt", weights_only=True) for folder in (whole, cut))
    assert all(torch.equal(a[name], b[name]) for name in a)


def test_features_of_unequal_signals_have_their_places() -> None:
    small, large = place_features([3, 4], [5, 8])
    assert large.tolist() == list(range(4 + 1 + 2 * 8))
    assert small.tolist() == [0, 1, 2, 4, *range(5, 10), *range(13, 18)]


def test_every_action_is_one_of_a_signals_phases() -> None:
    seen = []
    for surplus in (False, True):
        env = agents.JointEnv(dojo_env.parallel_env(scenario="cologne3", num_seconds=100))
        with contextlib.closing(env):
            phases = env.action_space.nvec
            env.reset(seed=7)
            own = np.arange(20)[:, None] // 3 % phases
            steps = [env.step(action + surplus * phases) for action in own]
            seen.append(np.stack([step[0] for step in steps]))
            assert env.metrics()["violations"] == {}
            assert steps[0][1].shape == phases.shape
    assert np.array_equal(*seen)
    who = seen[0][:, :, -len(phases) :]
    assert np.array_equal(who, np.broadcast_to(np.eye(len(phases)), who.shape))


def test_one_agent_for_several_signals_is_refused_before_any_work(tmp_path: Path) -> None:
    for words, arguments in (("has 3 signals", []), ("numbers of views", ["--observation", "multi_view"])):
        learners = ["--agents", "shared"] if arguments else []
        done = train("--scenario", "cologne3", *arguments, *learners, "--out", tmp_path / "a")
        assert done.returncode == 2
        assert words in done.stderr.strip().splitlines()[-1]
    assert not (tmp_path / "a").exists()
