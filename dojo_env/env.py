"""The Gymnasium environment: one signal, one agent."""

from typing import Any, Unpack

import gymnasium
import numpy as np

from dojo_env.config import EnvConfig, build_config
from dojo_env.errors import ConfigError, SimulationBusyError
from dojo_env.instant import Instant
from dojo_env.keywords import Settings
from dojo_env.watching.viewer import Viewer
from dojo_env.world import Beginning, World
from dojo_env.world_process import open_world

_LARGEST_SEED = 2**31 - 2


class TrafficSignalEnv(gymnasium.Env[Any, Any]):
    """One signal of a scenario, as contract and README describe it; see `config` for the keywords."""

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 4}  # noqa: RUF012 - Gymnasium's own way

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
            ConfigError: a setting cannot work, or the scenario has several signals and none is named.
        """
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(f"render_mode={render_mode!r}: expected one of {self.metadata['render_modes']}")
        self.render_mode = render_mode
        self._made_with = {"render_mode": render_mode, "render_port": render_port, "own_process": own_process}
        self.config = one_config(config, dict(keywords))
        self.world: World = open_world(self.config, own_process=own_process)
        if len(self.world.signals) != 1:
            names = ", ".join(self.world.signals)
            self.world.close()
            raise ConfigError(
                f"scenario {self.config.scenario.name} has several signals ({names}): "
                "name one, as in ts_ids=[...], or use dojo_env.parallel_env"
            )
        self.signal = self.world.signals[0]
        self.observation_space, self.action_space = self.world.spaces()[self.signal]
        self._viewer = open_viewer(self.world, self.config, render_mode, render_port)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; without a seed, one follows from the seed before.

        It moves into a process of its own where another environment of this one runs.

        Args:
            seed: of all that is random in the episode.
            options: none are known.

        Returns:
            The observation, and figures by name.

        Raises:
            SimulationError: SUMO refuses the scenario.
        """
        super().reset(seed=seed, options=options)
        chosen = choose_seed(seed, self.config, self.np_random)
        self.world, (observations, info) = begin_episode(self.world, self.config, chosen)
        self._viewer.follow(self.world.draw)
        return observations[self.signal], info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act, and simulate until the next decision; an episode is only ever truncated, at its end.

        Args:
            action: of `action_space`; which phase, or as `action_mode` says.

        Returns:
            The observation, the reward, False, whether the episode has ended, and figures by name.

        Raises:
            EpisodeOverError: no episode is running.
            SimulationError: SUMO stopped; `reset` begins anew.
        """
        observations, rewards, ended, info = self.world.step({self.signal: read_action(action)})
        self._viewer.follow(self.world.draw, ended=ended)
        return observations[self.signal], rewards[self.signal], False, ended, info

    def render(self) -> Any:
        """Draw the views with the phase and the figures: (h, w, 3) uint8 with `rgb_array`, else nothing.

        Returns:
            (h, w, 3) uint8, or None.
        """
        return self._viewer.render(self.world.draw)

    @property
    def instant(self) -> Instant:
        """What is known at the present decision."""
        return self.world.instant

    def metrics(self) -> dict[str, Any]:
        """Compute the figures of the episode so far; `travel_time` and so on.

        Returns:
            Figures by name: seconds, vehicles, vehicles an hour and g/s; see the guide to controllers.
        """
        return self.world.metrics()

    def save(self) -> dict[str, Any]:
        """Save the full state of the episode, as plain values.

        Returns:
            The seed and every action.
        """
        return self.world.save()

    def restore(self, state: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Go to a saved state.

        Args:
            state: what `save` gave.

        Returns:
            Its observation, and figures by name.

        Raises:
            ConfigError: the state was not made by `save`, or by another scenario's.
        """
        observations, info = self.world.restore(state)
        return observations[self.signal], info

    def close(self) -> None:
        """End the simulation and the page; safe at any time."""
        for part in (getattr(self, "_viewer", None), getattr(self, "world", None)):
            if part is not None:
                part.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it as it was made: what it is in the middle of stays behind, `save` tells that."""
        return make_again, (type(self), self.config, self._made_with), {"spec": self.spec}


def make_again(kind: Any, config: EnvConfig, made_with: dict[str, Any]) -> Any:
    """Make an environment of a kind as another one was made.

    Args:
        kind: the environment's class.
        config: all settings.
        made_with: its other keywords.

    Returns:
        The environment.
    """
    return kind(config, **made_with)


def begin_episode(world: World, config: EnvConfig, seed: int) -> tuple[World, Beginning]:
    """Begin an episode in a world, or, where another simulation of this process is running, in one apart.

    Args:
        world: that should run it.
        config: all settings, for a world apart.
        seed: of the episode.

    Returns:
        The world that it has begun in, and what it begins with.

    Raises:
        SimulationBusyError: the settings cannot be handed to a process of its own.
        SimulationError: SUMO refuses the input.
    """
    try:
        return world, world.reset(seed)
    except SimulationBusyError as busy:
        try:
            apart = open_world(config, own_process=True)
        except ConfigError as error:
            raise SimulationBusyError(f"{busy}; it gets none by itself, for {error}") from None
    world.close()
    try:
        return apart, apart.reset(seed)
    except BaseException:
        apart.close()
        raise


def open_viewer(world: World, config: EnvConfig, mode: str | None, port: int) -> Viewer:
    """Open what shows an environment; the world is closed where that fails.

    Args:
        world: what is shown.
        config: of the environment.
        mode: `human`, `rgb_array` or None.
        port: of the page; 0 takes any that is free.

    Returns:
        The viewer; `close` it.

    Raises:
        ConfigError: the port is taken.
    """
    try:
        return Viewer(mode, config.scenario.name, tuple(world.signals), port=port)
    except ConfigError:
        world.close()
        raise


def choose_seed(seed: int | None, config: EnvConfig, generator: np.random.Generator) -> int:
    """Take the seed given to `reset`, else the configured one, else the next of the generator.

    Args:
        seed: that was given, or None.
        config: of the environment.
        generator: the environment's own.

    Returns:
        The episode's seed.
    """
    if seed is not None:
        return seed
    configured = config.seed
    return configured if configured is not None else int(generator.integers(_LARGEST_SEED))


def read_action(action: Any) -> Any:
    """Take the number out of what agents hand over: a number, or an array of one.

    Args:
        action: what the agent gave.

    Returns:
        The number.

    Raises:
        ConfigError: it is none.
    """
    if type(action) in (int, np.int64):  # What learners hand over, at every decision.
        return int(action)
    array = np.asarray(action)
    if array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise ConfigError(f"action {action!r}: expected one whole number")
    return array.reshape(-1)[0].item()


def one_config(config: EnvConfig | None, keywords: dict[str, Any]) -> EnvConfig:
    """Take the settings given whole, or build them from keywords.

    Args:
        config: all settings, or None.
        keywords: the same one by one.

    Returns:
        All settings.

    Raises:
        ConfigError: both are given, or a setting cannot work.
    """
    if config is None:
        return build_config(**keywords)
    if keywords:
        raise ConfigError(f"config is given whole, and {', '.join(keywords)} beside it; leave one out")
    return config
