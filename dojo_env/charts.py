"""Charts of figures over time, of what signals showed and of traffic from above, drawn by matplotlib.

They show themselves in a notebook. Matplotlib loads when the first one is drawn.
"""

import io
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dojo_env.errors import ConfigError
from dojo_env.series import TITLES, Numbers, Series
from dojo_maps.description import RoadMap
from dojo_maps.errors import explain_missing
from dojo_maps.input_files import is_there
from dojo_maps.whole_file import replaced

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's, which people who see few colours tell apart."""
STYLE: Any = {
    "font.size": 9, "axes.titlesize": 10, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": "#e6e6e6", "axes.axisbelow": True, "lines.linewidth": 1.5,
    "legend.frameon": False, "figure.dpi": 80, "savefig.facecolor": "white", "svg.hashsalt": "traffic-dojo",
}  # fmt: skip
_UNDATED: dict[str, dict[str, Any]] = {
    ".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None},
}  # fmt: skip
"""The kinds of files, and what keeps the same chart to the same bytes."""
_LAMPS = {"r": "#c93a31", "y": "#f1c40f", "Y": "#f1c40f", "u": "#e67e22", "g": "#7fc99a", "G": "#0f9d58"}
_DARK = "#5a626e"
"""What shows no light at all."""
_LETTERS, _HANDLE = 13, 8
"""Of a legend: letters of an inch, and the room of a line, in letters."""
_GROUND = "#c5cad1"
_MOST_LINKS = 40
_LEAST_HALF = 0.4
"""Metres: half of how wide the slimmest are drawn."""
_AROUND = 15.0
"""Metres of map around the traffic."""


class Plot:
    """A chart that shows itself in a notebook.

    Attributes:
        figure: matplotlib's, to change whatever you like.
    """

    def __init__(self, figure: "Figure") -> None:
        """Take what is drawn.

        Args:
            figure: of matplotlib.
        """
        self.figure = figure

    def save(self, path: str | Path) -> Path:
        """Write it as .png, .svg or .pdf; the same chart gives the same bytes.

        Args:
            path: of the file.

        Returns:
            The path.

        Raises:
            ConfigError: the name ends in something else.
            WriteError: the file cannot be written.
        """
        path = Path(path)
        check_name(path)
        with replaced(path) as fresh, styled():
            self.figure.savefig(fresh, metadata=_UNDATED[path.suffix.lower()])
        return path

    def _repr_png_(self) -> bytes:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        file = io.BytesIO()
        with styled():
            self.figure.savefig(file, format="png", metadata=_UNDATED[".png"])
        return file.getvalue()

    def __repr__(self) -> str:
        """Tell what there is to do with it."""
        return f"Plot(.save(path) writes {', '.join(_UNDATED)})"


def check_name(path: Path) -> None:
    """Refuse a file that no chart can be written to.

    Args:
        path: of the file.

    Raises:
        ConfigError: its name says no kind that charts are written in, or its folder is not there.
    """
    if path.suffix.lower() not in _UNDATED:
        raise ConfigError(f"{path}: a plot's name ends in {', '.join(_UNDATED)}")
    if not is_there(path.absolute().parent):
        raise ConfigError(f"{path}: no such folder; make it first")


def styled() -> AbstractContextManager[None]:
    """Draw in the style of all charts within a context.

    Returns:
        The context.

    Raises:
        ToolMissingError: matplotlib is not installed.
    """
    try:
        from matplotlib import rc_context  # noqa: PLC0415 - takes long, and few draw
    except ModuleNotFoundError as error:
        raise explain_missing(error) or error from error
    return rc_context(STYLE)


