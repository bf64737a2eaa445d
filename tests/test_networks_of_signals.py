"""FRAP, CoLight and MAPPO: what their observations tell, and what each network may depend on."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

import dojo_env
from dojo_maps.signals.programs import green_links

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
from dojo_env.learning.algorithms import build_policy  # noqa: E402 - after what it needs
from dojo_env.learning.settings import NETWORKS, Training  # noqa: E402


def observe(observation: str) -> tuple[Any, dict[str, Any]]:
    env = dojo_env.parallel_env(
        scenario="cologne3", observation=observation, num_seconds=200, begin_time=25_200
    )
    seen, _ = env.reset(seed=3)
    for _ in range(30):
        seen, *_ = env.step(dict.fromkeys(env.agents, 0))
    return env, seen


def build(network: str, space: spaces.Space[Any], algorithm: str = "ppo", phases: int = 4) -> Any:
    torch.manual_seed(5)
    training = Training(algorithm=algorithm, network=network, observation=NETWORKS[network] or "features")
    return build_policy(training, space, spaces.Discrete(phases)).eval()


def batch(seen: dict[str, Any]) -> dict[str, Any]:
    return {name: torch.from_numpy(np.asarray(part)[None].copy()) for name, part in seen.items()}


def chances(policy: Any, seen: dict[str, Any]) -> Any:
    with torch.no_grad():
        return policy.get_distribution(batch(seen)).distribution.probs[0].numpy()


def value(policy: Any, seen: dict[str, Any]) -> float:
    with torch.no_grad():
        return float(policy.predict_values(batch(seen)))


def test_movements_are_counted_where_they_go() -> None:
    env, seen = observe("movements")
    with closing(env):
        instant = env.world.instant
        for name, own in seen.items():
            view, approach = instant.signals[name], instant.approach(name)
            count = len(view.plan.phases)
            assert own["mask"].sum() == count
            assert own["movements"][:, :2].sum() * 10 == pytest.approx(len(approach.links))
            for link, stands in set(zip(approach.links, approach.halting, strict=True)):
                alike = sum(
                    pair == (link, stands) for pair in zip(approach.links, approach.halting, strict=True)
                )
                assert own["movements"][link, 0 if stands else 1] * 10 == pytest.approx(alike)
            for row, state in enumerate(view.plan.phases):
                assert set(np.flatnonzero(own["serves"][row])) == set(green_links(state))
            assert env.observation_space(name).contains(own)
        assert sum(own["movements"].sum() for own in seen.values()) > 0


def test_neighbourhood_is_the_nearest_five() -> None:
    env = dojo_env.parallel_env(scenario="grid4x4", observation="neighbours", num_seconds=60)
    with closing(env):
        seen, _ = env.reset(seed=1)
        names = list(seen)
        # A corner of the grid, an edge and a middle; letters are columns, digits rows.
        places = {name: np.array([ord(name[0]), int(name[1])]) for name in names}
        for name, own in seen.items():
            apart = np.array([np.abs(places[name] - places[other]).sum() for other in names])
            near = own["near"] > 0
            assert near.sum() == 5
            assert near[names.index(name)]
            assert apart[near].max() <= 2
            assert near[apart == 1].all()
            assert np.array_equal(own["own"], own["everyone"][names.index(name)])
            assert env.observation_space(name).contains(own)


@pytest.mark.parametrize("algorithm", ["ppo", "dqn"])
def test_frap_does_not_depend_on_how_phases_and_movements_are_numbered(algorithm: str) -> None:
    env, seen = observe("movements")
    env.close()
    (name, own) = max(seen.items(), key=lambda item: item[1]["mask"].sum())
    count = int(own["mask"].sum())
    policy = build("frap", env.observation_space(name), algorithm, count)
    draw = np.random.default_rng(2)
    phases = np.concatenate([draw.permutation(count), np.arange(count, len(own["mask"]))])
    links = draw.permutation(len(own["movements"]))
    other = {
        **own,
        "movements": own["movements"][links],
        "serves": own["serves"][phases][:, links],
        "mask": own["mask"][phases],
    }

    def score(known: dict[str, Any]) -> Any:
        if algorithm == "ppo":
            return chances(policy, known)
        with torch.no_grad():
            return policy.q_net(batch(known))[0].numpy()

    assert np.allclose(score(other), score(own)[phases[:count]], atol=1e-5)
    assert np.ptp(score(own)) > 0
    if algorithm == "ppo":
        assert value(policy, other) == pytest.approx(value(policy, own), abs=1e-5)


def test_frap_never_chooses_a_phase_that_a_signal_lacks() -> None:
    env, seen = observe("movements")
    env.close()
    name, own = min(seen.items(), key=lambda item: item[1]["mask"].sum())
    count, rows = int(own["mask"].sum()), len(own["mask"])
    assert count < rows
    policy = build("frap", env.observation_space(name), phases=rows)
    assert chances(policy, own)[count:].max() == 0
    padded = {**own, "movements": own["movements"].copy()}
    assert np.allclose(chances(policy, padded)[:count].sum(), 1)


def test_colight_sees_the_near_ones_alone_and_them_truly() -> None:
    space = spaces.Dict(
        own=spaces.Box(0, 1, (6,)), everyone=spaces.Box(0, 1, (8, 6)), near=spaces.Box(0, 1, (8,))
    )
    policy = build("colight", space)
    seen = space.sample()
    seen["near"] = (np.arange(8) < 5).astype(np.float32)
    far, near = ({**seen, "everyone": seen["everyone"].copy()} for _ in range(2))
    far["everyone"][6] = 1 - far["everyone"][6]
    near["everyone"][2] = 1 - near["everyone"][2]
    assert np.array_equal(chances(policy, far), chances(policy, seen))
    assert not np.array_equal(chances(policy, near), chances(policy, seen))


def test_mappo_acts_on_its_own_and_judges_by_everyones() -> None:
    space = spaces.Dict(
        own=spaces.Box(0, 1, (6,)), everyone=spaces.Box(0, 1, (8, 6)), near=spaces.Box(0, 1, (8,))
    )
    policy = build("mappo", space)
    seen = space.sample()
    others = {**seen, "everyone": 1 - seen["everyone"]}
    assert np.array_equal(chances(policy, others), chances(policy, seen))
    assert value(policy, others) != value(policy, seen)
    own = {**seen, "own": 1 - seen["own"]}
    assert not np.array_equal(chances(policy, own), chances(policy, seen))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"network": "frap"}, "observation='movements' alone"),
        ({"network": "mappo", "observation": "neighbours", "algorithm": "dqn"}, "learn by algorithm='ppo'"),
        ({"network": "transformer"}, "expected one of usual, frap, colight, mappo"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(dojo_env.errors.ConfigError, match=words):
        Training(**given)
