"""Attack the signals of real episodes, and judge by the network alone what SUMO showed in each second.

The judge shares no code with the environment: `sumolib` reads foes, right of way, speeds and crossings from
the network, and SUMO's subscriptions tell the letters of the second that it has just simulated. Roads are
empty, since no rule of the environment looks at traffic: a million actions take minutes.
"""

import argparse
import random
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import libsumo
import sumolib

import dojo_env
from dojo_env.scenario import PACKAGED, find_map
from dojo_maps.errors import DojoError

RULES = (
    "conflict", "skipped_yellow", "short_yellow", "short_green", "long_green", "short_red", "sudden_yield",
    "walker_cut_off",
)  # fmt: skip
MODES = ("choose_phase", "next_or_keep", "set_duration")
SECONDS = 1200
"""Of an episode."""


@dataclass
class Controlled:
    """What the network says of a signal's links.

    Attributes:
        foes: per link, those whose ways cross or join its own.
        yields: per link, those of its foes that all of its ways wait for.
        speeds: of links that vehicles have, the highest limit before them, m/s.
        crossings: of links that walkers have, the longest way, m.
    """

    foes: dict[int, set[int]] = field(default_factory=dict)
    yields: dict[int, set[int]] = field(default_factory=dict)
    speeds: dict[int, float] = field(default_factory=dict)
    crossings: dict[int, float] = field(default_factory=dict)


def read_signals(path: Path) -> dict[str, Controlled]:
    """Read a network's signals with SUMO's own library."""
    network = sumolib.net.readNet(str(path), withInternal=True, withPedestrianConnections=True)
    signals: dict[str, Controlled] = {}
    ways: dict[str, list[tuple[str, int, int]]] = {}
    for edge in network.getEdges(withInternal=True):
        for connection in (c for lane in edge.getLanes() for c in lane.getOutgoing()):
            signal, link = connection.getTLSID(), connection.getTLLinkIndex()
            if signal and link >= 0:
                node, place = _note(network, connection, signals.setdefault(signal, Controlled()))
                ways.setdefault(node, []).append((signal, link, place))
    for name, own in ways.items():
        node = network.getNode(name)
        for (signal, a, i), (other, b, k) in combinations(own, 2):
            if signal == other and a != b and min(i, k) >= 0 and (node.areFoes(i, k) or node.areFoes(k, i)):
                _note_foes(signals[signal], a, b, waits=node._prohibits[i][-k - 1] == "1")
                _note_foes(signals[signal], b, a, waits=node._prohibits[k][-i - 1] == "1")
    return signals


def _note(network: Any, connection: Any, known: Controlled) -> tuple[str, int]:
    """Note what a controlled connection leads over; tell its junction and its place there, or -1."""
    link, source, target = connection.getTLLinkIndex(), connection.getFromLane(), connection.getToLane()
    crossing = next((x for x in (target, source) if x.getEdge().getFunction() == "crossing"), None)
    if crossing is not None:
        length = sumolib.geomhelper.polyLength(crossing.getShape())
        known.crossings[link] = max(known.crossings.get(link, 0.0), length)
        name = crossing.getEdge().getID()[1:].rpartition("_c")[0]
        return name, network.getNode(name).getInternal().index(crossing.getID())
    inside = source.getEdge().getFunction() == "internal"
    known.speeds[link] = max(known.speeds.get(link, 0.0), 0.0 if inside else source.getSpeed())
    node = source.getEdge().getToNode()
    return node.getID(), node.getLinkIndex(connection)


def _note_foes(known: Controlled, link: int, foe: int, *, waits: bool) -> None:
    """Note that a link's way is another's foe; the link yields only where all of its ways do."""
    new = foe not in known.foes.setdefault(link, set())
    known.foes[link].add(foe)
    yields = known.yields.setdefault(link, set())
    if not waits:
        yields.discard(foe)
    elif new:
        yields.add(foe)


