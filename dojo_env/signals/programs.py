"""Signal programs that a scenario's additional files bring: SUMO runs the last one it reads, so plans do."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from dojo_env.elements import read_elements
from dojo_env.errors import ConfigError
from dojo_maps.description import Program, Signal
from dojo_maps.safe_xml import Attributes
from dojo_maps.signals.programs import read_program


def add_programs(signals: Iterable[Signal], files: Iterable[Path]) -> list[Signal]:
    """Give signals the programs that additional files hold for them, after their own.

    Args:
        signals: of the map.
        files: in the order in which SUMO reads them.

    Returns:
        The signals, in their order; programs of signals that are not among them are left out.

    Raises:
        ConfigError: a file cannot be read, or a program does not fit its signal.
    """
    found = [program for path in files for program in _read_programs(path)]
    return [
        replace(
            signal,
            programs=(*signal.programs, *(_fitting(p, signal) for id_, p in found if id_ == signal.id)),
        )
        for signal in signals
    ]


def refuse_switching(signals: Iterable[str], files: Iterable[Path]) -> None:
    """Refuse signals whose programs SUMO itself switches by the clock: it would overrule who controls them.

    Args:
        signals: ids of those that something else than the clock is to control.
        files: additional files.

    Raises:
        ConfigError: a WAUT of the files names one of the signals, or a file cannot be read.
    """
    wanted = set(signals)
    for path in files:
        named: list[str] = []

        def visit(name: str, attributes: Attributes, named: list[str] = named) -> None:
            if name == "wautJunction":
                named.append(attributes.get("junctionID", ""))

        read_elements(path, visit)
        switched = next((signal for signal in named if signal in wanted), None)
        if switched is not None:
            raise ConfigError(
                f"{path}: a WAUT switches the programs of signal {switched}, which nothing else can control "
                "then; remove its wautJunction, leave the signal out with ts_ids, or choose fixed-time"
            )


def _read_programs(path: Path) -> list[tuple[str, Program]]:
    """List (signal id, program) in the file's order."""
    logics: list[tuple[Attributes, list[Attributes], Attributes]] = []
    owner = ""

    def visit(name: str, attributes: Attributes) -> None:
        nonlocal owner
        if name == "tlLogic":
            logics.append((attributes, [], {}))
        elif name == "phase" and logics:
            logics[-1][1].append(attributes)
        elif name == "param" and owner in ("tlLogic", "phase") and logics:
            logics[-1][2][attributes.get("key", "")] = attributes.get("value", "")
        owner = owner if name == "param" else name

    read_elements(path, visit)
    found = []
    for attributes, phases, parameters in logics:
        try:
            found.append((attributes["id"], read_program(attributes, phases, parameters)))
        except (KeyError, ValueError) as error:
            raise ConfigError(
                f"{path}: a broken tlLogic ({error}); see SUMO's page on traffic lights"
            ) from error
    return [(signal, program) for signal, program in found if program.phases]


def _fitting(program: Program, signal: Signal) -> Program:
    needed = 1 + max(link.index for link in signal.links)
    for phase in program.phases:
        if len(phase.state) < needed:
            raise ConfigError(
                f"program {program.id} of signal {signal.id}: state {phase.state!r} has {len(phase.state)} "
                f"letters for {needed} links; make the additional file anew for this network"
            )
    return program
