"""What an agent is paid: a function of a signal and of the decisions before and after an interval.

Both are values. A function of a user's may ask `before` for anything, and is told what was then.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from dojo_env.errors import ConfigError, refuse_other_arguments
from dojo_env.instant import Instant

Reward = Callable[[str, Instant, Instant], float]


def diff_waiting_time(signal: str, before: Instant, now: Instant) -> float:
    """How much the accumulated waiting on the signal's lanes has gone down, in 100 s.

    Args:
        signal: id of the signal that is paid.
        before: the decision at the interval's begin.
        now: the decision at its end.

    Returns:
        Hundreds of seconds; negative where waiting has grown.
    """
    return (_waiting(signal, before) - _waiting(signal, now)) / 100.0


def average_speed(signal: str, _before: Instant, now: Instant) -> float:
    """Speed over speed limit, averaged over the vehicles on the signal's lanes; 1 where there are none.

    Args:
        signal: id of the signal that is paid.
        _before: nothing heeds it.
        now: the decision at the interval's end.

    Returns:
        The mean; above 1 where vehicles exceed the limit.
    """
    return now.signals[signal].lanes.average_speed


def queue(signal: str, _before: Instant, now: Instant) -> float:
    """Halting vehicles, negative.

    Args:
        signal: id of the signal that is paid.
        _before: nothing heeds it.
        now: the decision at the interval's end.

    Returns:
        Minus the vehicles slower than 0.1 m/s on the signal's lanes.
    """
    return -now.signals[signal].lanes.total_halting


def pressure(signal: str, _before: Instant, now: Instant) -> float:
    """Vehicles on the lanes that lead away, less those on the lanes that lead here.

    Args:
        signal: id of the signal that is paid.
        _before: nothing heeds it.
        now: the decision at the interval's end.

    Returns:
        Vehicles; negative where more come than leave.

    Raises:
        StaleInstantError: SUMO has moved on, and nobody has counted the vehicles that lead away.
    """
    view = now.signals[signal]
    return float(now.count_vehicles(view.plan.out_lanes).sum() - view.lanes.total_vehicles)


def co2(signal: str, _before: Instant, now: Instant) -> float:
    """CO2 emitted on the signal's lanes, g/s, negative.

    Args:
        signal: id of the signal that is paid.
        _before: nothing heeds it.
        now: the decision at the interval's end.

    Returns:
        Minus the rate at the decision, g/s.
    """
    return -now.signals[signal].lanes.total_co2


def delay(signal: str, _before: Instant, now: Instant) -> float:
    """Sum over lanes of 1 - mean speed / speed limit, negative.

    Args:
        signal: id of the signal that is paid.
        _before: nothing heeds it.
        now: the decision at the interval's end.

    Returns:
        Minus the sum over the signal's lanes; an empty lane counts 0.
    """
    return -now.signals[signal].lanes.delay


def throughput(_signal: str, before: Instant, now: Instant) -> float:
    """Vehicles that have arrived anywhere on the map in the interval.

    Args:
        _signal: nothing heeds it: all signals are paid alike.
        before: the decision at the interval's begin.
        now: the decision at its end.

    Returns:
        Vehicles, the same for all signals.
    """
    return float(now.traffic.arrived - before.traffic.arrived)


REWARDS: dict[str, Reward] = {
    "diff-waiting-time": diff_waiting_time,
    "average-speed": average_speed,
    "queue": queue,
    "pressure": pressure,
    "co2": co2,
    "delay": delay,
    "throughput": throughput,
}
"""Rewards by name."""


def build_rewards(wanted: Any, signals: Sequence[str]) -> dict[str, Reward]:
    """Give each signal its reward: one for all, or a dict that names every signal.

    Args:
        wanted: a name, a function, a dict of names and weights; or a dict of such by signal.
        signals: ids.

    Returns:
        A function by signal.

    Raises:
        ConfigError: a name is unknown, or a dict names neither rewards nor all signals.
    """
    if isinstance(wanted, Mapping) and set(wanted) == set(signals):
        return {signal: _build_reward(wanted[signal]) for signal in signals}
    return dict.fromkeys(signals, _build_reward(wanted))


def is_own(reward: Reward) -> bool:
    """Tell whether a reward is one of these, or made of them: those ask nothing late of a past decision.

    Args:
        reward: any.

    Returns:
        Whether it is.
    """
    return isinstance(reward, _Weighted) or any(reward is own for own in REWARDS.values())


def _build_reward(wanted: Any) -> Reward:
    known = ", ".join(REWARDS)
    if isinstance(wanted, str) and wanted in REWARDS:
        return REWARDS[wanted]
    if isinstance(wanted, Mapping) and wanted and set(wanted) <= set(REWARDS):
        return _Weighted({name: _read_weight(name, weight) for name, weight in wanted.items()})
    if callable(wanted):
        refuse_other_arguments("reward_fn", wanted, ("signal", "before", "now"))
        return wanted
    raise ConfigError(
        f"reward_fn={wanted!r}: expected one of {known}, a callable, or a dict of these and weights"
    )


def _read_weight(name: str, weight: Any) -> float:
    try:
        value = float(weight)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(f"reward_fn: the weight of {name!r} is {weight!r}; expected a finite number")
    return value


class _Weighted:
    """A sum of rewards with weights; a class, so that it can be sent to a worker process."""

    def __init__(self, weights: Mapping[str, float]) -> None:
        self._weights = dict(weights)

    def __call__(self, signal: str, before: Instant, now: Instant) -> float:
        return sum(weight * REWARDS[name](signal, before, now) for name, weight in self._weights.items())


def _waiting(signal: str, instant: Instant) -> float:
    return instant.signals[signal].lanes.total_waiting
