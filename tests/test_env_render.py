"""The render modes: one picture of all views, and the live page that each decision appears on."""

import json
import urllib.request
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

import dojo_env
from dojo_env.conditions import Conditions
from dojo_env.errors import ConfigError, EpisodeOverError


def make(scenario: str = "cologne1", **keywords: object) -> dojo_env.TrafficSignalEnv:
    return gymnasium.make(
        "dojo_env/TrafficSignal-v0", scenario=scenario, num_seconds=60, **keywords
    ).unwrapped


def fetch(url: str, after: int = 0) -> dict:
    with urllib.request.urlopen(f"{url}frame?after={after}", timeout=30) as answer:  # noqa: S310 - our own
        return json.load(answer)


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("mode", [None, "rgb_array", "human"])
def test_gymnasium_s_checker_accepts_every_render_mode(mode: str | None) -> None:
    env = make(render_mode=mode)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("own_process", [False, True])
def test_rgb_array_shows_every_view_the_phase_and_the_figures(own_process: bool) -> None:
    env = make(render_mode="rgb_array", own_process=own_process)
    env.reset(seed=1)
    pictures = [env.render()]
    for action in (1, 1):
        env.step(action)
        pictures.append(env.render())
    env.close()
    assert {picture.dtype for picture in pictures} == {np.dtype(np.uint8)}
    assert {picture.shape for picture in pictures} == {(658, 1456, 3)}
    head, foot = slice(0, 46), slice(574, 658)
    for part in (head, foot):
        assert not np.array_equal(pictures[0][part], pictures[2][part])


@pytest.mark.slow
def test_rgb_array_s_views_are_what_the_agent_sees() -> None:
    env = make("two-way", render_mode="rgb_array", observation="multi_view")
    env.reset(seed=1)
    for _ in range(4):
        observation, *_ = env.step(0)
    views = env.world.draw().views
    env.close()
    assert list(views) == ["From above", *(f"Approach {k + 1}" for k in range(4))]
    assert views["From above"].shape == (512, 712, 3)
    assert all(np.array_equal(views[f"Approach {k + 1}"], observation[f"approach_{k}"]) for k in range(4))


@pytest.mark.slow
def test_rendering_changes_nothing_that_the_agent_sees() -> None:
    spoilt = Conditions(noise=4, dropped=0.5, dirt=0.3)

    def play(mode: str | None) -> list[bytes]:
        env = make("two-way", render_mode=mode, observation="bev", conditions=spoilt)
        seen = [env.reset(seed=3)[0].tobytes()]
        for k in range(8):
            seen.append(env.step(k % 2)[0].tobytes())
            if mode == "rgb_array":
                env.render()
                env.render()
        env.close()
        return seen

    assert play(None) == play("rgb_array") == play("human")


def test_there_is_nothing_to_render_before_the_first_reset() -> None:
    env = make("two-way", render_mode="rgb_array")
    with pytest.raises(EpisodeOverError, match="reset"):
        env.render()
    env.close()


def test_several_signals_are_shown_from_above() -> None:
    env = dojo_env.parallel_env(scenario="cologne3", num_seconds=60, render_mode="rgb_array")
    parallel_api_test(env, num_cycles=15)
    env.reset(seed=1)
    env.step({})
    assert list(env.world.draw().views) == env.possible_agents
    picture = env.render()
    env.close()
    assert picture.shape[0] == 394
    assert picture.std() > 20


@pytest.mark.slow
def test_human_serves_each_decision_until_it_is_closed(capsys: pytest.CaptureFixture[str]) -> None:
    env = dojo_env.parallel_env(scenario="cologne3", num_seconds=60, render_mode="human")
    said = capsys.readouterr().err
    url = said.split()[-1]
    assert url.startswith("http://127.0.0.1:")
    env.reset(seed=1)
    first = fetch(url)
    env.step({})
    second = fetch(url, first["version"])
    assert (first["clock"], second["clock"]) == ("07:00:00", "07:00:05")
    assert [view["name"] for view in second["views"]] == [
        "From above",
        "Approach 1",
        "Approach 2",
        "Approach 3",
    ]
    assert not second["controls"]
    assert [lamp["signal"] for lamp in second["board"]["lamps"]] == env.possible_agents
    while env.agents:
        env.step({})
    assert fetch(url)["ended"]
    assert env.render() is None
    env.close()
    env.close()
    with pytest.raises(OSError, match="refused"):
        fetch(url)


def test_a_wrong_mode_or_a_port_that_is_taken_gets_one_clear_error() -> None:
    with pytest.raises(ConfigError, match="render_mode='ansi'"):
        dojo_env.parallel_env(scenario="two-way", render_mode="ansi")
    env = make("two-way", render_mode="human")
    port = int(env._viewer._server.url.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(ConfigError, match=f"port {port}"):
        make("two-way", render_mode="human", render_port=port)
    env.close()


@pytest.mark.slow
def test_an_environment_that_is_rendered_moves_out_of_another_one_s_way() -> None:
    first, shown = make("two-way"), make("two-way", render_mode="rgb_array")
    first.reset(seed=1)
    shown.reset(seed=1)
    assert shown.render().ndim == 3
    first.step(0)
    for env in (first, shown):
        env.close()
