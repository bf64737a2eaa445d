"""The PettingZoo environment: every signal an agent, all acting at once."""

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from dojo_env.config import EnvConfig
from dojo_env.env import begin_episode, choose_seed, make_again, one_config, open_viewer, read_action
from dojo_env.errors import ConfigError, EpisodeOverError
from dojo_env.instant import Instant
from dojo_env.keywords import Settings
from dojo_env.local_world import SIGNAL_FIGURES
from dojo_env.world import World
from dojo_env.world_process import open_world

_SHARED = ("step", "system_", "agents_", "safety_")
"""How the names of figures begin that are the same for all agents."""


class TrafficSignalsEnv(ParallelEnv):  # type: ignore[misc]
    """Every signal of a scenario, or those named in `ts_ids`; see `config` for the keywords."""

    metadata: dict[str, Any] = {  # noqa: RUF012 - PettingZoo's own way
        "name": "dojo_traffic_signals_v0",
        "render_modes": ["human", "rgb_array"],
        "render_fps": 4,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        config: EnvConfig | None = None,
        *,
        render_mode: str | None = None,
        render_port: int = 0,
        own_process: bool = False,
        **keywords: Unpack[Settings],
    ) -> None:
        """Open the map.

        Args:
            config: all settings at once, instead of keywords.
            render_mode: `rgb_array`, or `human` for a live page on the loopback address, or None.
            render_port: of that page; 0 takes any that is free.
            own_process: run the simulation in a process of its own, so that several fit into this one.
            keywords: see `Settings`.

        Raises:
            ConfigError: a setting cannot work.
        """
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(f"render_mode={render_mode!r}: expected one of {self.metadata['render_modes']}")
        self.render_mode = render_mode
        self._made_with = {"render_mode": render_mode, "render_port": render_port, "own_process": own_process}
        self.config = one_config(config, dict(keywords))
        self.world: World = open_world(self.config, own_process=own_process)
        self.possible_agents = list(self.world.signals)
        self.agents: list[str] = []
        self._spaces = self.world.spaces()
        self._generator = np.random.default_rng()
        self._viewer = open_viewer(self.world, self.config, render_mode, render_port)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Give an agent's observation space.

        Args:
            agent: the signal's id.

        Returns:
            The space.
        """
        return self._spaces[agent][0]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Give an agent's action space.

        Args:
            agent: the signal's id.

        Returns:
            The space.
        """
        return self._spaces[agent][1]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin an episode; without a seed, one follows from the seed before.

        It moves into a process of its own where another environment of this one runs.

        Args:
            seed: of all that is random in the episode.
            options: none are known.

        Returns:
            Observations, and figures by name, each by agent.

        Raises:
            SimulationError: SUMO refuses the scenario.
        """
        if seed is not None:
            self._generator = np.random.default_rng(seed)
        chosen = choose_seed(seed, self.config, self._generator)
        self.world, (observations, info) = begin_episode(self.world, self.config, chosen)
        self.agents = list(self.possible_agents)
        self._viewer.follow(self.world.draw)
        return observations, self._infos(info)

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Act, and simulate until the next decision; a signal without an action keeps its phase.

        Args:
            actions: by agent.

        Returns:
            Observations, rewards, whether each has terminated (none ever does), whether each is
            truncated, and figures by name; each by agent.

        Raises:
            EpisodeOverError: no episode is running.
            ConfigError: an action is none of its signal's.
        """
        if not self.agents:
            raise EpisodeOverError("no episode is running; call reset first")
        if not isinstance(actions, Mapping):
            raise ConfigError(f"actions={actions!r}: expected a dict of one action for each of {self.agents}")
        asked = {agent: read_action(action) for agent, action in actions.items()}
        observations, rewards, ended, info = self.world.step(asked)
        self._viewer.follow(self.world.draw, ended=ended)
        present, infos = self.agents, self._infos(info)
        if ended:
            self.agents = []
        return (
            observations,
            rewards,
            dict.fromkeys(present, False),
            dict.fromkeys(present, ended),
            infos,
        )

    @property
    def instant(self) -> Instant:
        """What is known at the present decision."""
        return self.world.instant

    def metrics(self) -> dict[str, Any]:
        """Compute the figures of the episode so far.

        Returns:
            Figures by name, of the whole network.
        """
        return self.world.metrics()

    def save(self) -> dict[str, Any]:
        """Save the full state of the episode, as plain values.

        Returns:
            The seed and every action.
        """
        return self.world.save()

    def restore(self, state: dict[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Go to a saved state.

        Args:
            state: what `save` gave.

        Returns:
            Its observations, and figures by name, each by agent.

        Raises:
            ConfigError: the state was not made by `save`, or by another scenario's.
        """
        observations, info = self.world.restore(state)
        self.agents = list(self.possible_agents)
        return observations, self._infos(info)

    def render(self) -> Any:
        """Draw the view above every signal with its phase and the figures; see `TrafficSignalEnv`.

        Returns:
            (h, w, 3) uint8, or None.
        """
        return self._viewer.render(self.world.draw)

    def close(self) -> None:
        """End the simulation and the page; safe at any time."""
        for part in (getattr(self, "_viewer", None), getattr(self, "world", None)):
            if part is not None:
                part.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it as it was made; see `TrafficSignalEnv`."""
        return make_again, (type(self), self.config, self._made_with)

    def _infos(self, info: dict[str, Any]) -> dict[str, dict[str, Any]]:
        """Give each agent the figures of all and its own."""
        shared = {key: value for key, value in info.items() if key.startswith(_SHARED)}
        return {
            agent: {**shared, **{f"{agent}_{name}": info[f"{agent}_{name}"] for name in SIGNAL_FIGURES}}
            for agent in self.possible_agents
        }


def parallel_env(
    config: EnvConfig | None = None,
    *,
    render_mode: str | None = None,
    render_port: int = 0,
    own_process: bool = False,
    **keywords: Unpack[Settings],
) -> TrafficSignalsEnv:
    """Make a PettingZoo environment with an agent per signal.

    Args:
        config: all settings at once, instead of keywords.
        render_mode: `rgb_array`, or `human` for a live page on the loopback address, or None.
        render_port: of that page; 0 takes any that is free.
        own_process: run the simulation in a process of its own, so that several fit into this one.
        keywords: see `Settings`.

    Returns:
        The environment; `reset` begins its first episode.

    Raises:
        ConfigError: a setting cannot work.
    """
    return TrafficSignalsEnv(
        config, render_mode=render_mode, render_port=render_port, own_process=own_process, **keywords
    )
