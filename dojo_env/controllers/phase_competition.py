"""A learned policy for any junction: every phase gets a score from its vector, in the light of the others.

The network is small, and runs here on numpy: who installs the package needs no torch to use it.
`learning.universal` trains it.

Source: Zheng et al., Learning phase competition for traffic signal control (FRAP), CIKM 2019; deep sets,
Zaheer et al., NeurIPS 2017.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.controllers.base import Controller
from dojo_env.errors import PolicyError
from dojo_env.instant import Instant
from dojo_env.phase_features import CONSTRAINTS, PHASE_FEATURES, PhaseReader
from dojo_env.plain_arrays import read_arrays
from dojo_maps.signals.programs import green_links

Array = NDArray[np.float32]

LAYERS = ("encode1", "encode2", "score1", "score2")
"""Of the scores: two layers that every phase's vector goes through, two that see it beside the others."""
WEIGHTS = (*(f"{layer}_{part}" for layer in LAYERS for part in ("weight", "bias")), "rule_weight")
"""Of the layers; and of a sum of the features that is added, with which a policy begins."""
INPUTS = len(PHASE_FEATURES) + len(CONSTRAINTS)
QUEUE_PRESSURE = {"is_present": 1.0, "halting": 10.0, "halting_yielding": 10.0, "moving": 5.0}
"""The rule of that name, as a sum of features."""
PACKAGED = Path(__file__).parent / "weights"
"""Where the policies are that ship with the package."""
_MOST = 1 << 24


def score_phases(weights: Mapping[str, Array], phases: Array, constraints: Array, present: int) -> Array:
    """Score the phases of a signal.

    Args:
        weights: of each layer, (out, in), and its bias, (out,).
        phases: (n, features) of `PhaseReader.read`.
        constraints: (c,) of `PhaseReader.constraints`.
        present: the phase that is green.

    Returns:
        (n,) scores; the best phase has the greatest.
    """
    seen = np.concatenate([phases, np.broadcast_to(constraints, (len(phases), len(constraints)))], axis=1)
    encoded = _layer(weights, "encode2", _layer(weights, "encode1", seen))
    context = np.concatenate([encoded.mean(axis=0), encoded.max(axis=0), encoded[present]])
    both = np.concatenate([encoded, np.broadcast_to(context, (len(phases), len(context)))], axis=1)
    hidden = _layer(weights, "score1", both)
    rule = seen @ weights["rule_weight"].T
    scores: Array = (hidden @ weights["score2_weight"].T + weights["score2_bias"] + rule)[:, 0]
    return scores


def _layer(weights: Mapping[str, Array], name: str, values: Array) -> Array:
    return np.maximum(values @ weights[f"{name}_weight"].T + weights[f"{name}_bias"], 0.0)


def read_weights(path: Path) -> dict[str, Array]:
    """Read a policy's weights.

    Args:
        path: of the `.npz` file.

    Returns:
        Arrays by the names in `WEIGHTS`: of each layer its weight, (out, in), and its bias, (out,).

    Raises:
        PolicyError: the file is missing, damaged, or of other sizes.
    """
    what = "a universal policy, such as dojo-env train --universal keeps"
    weights = read_arrays(path, dict.fromkeys(WEIGHTS, "<f4"), most=_MOST, error=PolicyError, what=what)
    if weights["encode1_weight"].shape[1:] == weights["rule_weight"].shape[1:] == (INPUTS - 1,):
        # Of the first version, which knew no `delay`: it counts for nothing.
        for name in ("encode1_weight", "rule_weight"):
            weights[name] = np.insert(weights[name], PHASE_FEATURES.index("delay"), 0.0, axis=1)
    sizes = [weights[f"{layer}_weight"].shape for layer in LAYERS]
    fits = all(len(size) == 2 for size in sizes) and all(
        weights[f"{layer}_bias"].shape == size[:1] for layer, size in zip(LAYERS, sizes, strict=True)
    )
    if not fits or sizes[0][1] != INPUTS or sizes[1][1] != sizes[0][0] or sizes[3] != (1, sizes[2][0]):
        raise PolicyError(path, "its layers do not fit; take weights of this version")
    if sizes[2][1] != 4 * sizes[1][0] or weights["rule_weight"].shape != (1, INPUTS):
        raise PolicyError(path, "its layers do not fit; take weights of this version")
    return weights


class PhaseCompetition(Controller):
    """The phase with the best score, at any junction; where blue lights come, of those that let them go."""

    def __init__(
        self,
        weights: Path | Mapping[str, Array] = PACKAGED / "learned.npz",
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        """Take the weights, from their file or as they are, and keywords that the environment needs.

        Raises:
            PolicyError: the file holds none.
        """
        super().__init__(settings)
        if isinstance(weights, Path):
            self.weights = (weights,)
        self._weights = read_weights(weights) if isinstance(weights, Path) else dict(weights)
        self._readers: dict[str, PhaseReader] = {}

    def reset(self, seed: int) -> None:
        """Forget when phases were green."""
        self._readers = {}

    def choose(self, signal: str, instant: Instant) -> int:
        """Score each phase."""
        view = instant.signals[signal]
        if signal not in self._readers:
            self._readers[signal] = PhaseReader(view.plan)
        reader = self._readers[signal]
        phases = reader.read(signal, instant)
        scores = score_phases(self._weights, phases, reader.constraints(view), view.phase)
        urgent = instant.approach(signal).urgent
        if urgent:
            served = [len(urgent & green_links(state)) for state in view.plan.phases]
            scores = np.where(np.array(served) == max(served), scores, -np.inf)
        return int(scores.argmax())
