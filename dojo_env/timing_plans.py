"""Signal timing plans: which phases follow each other at each signal, and for how long, whatever the traffic.

`dojo-env plan` searches one, `--controller plan.json` runs it. SUMO's own logics take the same: there the
greens' lengths vary, within limits.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError, PlanError
from dojo_maps.safe_json import read_json
from dojo_maps.whole_file import write_json

PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "fixed": (),
    "actuated": ("max-gap", "detector-gap", "passing-time", "inactive-threshold", "jam-threshold"),
    "delay_based": ("detectorRange", "minTimeLoss"),
}
"""Of each logic, by SUMO's names; the others of SUMO's write files or show things."""
LOGICS = tuple(PARAMETERS)
FORMAT, VERSION = "dojo-plan", 1
_MOST_STAGES, _LONGEST = 64, 3600


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalTiming:
    """The cycle of one signal.

    Attributes:
        stages: each phase by its number, and the whole seconds from its request to that of the next one:
            its green and the change before it. No green is shorter than the signal's least.
        offset: how many seconds of the cycle are over when an episode begins.
    """

    stages: tuple[tuple[int, int], ...]
    offset: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingPlan:
    """The cycles of a scenario's signals.

    Attributes:
        signals: by id; who is not named has the network's own cycle.
        logic: `fixed`, or SUMO's `actuated` or `delay_based`, which let the greens' lengths vary.
        max_green: seconds, of such a green.
        parameters: of SUMO's logic, by its names.
    """

    signals: Mapping[str, SignalTiming]
    logic: str = "fixed"
    max_green: int = 60
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse an unknown logic, and parameters that are no times or distances of it.

        Raises:
            ConfigError: there is none of that name.
        """
        if self.logic not in LOGICS:
            raise ConfigError(f"logic={self.logic!r}: expected one of {', '.join(LOGICS)}")
        known = PARAMETERS[self.logic]
        if unknown := sorted(self.parameters.keys() - set(known)):
            expected = f"expected some of {', '.join(known)}" if known else "it has none"
            raise ConfigError(f"parameters of {self.logic}: {', '.join(unknown)[:80]}: {expected}")


def describe_plan(plan: TimingPlan) -> dict[str, Any]:
    """Describe a plan as JSON values.

    Args:
        plan: to describe.

    Returns:
        The values of its file.
    """
    described: dict[str, Any] = {"format": FORMAT, "version": VERSION, "logic": plan.logic}
    if plan.logic != "fixed":
        described |= {"max_green": plan.max_green, "parameters": dict(plan.parameters)}
    signals = {
        signal: {"offset": timing.offset, "stages": [list(stage) for stage in timing.stages]}
        for signal, timing in plan.signals.items()
    }
    return {**described, "signals": signals}


def write_plan(plan: TimingPlan, path: Path, **about: Any) -> None:
    """Write a plan as JSON; `about` is for people to read.

    Args:
        plan: to write.
        path: of the file.
        about: what else the file says.
    """
    write_json(path, {**describe_plan(plan), **about})


def read_plan(path: Path) -> TimingPlan:
    """Read a plan's file.

    Args:
        path: of the file.

    Returns:
        The plan.

    Raises:
        PlanError: it cannot be read, or holds no plan.
    """
    value = read_json(path, error=PlanError)
    if not isinstance(value, dict) or (value.get("format"), value.get("version")) != (FORMAT, VERSION):
        raise PlanError(path, f"not a timing plan: expected format {FORMAT!r}, version {VERSION}")
    signals = value.get("signals")
    if not isinstance(signals, dict):
        raise PlanError(path, "signals: expected an object, a signal each")
    parameters = value.get("parameters", {})
    if not isinstance(parameters, dict) or not all(map(_is_number, parameters.values())):
        raise PlanError(path, "parameters: expected numbers by name")
    longest = value.get("max_green", 60)
    if not _is_count(longest, 1, _LONGEST):
        raise PlanError(path, f"max_green = {longest!r}: expected whole seconds from 1 to {_LONGEST}")
    try:
        return TimingPlan(
            signals={signal: _read_timing(path, signal, timing) for signal, timing in signals.items()},
            logic=value.get("logic", "fixed"),
            max_green=longest,
            parameters=parameters,
        )
    except ConfigError as error:
        raise PlanError(path, str(error)) from error


def _read_timing(path: Path, signal: str, value: Any) -> SignalTiming:
    stages = value.get("stages") if isinstance(value, dict) else None
    if not isinstance(stages, list) or not 1 <= len(stages) <= _MOST_STAGES:
        raise PlanError(path, f"1 to {_MOST_STAGES} stages expected", f"signal {signal}")
    for stage in stages:
        fits = isinstance(stage, list) and len(stage) == 2
        if not fits or not _is_count(stage[0], 0, 1000) or not _is_count(stage[1], 1, _LONGEST):
            raise PlanError(
                path, f"stage {stage!r}: expected [phase, seconds], whole numbers", f"signal {signal}"
            )
    offset = value.get("offset", 0)
    if not _is_count(offset, 0, _LONGEST * _MOST_STAGES):
        raise PlanError(path, f"offset = {offset!r}: expected whole seconds from 0", f"signal {signal}")
    return SignalTiming(stages=tuple((phase, seconds) for phase, seconds in stages), offset=offset)


def _is_count(value: Any, least: int, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
