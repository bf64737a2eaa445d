"""Several signals of one world as that many environments, which is all that Stable-Baselines3 needs.

Signals differ in numbers of phases and lanes, so what they see and do is brought to one size. Features are
padded with zeros block by block, so that a place always means the same, and say at their end whose they are
(parameter sharing with agent indication; Terry et al., arXiv:2005.13625). Other observations are of one size
as they come. An action beyond a signal's last
phase counts on from its first: so every action is one of its phases, always the same, and none needs a mask.
"""

from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from dojo_env.lane_features import place_features
from dojo_env.parallel import TrafficSignalsEnv

_IMAGE = 3
"""Axes of an image."""


class Stack:
    """What several signals observe, brought to one size: a row each.

    Attributes:
        observation_space: of all rows; a dict of such where a signal observes one.
        action_space: a phase of each signal.
    """

    def __init__(self, known: Mapping[str, tuple[spaces.Space[Any], spaces.Discrete]]) -> None:
        """Take each signal's observation and action space."""
        self._agents = tuple(known)
        phases = [int(action.n) for _, action in known.values()]
        observed: list[Any] = [space for space, _ in known.values()]
        self.action_space = spaces.MultiDiscrete(phases)
        self._places: list[NDArray[np.int64]] = []
        self.observation_space: spaces.Space[Any]
        if isinstance(observed[0], spaces.Dict) or len(observed[0].shape) == _IMAGE:
            self.observation_space = _repeat(observed[0], len(phases))
            return
        lanes = [(space.shape[0] - 1 - count) // 2 for count, space in zip(phases, observed, strict=True)]
        self._places = place_features(phases, lanes)
        width = max(phases) + 1 + 2 * max(lanes) + len(self._agents)
        self.observation_space = spaces.Box(0.0, 1.0, (len(phases), width), np.float32)

    @property
    def row_space(self) -> spaces.Space[Any]:
        """What one signal observes, in a row."""
        return take_row(self.observation_space)

    def stack(self, seen: Mapping[str, Any]) -> Any:
        """Put the signals' observations into rows.

        Args:
            seen: by the signal's id, of all signals.

        Returns:
            (signals, ...), or a dict of such where a signal observes one. Features are padded, and end with
            a 1 in the signal's own place.
        """
        if not self._places:
            return _join([seen[agent] for agent in self._agents])
        stacked = np.zeros(self.observation_space.shape or (), np.float32)
        for row, (agent, places) in enumerate(zip(self._agents, self._places, strict=True)):
            stacked[row, places] = seen[agent]
            stacked[row, row - len(self._agents)] = 1
        return stacked

    def name_actions(self, actions: NDArray[Any]) -> dict[str, int]:
        """Turn numbers into each signal's phase.

        Args:
            actions: (signals,) from 0; one beyond a signal's last phase counts on from its first.

        Returns:
            A phase by the signal's id.
        """
        phases = actions % self.action_space.nvec
        return {agent: int(phase) for agent, phase in zip(self._agents, phases, strict=True)}


def change_each(change: Callable[[Any], Any], value: Any) -> Any:
    """Change an array, or each of a dict of arrays.

    Args:
        change: gives what takes an array's place.
        value: an array, or a dict of arrays.

    Returns:
        What `change` gave, or a new dict of that by name.
    """
    return {name: change(part) for name, part in value.items()} if isinstance(value, dict) else change(value)


def _join(rows: Sequence[Any]) -> Any:
    if isinstance(rows[0], dict):
        return {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    return np.stack(rows)


def _repeat(space: Any, count: int) -> spaces.Space[Any]:
    """Describe as many observations as there are signals, all of one size."""
    if isinstance(space, spaces.Dict):
        return spaces.Dict({name: _repeat(part, count) for name, part in space.items()})
    return spaces.Box(space.low.min(), space.high.max(), (count, *space.shape), space.dtype)


def take_row(space: Any) -> spaces.Space[Any]:
    """Describe a row of a box of rows, or of each of a dict.

    Args:
        space: (rows, ...) of values from 0, or a dict of such.

    Returns:
        (...), or a dict of such; its values go from 0 to the greatest of all rows.
    """
    if isinstance(space, spaces.Dict):
        return spaces.Dict({name: take_row(part) for name, part in space.items()})
    return spaces.Box(0, space.high.max(), space.shape[1:], space.dtype)


class JointEnv(gymnasium.Env[Any, Any]):
    """All signals act at once: observations and rewards are stacked, an action is one number each."""

    def __init__(self, env: TrafficSignalsEnv) -> None:
        """Take the signals' environment."""
        self._env, self._agents, self.world = env, env.possible_agents, env.world
        self._stack = Stack(env.world.spaces())
        self.observation_space = self._stack.observation_space
        self.action_space = self._stack.action_space

    def reset(self, *, seed: int | None = None, **_options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of the episode; None takes one that follows from the seed before.

        Returns:
            What the signals observe, as `Stack.stack` gives it, and the first signal's figures.

        Raises:
            SimulationError: SUMO refuses the scenario.
        """
        seen, infos = self._env.reset(seed=seed)
        return self._stack.stack(seen), infos[self._agents[0]]

    def step(self, action: NDArray[Any]) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Act, and simulate until the next decision.

        Args:
            action: (signals,) numbers, as `Stack.name_actions` takes them.

        Returns:
            What the signals observe, as `Stack.stack` gives it; (signals,) rewards; False, since nothing ends
            before its time; whether the episode is over; and the first signal's figures.

        Raises:
            SimulationError: SUMO stopped.
        """
        seen, rewards, _, ended, infos = self._env.step(self._stack.name_actions(action))
        first = self._agents[0]
        paid = np.array([rewards[agent] for agent in self._agents], np.float32)
        return self._stack.stack(seen), paid, False, ended[first], infos[first]

    def metrics(self) -> dict[str, Any]:
        """Compute the figures of the episode so far."""
        return self._env.metrics()

    def close(self) -> None:
        """End the simulation."""
        self._env.close()


class AgentsVecEnv(VecEnvWrapper):
    """The signals of joint environments side by side: all of the first one, then all of the second."""

    def __init__(self, joint: VecEnv) -> None:
        """Take environments that are `JointEnv`s."""
        acting: Any = joint.action_space
        self.phases = tuple(int(count) for count in acting.nvec)
        self.agents = len(self.phases)
        super().__init__(
            joint,
            take_row(joint.observation_space),
            spaces.Discrete(max(self.phases)),
        )
        self.num_envs = joint.num_envs * self.agents

    def reset(self) -> Any:
        """Begin an episode everywhere."""
        return self._flat(self.venv.reset())

    def step_async(self, actions: NDArray[Any]) -> None:
        """Hand each joint environment its signals' actions.

        Args:
            actions: (environments * signals,) all of the first environment, then all of the second.
        """
        self.venv.step_async(np.reshape(actions, (-1, self.agents)))

    def step_wait(self) -> Any:
        """Give every signal its own; the figures of an episode come with its first signal."""
        seen, rewards, ended, infos = self.venv.step_wait()
        return self._flat(seen), rewards.ravel(), np.repeat(ended, self.agents), self._share(infos)

    def _flat(self, seen: Any) -> Any:
        return change_each(lambda part: part.reshape(-1, *part.shape[2:]), seen)

    def _share(self, infos: list[dict[str, Any]]) -> list[dict[str, Any]]:
        shared = []
        for info in infos:
            last = info.pop("terminal_observation", None)
            for agent in range(self.agents):
                own = {"TimeLimit.truncated": info["TimeLimit.truncated"], **(info if agent == 0 else {})}
                if last is not None:
                    own["terminal_observation"] = change_each(itemgetter(agent), last)
                shared.append(own)
        return shared
