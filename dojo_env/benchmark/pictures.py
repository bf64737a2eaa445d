"""Pictures of a results folder: the hour's curves, the trainings, the six figures beside published ones.

The same files give the same bytes: pictures carry no date and no version.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

from dojo_env.benchmark.kept_rows import KeptRow, read_kept
from dojo_env.benchmark.tables import BLIND
from dojo_env.charts import COLOURS, average, styled
from dojo_env.learning.result_files import Numbers, Published
from dojo_env.metrics import SIX
from dojo_env.series import TITLES
from dojo_maps.whole_file import replaced
from dojo_maps.wording import counted

REFERENCE = "MaxPressure"
ALL_TRIPS = "travel_time_all"
"""What tells good policies: unlike travel time it counts vehicles that have not arrived."""
WINDOW = 4
"""Minutes that a curve is averaged over, about as in the paper's figures 4 and 5."""
CUT = 2.5
"""Axes end at so many times what is usual, lest a row that jams hide what sets the others apart."""
PAPER_CHOICES = {
    "two-way": ("DQN-BEV*", "PPO-BEV*", "A2C-BEV*"),
    "cologne1": ("DQN-F", "DQN-MV", "DQN-BEV", "DQN-BEV*"),
}
"""The rows that these figures show."""
_COLOURS = 64
"""Of a picture."""
TICKS = (30, 40, 50, 60, 80, 100, 150, 200, 300, 500, 1000, 2000)


def draw_all(results: Path, published: Mapping[str, Published]) -> list[Path]:
    """Draw every picture of every scenario that has rows, under `pictures`.

    Args:
        results: holds a folder per scenario, and in it one per row.
        published: figures by scenario, to show beside ours.

    Returns:
        Their paths.
    """
    folder, drawn = results / "pictures", []
    folder.mkdir(exist_ok=True)
    with styled():
        for scenario, kept in read_kept(results).items():
            figures = {
                "hour": draw_hour(scenario, [kept[name] for name in choose_rows(kept)]),
                "paper": draw_hour(scenario, _paper_choice(scenario, kept)),
                "training": draw_training(scenario, kept),
                "figures": draw_bars(scenario, kept, published.get(scenario, {})),
            }
            for kind, figure in figures.items():
                path = folder / f"{scenario}-{kind}.png"
                if figure is None:
                    path.unlink(missing_ok=True)
                    continue
                _write(figure, path)
                drawn.append(path)
    return drawn


