"""The benchmark's tables: Markdown for people, CSV for programs, from the files of the rows."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from dojo_env.benchmark.kept_rows import KeptRow, read_kept
from dojo_env.benchmark.rows import read_packaged_rows
from dojo_env.metrics import SIX
from dojo_env.runs import JAMMED
from dojo_maps.whole_file import write_table, write_text

Figures = Mapping[str, Mapping[str, float]]
"""Mean and standard deviation of each figure."""
_SERVING = 0.9
"""Of the best throughput: below, travel time is of the few who got through, and no row is marked."""
BLIND = "Blind"
"""The row of the best plan that sees nothing, from which the way to the best row is measured."""
_HEADS = ("travel time (s)", "throughput (veh/h)", "delay", "acc. waiting (s)", "queue (veh)", "CO2 (g/s)")


def write_tables(folder: Path, published: Mapping[str, Mapping[str, Figures]]) -> str:
    """Write `table.md` and `table.csv` of all rows in a folder.

    Args:
        folder: holds a folder per scenario, and in it one per row.
        published: figures by scenario and row to show beside ours.

    Returns:
        The text of `table.md`.
    """
    parts, lines, order = [], [], tuple(read_packaged_rows())
    for scenario, rows in read_kept(folder).items():
        kept = {name: row.figures for name, row in rows.items()}
        theirs = published.get(scenario, {})
        names = [
            *(n for n in order if n in kept or n in theirs),
            *sorted((kept.keys() | theirs) - set(order)),
        ]
        parts.append(_section(scenario, names, rows, theirs))
        lines += [line for name in names for line in _lines(scenario, name, kept, theirs)]
    text = "\n".join(parts)
    write_text(folder / "table.md", text)
    head = ["scenario", "row", "figure", "mean", "std", "published", "published_std", "difference"]
    write_table(folder / "table.csv", head, lines)
    return text


def _section(
    scenario: str, names: Sequence[str], rows: Mapping[str, KeptRow], theirs: Mapping[str, Figures]
) -> str:
    """Write a scenario's rows, our best figures bold and the second best underlined, published ones below."""
    kept = {name: row.figures for name, row in rows.items()}
    marks = {figure: _rank(figure, kept) for figure in SIX}
    heads = (*_HEADS, "median of all trips (s)", "jams", "of the way", "trainings")
    lines = [f"### {scenario}", "", f"| row | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for name in names:
        if name in kept:
            row = rows[name]
            cells = [_mark(_cell(row.figures[f]), marks[f].get(name)) for f in SIX]
            cells += [*_tell_hours(row), _tell_way(row.figures, kept, theirs), _tell_trainings(row)]
            lines.append(f"| {name} | {' | '.join(cells)} |")
        else:
            lines.append(f"| {name} |{' not run |' * len(heads)}")
        if name in theirs:
            way = _tell_way(theirs[name], kept, theirs)
            cells = [*(_cell(theirs[name][f]) for f in SIX), "", "", way, ""]
            lines.append(f"| *published* | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def _tell_hours(row: KeptRow) -> tuple[str, str]:
    """Tell the median over hours of the mean trip with all that have not ended, and how many hours jammed."""
    hours = row.result["episodes"]
    trips = [hour["travel_time_all"] for hour in hours if "travel_time_all" in hour]
    late = [hour["late"] > JAMMED for hour in hours if "late" in hour]
    return f"{median(trips):.2f}" if trips else "", f"{sum(late)} of {len(late)}" if late else ""


def _tell_way(figures: Figures, kept: Mapping[str, Figures], theirs: Mapping[str, Figures]) -> str:
    """Tell how far from the best blind plan to the best known row a row comes, in travel time."""
    most = _find_most_served(kept)
    if figures["throughput"]["mean"] < _SERVING * most:
        return "jams"
    if BLIND not in kept:
        return ""
    known = [*kept.values(), *theirs.values()]
    best = min(row["travel_time"]["mean"] for row in known if row["throughput"]["mean"] >= _SERVING * most)
    blind = kept[BLIND]["travel_time"]["mean"]
    return f"{(blind - figures['travel_time']['mean']) / (blind - best):.0%}" if best < blind else "0%"


def _tell_trainings(row: KeptRow) -> str:
    """Tell how many policies a row's figures are of, and how far their mean travel times lie apart."""
    if not row.learned:
        return ""
    spread = row.result.get("between_trainings", {}).get("travel_time")
    return str(row.result.get("trainings", 1)) + ("" if spread is None else f", ± {spread:.2f} s")


def _rank(figure: str, kept: Mapping[str, Figures]) -> dict[str, int]:
    most = _find_most_served(kept)
    serving = [name for name in kept if kept[name]["throughput"]["mean"] >= _SERVING * most]
    best_first = sorted(serving, key=lambda name: kept[name][figure]["mean"], reverse=figure == "throughput")
    return {name: place for place, name in enumerate(best_first[:2])}


def _find_most_served(kept: Mapping[str, Figures]) -> float:
    return max((row["throughput"]["mean"] for row in kept.values()), default=0.0)


def _mark(text: str, place: int | None) -> str:
    return text if place is None else f"**{text}**" if place == 0 else f"<u>{text}</u>"


def _cell(figure: Mapping[str, float]) -> str:
    digits = 0 if figure["mean"] >= 1000 else 2
    return f"{figure['mean']:.{digits}f} ± {figure['std']:.{digits}f}"


def _lines(
    scenario: str, name: str, kept: Mapping[str, Figures], theirs: Mapping[str, Figures]
) -> list[list[Any]]:
    lines: list[list[Any]] = []
    for figure in SIX:
        ours, other = kept.get(name, {}).get(figure), theirs.get(name, {}).get(figure)
        ratio = ours["mean"] / other["mean"] - 1 if ours and other else ""
        values = [v for each in (ours, other) for v in ((each["mean"], each["std"]) if each else ("", ""))]
        lines.append([scenario, name, figure, *values, ratio])
    return lines
