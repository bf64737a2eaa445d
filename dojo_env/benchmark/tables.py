"""The benchmark's tables: Markdown for people, CSV for programs, from the files of the rows."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dojo_env.benchmark.kept_rows import read_kept
from dojo_env.benchmark.rows import read_packaged_rows
from dojo_env.metrics import SIX
from dojo_maps.whole_file import write_table, write_text

Figures = Mapping[str, Mapping[str, float]]
"""Mean and standard deviation of each figure."""
_SERVING = 0.9
"""Of the best throughput: below, travel time is of the few who got through, and no row is marked."""
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
        parts.append(_section(scenario, names, kept, theirs))
        lines += [line for name in names for line in _lines(scenario, name, kept, theirs)]
    text = "\n".join(parts)
    write_text(folder / "table.md", text)
    head = ["scenario", "row", "figure", "mean", "std", "published", "published_std", "difference"]
    write_table(folder / "table.csv", head, lines)
    return text


def _section(
    scenario: str, names: Sequence[str], kept: Mapping[str, Figures], theirs: Mapping[str, Figures]
) -> str:
    """Write a scenario's rows, our best figures bold and the second best underlined, published ones below."""
    marks = {figure: _rank(figure, kept) for figure in SIX}
    lines = [f"### {scenario}", "", f"| row | {' | '.join(_HEADS)} |", "|---" * (len(SIX) + 1) + "|"]
    for name in names:
        cells = [_mark(_cell(kept[name][f]), marks[f].get(name)) if name in kept else "not run" for f in SIX]
        lines.append(f"| {name} | {' | '.join(cells)} |")
        if name in theirs:
            lines.append(f"| *published* | {' | '.join(_cell(theirs[name][f]) for f in SIX)} |")
    return "\n".join([*lines, ""])


def _rank(figure: str, kept: Mapping[str, Figures]) -> dict[str, int]:
    most = max((row["throughput"]["mean"] for row in kept.values()), default=0)
    serving = [name for name in kept if kept[name]["throughput"]["mean"] >= _SERVING * most]
    best_first = sorted(serving, key=lambda name: kept[name][figure]["mean"], reverse=figure == "throughput")
    return {name: place for place, name in enumerate(best_first[:2])}


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
