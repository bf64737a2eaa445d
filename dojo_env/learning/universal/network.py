"""The network of the universal policy in torch: what `controllers.phase_competition` runs, and a value."""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from dojo_env.controllers.phase_competition import INPUTS, LAYERS, QUEUE_PRESSURE
from dojo_env.phase_features import PHASE_FEATURES


class PhaseNet(nn.Module):
    """Scores of phases, and the value of the junction's state."""

    def __init__(self, width: int = 64) -> None:
        """Begin with queue pressure, which knows nothing of waiting, walkers and what a change costs."""
        super().__init__()
        self.encode1, self.encode2 = nn.Linear(INPUTS, width), nn.Linear(width, width)
        self.score1, self.score2 = nn.Linear(4 * width, width), nn.Linear(width, 1)
        self.value1, self.value2 = nn.Linear(3 * width, width), nn.Linear(width, 1)
        self.rule = nn.Linear(INPUTS, 1, bias=False)
        with torch.no_grad():
            self.score2.weight.mul_(0.1)
            self.rule.weight.zero_()
            for name, weight in QUEUE_PRESSURE.items():
                self.rule.weight[0, PHASE_FEATURES.index(name)] = weight

    @classmethod
    def of_weights(
        cls, weights: Mapping[str, NDArray[np.float32]], *, temperature: float = 1.0
    ) -> "PhaseNet":
        """Go on from a policy's weights, which hold no values of states.

        Args:
            weights: as `phase_competition.read_weights` gives them.
            temperature: what the scores are divided by.

        Returns:
            A network of these scores.
        """
        network = cls(len(weights["encode1_bias"]))
        named = {name: torch.from_numpy(np.array(array)) for name, array in weights.items()}
        own = network.state_dict()
        for name in own:
            layer, _, part = name.partition(".")
            own[name] = named.get(f"{layer}_{part}", own[name])
        network.load_state_dict(own)
        with torch.no_grad():
            for tensor in (network.score2.weight, network.score2.bias, network.rule.weight):
                tensor.div_(temperature)
        return network

    def forward(
        self, phases: torch.Tensor, constraints: torch.Tensor, mask: torch.Tensor, present: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Judge n junctions at once.

        Args:
            phases: (n, p, features), padded to the most phases.
            constraints: (n, c).
            mask: (n, p) true where there is a phase.
            present: (n,) the phase that is green.

        Returns:
            (n, p) scores, -inf where there is no phase; and (n,) values.
        """
        count = phases.shape[1]
        seen = torch.cat([phases, constraints[:, None].expand(-1, count, -1)], dim=2)
        encoded = self.encode2(self.encode1(seen).relu()).relu() * mask[..., None]
        mean = encoded.sum(1) / mask.sum(1, keepdim=True)
        most = encoded.amax(1)  # Nothing encoded is below 0.
        own = encoded[torch.arange(len(encoded)), present]
        context = torch.cat([mean, most, own], dim=1)
        both = torch.cat([encoded, context[:, None].expand(-1, count, -1)], dim=2)
        scores = (self.score2(self.score1(both).relu()) + self.rule(seen))[..., 0]
        value = self.value2(self.value1(context).relu())[:, 0]
        return scores.masked_fill(~mask, -torch.inf), value

    def export(self) -> dict[str, NDArray[np.float32]]:
        """Give the weights of the scores as `phase_competition` takes them."""
        found = {}
        for name in LAYERS:
            layer = getattr(self, name)
            found[f"{name}_weight"] = layer.weight.detach().numpy().astype(np.float32)
            found[f"{name}_bias"] = layer.bias.detach().numpy().astype(np.float32)
        found["rule_weight"] = self.rule.weight.detach().numpy().astype(np.float32)
        return found
