"""Policies side by side: one network whose scores are the sums of theirs."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]

_SEEN = 4
"""What the third layer sees of each phase: itself, the mean of all, their maximum, and the present one."""


def join_policies(policies: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Put policies side by side. Of trainings with different seeds, the sum errs less than each does.

    Args:
        policies: as `phase_competition.read_weights` gives them.

    Returns:
        The weights of one network, whose width is the sum of theirs.
    """

    def of_each(name: str) -> list[Array]:
        return [each[name] for each in policies]

    seen = zip(*(np.split(matrix, _SEEN, axis=1) for matrix in of_each("score1_weight")), strict=True)
    return {
        **{
            f"{layer}_bias": np.concatenate(of_each(f"{layer}_bias"))
            for layer in ("encode1", "encode2", "score1")
        },
        "encode1_weight": np.concatenate(of_each("encode1_weight")),
        "encode2_weight": _diagonal(of_each("encode2_weight")),
        "score1_weight": np.concatenate([_diagonal(parts) for parts in seen], axis=1),
        "score2_weight": np.concatenate(of_each("score2_weight"), axis=1),
        "score2_bias": np.sum(of_each("score2_bias"), axis=0),
        "rule_weight": np.sum(of_each("rule_weight"), axis=0),
    }


def _diagonal(matrices: Sequence[Array]) -> Array:
    """Put matrices along the diagonal of a greater one."""
    rows, columns = (np.cumsum([0, *(matrix.shape[axis] for matrix in matrices)]) for axis in range(2))
    whole = np.zeros((rows[-1], columns[-1]), np.float32)
    for number, matrix in enumerate(matrices):
        whole[rows[number] : rows[number + 1], columns[number] : columns[number + 1]] = matrix
    return whole