def draw_series(
    runs: Mapping[str, Sequence[Series]], names: Sequence[str] = (), *, smooth: float = 60.0
) -> Plot:
    """Draw figures over time, a panel for each; several episodes of a run become their mean and their range.

    Args:
        runs: the episodes of each, by what the legend calls it.
        names: of figures; none for those that tell most.
        smooth: seconds that values are averaged over, with those before; a training's are not.

    Returns:
        The chart.

    Raises:
        ConfigError: nothing is measured, or no figure has a name.
        ToolMissingError: matplotlib is not installed.
    """
    every = [series for episodes in runs.values() for series in episodes]
    if not every or not all(len(series.at) for series in every):
        raise ConfigError("nothing was measured; step the environment first")
    if not smooth > 0:
        raise ConfigError(f"smooth={smooth}: expected seconds above 0")
    if len({series.unit for series in every}) > 1:
        raise ConfigError("one of them is a training and another is not; draw them apart")
    chosen = _choose(every, names)
    with styled():
        figure, panels = _open_panels(len(chosen))
        looks = [{"color": colour, "linestyle": line} for line in ("-", "--", ":") for colour in COLOURS]
        for place, name in zip(panels, chosen, strict=False):
            for (label, episodes), look in zip(runs.items(), cycle(looks), strict=False):
                _draw_run(place, episodes, name, smooth, {"label": label, **look})
            place.set_title(TITLES.get(name, name.replace("_", " ")), loc="left")
            place.margins(x=0)
        for place in panels[max(0, len(chosen) - _across(len(chosen))) : len(chosen)]:
            place.set_xlabel("minutes" if every[0].unit == "seconds" else every[0].unit)
        if len(runs) > 1:
            handles, labels = panels[0].get_legend_handles_labels()
            ncols = max(1, int(figure.get_figwidth() * _LETTERS) // (max(map(len, labels)) + _HANDLE))
            figure.legend(handles, labels, loc="outside lower center", ncols=ncols)
    return Plot(figure)


def _choose(every: Sequence[Series], names: Sequence[str]) -> tuple[str, ...]:
    """Check that all have these figures, or choose of those that all have."""
    if names:
        return tuple(dict.fromkeys(name for series in every for name in series.choose(names)))
    common = set[str].intersection(*(set(series.figures) for series in every))
    if not common:
        raise ConfigError("they have no figure in common; draw them apart")
    first = every[0]
    return replace(
        first, figures={name: first.figures[name] for name in first.figures if name in common}
    ).choose()


def _across(count: int) -> int:
    """Tell how many panels stand side by side."""
    return min(count, 2 if count in (2, 4) else 3)


def _open_panels(count: int) -> "tuple[Figure, list[Axes]]":
    from matplotlib.figure import Figure  # noqa: PLC0415 - takes long, and few draw

    across = _across(count)
    rows = -(-count // across)
    figure = Figure(figsize=(max(3.4 * across, 5.0), 2.3 * rows + 0.6), layout="constrained")
    panels = list(figure.subplots(rows, across, sharex=True, squeeze=False).flat)
    for place in panels[count:]:
        place.set_axis_off()
    return figure, panels


def _draw_run(place: "Axes", episodes: Sequence[Series], name: str, smooth: float, look: Any) -> None:
    is_training = episodes[0].unit != "seconds"
    if is_training:
        look = {**look, "marker": "."}  # A short one has a single validation.
    lines = [
        (series.at, series.figures[name])
        if is_training
        else (series.at / 60, average(series.figures[name], _count_averaged(series, smooth)))
        for series in episodes
    ]
    if len({len(times) for times, _ in lines}) > 1:  # One was broken off: there is no mean.
        for k, (times, values) in enumerate(lines):
            place.plot(times, values, **(look if k == 0 else {**look, "label": "_"}))
        return
    times, values = lines[0][0], np.array([values for _, values in lines])
    place.plot(times, values.mean(axis=0), **look)
    if len(lines) > 1:
        place.fill_between(
            times, values.min(axis=0), values.max(axis=0), color=look["color"], alpha=0.15, lw=0
        )


def _count_averaged(series: Series, smooth: float) -> int:
    interval = series.at[1] - series.at[0] if len(series.at) > 1 else smooth
    return max(1, round(smooth / interval))


def average(values: Numbers, count: int) -> Numbers:
    """Average each value with the ones before it, as many as there are up to a count.

    Args:
        values: (n,).
        count: of values, this one among them.

    Returns:
        (n,) means.
    """
    sums = np.concatenate([[0.0], np.cumsum(values)])
    ends = np.arange(1, len(values) + 1)
    begins = np.maximum(ends - count, 0)
    return (sums[ends] - sums[begins]) / (ends - begins)


def draw_lights(times: Numbers, states: Mapping[str, Sequence[str]]) -> Plot:
    """Draw what signals showed, a row for each of their links: green, pale where it yields, yellow, red.

    Args:
        times: (n,) seconds since the episode's begin.
        states: n states by signal, a letter per link each.

    Returns:
        The chart, with a panel per signal.

    Raises:
        ConfigError: there is no signal.
        ToolMissingError: matplotlib is not installed.
    """
    if not states:
        raise ConfigError("no signal was recorded")
    with styled():
        from matplotlib.colors import to_rgb  # noqa: PLC0415 - takes long, and few draw
        from matplotlib.figure import Figure  # noqa: PLC0415

        colours = {letter: to_rgb(colour) for letter, colour in _LAMPS.items()}
        links = {signal: min(max(map(len, shown)), _MOST_LINKS) for signal, shown in states.items()}
        heights = [0.11 * count + 0.55 for count in links.values()]
        figure = Figure(figsize=(9.0, sum(heights) + 0.3), layout="constrained")
        panels = figure.subplots(len(states), 1, sharex=True, squeeze=False, height_ratios=heights)
        for place, (signal, shown) in zip(panels.flat, states.items(), strict=True):
            count = links[signal]
            rows = [[colours.get(letter, to_rgb(_DARK)) for letter in state[:count]] for state in shown]
            ends = (times[0] / 60, (times[-1] + 1) / 60)
            place.imshow(
                np.array(rows).swapaxes(0, 1), aspect="auto", interpolation="nearest",
                extent=(*ends, count - 0.5, -0.5),
            )  # fmt: skip
            place.set_yticks([0, count - 1])
            place.set_title(f"{signal}: what each link shows", loc="left")
            place.grid(visible=False)
            place.tick_params(length=0)
        panels[-1, 0].set_xlabel("minutes")
    return Plot(figure)


def draw_traffic(
    title: str, positions: Numbers, headings: Numbers, sizes: Numbers, speeds: Numbers,
    road_map: RoadMap | None = None,
) -> Plot:  # fmt: skip
    """Draw traffic from above: every road user to scale, red where it stands, green where it is fast.

    Args:
        title: of the chart.
        positions: (n, 3) middle of the front end, metres.
        headings: (n,) radians, counter-clockwise from east.
        sizes: (n, 3) length, width, height, metres.
        speeds: (n,) m/s.
        road_map: whose lanes are drawn below.

    Returns:
        The chart, metres east and north.

    Raises:
        ToolMissingError: matplotlib is not installed.
    """
    with styled():
        from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415 - takes long
        from matplotlib.figure import Figure  # noqa: PLC0415

        shown = positions[:, :2] if len(positions) or road_map is None else np.array(road_map.bounds)
        low, high = (
            (shown.min(axis=0) - _AROUND, shown.max(axis=0) + _AROUND) if len(shown) else ([0, 0], [1, 1])
        )
        tall = float(np.clip(6 * (high[1] - low[1]) / (high[0] - low[0]), 2, 6))
        figure = Figure(figsize=(7, tall + 0.7), layout="constrained")
        place = figure.subplots()
        if road_map is not None:
            ground: Any = {"color": _GROUND, "zorder": 1}
            place.add_collection(PolyCollection([j.polygon[:, :2] for j in road_map.junctions], **ground))
            place.add_collection(
                LineCollection([lane.shape[:, :2] for lane in road_map.lanes], lw=2, **ground)
            )
        bodies = PolyCollection(
            list(_outline(positions, headings, sizes)), array=speeds * 3.6, cmap="RdYlGn", clim=(0, 50),
            edgecolor="#222222", lw=0.3, zorder=2,
        )  # fmt: skip
        place.add_collection(bodies)
        place.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        place.set_title(title, loc="left")
        figure.colorbar(bodies, ax=place, label="km/h")
    return Plot(figure)


def _outline(front: Numbers, headings: Numbers, sizes: Numbers) -> Numbers:
    """Give the corners of each road user, (n, 4, 2), metres; people are drawn wide enough to be seen."""
    ahead = np.column_stack([np.cos(headings), np.sin(headings)])
    aside = ahead[:, ::-1] * [-1, 1] * np.maximum(sizes[:, 1, None] / 2, _LEAST_HALF)
    front, back = front[:, :2], front[:, :2] - ahead * sizes[:, 0, None]
    return np.stack([front + aside, front - aside, back - aside, back + aside], axis=1)
