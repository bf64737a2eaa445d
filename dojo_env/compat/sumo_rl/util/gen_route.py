"""Demand for SUMO-RL's two-way junction: heavy from east and west, then even, in turns."""

from pathlib import Path

from dojo_maps.whole_file import write_text

_SIDES = "nsew"
_LIGHT, _EVEN, _HEAVY = (100, 200), (200, 400), (300, 600)
"""Vehicles per hour: each way, and to the left."""
_LEFT = {"n": "e", "e": "s", "s": "w", "w": "n"}


def write_route_file(file: str | Path, end: int, step: int) -> None:
    """Write the demand.

    Args:
        file: that is written.
        end: seconds.
        step: seconds after which the demand changes.
    """
    ways = [(a, b) for a in _SIDES for b in _SIDES if a != b]
    lines = [f'    <route id="route_{a}{b}" edges="{a}_t t_{b}"/>' for a, b in ways]
    for number, begin in enumerate(range(0, end, step)):
        for a, b in ways:
            rates = _EVEN if number % 2 else _LIGHT if a in "ns" else _HEAVY
            rate = rates[b == _LEFT[a]]
            lines.append(
                f'    <flow id="flow_{a}{b}_{number}" route="route_{a}{b}" '
                f'begin="{begin}" end="{begin + step}" vehsPerHour="{rate}" '
                'departSpeed="max" departPos="base" departLane="best"/>'
            )
    write_text(Path(file), "\n".join(["<routes>", *lines, "</routes>", ""]))
