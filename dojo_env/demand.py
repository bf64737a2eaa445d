"""The demand of the scenario two-way: two directions that take turns being busy, four times an hour."""

from pathlib import Path

from dojo_maps.whole_file import write_text

_PERIOD = 900
"""Seconds from one change of the demand to the next."""
_BUSY = {"s": 350, "left": 350, "right": 300}
_CALM = {"s": 100, "left": 100, "right": 50}
"""Vehicles per hour of each movement of an approach. Source: the package sumo-rl's `vhvh` demand."""
_MOVEMENTS = (
    ("ns", "s"), ("nw", "left"), ("ne", "right"), ("sw", "right"), ("sn", "s"), ("se", "left"),
    ("en", "left"), ("ew", "s"), ("es", "right"), ("wn", "right"), ("we", "s"), ("ws", "left"),
)  # fmt: skip


def build_two_way_demand() -> str:
    """Write SUMO routes and flows: first north and south are busy, then west and east, and again.

    Returns:
        The route file's text.
    """
    lines = ["<routes>"]
    lines += [f'    <route id="route_{m}" edges="{m[0]}_t t_{m[1]}"/>' for m, _ in _MOVEMENTS]
    for period in range(4):
        busy_letters = "ns" if period % 2 == 0 else "ew"
        for movement, turn in _MOVEMENTS:
            rate = (_BUSY if movement[0] in busy_letters else _CALM)[turn]
            lines.append(
                f'    <flow id="flow_{movement}{period + 1 if period else ""}" route="route_{movement}" '
                f'begin="{period * _PERIOD}" end="{(period + 1) * _PERIOD}" vehsPerHour="{rate}" '
                'departSpeed="max" departPos="base" departLane="best"/>'
            )
    return "\n".join([*lines, "</routes>", ""])


def write_two_way_demand(folder: Path) -> Path:
    """Write the demand into a folder, whole, unless it lies there already.

    Args:
        folder: where it goes.

    Returns:
        The route file.
    """
    path, text = folder / "two-way.rou.xml", build_two_way_demand()
    if not path.is_file() or path.read_bytes() != text.encode():
        write_text(path, text)
    return path
