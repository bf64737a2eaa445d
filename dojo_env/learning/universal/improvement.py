"""What is learned from decisions whose phases have been compared: cheaper phases become more likely.

Costs are told in those by which phases usually differ at that junction: a quiet junction teaches as much as a
busy one. Each update takes some of the decisions of the last rounds; the weights that count are a running
mean of what the updates lead to, which errs less than the last ones.

Source: Lagoudakis and Parr, Reinforcement learning as classification, ICML 2003; Polyak and Juditsky,
Acceleration of stochastic approximation by averaging, 1992.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from dojo_env.learning.universal.branches import Decision
from dojo_env.learning.universal.network import PhaseNet

Array = NDArray[np.float32]
_STEEPEST = 0.5
"""The longest step of the weights."""
_MEMORY = 0.95
"""How much of a junction's usual difference stays with each decision."""
_LEAST, _MOST = 0.3, 4.0
"""The least usual difference, vehicles; and by how many of them a phase may differ."""
_AVERAGE = 0.99
"""How much of the mean weights stays with each update."""


class Lessons:
    """The last decisions whose phases have been compared, with what each phase costs beside the others."""

    def __init__(self, most: int) -> None:
        """Remember so many decisions."""
        self._decisions: deque[Decision] = deque(maxlen=most)
        self._usual: dict[str, float] = {}

    def __len__(self) -> int:
        """Count the decisions."""
        return len(self._decisions)

    def add(self, decisions: Iterable[Decision]) -> None:
        """Remember more; those that are too many are forgotten, the oldest first.

        Args:
            decisions: of one round, in their order.
        """
        for each in decisions:
            spread = float(np.nanstd(each.costs))
            usual = self._usual.get(each.junction, spread)
            self._usual[each.junction] = _MEMORY * usual + (1 - _MEMORY) * spread
            self._decisions.append(each)

    def draw(self, count: int, generator: torch.Generator) -> dict[str, torch.Tensor]:
        """Draw decisions, each as likely.

        Args:
            count: how many; one can come twice.
            generator: draws.

        Returns:
            What `PhaseNet.forward` takes by its names, and (count, p) `costs`: in usual differences from the
            mean of the decision, infinite where a phase was not looked at.
        """
        places = torch.randint(len(self._decisions), (count,), generator=generator)
        drawn = [self._decisions[int(place)] for place in places]
        most = max(len(each.phases) for each in drawn)
        phases = np.zeros((count, most, drawn[0].phases.shape[1]), np.float32)
        mask, costs = np.zeros((count, most), bool), np.full((count, most), np.inf, np.float32)
        for row, each in enumerate(drawn):
            own, usual = slice(len(each.phases)), max(self._usual[each.junction], _LEAST)
            phases[row, own], mask[row, own] = each.phases, True
            beside = np.clip((each.costs - np.nanmean(each.costs)) / usual, -_MOST, _MOST)
            costs[row, own] = np.where(np.isnan(beside), np.inf, beside)
        return {
            "phases": torch.from_numpy(phases),
            "constraints": torch.from_numpy(np.stack([each.constraints for each in drawn])),
            "mask": torch.from_numpy(mask),
            "present": torch.tensor([each.present for each in drawn]),
            "costs": torch.from_numpy(costs),
        }

    def dump(self) -> dict[str, Any]:
        """Give all of it as plain values and tensors, for `load`."""
        return {
            "usual": dict(self._usual),
            "decisions": [
                {
                    "junction": each.junction,
                    "phases": torch.from_numpy(each.phases),
                    "constraints": torch.from_numpy(each.constraints),
                    "present": each.present,
                    "chosen": each.chosen,
                    "costs": torch.from_numpy(each.costs),
                }
                for each in self._decisions
            ],
        }

    def load(self, known: Mapping[str, Any]) -> None:
        """Take what `dump` gave.

        Args:
            known: that.
        """
        self._usual = dict(known["usual"])
        self._decisions.clear()
        for each in known["decisions"]:
            arrays = {name: each[name].numpy() for name in ("phases", "constraints", "costs")}
            self._decisions.append(Decision(**{**each, **arrays}))


def update(
    network: PhaseNet,
    average: PhaseNet,
    optimizer: torch.optim.Optimizer,
    lessons: Lessons,
    *,
    steps: int,
    size: int,
    entropy: float,
    generator: torch.Generator,
) -> None:
    """Improve the network.

    Args:
        network: is changed.
        average: the running mean of its weights; is changed, too.
        optimizer: of the network's weights.
        lessons: what there is to learn from.
        steps: of the weights.
        size: decisions of a step.
        entropy: the worth of being undecided.
        generator: of the decisions' order.
    """
    for _ in range(steps):
        batch = lessons.draw(size, generator)
        costs = batch.pop("costs")
        compared = costs.isfinite()
        logarithms = network(**batch).masked_fill(~compared, -torch.inf).log_softmax(1)
        chances = logarithms.exp()
        expected = (chances * costs.masked_fill(~compared, 0.0)).sum(1).mean()
        undecided = -(chances * logarithms.masked_fill(~compared, 0.0)).sum(1).mean()
        optimizer.zero_grad()
        (expected - entropy * undecided).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), _STEEPEST)
        optimizer.step()
        with torch.no_grad():
            for mean, weight in zip(average.parameters(), network.parameters(), strict=True):
                mean.lerp_(weight, 1 - _AVERAGE)
