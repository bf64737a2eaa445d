"""Defects of signal programs."""

import itertools
import random
from xml.etree import ElementTree as ET

from mutations.net import TIMES, Net, NoPlaceError, Planted, choose, name_of


def green_foes(net: Net, chance: random.Random) -> Planted:
    places = []
    for logic in net.signals():
        ways = {name_of(c): i for i, cs in net.links(logic.get("id", "")).items() for c in cs}
        places += [(logic, pair) for pair in _foes(net, ways)]
    chosen = choose(chance, places)
    logic, (one, other) = chosen
    phase = choose(chance, logic.iter("phase"))
    indices = [int(c.get("linkIndex", "0")) for c in net.connections() if name_of(c) in (one, other)]
    for index in indices:
        _show(phase, index, "G")
    return Planted("signals.green_conflict", ("connection", one), TIMES)


def _foes(net: Net, ways: dict[str, int]) -> list[tuple[str, str]]:
    """Pairs of connections with different letters that a junction's rules call foes."""
    by_via = {}
    onward = {
        f"{c.get('from')}_{c.get('fromLane')}": c.get("via")
        for c in net.root.iter("connection")
        if c.get("from", "").startswith(":") and c.get("via")
    }
    for c in net.connections():
        via = c.get("via")
        while via in onward:
            via = onward[via]
        by_via[via] = name_of(c)
    pairs = []
    for junction in net.root.iter("junction"):
        lanes = junction.get("intLanes", "").split()
        names = [by_via.get(lane) for lane in lanes]
        for k, request in enumerate(junction.iter("request")):
            bits = request.get("foes", "")[::-1]
            for j, bit in enumerate(bits[:k]):
                if bit == "1" and names[k] in ways and names[j] in ways and ways[names[k]] != ways[names[j]]:
                    pairs.append((names[k], names[j]))
    return pairs


def never_green(net: Net, chance: random.Random) -> Planted:
    logic = choose(chance, net.signals())
    links, index = net.links(logic.get("id", "")), choose(chance, _vehicles(net, logic))
    for phase in logic.iter("phase"):
        _show(phase, index, "r")
    return Planted("signals.never_green", ("connection", name_of(links[index][0])), TIMES)


def _vehicles(net: Net, logic: ET.Element) -> list[int]:
    """Letters of a signal that control vehicles only."""
    links = net.links(logic.get("id", ""))
    return sorted(i for i, cs in links.items() if not any(c.get("to", "").startswith(":") for c in cs))


def _show(phase: ET.Element, index: int, letter: str) -> None:
    state = phase.get("state", "")
    phase.set("state", f"{state[:index]}{letter}{state[index + 1 :]}")


def cut_state(net: Net, chance: random.Random) -> Planted:
    logic = choose(chance, (x for x in net.root.iter("tlLogic") if net.links(x.get("id", "")) and len(x)))
    phase = choose(chance, logic.iter("phase"))
    phase.set("state", phase.get("state", "")[:-1])
    if not phase.get("state"):
        raise NoPlaceError
    return Planted("signals.state_length", ("signal", logic.get("id", "")), TIMES)


def _yellow_phases(net: Net, logic: ET.Element) -> list[tuple[int, ET.Element]]:
    vehicles, phases = set(_vehicles(net, logic)), list(logic.iter("phase"))
    return [
        (k, phase)
        for k, phase in enumerate(phases)
        if not phase.get("next")
        and any(
            i in vehicles and letter == "y" and phases[k - 1].get("state", "")[i] in "Gg"
            for i, letter in enumerate(phase.get("state", ""))
        )
    ]


def remove_yellow(net: Net, chance: random.Random) -> Planted:
    chosen = choose(chance, ((x, p) for x in net.signals() for _, p in _yellow_phases(net, x)))
    logic, phase = chosen
    phase.set("state", phase.get("state", "").replace("y", "r"))
    return Planted("signals.missing_yellow", ("signal", logic.get("id", "")), TIMES)


def shorten_yellow(net: Net, chance: random.Random) -> Planted:
    chosen = choose(
        chance,
        (
            (x, p)
            for x in net.signals()
            for _, p in _yellow_phases(net, x)
            if float(p.get("duration", "0")) >= 3 and not _yellow_goes_on(x, p)
        ),
    )
    logic, phase = chosen
    phase.set("duration", "1")
    phase.attrib.pop("minDur", None)
    return Planted("signals.yellow_short", ("signal", logic.get("id", "")), TIMES)


def _yellow_goes_on(logic: ET.Element, phase: ET.Element) -> bool:
    phases = list(logic.iter("phase"))
    after = phases[(phases.index(phase) + 1) % len(phases)].get("state", "")
    return any(a == b == "y" for a, b in zip(phase.get("state", ""), after, strict=True))


def add_letter(net: Net, chance: random.Random) -> Planted:
    logic = choose(chance, (x for x in net.signals() if net.links(x.get("id", ""))))
    for phase in logic.iter("phase"):
        phase.set("state", phase.get("state", "") + "r")
    return Planted("signals.unused_index", ("signal", logic.get("id", "")), TIMES)


def never_stop(net: Net, chance: random.Random) -> Planted:
    """Show a link protected green all the time though a foe gets green, too."""
    places = []
    for logic in net.signals():
        ways = {name_of(c): i for i, cs in net.links(logic.get("id", "")).items() for c in cs}
        phases = [phase.get("state", "") for phase in logic.iter("phase")]
        for pair in _foes(net, ways):
            for one, other in (pair, pair[::-1]):
                if one in ways and any(state[ways[other]] in "Gg" for state in phases):
                    places.append((logic, one, ways[one]))
    logic, name, index = choose(chance, places)
    for phase in logic.iter("phase"):
        _show(phase, index, "G")
    return Planted("signals.always_green", ("connection", name), TIMES)


