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