def _write(figure: Figure, path: Path) -> None:
    """Write a figure with a palette, in a third of the bytes."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    with replaced(path) as fresh:
        picture.quantize(_COLOURS, dither=Image.Dither.NONE).save(fresh, "png", optimize=True)


def choose_rows(kept: Mapping[str, KeptRow]) -> list[str]:
    """Choose MaxPressure, who sees nothing, the best controller, and the four best rows that learned.

    The best have the least mean trip, of all vehicles.

    Args:
        kept: a scenario's rows by name.

    Returns:
        Their names in this order, without those that are not there.
    """
    best = sorted(kept, key=lambda name: kept[name].figures[ALL_TRIPS]["mean"])
    others = [name for name in best if not kept[name].learned and name not in (REFERENCE, BLIND)][:1]
    shown = [name for name in (REFERENCE, BLIND, *others) if name in kept]
    return shown + [name for name in best if kept[name].learned][:4]


def _paper_choice(scenario: str, kept: Mapping[str, KeptRow]) -> list[KeptRow]:
    named = [kept[name] for name in PAPER_CHOICES.get(scenario, ()) if name in kept]
    return [*([kept[REFERENCE]] if REFERENCE in kept else []), *named] if named else []


def draw_hour(scenario: str, rows: Sequence[KeptRow]) -> Figure | None:
    """Draw what was measured over the first seed's hour.

    Args:
        scenario: its name, for the title.
        rows: that are drawn together.

    Returns:
        The figure; None where there is no row.
    """
    if not rows:
        return None
    figure = Figure(figsize=(9.5, 6.2), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    looks = _looks(rows)
    for place, name in zip(axes.flat, ("co2", "delay", "accumulated_waiting", "queue"), strict=True):
        for row in rows:
            minutes, series = row.read_series()
            place.plot(minutes, average(series[name], WINDOW), label=row.name, **looks[row.name])
        place.set_title(TITLES[name], loc="left")
        highest = [line.get_ydata().max() for line in place.get_lines()]
        place.set_ylim(0, 1.05 * min(max(highest), CUT * min(highest)) or None)
        place.set_xlim(0, minutes[-1])
        place.xaxis.set_major_locator(ticker.MultipleLocator(minutes[-1] / 4))
    for place in axes[1]:
        place.set_xlabel("minutes since the episode's begin")
    figure.suptitle(f"{scenario}: one episode, each curve the mean of the last {WINDOW} minutes")
    _legend(figure, axes.flat[0])
    return figure


def draw_training(scenario: str, kept: Mapping[str, KeptRow]) -> Figure | None:
    """Draw the mean trip on validation seeds over the steps, a panel for each kind of sight.

    All trips count, those too that have not ended: travel time alone praises who jams the junction.

    Args:
        scenario: its name, for the title.
        kept: rows by name; those that learned are drawn.

    Returns:
        The figure; None where no row has a curve.
    """
    panels: dict[str, list[tuple[KeptRow, dict[str, Numbers]]]] = {}
    for row in kept.values():
        if row.learned and (curve := row.read_curve()):
            seen = row.name.partition("-")[2] or row.result["training"]["observation"]
            panels.setdefault(seen, []).append((row, curve))
    if not panels:
        return None
    columns = min(len(panels), 4)
    lines = -(-len(panels) // columns)
    figure = Figure(figsize=(max(2.9 * columns, 5.5), 2.6 * lines + 0.9), layout="constrained")
    axes = figure.subplots(lines, columns, sharey=True, squeeze=False)
    reference = kept[REFERENCE].figures[ALL_TRIPS]["mean"] if REFERENCE in kept else None
    for place, (seen, curves) in zip(axes.flat, panels.items(), strict=False):
        for row, curve in curves:
            _draw_curve(place, row, curve)
        if reference is not None:
            place.axhline(reference, color="#333333", linestyle="--", linewidth=1.2, label=REFERENCE)
        place.set_title(f"observes {seen}", loc="left")
        place.set_xlabel("thousand steps")
        place.set_xlim(left=0)
    for place in list(axes.flat)[len(panels) :]:
        place.set_axis_off()
    for place in axes[:, 0]:
        place.set_ylabel("mean trip, of all vehicles (s)")
    _scale(list(axes.flat))
    figure.suptitle(f"{scenario}: training; the dot is the policy that was kept")
    _legend(figure, *axes.flat)
    return figure


def _scale(axes: Sequence[Axes]) -> None:
    """Give panels that share an axis its limits; logarithmic where much changes."""
    values = [value for place in axes for line in place.get_lines() for value in line.get_ydata()]
    axes[0].set_ylim(0.96 * min(values), 1.04 * max(values))
    if max(values) > 2 * min(values):
        axes[0].set_yscale("log")
        axes[0].yaxis.set_major_locator(ticker.FixedLocator(TICKS))
        axes[0].yaxis.set_major_formatter(ticker.ScalarFormatter())
        axes[0].yaxis.set_minor_locator(ticker.NullLocator())


def _draw_curve(place: Axes, row: KeptRow, curve: Mapping[str, Numbers]) -> None:
    algorithms = ("DQN", "PPO", "A2C")
    algorithm = row.name.partition("-")[0]
    colour = COLOURS[algorithms.index(algorithm)] if algorithm in algorithms else COLOURS[-1]
    steps, times = curve["steps"] / 1000, curve[ALL_TRIPS]
    place.plot(steps, times, color=colour, label=algorithm)
    best = int(np.argmin(times))
    place.plot(steps[best], times[best], "o", color=colour, markersize=5)


def draw_bars(scenario: str, kept: Mapping[str, KeptRow], published: Published) -> Figure | None:
    """Draw the six figures of every row, published ones below where there are any.

    Args:
        scenario: its name, for the title.
        kept: rows by name.
        published: figures by row and name.

    Returns:
        The figure.
    """
    names = list(kept)
    size = 0.26 * len(names) + 0.9
    figure = Figure(figsize=(11, 2 * size), layout="constrained")
    axes = figure.subplots(2, 3, sharey=True)
    spots = np.arange(len(names))[::-1]
    for place, figure_name in zip(axes.flat, SIX, strict=True):
        ours = [kept[name].figures[figure_name] for name in names]
        theirs = [(s, published[n][figure_name]) for s, n in zip(spots, names, strict=True) if n in published]
        colours = [COLOURS[0] if kept[name].learned else COLOURS[5] for name in names]
        _draw_bars(place, spots + (0.2 if theirs else 0), ours, colours)
        _draw_bars(place, [spot - 0.2 for spot, _ in theirs], [cell for _, cell in theirs], "#bdbdbd")
        _cut(
            place,
            [*zip(spots + (0.2 if theirs else 0), ours, strict=True), *((s - 0.2, c) for s, c in theirs)],
        )
        place.set_title(TITLES[figure_name], loc="left")
        place.grid(visible=False, axis="y")
    axes[0, 0].set_yticks(spots, names)
    axes[0, 0].set_ylim(-0.6, len(names) - 0.4)
    episodes = counted(kept[names[0]].result["seeds"], "episode")
    figure.suptitle(f"{scenario}: means of {episodes}, bars with their spread")
    handles = [
        (COLOURS[5], "ours, not trained here"),
        *([(COLOURS[0], "ours, trained here")] if any(row.learned for row in kept.values()) else []),
        *([("#bdbdbd", "published")] if published else []),
    ]
    figure.legend(
        handles=[Rectangle((0, 0), 1, 1, color=c, label=t) for c, t in handles],
        loc="outside lower center", ncols=3,
    )  # fmt: skip
    return figure


def _draw_bars(place: Axes, at: Any, cells: Sequence[Mapping[str, float]], colours: Any) -> None:
    if cells:
        means, spreads = ([cell[part] for cell in cells] for part in ("mean", "std"))
        place.barh(
            at,
            means,
            height=0.38,
            color=colours,
            xerr=spreads,
            error_kw={"elinewidth": 0.9, "ecolor": "#444444"},
        )


def _cut(place: Axes, bars: Sequence[tuple[float, Mapping[str, float]]]) -> None:
    """End the axis before rows that fail would hide what sets the others apart, and write their values."""
    limit = CUT * float(np.median([cell["mean"] for _, cell in bars]))
    largest = max(cell["mean"] + cell["std"] for _, cell in bars)
    place.set_xlim(0, min(limit, 1.05 * largest))
    for at, cell in bars:
        if cell["mean"] > limit:
            place.text(
                limit, at, f"{cell['mean']:,.0f} \u2192", ha="right", va="center", fontsize=7,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
            )  # fmt: skip


def _looks(rows: Iterable[KeptRow]) -> dict[str, dict[str, Any]]:
    """Give each row its line: what learned in colour, what it is measured against in grey."""
    colours, greys = iter(COLOURS), iter((("#777777", ":"), ("#777777", "-."), ("#aaaaaa", "-")))
    looks = {}
    for row in rows:
        if row.name == REFERENCE:
            colour, line = "#222222", "--"
        else:
            colour, line = (next(colours), "-") if row.learned else next(greys, ("#aaaaaa", "-"))
        looks[row.name] = {"color": colour, "linestyle": line}
    return looks


def _legend(figure: Figure, *axes: Axes) -> None:
    found = {
        text: handle
        for place in axes
        for handle, text in zip(*place.get_legend_handles_labels(), strict=True)
    }
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=6)