def _run_alone(net: Net) -> list[ET.Element]:
    """Programs of signals that have no other."""
    every = [x.get("id") for x in net.root.iter("tlLogic")]
    return [logic for logic in net.signals() if every.count(logic.get("id")) == 1]


def stop_changing(net: Net, chance: random.Random) -> Planted:
    logic = choose(chance, _run_alone(net))
    for phase in list(logic.iter("phase"))[1:]:
        logic.remove(phase)
    return Planted("signals.tls_trivial", ("signal", logic.get("id", "")), TIMES)


def drop_yellow_phases(net: Net, chance: random.Random) -> Planted:
    """Leave a program its greens only, one straight after the other."""
    options = []
    for logic in _run_alone(net):
        phases = list(logic.iter("phase"))
        yellow = [
            p
            for p in phases
            if set(p.get("state", "")) & set("yYuo") or not set(p.get("state", "")) & set("Gg")
        ]
        greens = [p.get("state", "") for p in phases if p not in yellow]
        changes = any(_gains_and_loses(a, b) for a, b in zip(greens, greens[1:] + greens[:1], strict=True))
        if yellow and changes and not any(p.get("next") for p in phases):
            options.append((logic, yellow))
    logic, yellow = choose(chance, options)
    for phase in yellow:
        logic.remove(phase)
    return Planted("signals.rl_form", ("signal", logic.get("id", "")), TIMES)


def _gains_and_loses(before: str, after: str) -> bool:
    pairs = list(zip(before, after, strict=True))
    return any(a in "Gg" and b in "rs" for a, b in pairs) and any(b in "Gg" and a in "rs" for a, b in pairs)


def stretch_cycle(net: Net, chance: random.Random) -> Planted:
    logic = choose(chance, (x for x in net.signals() if x.get("type", "static") == "static"))
    longest = max(logic.iter("phase"), key=lambda phase: float(phase.get("duration", "0")))
    longest.set("duration", "400")
    return Planted("signals.cycle", ("signal", logic.get("id", "")), TIMES)


def starve_link(net: Net, chance: random.Random) -> Planted:
    """Leave a link a green for a moment only."""
    logic = choose(chance, net.signals())
    links, index = net.links(logic.get("id", "")), choose(chance, _vehicles(net, logic))
    phases = list(logic.iter("phase"))
    if sum(float(p.get("duration", "0")) for p in phases[1:]) < 30:
        raise NoPlaceError
    for phase in phases:
        _show(phase, index, "G" if phase is phases[0] else "r")
    phases[0].set("duration", "0.2")
    phases[0].attrib.pop("minDur", None)
    return Planted("signals.green_fraction", ("connection", name_of(links[index][0])), TIMES)


def speed_up_turn(net: Net, chance: random.Random) -> Planted:
    """Let a turn that has to yield come from a motorway."""
    options = [
        c
        for logic in net.signals()
        for index, cs in net.links(logic.get("id", "")).items()
        for c in cs
        if c.get("dir") == "l" and any(p.get("state", "")[index] == "g" for p in logic.iter("phase"))
    ]
    c = choose(chance, options)
    net.lane(c, "from").set("speed", "30.00")
    return Planted("signals.minor_green_fast", ("connection", name_of(c)), TIMES)


def move_signal(net: Net, chance: random.Random) -> Planted:
    """Put a signal where another one stands."""
    lit = [j for j in net.root.iter("junction") if j.get("type", "").startswith("traffic_light")]
    signals = {x.get("id") for x in net.signals()}
    one, other = choose(
        chance, [(a, b) for a, b in itertools.pairwise(lit) if {a.get("id"), b.get("id")} <= signals]
    )
    one.set("x", f"{float(other.get('x', '0')) + 5:.2f}")
    one.set("y", other.get("y", "0"))
    also = frozenset({"geometry.node_offset", "geometry.lane_overlap"})
    return Planted("signals.split_signals", ("signal", one.get("id", "")), also, everywhere=True)


def slow_down(net: Net, chance: random.Random) -> Planted:
    """Let those who leave last in a yellow creep, while a foe starts soon after."""
    options = []
    for logic in net.signals():
        links = net.links(logic.get("id", ""))
        ways = {name_of(c): i for i, cs in links.items() for c in cs}
        comes_fast = all(
            float(net.lane(c, "from").get("speed", "0")) > 8 for cs in links.values() for c in cs
        )
        for pair in _foes(net, ways) if comes_fast else ():
            for one, other in (pair, pair[::-1]):
                if _starts_soon(list(logic.iter("phase")), ways[one], ways[other]):
                    options.append(one)
    name = choose(chance, options)
    lane = net.lane(next(c for c in net.connections() if name_of(c) == name), "from")
    lane.set("speed", "0.50")
    return Planted("signals.all_red", ("lane", lane.get("id", "")), TIMES)


def _starts_soon(phases: list[ET.Element], leaving: int, starting: int) -> bool:
    """Tell whether a letter turns from yellow to red and another to G at once."""
    states = [phase.get("state", "") for phase in phases]
    return any(
        before[leaving] == "y" and state[leaving] == "r" and state[starting] == "G"
        for before, state in zip([states[-1], *states], states, strict=False)
    ) and not any(phase.get("next") for phase in phases)
