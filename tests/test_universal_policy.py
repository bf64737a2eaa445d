"""One policy for any junction: its observation, its network, its training, and the one that ships."""

import csv
import os
import signal
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from commands import run_env, run_tool, start_env, wait_for_file

import dojo_env
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.controllers.phase_competition import (
    INPUTS,
    PACKAGED,
    WEIGHTS,
    PhaseCompetition,
    read_weights,
    score_phases,
)
from dojo_env.errors import PolicyError
from dojo_env.learning.universal.rollouts import measure_cost
from dojo_env.learning.universal.settings import UniversalTraining
from dojo_env.local_world import LocalWorld
from dojo_env.phase_features import PHASE_FEATURES

SMALL = ["--junctions", "two-way", "cologne3", "--seconds", "180", "--every", "1", "--processes", "2",
         "--set", "rounds=2", "episodes=3", "shortest=120", "validation_seconds=120"]  # fmt: skip


@pytest.fixture(scope="module")
def weights() -> dict[str, np.ndarray]:
    return read_weights(PACKAGED / "learned.npz")


def column(phases: np.ndarray, name: str) -> np.ndarray:
    return phases[:, PHASE_FEATURES.index(name)]


def test_policies_side_by_side_add_up_their_scores(tmp_path: Path, weights: dict[str, np.ndarray]) -> None:
    pytest.importorskip("stable_baselines3")
    network = pytest.importorskip("dojo_env.learning.universal.network").PhaseNet(8)
    np.savez(tmp_path / "small.npz", **network.export())
    done = run_tool("join_policies", "learned", tmp_path / "small.npz", "--out", tmp_path / "both.npz")
    assert done.returncode == 0, done.stderr
    draw = np.random.default_rng(1)
    phases = draw.random((5, len(PHASE_FEATURES)), np.float32)
    seen = (phases, draw.random(INPUTS - len(PHASE_FEATURES), np.float32), 2)
    alone = [score_phases(each, *seen) for each in (weights, read_weights(tmp_path / "small.npz"))]
    both = score_phases(read_weights(tmp_path / "both.npz"), *seen)
    np.testing.assert_allclose(both, sum(alone), rtol=1e-4, atol=1e-4)


def test_what_a_forecast_tells_can_be_added_to_a_policy(
    tmp_path: Path, weights: dict[str, np.ndarray]
) -> None:
    pytest.importorskip("stable_baselines3")
    done = run_tool("join_policies", "learned", "--delay", 0.5, "--out", tmp_path / "more.npz")
    assert done.returncode == 0, done.stderr
    phases, rules = np.zeros((3, len(PHASE_FEATURES)), np.float32), np.zeros(5, np.float32)
    phases[1, PHASE_FEATURES.index("delay")] = 0.2
    less = score_phases(weights, phases, rules, 0) - score_phases(
        read_weights(tmp_path / "more.npz"), phases, rules, 0
    )
    assert less == pytest.approx([0.0, 0.5 * 20, 0.0], abs=1e-3)


def test_policies_from_before_the_forecast_are_read(tmp_path: Path, weights: dict[str, np.ndarray]) -> None:
    known = PHASE_FEATURES.index("delay")
    old = {name: np.delete(array, known, axis=1) if array.shape[-1] == INPUTS else array
           for name, array in weights.items()}  # fmt: skip
    np.savez(tmp_path / "old.npz", **old)
    draw = np.random.default_rng(1)
    phases, rules = draw.random((5, len(PHASE_FEATURES)), np.float32), draw.random(5, np.float32)
    without = phases.copy()
    without[:, known] = 0.0
    scores = [score_phases(read_weights(tmp_path / "old.npz"), each, rules, 2) for each in (phases, without)]
    assert scores[0] == pytest.approx(scores[1])
    assert scores[0] == pytest.approx(score_phases(weights, without, rules, 2), rel=1e-4)


def test_phases_are_observed_in_gymnasiums_way_and_tell_who_waits() -> None:
    env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario="cologne1", observation="phases",
                         num_seconds=200)  # fmt: skip
    seen, _ = env.reset(seed=1)
    inner = env.unwrapped
    chooser = make_controller("queue-pressure")
    ended = False
    while not ended:
        assert env.observation_space.contains(seen)
        view, approach = inner.instant.signals[inner.signal], inner.instant.approach(inner.signal)
        phases = seen["phases"]
        assert column(phases, "is_present").argmax() == view.phase
        for number, state in enumerate(view.plan.phases):
            first = sum(
                state[link] == "G" and link not in approach.blocked
                for link, halting in zip(approach.links, approach.halting, strict=True)
                if halting
            )
            assert column(phases, "halting")[number] * 10 == pytest.approx(first, abs=1e-4)
        assert bool(seen["constraints"][-1]) == view.may_change
        seen, _, _, ended, _ = env.step(chooser.act(inner.instant)[inner.signal])
    env.close()


