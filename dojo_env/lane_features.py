"""A signal's `features` as one vector, and where its parts go in a vector for all signals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dojo_env.instant import SignalView


def read_features(view: SignalView) -> NDArray[np.float32]:
    """Measure the lanes as they are, in SUMO-RL's order.

    Args:
        view: the signal at a decision.

    Returns:
        (phases + 1 + 2 lanes,) values, 0 to 1: the phase as one-hot, whether a change would be granted, each
        lane's density, each lane's queue.
    """
    phases = [0.0] * len(view.plan.phases)
    phases[view.phase] = 1.0
    return np.array([*phases, view.may_change, *view.lanes.shares], dtype=np.float32)


def place_features(phases: Sequence[int], lanes: Sequence[int]) -> list[NDArray[np.int64]]:
    """Tell where each signal's features go in a vector for all, so that a place always means the same.

    Args:
        phases: how many each signal has.
        lanes: how many each signal has.

    Returns:
        For each signal the places of its phases, its flag, its densities and its queues; each block is as
        wide as the widest.
    """
    flag, most = max(phases, default=0), max(lanes, default=0)
    return [
        np.concatenate([np.arange(count), [flag], *(flag + 1 + at + np.arange(each) for at in (0, most))])
        for count, each in zip(phases, lanes, strict=True)
    ]
