"""One update of the universal policy from the episodes of a round.

Decisions take different times, so discounts do, too. Costs are told in those that each junction usually has,
and advantages by how they stand out at their signal in their episode: a quiet junction teaches as much as a
busy one.

Source: Schulman et al., Proximal policy optimization algorithms, arXiv:1707.06347; Schulman et al.,
High-dimensional continuous control using generalized advantage estimation, arXiv:1506.02438; Sutton, Precup,
Singh, Between MDPs and semi-MDPs, 1999.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from dojo_env.learning.universal.network import PhaseNet
from dojo_env.learning.universal.rollouts import DISCOUNT, Trajectory

Array = NDArray[np.float32]
_TRACE, _STEEPEST = 0.9, 0.5
"""How far advantages look ahead, and the longest step of the weights."""
_MEMORY = 0.9
"""How much of a junction's usual cost stays with each episode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Decisions of all signals and episodes of a round."""

    phases: torch.Tensor
    constraints: torch.Tensor
    mask: torch.Tensor
    present: torch.Tensor
    actions: torch.Tensor
    chances: torch.Tensor
    advantages: torch.Tensor
    returns: torch.Tensor


class UsualCosts:
    """What a decision time usually costs at each junction."""

    def __init__(self, known: dict[str, float] | None = None) -> None:
        """Go on with what is known."""
        self.known = dict(known or {})

    def note(self, track: Trajectory) -> float:
        """Take an episode's costs into account.

        Args:
            track: the decisions at one junction.

        Returns:
            What a decision time now usually costs at that junction, always above 0.
        """
        now = float(track.costs.sum() / max(track.spans.sum(), 1)) + 1.0
        before = self.known.get(track.junction, now)
        self.known[track.junction] = _MEMORY * before + (1 - _MEMORY) * now
        return self.known[track.junction]


def build_batch(network: PhaseNet, tracks: Sequence[Trajectory], usual: UsualCosts) -> Batch:
    """Put a round's decisions together, with their advantages.

    Args:
        network: says what states are worth; it stays as it is.
        tracks: one per signal and episode, at least one.
        usual: takes the costs of each into account.

    Returns:
        The decisions in the order of `tracks`, padded to the most phases.
    """
    most = max(track.phases.shape[1] for track in tracks)
    parts: list[dict[str, Any]] = []
    for track in tracks:
        scale = usual.note(track) / (1 - DISCOUNT) / 3
        seen = _pad(track, most)
        with torch.no_grad():
            _, values = network(*seen)
        advantages = compute_advantages(-track.costs / scale, track.spans, values.numpy())
        returns = advantages + values.numpy()[:-1]
        spread = advantages.std() + 1e-6
        phases, constraints, mask, present = (part[:-1] for part in seen)
        parts.append(
            {
                "phases": phases,
                "constraints": constraints,
                "mask": mask,
                "present": present,
                "actions": torch.from_numpy(track.actions),
                "chances": torch.from_numpy(track.chances),
                "advantages": torch.from_numpy((advantages - advantages.mean()) / spread),
                "returns": torch.from_numpy(returns),
            }
        )
    return Batch(**{name: torch.cat([part[name] for part in parts]) for name in parts[0]})


def compute_advantages(rewards: Array, spans: NDArray[np.int64], values: Array) -> Array:
    """Compute how much better each decision came out than expected.

    Args:
        rewards: (n,) until the next decision.
        spans: (n,) decision times until then.
        values: (n + 1,) expected at each decision, and after the last one.

    Returns:
        (n,) generalised advantages.
    """
    advantages = np.zeros(len(rewards), np.float32)
    later = 0.0
    for place in reversed(range(len(rewards))):
        discount = DISCOUNT ** int(spans[place])
        surprise = rewards[place] + discount * values[place + 1] - values[place]
        later = surprise + discount * _TRACE * later
        advantages[place] = later
    return advantages


def _pad(track: Trajectory, most: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    count, phases, features = track.phases.shape
    padded = np.zeros((count, most, features), np.float32)
    padded[:, :phases] = track.phases
    mask = np.zeros((count, most), bool)
    mask[:, :phases] = True
    return (
        torch.from_numpy(padded),
        torch.from_numpy(track.constraints),
        torch.from_numpy(mask),
        torch.from_numpy(track.present),
    )


def update(
    network: PhaseNet,
    optimizer: torch.optim.Optimizer,
    batch: Batch,
    *,
    epochs: int,
    size: int,
    entropy: float,
    clip: float | None,
    generator: torch.Generator,
) -> None:
    """Improve the network on a batch.

    Args:
        network: is changed.
        optimizer: of its weights.
        batch: of a round.
        epochs: how often each decision is looked at.
        size: decisions of a step.
        entropy: the worth of trying things.
        clip: how far an update may move the odds of a choice, as a share; None leaves choices as they are.
        generator: of the decisions' order.
    """
    for _ in range(epochs):
        order = torch.randperm(len(batch.actions), generator=generator)
        for rows in torch.split(order, size):
            scores, values = network(
                batch.phases[rows], batch.constraints[rows], batch.mask[rows], batch.present[rows]
            )
            loss = 0.5 * (values - batch.returns[rows]).square().mean()
            if clip is not None:
                chances = scores.log_softmax(1).gather(1, batch.actions[rows, None])[:, 0]
                ratio = (chances - batch.chances[rows]).exp()
                gains = batch.advantages[rows]
                gain = torch.minimum(ratio * gains, ratio.clamp(1 - clip, 1 + clip) * gains).mean()
                loss = loss - gain - entropy * _spread(scores, batch.mask[rows])
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), _STEEPEST)
            optimizer.step()


def _spread(scores: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Compute the entropy, where there are phases."""
    logarithms = scores.log_softmax(1).masked_fill(~mask, 0.0)
    return -(logarithms.exp() * logarithms * mask).sum(1).mean()
