"""Run a controller for whole episodes and collect their figures."""

import pickle
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from html import escape
from operator import index
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from dojo_env.charts import Plot, draw_series
from dojo_env.config import build_config
from dojo_env.controllers import Controller, make_controller
from dojo_env.errors import ConfigError
from dojo_env.keywords import Settings
from dojo_env.metrics import SIX
from dojo_env.recording import Recording, read_recording
from dojo_env.series import Series
from dojo_env.watch import FilmShow, choose_looks, open_views
from dojo_env.watching.video import open_video
from dojo_env.world_process import open_world
from dojo_maps.short_repr import shortened
from dojo_maps.wording import counted


class Episodes(list[dict[str, Any]]):
    """The figures of episodes, as `metrics()` has them; a notebook shows their means as a table.

    Attributes:
        title: who controlled what.
        series: what was measured at each decision of each episode.
    """

    def __init__(self, title: str) -> None:
        """Begin with none.

        Args:
            title: who controls what.
        """
        super().__init__()
        self.title = title
        self.series: list[Series] = []

    def plot(self, *names: str, smooth: float = 60.0) -> Plot:
        """Draw figures over time: the mean of all episodes, and their range.

        Args:
            names: such as `queue`, `co2` or any that `info` tells; none for those that tell most.
            smooth: seconds that values are averaged over, with those before.

        Returns:
            The chart, which shows itself in a notebook.

        Raises:
            ConfigError: no figure has a name.
            ToolMissingError: matplotlib is not installed.
        """
        return draw_series({self.title: self.series}, names, smooth=smooth)

    def __repr__(self) -> str:
        """Tell who controlled what, and how many there are."""
        return shortened(f"Episodes({self.title!r}, {counted(len(self), 'episode')})")

    def _repr_html_(self) -> str:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        rows = "".join(
            f"<tr><th>{name}</th>" + "".join(f"<td>{value[part]:,.2f}</td>" for part in _PARTS) + "</tr>"
            for name, value in (summarize(self) if self else {}).items()
        )
        head = "".join(f"<th>{part}</th>" for part in _PARTS)
        return (
            f"<table><caption>{escape(self.title)}: {counted(len(self), 'episode')}</caption>"
            f"<tr><th></th>{head}</tr>{rows}</table>"
        )


def run_controller(
    controller: str | Controller,
    seeds: Sequence[int] | int,
    *,
    on_step: Callable[[dict[str, Any]], None] = lambda _info: None,
    on_episode: Callable[[dict[str, Any]], None] = lambda _figures: None,
    on_stage: Callable[[str], None] = lambda _stage: None,
    video: str | Path | None = None,
    **keywords: Unpack[Settings],
) -> Episodes:
    """Run an episode per seed.

    They run in a process of their own, so that it does not matter what ran before, and a crash of SUMO does
    not take this one along. A controller that a script or a notebook defines itself runs in this process.

    Args:
        controller: its name, or one that is there already.
        seeds: one episode each; or how many, from the scenario's own seed on, or from 0.
        on_step: is told what `info` told after each decision, when an episode is over.
        on_episode: is then told its figures.
        on_stage: is told now and then how far the video is.
        video: a file that shows all episodes, one after the other, second by second.
        keywords: see `Settings`.

    Returns:
        The figures of each episode, as `metrics()` has them, and its `seed`: a list that can `plot()` what
        was measured over time.

    Raises:
        ConfigError: the controller or a setting is unknown, or the video cannot be written.
        SimulationError: SUMO refuses the scenario.
    """
    acting = make_controller(controller) if isinstance(controller, str) else controller
    if not isinstance(acting, Controller):
        raise ConfigError(f"controller {acting!r}: expected a name, or an object such as MyController()")
    config = build_config(**acting.complete({"show_links": video is not None, **keywords}))
    chosen = _choose_seeds(seeds, config.seed or 0)
    title = f"{config.scenario.name}, {acting}"
    episodes = Episodes(title)
    with ExitStack() as stack:
        film = stack.enter_context(open_video(video)) if video is not None else None
        world = stack.enter_context(closing(open_world(config, own_process=_is_known_elsewhere(acting))))
        show = None
        if film is not None:
            views = open_views(build_config(**{"show_links": True, **choose_looks(acting), **keywords}))
            show = FilmShow(*views, title, film, on_stage=on_stage)
            world.watch(show.add)
        for seed in chosen:
            if show is not None:
                show.begin(seed)
            infos, found = world.run(acting, seed)
            for info in infos:
                on_step(info)
            on_episode(found)
            episodes.append(found)
            episodes.series.append(Series.of_infos(infos))
    return episodes


def _choose_seeds(seeds: Any, first: int) -> list[int]:
    """List the episodes' seeds.

    Raises:
        ConfigError: there is none, or one is no whole number from 0.
    """
    try:
        chosen = list(map(index, range(first, first + seeds) if isinstance(seeds, int) else seeds))
    except TypeError:
        chosen = []
    if not chosen or min(chosen) < 0:
        raise ConfigError(
            f"seeds={seeds!r}: expected how many, at least 1, or a list of whole numbers from 0"
        )
    return chosen


def _is_known_elsewhere(controller: Controller) -> bool:
    """Tell whether another process can import all that a controller is made of."""
    try:
        return b"__main__" not in pickle.dumps(controller)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False


def record(
    stem: str | Path,
    controller: str | Controller = "actuated",
    *,
    seed: int = 0,
    **keywords: Unpack[Settings],
) -> Recording:
    """Run an episode and record every second of it, to be seen again with `replay`.

    Args:
        stem: the recording is `STEM_ep1.npz`.
        controller: its name, or one that is there already.
        seed: of the episode.
        keywords: see `Settings`.

    Returns:
        The recording.

    Raises:
        ConfigError: the controller or a setting is unknown.
        SimulationError: SUMO refuses the scenario, or stopped.
        WriteError: the file cannot be written.
    """
    keywords["record_name"] = str(stem)
    run_controller(controller, [seed], **keywords)
    return read_recording(f"{stem}_ep1.npz")


_PARTS = ("mean", "std", "median")
FIGURES = (
    *SIX,
    *("travel_time_all", "time_loss", "depart_delay", "mean_trip_duration", "arrived", "missing", "late"),
    *("longest_red", "pedestrian_waiting"),
)
"""What is told of episodes, beside the six figures of the paper's table."""
JAMMED = 0.05
"""An episode has jammed where more than this share of its vehicles is late at its end."""


def summarize(figures: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Give mean, standard deviation and median over episodes of every figure that is a number.

    Args:
        figures: of the episodes, as `run_controller` gives them.

    Returns:
        By the figure's name: `mean`, `std` and `median`.

    Raises:
        ConfigError: there is none.
    """
    if not figures:
        raise ConfigError("no episode to summarize")
    return {
        name: {
            "mean": float(np.mean([f[name] for f in figures])),
            "std": float(np.std([f[name] for f in figures], ddof=1)) if len(figures) > 1 else 0.0,
            "median": float(np.median([f[name] for f in figures])),
        }
        for name in FIGURES
    }
