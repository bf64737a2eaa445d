"""Signal programs as checks read them: who is shown what in which phase, and who must not go with whom."""

import itertools
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from dojo_maps.description import Connection, Crossing, LinkKind, Points, Program, Signal
from dojo_maps.issue import Element
from dojo_maps.signals.conflicts import list_foes
from dojo_maps.signals.nema import unroll
from dojo_maps.validation.check import element
from dojo_maps.validation.facts import Facts


@dataclass(frozen=True, slots=True, kw_only=True)
class Conflict:
    """Two ways across a junction that cross or join, and a letter of each in the signal's state."""

    one: Connection | Crossing
    other: Connection | Crossing
    indices: tuple[int, int]


class SignalFacts:
    """A signal with its links by letter, the conflicts among them, and its programs as they are shown."""

    def __init__(self, facts: Facts, signal: Signal) -> None:
        """Look up what a signal controls."""
        self.signal = signal
        self.facts = facts
        self.links: dict[int, list[Connection | Crossing]] = defaultdict(list)
        self.vehicle = sorted({link.index for link in signal.links if link.kind is LinkKind.VEHICLE})
        self.walking = sorted({link.index for link in signal.links if link.kind is LinkKind.PEDESTRIAN})
        for link in signal.links:
            # A crossing's link leads onto it, or, for those who come the other way, off it.
            names = (f"{link.from_id}->{link.to_id}", link.to_id, link.from_id)
            ways = [way for name in names if (way := way_of(facts, name)) is not None]
            if ways and ways[0] not in self.links[link.index]:
                self.links[link.index].append(ways[0])
        self.programs = tuple(map(unroll, signal.programs))
        self.conflicts = tuple(self._list_conflicts())
        self._columns: dict[int, tuple[Program, list[str]]] = {}

    def _list_conflicts(self) -> Iterator[Conflict]:
        """List conflicting ways with each pair of their letters: a crossing may have two."""
        letters: dict[str, list[int]] = defaultdict(list)
        known: dict[str, Connection | Crossing] = {}
        for index, ways in sorted(self.links.items()):
            for way in ways:
                letters[way.id].append(index)
                known[way.id] = way
        for name in self.signal.junctions:
            junction = self.facts.junctions.get(name)
            for pair in list_foes(junction) if junction else ():
                for indices in itertools.product(letters.get(pair.one, ()), letters.get(pair.other, ())):
                    yield Conflict(one=known[pair.one], other=known[pair.other], indices=indices)

    def letters(self, program: Program, index: int) -> str:
        """Tell what one letter of the state shows from phase to phase.

        Args:
            program: of this signal, as in the description or in `programs`.
            index: the letter's place in the state.

        Returns:
            A letter for each phase; where a state is too short, `?`.
        """
        known = self._columns.get(id(program))
        if known is None:
            states = [phase.state for phase in program.phases]
            columns = ["".join(column) for column in itertools.zip_longest(*states, fillvalue="?")]
            # The program is kept as well, so that no other one can get its identity.
            known = self._columns[id(program)] = (program, columns)
        return known[1][index] if index < len(known[1]) else "?" * len(program.phases)

    def elements(self, *indices: int) -> tuple[Element, ...]:
        """Name the signal, then the ways and lanes that letters control.

        Args:
            indices: the letters' places in the state; none names the signal alone.

        Returns:
            The signal, and for each letter in their order its connections and crossings; then the lanes of
            all connections, each once.
        """
        ways = [way for index in dict.fromkeys(indices) for way in self.links.get(index, ())]
        return (*element("signal", self.signal.id), *name_ways(ways))

    def named(self, program: Program) -> str:
        """Name one of its programs in a sentence.

        Args:
            program: of this signal.

        Returns:
            Words that fit after "in".
        """
        return f"program {program.id} of the signal {self.signal.id}"

    def place(self, index: int) -> Points:
        """Find where those stop whom a letter controls.

        Args:
            index: the letter's place in the state.

        Returns:
            (3,), metres, map frame: the start of the first way that it controls, or `middle` where there is
            none.
        """
        for way in self.links.get(index, ()):
            return way.shape[0]
        return self.middle

    @property
    def middle(self) -> Points:
        """A place at the signal, (3,): where its first link stops, or else its junction."""
        for ways in self.links.values():
            for way in ways:
                return way.shape[0]
        for junction in self.signal.junctions:
            if junction in self.facts.junctions:
                return self.facts.junctions[junction].position  # type: ignore[return-value]
        named = self.facts.junctions.get(self.signal.id)
        return named.position if named else (*self.facts.map.origin, 0.0)  # type: ignore[return-value]


def signals_of(facts: Facts) -> tuple[SignalFacts, ...]:
    """Look up the street's signals, once per map.

    Args:
        facts: of the map; it keeps what is found.

    Returns:
        The signals in the map's order, those that control railways only left out.
    """
    found: tuple[SignalFacts, ...] | None = facts.kept.get("signals")
    if found is None:
        found = facts.kept["signals"] = tuple(SignalFacts(facts, signal) for signal in facts.signals)
    return found


def programs_of(facts: Facts) -> Iterator[tuple[SignalFacts, Program]]:
    """List every signal's programs that change, those with states of unequal length left out.

    Args:
        facts: of the map.

    Yields:
        Each program of more than one phase, as it is shown, after its signal.
    """
    for signal in signals_of(facts):
        for program in signal.programs:
            if len(program.phases) > 1 and len({len(phase.state) for phase in program.phases}) == 1:
                yield signal, program


def way_of(facts: Facts, name: str) -> Connection | Crossing | None:
    """Find a connection or one of the network's crossings by its id.

    Args:
        facts: of the map.
        name: the id.

    Returns:
        The connection or crossing; None where the network has neither.
    """
    return facts.connections.get(name) or facts.crossings.get(name)


def name_ways(ways: Iterable[Connection | Crossing]) -> tuple[Element, ...]:
    """Name ways and, for connections, their lanes.

    Args:
        ways: connections and crossings, in any order.

    Returns:
        The ways in their order, then the lanes that the connections lead from and to, each once.
    """
    ways = list(ways)
    lanes = [lane for way in ways if isinstance(way, Connection) for lane in (way.from_lane, way.to_lane)]
    named = [
        item
        for way in ways
        for item in element("crossing" if isinstance(way, Crossing) else "connection", way.id)
    ]
    return (*named, *element("lane", *dict.fromkeys(lanes)))