class Judge:
    """Judges a signal's letters, second by second."""

    def __init__(self, known: Controlled, settings: dict[str, Any]) -> None:
        """Take the rules from the environment's settings; what was before counts as long ago."""
        self._known, self._settings = known, settings
        self._letters = ""
        self._since: list[float] = []
        self._stood = (0.0, False)
        self.changes = 0

    def look(self, second: int, letters: str) -> Iterator[str]:
        """Judge the letters of a second; name every rule that they break."""
        if letters == self._letters:
            return
        yield from self._judge_conflicts(letters)
        if not self._letters:
            self._since = [second if _is_green(letter) else -1e9 for letter in letters]
            self._stood = second, False
        else:
            yield from self._judge_changes(second, letters)
            yield from self._judge_standing(second, letters)
        self._letters = letters
        self.changes += 1

    def _judge_conflicts(self, letters: str) -> Iterator[str]:
        for a, b in combinations([k for k, letter in enumerate(letters) if _is_green(letter)], 2):
            waits = (letters[a] == "g" and b in self._known.yields.get(a, ())) or (
                letters[b] == "g" and a in self._known.yields.get(b, ())
            )
            if b in self._known.foes.get(a, ()) and not waits:
                yield "conflict"

    def _judge_changes(self, second: int, letters: str) -> Iterator[str]:
        changed = [k for k, (old, new) in enumerate(zip(self._letters, letters, strict=True)) if old != new]
        for link in changed:
            old, new = self._letters[link], letters[link]
            if _is_green(old) and not _is_green(new):
                yield from self._judge_end(link, second, new)
            if old == "y" and (second - self._since[link] < self._yellow(link) or _is_green(new)):
                yield "short_yellow"
        for link in changed:
            if (
                _is_green(self._letters[link]) != _is_green(letters[link])
                or "y" in self._letters[link] + letters[link]
            ):
                self._since[link] = second
        for link in changed:
            if letters[link] == "G" or (_is_green(letters[link]) and not _is_green(self._letters[link])):
                yield from self._judge_start(link, second, letters)

    def _judge_end(self, link: int, second: int, new: str) -> Iterator[str]:
        if link in self._known.speeds and new != "y":
            yield "skipped_yellow"
        if second - self._since[link] < self._settings["min_green"]:
            yield "short_green"

    def _judge_start(self, link: int, second: int, letters: str) -> Iterator[str]:
        """Judge a link that turns green, or gets priority."""
        for foe in self._known.foes.get(link, ()):
            stopped = 0 if letters[foe] == "y" else second - self._since[foe]
            if _is_green(letters[foe]):  # A conflict, or one waits for the other.
                if (self._letters[foe], letters[foe]) == ("G", "g") and foe in self._known.speeds:
                    yield "sudden_yield"
                continue
            if foe in self._known.speeds and (letters[foe] == "y" or stopped < self._settings["all_red"]):
                yield "short_red"
            way = self._known.crossings.get(foe, 0.0)
            if stopped < way / self._settings["walking_speed"] - 1e-6:
                yield "walker_cut_off"

    def _judge_standing(self, second: int, letters: str) -> Iterator[str]:
        """Judge how long letters stood, the wait for walkers and all-red aside."""
        start, waiting = self._stood
        longest = self._settings["max_green"]
        old = self._letters
        if (
            longest
            and not waiting
            and "y" not in old
            and any(map(_is_green, old))
            and second - start > longest
        ):
            yield "long_green"
        changed = [k for k, (a, b) in enumerate(zip(old, letters, strict=True)) if a != b]
        only_walkers = all(not _is_green(letters[k]) and k not in self._known.speeds for k in changed)
        self._stood = second + (self._settings["all_red"] if "y" in old else 0), only_walkers

    def _yellow(self, link: int) -> float:
        """Tell how long yellow must last; by speed it is ITE's formula, within 3 to 6 s."""
        wanted = self._settings["yellow_time"]
        if wanted != "speed":
            return wanted
        return min(max(1.0 + self._known.speeds.get(link, 0.0) / (2 * 3.05), 3.0), 6.0)


def _is_green(letter: str) -> bool:
    return letter in "Gg"


def draw_settings(chance: random.Random) -> dict[str, Any]:
    """Draw an episode's settings."""
    return {
        "action_mode": chance.choice(MODES),
        "yellow_time": chance.choice([1, 2, 3, "speed"]),
        "all_red": chance.choice([0, 1, 3]),
        "min_green": chance.choice([1, 5, 10]),
        "max_green": chance.choice([None, 20, 45]),
        "phases": chance.choice(["program", "computed"]),
        "walking_speed": chance.choice([0.8, 1.2]),
    }


