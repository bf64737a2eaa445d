"""Run a controller for whole episodes and collect their figures."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dojo_env.config import build_config
from dojo_env.controllers import Controller, make_controller
from dojo_env.forks import call_in_fork
from dojo_env.metrics import SIX
from dojo_env.watch import FilmShow
from dojo_env.watching.video import Video
from dojo_env.world import World

Outcome = tuple[list[dict[str, Any]], dict[str, Any], Any]
"""What `info` told at each decision of an episode, its figures, and what the world leaves to the next."""


def run_controller(
    name: str,
    seeds: Sequence[int],
    *,
    on_step: Callable[[dict[str, Any]], None] = lambda _info: None,
    on_episode: Callable[[dict[str, Any]], None] = lambda _figures: None,
    video: Path | None = None,
    **keywords: Any,
) -> list[dict[str, Any]]:
    """Run an episode per seed; returns the figures of each.

    Each runs in a fork, so that it does not matter which ran before; but where a video shows them.

    Args:
        name: of the controller.
        seeds: one episode each.
        on_step: is told what `info` told after each decision, when an episode is over.
        on_episode: is then told its figures.
        video: a file that shows all episodes, one after the other, second by second.
        keywords: settings of the environment.

    Raises:
        ConfigError: the controller or a setting is unknown, or the video cannot be written.
        SimulationError: SUMO refuses the scenario.
    """
    controller = make_controller(name)
    config = build_config(**{"show_links": video is not None, **keywords, **controller.settings})
    figures = []
    with ExitStack() as stack:
        film = stack.enter_context(Video(video)) if video is not None else None
        world = stack.enter_context(closing(World(config)))
        if film is not None:
            title = f"{config.scenario.name}, {name}"
            world.watch(FilmShow(world.eyes, world.map.plans, title, film).add)
        run = _run_episode if film is not None else partial(call_in_fork, _run_episode)
        for seed in seeds:
            infos, found, world.lasting = run(world, controller, seed)
            for info in infos:
                on_step(info)
            on_episode(found)
            figures.append(found)
    return figures


def _run_episode(world: World, controller: Controller, seed: int) -> Outcome:
    """Run an episode to its end."""
    infos: list[dict[str, Any]] = []
    controller.reset(seed)
    world.reset(seed)
    ended = False
    try:
        while not ended:
            _, _, ended, info = world.step(controller.act(world.instant))
            infos.append(info)
    except BaseException:
        world.close()  # What there is of the episode is written by whose fork it is.
        raise
    return infos, world.metrics(), world.lasting


def summarize(figures: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Give mean and standard deviation over episodes of every figure that is a number."""
    numbers = [*SIX, "mean_trip_duration", "mean_trip_duration_all", "arrived", "pedestrian_waiting"]
    return {
        name: {
            "mean": float(np.mean([f[name] for f in figures])),
            "std": float(np.std([f[name] for f in figures], ddof=1)) if len(figures) > 1 else 0.0,
        }
        for name in numbers
    }
