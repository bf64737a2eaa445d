"""SUMO-RL's environments for PettingZoo: agents in turn, or all at once."""

from typing import Any, ClassVar

from gymnasium import spaces
from gymnasium.utils import EzPickle
from pettingzoo import AECEnv
from pettingzoo.utils import AgentSelector, wrappers
from pettingzoo.utils.conversions import parallel_wrapper_fn


class SumoEnvironmentPZ(AECEnv, EzPickle):  # type: ignore[misc]
    """Every signal an agent; they act in turn, and SUMO runs after the last one.

    Attributes:
        env: the `SumoEnvironment`.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": ["human", "rgb_array"],
        "name": "sumo_rl_v0",
        "is_parallelizable": True,
    }

    agent_selection: str
    terminations: dict[str, bool]
    truncations: dict[str, bool]
    _cumulative_rewards: dict[str, Any]

    def __init__(self, **kwargs: Any) -> None:
        """Open the map; the keywords are those of `SumoEnvironment`."""
        from .env import SumoEnvironment  # noqa: PLC0415 - it names this module's environments

        EzPickle.__init__(self, **kwargs)
        super().__init__()
        self.env = SumoEnvironment(**kwargs)
        self.render_mode = self.env.render_mode
        self.possible_agents = list(self.env.ts_ids)
        self.agents = list(self.possible_agents)
        self.action_spaces = {agent: self.env.action_spaces(agent) for agent in self.agents}
        self.observation_spaces = {agent: self.env.observation_spaces(agent) for agent in self.agents}
        self._begin()

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Tell the space of an agent's observations.

        Args:
            agent: id of a signal.

        Returns:
            The space, the same object at each call.
        """
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Tell the space of an agent's actions.

        Args:
            agent: id of a signal.

        Returns:
            A number for each green phase; the same object at each call.
        """
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Begin an episode.

        Args:
            seed: of this episode, and of those after it that are given none.
            options: nothing heeds them.

        Raises:
            ConfigError: `sumo_seed` is neither a whole number nor "random".
            SimulationError: SUMO refuses the input.
        """
        self.env.reset(seed=seed, options=options)
        self.agents = list(self.possible_agents)
        self._begin()
        self._tell()

    def step(self, action: Any) -> None:
        """Act for the agent whose turn it is; after the last one, simulate until the next decision.

        Args:
            action: number of a green phase; None, and nothing else, for an agent whose episode is over.

        Raises:
            EpisodeOverError: no episode is running.
            ConfigError: an agent asks for a phase that its signal has not; raised at the last agent's turn.
            SimulationError: SUMO stopped; `reset` begins anew.
            ValueError: an action is given for an agent whose episode is over.
        """
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            self._was_dead_step(action)
            return
        if not self.env.fixed_ts:
            self.env._apply_actions({agent: action})
        if self._selector.is_last():
            self.env._run_steps()
            self.env._compute_observations()
            self.rewards = self.env._compute_rewards()
            self.truncations = dict.fromkeys(self.agents, self.env._compute_dones()["__all__"])
            self._tell()
        else:
            self._clear_rewards()
        self.agent_selection = self._selector.next()
        self._cumulative_rewards[agent] = 0.0
        self._accumulate_rewards()

    def observe(self, agent: str) -> Any:
        """Tell what an agent has seen last.

        Args:
            agent: id of a signal.

        Returns:
            Its observation of the last decision; None before the first reset.
        """
        return self.env.observations[agent]

    def render(self) -> Any:
        """Draw as `SumoEnvironment` does."""
        return self.env.render()

    def save_csv(self, out_csv_name: str | None, episode: int) -> None:
        """Write the episode's figures as `SumoEnvironment` does.

        Args:
            out_csv_name: the beginning of the file's path, whose folders are made; None writes nothing.
            episode: the number in the file's name.

        Raises:
            UsageError: a folder has the file's name, or a file is in a folder's way.
            WriteError: the file cannot be written.
        """
        self.env.save_csv(out_csv_name, episode)

    def close(self) -> None:
        """End the simulation."""
        self.env.close()

    def _begin(self) -> None:
        self._selector = AgentSelector(self.agents)
        self.agent_selection = self._selector.reset()
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos: dict[str, dict[str, Any]] = {agent: {} for agent in self.agents}

    def _tell(self) -> None:
        """Give each agent the figures of all traffic, and its own."""
        info = self.env._compute_info()
        self.infos = {
            agent: {name: value for name, value in info.items() if name.startswith((f"{agent}_", "system"))}
            for agent in self.agents
        }


def env(**kwargs: Any) -> Any:
    """Make an environment whose agents act in turn; the keywords are those of `SumoEnvironment`."""
    return wrappers.OrderEnforcingWrapper(wrappers.AssertOutOfBoundsWrapper(SumoEnvironmentPZ(**kwargs)))


parallel_env = parallel_wrapper_fn(env)
"""Make an environment whose agents act all at once; the keywords are those of `SumoEnvironment`."""
