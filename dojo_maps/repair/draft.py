"""A signal program on the desk: phases can be lengthened, split and put in, and the order stays right."""

from dataclasses import replace
from pathlib import Path

from dojo_maps.description import Program
from dojo_maps.repair.edits import SetPhases
from dojo_maps.repair.net_text import key_of
from dojo_maps.safe_xml import Attributes
from dojo_maps.signals.programs import following, least, read_seconds
from dojo_maps.sources.sumo_signals import read_program
from dojo_maps.sources.sumo_xml import LogicRecord

_VARIABLE = ("actuated", "delay_based")


class Draft:
    """A program as it will be; `lines` say what was done.

    Attributes:
        record: the program as it is.
        phases: the attributes of its phases, to be changed.
        lines: what was done, in a few words each.
    """

    def __init__(self, record: LogicRecord, path: Path) -> None:
        """Copy a program."""
        self.record = record
        self.phases: list[Attributes] = [dict(phase) for phase in record.phases]
        self.lines: list[str] = []
        self._path = path
        self._read: tuple[list[Attributes], Program] | None = None

    @property
    def program(self) -> Program:
        """The program as it will be."""
        if self._read is None or self._read[0] != self.phases:
            phases = [dict(phase) for phase in self.phases]
            self._read = (phases, read_program(replace(self.record, phases=phases), self._path))
        return self._read[1]

    @property
    def name(self) -> str:
        """The program's id."""
        return self.record.attributes.get("programID", "0")

    @property
    def variable(self) -> bool:
        """Whether the program itself chooses how long a phase lasts."""
        return self.record.attributes.get("type") in _VARIABLE

    @property
    def change(self) -> SetPhases | None:
        """The change to the network's text, if there is one."""
        if self.phases == self.record.phases:
            return None
        phases = tuple(tuple(phase.items()) for phase in self.phases)
        return SetPhases(key=key_of("tlLogic", self.record.attributes), phases=phases)

    def after(self, phase: int) -> int | None:
        """Find the one phase that comes after another.

        Args:
            phase: its place.

        Returns:
            The place of the next phase; None if there are several.
        """
        places = following(self.program, phase)
        return places[0] if len(places) == 1 and 0 <= places[0] < len(self.phases) else None

    def before(self, phase: int) -> int | None:
        """Find the one phase that comes before another.

        Args:
            phase: its place.

        Returns:
            The place of the phase before; None if there are several, or none.
        """
        program = self.program
        found = [k for k in range(len(self.phases)) if phase in following(program, k)]
        return found[0] if len(found) == 1 else None

    def least(self, phase: int) -> float:
        """Tell how long a phase lasts at least.

        Args:
            phase: its place.

        Returns:
            Seconds: its `minDur`, or its duration where that is shorter or the only one.
        """
        return least(self.program.phases[phase])

    def set_state(self, phase: int, letters: dict[int, str]) -> None:
        """Change some letters of a phase.

        Args:
            phase: its place.
            letters: new ones by link index; the phase's state has a letter for each already.
        """
        state = list(self.phases[phase].get("state", ""))
        for index, letter in letters.items():
            state[index] = letter
        self.phases[phase]["state"] = "".join(state)

    def lengthen(self, phase: int, seconds: float) -> None:
        """Let a phase last longer, at least and at most.

        The cycle gets longer as well; `take` gives the time back.

        Args:
            phase: its place.
            seconds: added to its duration, and to `minDur` and `maxDur` where it has them.
        """
        for key in ("duration", "minDur", "maxDur"):
            if key in self.phases[phase]:
                self.phases[phase][key] = in_seconds(read_seconds(self.phases[phase][key]) + seconds)

    def take(self, phase: int | None, seconds: float, keep: float) -> None:
        """Take time from a phase of a fixed program, so that the cycle stays.

        Nothing happens where too little would be left, or where the phase or the program is not fixed.

        Args:
            phase: its place; None takes nothing.
            seconds: what is taken.
            keep: the seconds that must be left.
        """
        if phase is None or self.variable:
            return
        chosen = self.phases[phase]
        left = read_seconds(chosen.get("duration", "0")) - seconds
        if left >= keep and "minDur" not in chosen and "maxDur" not in chosen:
            chosen["duration"] = in_seconds(left)

    def insert_after(self, phase: int, attributes: Attributes) -> None:
        """Put a phase between one and the one that comes after it.

        Where a phase names by number what follows it, the numbers move along.

        Args:
            phase: the place of the one before.
            attributes: of the new phase, as in a network, without `next`; they are copied.
        """
        after = self.phases[phase].pop("next", None)
        fresh = dict(attributes) if after is None else {**attributes, "next": after}
        self._renumber(phase + 1)
        if "next" in fresh:
            fresh["next"] = _moved(fresh["next"], phase + 1)
        self.phases.insert(phase + 1, fresh)

    def split(self, phase: int, first: float, rest: float) -> int:
        """Divide a phase into two that show the same.

        Args:
            phase: its place; it becomes the first piece.
            first: seconds that the first piece lasts, no less and no more.
            rest: seconds that the second lasts at least; it gets what is left of the phase if that is more.

        Returns:
            The place of the second piece, right after the first.
        """
        piece = dict(self.phases[phase])
        lasts = read_seconds(piece.get("duration", "0"))
        fresh = {**piece, "duration": in_seconds(max(lasts - first, rest))}
        for key in ("minDur", "maxDur"):
            if key in piece:
                left = rest if key == "minDur" else max(read_seconds(piece[key]) - first, rest)
                fresh[key] = in_seconds(left)
                self.phases[phase][key] = in_seconds(first)
        fresh.pop("next", None)
        self.phases[phase]["duration"] = in_seconds(first)
        self.insert_after(phase, fresh)
        return phase + 1

    def _renumber(self, start: int) -> None:
        for phase in self.phases:
            if "next" in phase:
                phase["next"] = _moved(phase["next"], start)


def in_seconds(value: float) -> str:
    """Write seconds as networks do: no more digits than needed.

    Args:
        value: seconds.

    Returns:
        The number, with two decimals at most.
    """
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _moved(places: str, start: int) -> str:
    return " ".join(str(int(k) + (int(k) >= start)) if k.isdecimal() else k for k in places.split())