def test_signals_of_one_scenario_share_a_space_with_a_mask() -> None:
    env = dojo_env.parallel_env(scenario="cologne3", observation="phases", num_seconds=60)
    seen, _ = env.reset(seed=1)
    for agent, each in seen.items():
        count = env.action_space(agent).n
        assert each["mask"].sum() == count
        assert not each["phases"][count:].any()
    assert len({space.shape for space in (env.observation_space(a)["phases"] for a in seen)}) == 1
    env.close()


def test_red_time_is_what_the_phase_has_not_been_green() -> None:
    world = LocalWorld(build_config(scenario="two-way", observation="phases", num_seconds=300, max_red=None))
    seen, _ = world.reset(1)
    (signal,), last, ended, step = world.signals, {}, False, 0
    while not ended:
        view = world.instant.signals[signal]
        for phase, state in enumerate(view.plan.phases):
            greens = {link for link, letter in enumerate(state) if letter in "Gg"}
            if phase == view.phase or all(view.state[link] in "Gg" for link in greens):
                last[phase] = world.instant.time
        since = [world.instant.time - last.get(phase, 0) for phase in range(len(view.plan.phases))]
        wanted = np.minimum(np.array(since) / 60, 3)
        assert column(seen[signal]["phases"], "red_time") == pytest.approx(wanted, abs=1e-6)
        seen, _, ended, _ = world.step({signal: step // 4 % 3})
        step += 1
    world.close()


def test_scores_do_not_depend_on_the_order_of_phases(weights: dict[str, np.ndarray]) -> None:
    draw = np.random.default_rng(0)
    phases, rules = draw.random((5, len(PHASE_FEATURES)), np.float32), draw.random(5, np.float32)
    order = draw.permutation(5)
    scores = score_phases(weights, phases, rules, 2)
    turned = score_phases(weights, phases[order], rules, int(np.flatnonzero(order == 2)[0]))
    assert turned == pytest.approx(scores[order], abs=1e-4)


def test_torch_and_numpy_score_alike(weights: dict[str, np.ndarray]) -> None:
    torch = pytest.importorskip("torch")
    from dojo_env.learning.universal.network import PhaseNet  # noqa: PLC0415 - torch is not everywhere

    torch.manual_seed(3)
    for network in (PhaseNet(), PhaseNet.of_weights(weights), PhaseNet.of_weights(weights, temperature=4)):
        check_scores(network, torch)


def test_a_policy_that_goes_on_ranks_phases_as_before_and_tries_others(
    weights: dict[str, np.ndarray],
) -> None:
    pytest.importorskip("torch")
    from dojo_env.learning.universal.network import PhaseNet  # noqa: PLC0415 - torch is not everywhere

    draw = np.random.default_rng(2)
    phases, rules = draw.random((5, len(PHASE_FEATURES)), np.float32), draw.random(5, np.float32)
    before = score_phases(weights, phases, rules, 1)
    softer = score_phases(PhaseNet.of_weights(weights, temperature=4).export(), phases, rules, 1)
    assert softer == pytest.approx(before / 4, abs=1e-4)


def test_slow_vehicles_cost_by_the_speed_that_they_lack() -> None:
    world = LocalWorld(build_config(scenario="two-way", num_seconds=300))
    world.reset(1)
    costs, ended = [], False
    while not ended:
        _, _, ended, _ = world.step({"t": 0})
        (view,) = world.instant.signals.values()
        lanes, limits = view.lanes, view.plan.limits
        slow = (lanes.vehicles * np.maximum(1 - lanes.mean_speed / limits, 0)).sum()
        assert world.traffic.simulation.measure_slowness(view.plan.lanes) == pytest.approx(slow)
        assert measure_cost("t", world.instant, world.traffic.simulation) > slow - 1e-6
        costs.append(slow)
    assert max(costs) > view.lanes.total_halting > 10
    world.close()


def check_scores(network: Any, torch: Any) -> None:
    draw = np.random.default_rng(1)
    phases, rules = draw.random((2, 6, len(PHASE_FEATURES)), np.float32), draw.random((2, 5), np.float32)
    mask = np.array([[True] * 6, [True] * 4 + [False] * 2])
    present = np.array([5, 1])
    scores, _ = network(*map(torch.from_numpy, (phases, rules, mask, present)))
    for row, count in enumerate((6, 4)):
        own = score_phases(network.export(), phases[row, :count], rules[row], present[row])
        assert scores[row, :count].detach().numpy() == pytest.approx(own, abs=1e-4)
        assert np.isinf(scores[row, count:].detach().numpy()).all()


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("scenario", ["cologne1", "ingolstadt1"])
def test_the_policy_that_ships_serves_whoever_comes(scenario: str) -> None:
    done = run_env("run", "--scenario", scenario, "--controller", "learned", "--seconds", 600)
    assert done.returncode == 0, done.stderr
    rival = run_env("run", "--scenario", scenario, "--controller", "fixed-time", "--seconds", 600)
    waiting = [float(each.stdout.split("accumulated_waiting")[1].split()[0]) for each in (done, rival)]
    assert waiting[0] < waiting[1]
    assert "safety violations                  0" in done.stdout


@pytest.mark.slow
def test_a_policy_is_trained_and_serves_another_junction(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    folder = tmp_path / "run"
    done = run_env("train", *SMALL, "rounds=1", "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "4 junctions of 2 scenarios" in done.stderr
    assert set(read_weights(folder / "policy.npz")) == set(WEIGHTS)
    done = run_env("run", "--scenario", "cologne1", "--controller", folder, "--seconds", 60)
    assert done.returncode == 0, done.stderr
    on = tmp_path / "on"
    done = run_env("train", *SMALL, "rounds=1", "--from", folder, "--out", on)
    assert done.returncode == 0, done.stderr
    before, after = (read_weights(each / "policy.npz") for each in (folder, on))
    # The first rounds learn only what states are worth, and the policy begins less sure than it was.
    assert np.array_equal(before["score1_weight"], after["score1_weight"])
    less = before["rule_weight"] / UniversalTraining(scenarios=("two-way",)).temperature
    np.testing.assert_allclose(after["rule_weight"], less, rtol=1e-6)


@pytest.mark.sampled(0)
def test_training_goes_on_to_the_same_result_however_many_processes(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    done = run_env("train", *SMALL, "--out", whole)
    assert done.returncode == 0, done.stderr
    assert "4 junctions of 2 scenarios" in done.stderr
    running = start_env("train", *SMALL, "--out", cut, "--processes", 1)
    wait_for_file(cut / "checkpoint.pt", running)
    os.killpg(running.pid, signal.SIGKILL)
    running.communicate()
    done = run_env("train", *SMALL, "--out", cut, "--resume")
    assert done.returncode == 0, done.stderr
    assert (cut / "curve.csv").read_bytes() == (whole / "curve.csv").read_bytes()
    a, b = (read_weights(folder / "policy.npz") for folder in (whole, cut))
    assert all(np.array_equal(a[name], b[name]) for name in WEIGHTS)
    with (whole / "curve.csv").open() as file:
        assert [row["round"] for row in csv.DictReader(file)] == ["1", "2"]


def test_bad_arguments_are_one_line(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    for words, arguments in (
        ("--algorithm is for one scenario", ["--algorithm", "ppo"]),
        ("wings", ["--set", "wings=2"]),
        ("rounds=0", ["--set", "rounds=0"]),
        ("nowhere", ["--junctions", "nowhere"]),
    ):
        done = run_env("train", "--quiet", "--junctions", *arguments, "--out", tmp_path / "a")
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    start = tmp_path / "missing.npz"
    done = run_env("train", "--quiet", "--junctions", "two-way", "--from", start, "--out", tmp_path / "a")
    assert (done.returncode, done.stderr) == (3, f"dojo-env: {start}: no such file\n")
    assert not (tmp_path / "a").exists()


def test_weights_that_do_not_fit_are_refused(weights: dict[str, np.ndarray], tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    for change in (
        {"encode1_weight": np.zeros((64, INPUTS + 1), np.float32)},
        {"score2_weight": np.zeros((2, 64), np.float32)},
        {"encode2_bias": np.zeros(3, np.float32)},
        {"score1_weight": np.zeros((64, 64), np.float32)},
    ):
        np.savez(path, **{**weights, **change})
        with pytest.raises(PolicyError, match="do not fit"):
            PhaseCompetition(path)
    path.write_bytes(b"no archive")
    with pytest.raises(PolicyError, match="cannot be read"):
        PhaseCompetition(path)
