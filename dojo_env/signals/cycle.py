"""A signal's cycle for SUMO's own controllers: the program's greens, with the changes of `switching` between.

So whoever runs a signal, agents, our controllers or SUMO's, every change takes the same yellow, all-red and
walkers' clearance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.signals.plan import Green, SignalPlan
from dojo_env.signals.switching import SignalSwitch, Stage
from dojo_env.timing_plans import SignalTiming, TimingPlan


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleStep:
    """What is shown for a while.

    Attributes:
        seconds: how long; of a green whose length varies, at first.
        state: the letters.
        varies: it is a green that SUMO's logics may lengthen and shorten.
    """

    seconds: float
    state: str
    varies: bool


def build_cycle(plan: SignalPlan, config: SignalConfig) -> tuple[CycleStep, ...]:
    """Put the program's greens in their order, with the changes between them.

    Each green begins when it does in the network's own program, as far as the minimum green lets it: where
    that has longer changes, its greens are longer here.

    Args:
        plan: of the signal.
        config: its times.

    Returns:
        One whole round, from the begin of the first green.
    """
    steps: list[CycleStep] = []
    changes = _list_changes(plan, [green.phase for green in plan.greens], config)
    for green, stages in zip(plan.greens, changes, strict=True):
        taken = sum(seconds for seconds, _ in stages)
        seconds = max(green.seconds + green.change - taken, config.min_green)
        steps.append(CycleStep(seconds=seconds, state=plan.phases[green.phase], varies=True))
        steps += [CycleStep(seconds=time, state=state, varies=False) for time, state in stages]
    return tuple(steps)


def plan_stages(plan: SignalPlan, timing: SignalTiming) -> SignalPlan:
    """Put a timing plan's stages in the place of the network's own greens.

    Args:
        plan: of the signal.
        timing: stages of the same signal, whose phases the plan has; see `check_timing`.

    Returns:
        The plan with these greens; it tells no starts, as the network's program no longer holds.
    """
    greens = tuple(Green(phase=phase, seconds=seconds, change=0.0) for phase, seconds in timing.stages)
    return replace(plan, greens=greens, starts=())


def check_timing(timing: TimingPlan, plans: Mapping[str, SignalPlan]) -> None:
    """See that a timing plan fits the signals.

    Args:
        timing: the timing plan.
        plans: of the signals to control, by their ids; those that the timing plan leaves out do not matter.

    Raises:
        ConfigError: it is for another signal, or names a phase that a signal has not.
    """
    for signal, own in timing.signals.items():
        if signal not in plans:
            raise ConfigError(f"timing: no signal {signal!r} to control; there are {', '.join(plans)}")
        count = len(plans[signal].phases)
        unknown = next((phase for phase, _ in own.stages if not 0 <= phase < count), None)
        if unknown is not None:
            raise ConfigError(
                f"timing: signal {signal} has no phase {unknown}; its phases are 0 to {count - 1}"
            )


def _list_changes(plan: SignalPlan, order: Sequence[int], config: SignalConfig) -> list[tuple[Stage, ...]]:
    """Go through the cycle twice, with greens as short as they may be; lists the second round's changes."""
    switch = SignalSwitch(
        plan, replace(config, max_green=None, enforce_max_green=None, action_mode="choose_phase")
    )
    changes: list[tuple[Stage, ...]] = []
    for after in [*order, *order, order[0]]:
        while not switch.may_change:
            switch.advance()
        switch.request_phase(after)
        changes.append(switch.now.stages if switch.phase == after else ())
    return changes[-len(order) :]


def find_step(steps: Sequence[CycleStep], seconds: float) -> tuple[int, float]:
    """Find where a cycle stands some seconds after its begin.

    Args:
        steps: of the whole cycle.
        seconds: since its begin; may be more than a round, or negative.

    Returns:
        The step's place among `steps`, and the seconds that it still lasts.
    """
    left = seconds % sum(step.seconds for step in steps)
    for number, step in enumerate(steps):
        if left < step.seconds:
            return number, step.seconds - left
        left -= step.seconds
    return 0, steps[0].seconds