class Attacker:
    """Asks a signal for something else as often as it can, one way and then another."""

    def __init__(self, count: int, chance: random.Random) -> None:
        """Take how many actions there are."""
        self._count, self._chance = count, chance
        self._ends = 0
        self._period, self._actions = 1, [0]

    def act(self, second: int) -> int:
        """Choose an action: at random, two or all in turn, or one and the same."""
        if second >= self._ends:
            self._ends = second + self._chance.randint(20, 120)
            self._period = self._chance.choice([1, 1, 2, 3, 7, 11, 20])
            every = list(range(self._count))
            self._chance.shuffle(every)
            self._actions = self._chance.choice([[], every, every[:2], every[:1]])
        if not self._actions:
            return self._chance.randrange(self._count)
        return self._actions[second // self._period % len(self._actions)]


@dataclass
class Verdict:
    """What came out on one map."""

    signals: int = 0
    actions: int = 0
    changes: int = 0
    broken: Counter[str] = field(default_factory=Counter)


def judge_map(name: str, actions: int, seed: int) -> Verdict:
    """Attack all signals of a map, episode after episode, until so many actions are done."""
    found, verdict = find_map(name), Verdict()
    network = found.map / "network.net.xml" if found.map.is_dir() else found.map
    known = read_signals(network)
    chance = random.Random(seed)  # noqa: S311 - no secret
    bare = dojo_env.Scenario(map=found.map, additional=found.additional, name=found.name)
    while verdict.actions < actions:
        settings = draw_settings(chance)
        env = dojo_env.parallel_env(scenario=bare, delta_time=1, num_seconds=SECONDS, **settings)
        try:
            attack(env, known, verdict, actions=actions, chance=chance)
        finally:
            env.close()
    return verdict


def attack(
    env: Any, known: dict[str, Controlled], verdict: Verdict, *, actions: int, chance: random.Random
) -> None:
    """Run an episode, or what is left of it, and note its verdict."""
    env.reset(seed=chance.randrange(1 << 30))
    signals = list(env.agents)
    settings = {name: getattr(env.config.signals, name) for name in draw_settings(chance)}
    judges = {signal: Judge(known[signal], settings) for signal in signals}
    attackers = {signal: Attacker(int(env.action_space(signal).n), chance) for signal in signals}
    letters = libsumo.constants.TL_RED_YELLOW_GREEN_STATE
    for signal in signals:
        libsumo.trafficlight.subscribe(signal, [letters])
    second = 0
    while env.agents and verdict.actions < actions:
        env.step({signal: attacker.act(second) for signal, attacker in attackers.items()})
        for signal, judge in judges.items():
            shown = libsumo.trafficlight.getSubscriptionResults(signal)[letters]
            verdict.broken.update(judge.look(second, shown))
        verdict.actions += len(signals)
        second += 1
    verdict.signals = len(signals)
    verdict.changes += sum(judge.changes for judge in judges.values())


def main() -> int:
    """Judge maps and print a line for each; 1 where a rule is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--actions", type=int, default=1_000_000, metavar="N", help="in all (default: a million)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument(
        "--maps", nargs="+", default=list(PACKAGED), metavar="MAP", help="scenarios, networks, bundles"
    )
    options = parser.parse_args()
    verdicts = []
    print(f"{'map':20}{'signals':>8}{'actions':>10}{'changes':>10}  broken rules")
    for number, name in enumerate(options.maps):
        try:
            verdict = judge_map(name, -(-options.actions // len(options.maps)), options.seed + number)
        except DojoError as error:
            print(f"judge_signals: {error}", file=sys.stderr)
            return error.exit_status
        verdicts.append(verdict)
        broken = ", ".join(f"{rule} {verdict.broken[rule]}" for rule in RULES if verdict.broken[rule])
        row = f"{Path(name).name.split('.')[0]:20}{verdict.signals:8}{verdict.actions:10}{verdict.changes:10}"
        print(f"{row}  {broken or 'none'}", flush=True)
    total = sum(verdict.broken.total() for verdict in verdicts)
    print(f"{sum(verdict.actions for verdict in verdicts)} actions, {total} violations")
    return int(total > 0)


if __name__ == "__main__":
    sys.exit(main())
