"""The command `dojo-env scenarios`: what is packaged, and the signals of any scenario."""

import argparse
from pathlib import Path

from dojo_maps.command import Commands, add_command
from dojo_maps.wording import counted


def add_scenarios(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    listed = add_command(
        commands,
        "scenarios",
        _list_scenarios,
        "list the packaged scenarios, or signals",
        example="dojo-env scenarios cologne3",
    )
    listed.add_argument(
        "scenarios", nargs="*", metavar="SCENARIO", help="show the signals of these, phase by phase"
    )


def _list_scenarios(options: argparse.Namespace) -> int:
    from dojo_env.scenario import PACKAGED, packaged_scenario
    from dojo_maps.demand.patterns import find_pattern, list_patterns

    for name in options.scenarios:
        _show_signals(name)
    if options.scenarios:
        return 0
    print(f"{'name':14}{'signals':>8}{'demand':>8}{'begin':>8}  licence")
    for name in PACKAGED:
        found = packaged_scenario(name)
        elements = _list_elements(found.map)
        signals = len({attributes["id"] for kind, attributes in elements if kind == "tlLogic"})
        demand = sum(_count_departures(path, found.end or 0) for path in found.routes)
        print(f"{name:14}{signals:8d}{demand:8d}{found.begin:8.0f}  {found.licence}")
    print("\nTraffic that must be seen, drawn anew for each seed: any of these or any map, and a pattern,")
    print("as in cologne1-surges or my_junction.dojo-mixed")
    for pattern in map(find_pattern, list_patterns()):
        print(f"-{pattern.name:13}{pattern.summary}")
    return 0


def _show_signals(name: str) -> None:
    """Print each signal of a scenario with its phases, and what of it cannot be controlled."""
    from dojo_env.config import SignalConfig
    from dojo_env.managers.map import MapManager
    from dojo_env.scenario import find_map, open_map
    from dojo_env.signals.diagram import draw_phases, list_oddities
    from dojo_maps.index import MapIndex

    found = find_map(name)
    manager = MapManager(open_map(found), SignalConfig(fixed_ts=True), additional=found.additional)
    index = MapIndex(manager.bundle.road_map)
    print(f"{found.name}: {counted(len(manager.plans), 'signal')} to control")
    for signal, plan in manager.plans.items():
        links = len({link for link, _, _ in plan.links} | {link for link, _ in plan.walks})
        sizes = (len(plan.phases), "phase"), (links, "link"), (len(plan.lanes), "lane")
        print(f"\nsignal {signal}: {', '.join(counted(*size) for size in sizes)}")
        for line in draw_phases(plan, index):
            print(line)
        for words in list_oddities(plan):
            print(f"  note: {words}")
    for signal in manager.left_out:
        print(f"\nsignal {signal}: left out, for it controls no vehicles or guards a railway")


def _list_elements(path: Path) -> list[tuple[str, dict[str, str]]]:
    from dojo_env.elements import read_elements

    found: list[tuple[str, dict[str, str]]] = []
    read_elements(path, lambda kind, attributes: found.append((kind, attributes)))
    return found


def _count_departures(routes: Path, end: float) -> int:
    """Count the vehicles that a route file lets depart until the scenario's end."""
    count = 0.0
    for kind, a in _list_elements(routes):
        if kind in ("trip", "vehicle"):
            count += float(a["depart"]) < end
        elif kind == "flow":
            count += float(a["vehsPerHour"]) * (float(a["end"]) - float(a["begin"])) / 3600
    return round(count)
