"""Signal programs that a scenario's additional files bring: SUMO runs the last one it reads, so plans do."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from dojo_env.elements import read_elements
from dojo_env.errors import ConfigError
from dojo_maps.description import Phase, Program, Signal


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
    found: list[tuple[str, Program]] = []

    def visit(name: str, attributes: dict[str, str]) -> None:
        try:
            if name == "tlLogic":
                found.append((attributes["id"], _program(attributes)))
            elif name == "phase" and found:
                signal, program = found[-1]
                found[-1] = (signal, replace(program, phases=(*program.phases, _phase(attributes))))
        except (KeyError, ValueError) as error:
            raise ConfigError(
                f"{path}: a broken {name} ({error}); see SUMO's page on traffic lights"
            ) from error

    read_elements(path, visit)
    return [(signal, program) for signal, program in found if program.phases]


def _program(attributes: dict[str, str]) -> Program:
    return Program(
        id=attributes.get("programID", "0"),
        kind=attributes.get("type", "static"),
        offset=0.0,
        phases=(),
    )


def _phase(attributes: dict[str, str]) -> Phase:
    return Phase(
        duration=float(attributes["duration"]),
        min_duration=None,
        max_duration=None,
        state=attributes["state"],
    )


def _fitting(program: Program, signal: Signal) -> Program:
    needed = 1 + max(link.index for link in signal.links)
    for phase in program.phases:
        if len(phase.state) < needed:
            raise ConfigError(
                f"program {program.id} of signal {signal.id}: state {phase.state!r} has {len(phase.state)} "
                f"letters for {needed} links; make the additional file anew for this network"
            )
    return program
