"""Several signals of one world as that many environments, which is all that Stable-Baselines3 needs.

Signals differ in numbers of phases and lanes, so what they see and do is brought to one size. Features are
padded with zeros block by block, so that a place always means the same, and say at their end whose they are
(parameter sharing with agent indication; Terry et al., arXiv:2005.13625). An action beyond a signal's last
phase counts on from its first: so every action is one of its phases, always the same, and none needs a mask.
"""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from dojo_env.parallel import TrafficSignalsEnv


class Stack:
    """What several signals observe, brought to one size: a row each.

    Attributes:
        observation_space: of all rows.
        action_space: a phase of each signal.
    """

    def __init__(self, known: Mapping[str, tuple[spaces.Space[Any], spaces.Discrete]]) -> None:
        """Take each signal's observation and action space."""
        self._agents = tuple(known)
        phases = [int(action.n) for _, action in known.values()]
        shapes = [observed.shape or () for observed, _ in known.values()]
        self.action_space = spaces.MultiDiscrete(phases)
        self._places = [] if len(shapes[0]) == 3 else place_features(phases, [size for (size,) in shapes])
        self.observation_space: spaces.Box
        if self._places:
            width = 1 + max(int(places[-1]) for places in self._places) + len(self._agents)
            self.observation_space = spaces.Box(0.0, 1.0, (len(phases), width), np.float32)
        else:
            self.observation_space = spaces.Box(0, 255, (len(phases), *shapes[0]), np.uint8)

    @property
    def row_space(self) -> spaces.Box:
        """What one signal observes, in a row."""
        return take_row(self.observation_space)

    def stack(self, seen: Mapping[str, Any]) -> NDArray[Any]:
        """Put the signals' observations into rows, (signals, ...)."""
        if not self._places:
            return np.stack([seen[agent] for agent in self._agents])
        stacked = np.zeros(self.observation_space.shape or (), np.float32)
        for row, (agent, places) in enumerate(zip(self._agents, self._places, strict=True)):
            stacked[row, places] = seen[agent]
            stacked[row, row - len(self._agents)] = 1
        return stacked

    def name_actions(self, actions: NDArray[Any]) -> dict[str, int]:
        """Turn (signals,) numbers into each signal's phase."""
        phases = actions % self.action_space.nvec
        return {agent: int(phase) for agent, phase in zip(self._agents, phases, strict=True)}


def take_row(space: Any) -> spaces.Box:
    """Describe a row of a box of rows."""
    return spaces.Box(0, space.high.max(), space.shape[1:], space.dtype)


class JointEnv(gymnasium.Env[Any, Any]):
    """All signals act at once: observations and rewards are stacked, an action is one number each."""

    def __init__(self, env: TrafficSignalsEnv) -> None:
        """Take the signals' environment."""
        self._env, self._agents, self.world = env, env.possible_agents, env.world
        self._stack = Stack(env.world.spaces())
        self.observation_space = self._stack.observation_space
        self.action_space = self._stack.action_space

    def reset(self, *, seed: int | None = None, **_options: Any) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin an episode."""
        seen, infos = self._env.reset(seed=seed)
        return self._stack.stack(seen), infos[self._agents[0]]

    def step(self, action: NDArray[Any]) -> tuple[NDArray[Any], Any, bool, bool, dict[str, Any]]:
        """Act."""
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


def place_features(phases: list[int], sizes: list[int]) -> list[NDArray[np.int64]]:
    """Tell where each signal's phases, flag, densities and queues go; blocks are as wide as the widest."""
    lanes = [(size - 1 - count) // 2 for count, size in zip(phases, sizes, strict=True)]
    flag, most = max(phases), max(lanes)
    return [
        np.concatenate([np.arange(count), [flag], *(flag + 1 + at + np.arange(each) for at in (0, most))])
        for count, each in zip(phases, lanes, strict=True)
    ]


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
        """Hand each joint environment its signals' actions."""
        self.venv.step_async(np.reshape(actions, (-1, self.agents)))

    def step_wait(self) -> Any:
        """Give every signal its own; the figures of an episode come with its first signal."""
        seen, rewards, ended, infos = self.venv.step_wait()
        return self._flat(seen), rewards.ravel(), np.repeat(ended, self.agents), self._share(infos)

    def _flat(self, seen: Any) -> NDArray[Any]:
        rows: NDArray[Any] = seen.reshape(-1, *seen.shape[2:])
        return rows

    def _share(self, infos: list[dict[str, Any]]) -> list[dict[str, Any]]:
        shared = []
        for info in infos:
            last = info.pop("terminal_observation", None)
            for agent in range(self.agents):
                own = {"TimeLimit.truncated": info["TimeLimit.truncated"], **(info if agent == 0 else {})}
                shared.append(own if last is None else {**own, "terminal_observation": last[agent]})
        return shared
