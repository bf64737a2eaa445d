"""Which of several phases is best."""

from collections.abc import Sequence


def choose_best(values: Sequence[float], present: int) -> int:
    """Choose the phase of the greatest value; among equals the present one, or else the next in their order.

    Where no value is above 0, the next phase comes, so that nothing stands still.

    Args:
        values: one for each phase.
        present: the phase that is green.

    Returns:
        The phase's number, its place among the values.
    """
    best = max(values)
    count = len(values)
    if values[present] == best > 0.0:
        return present
    return next(k % count for k in range(present + 1, present + 1 + count) if values[k % count] == best)
