"""How boxes overlap, and which of those that overlap are one object seen twice."""

import numpy as np
from numpy.typing import NDArray

from dojo_env.detectors.base import Floats


def measure_overlaps(boxes: Floats, others: Floats) -> Floats:
    """Compute the intersection over union of each box with each other one.

    Args:
        boxes: (n, 4) left, top, right, bottom.
        others: (m, 4).

    Returns:
        (n, m), 0 to 1.
    """
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    areas, other_areas = (np.prod(each[:, 2:] - each[:, :2], axis=1) for each in (boxes, others))
    union: Floats = areas[:, None] + other_areas[None, :] - shared
    return np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)


def suppress(boxes: Floats, scores: Floats, most: float) -> NDArray[np.intp]:
    """Keep of boxes that overlap the surest; of equally sure ones the first.

    Args:
        boxes: (n, 4).
        scores: (n,).
        most: intersection over union up to which two boxes are two objects.

    Returns:
        (k,) rows, the surest first.
    """
    order = np.argsort(-scores, kind="stable")
    overlaps = measure_overlaps(boxes[order], boxes[order])
    is_kept = np.ones(len(order), dtype=bool)
    for k in range(len(order)):
        if is_kept[k]:
            is_kept[k + 1 :] &= overlaps[k, k + 1 :] <= most
    kept: NDArray[np.intp] = order[is_kept]
    return kept
