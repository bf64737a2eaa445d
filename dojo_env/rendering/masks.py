"""Masks of road users, run by run, as COCO writes them. Source: pycocotools, common/maskApi.c."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import kernel

Ints = NDArray[np.int32]


class Shown(NamedTuple):
    """What an instance picture shows of road users; arrays have one row each.

    Attributes:
        pixels: (k,) how many show it; 0 where none does.
        boxes: (k, 4) left, top, right, bottom of these; right and bottom are exclusive.
        masks: (k,) `counts` of COCO's compressed `{"size": [h, w], "counts": ...}`.
    """

    pixels: Ints
    boxes: Ints
    masks: tuple[str, ...]


def encode_masks(instance: Ints, numbers: Ints) -> Shown:
    """Measure the visible pixels of road users, and encode them as COCO's compressed run lengths.

    Args:
        instance: (h, w) the number of the road user that each pixel shows.
        numbers: (k,) whose masks are wanted.

    Returns:
        One row for each number, in their order.
    """
    order = np.argsort(numbers)
    pixels, boxes = _measure(instance, numbers[order], order)
    sides = boxes[:, 2:] - boxes[:, :2]
    # A column begins at most one run a pixel, and one more; a count takes at most six letters.
    most = int((sides[:, 0] * (sides[:, 1] + 1)).max(initial=0)) + 2
    counts, letters = np.empty(most, np.int64), np.empty(6 * most, np.uint8)
    masks = (
        letters[: _encode(instance, number, box, counts, letters)].tobytes().decode("ascii")
        for number, box in zip(numbers, boxes, strict=True)
    )
    return Shown(pixels=pixels, boxes=boxes, masks=tuple(masks))


@kernel
def _measure(instance, known, order):
    """Count the pixels of each number, of which `known` holds all in order, and find the box they lie in."""
    height, width = instance.shape
    pixels, boxes = np.zeros(len(order), np.int32), np.zeros((len(order), 4), np.int32)
    last, place = 0, len(known)
    for row in range(height):
        for column in range(width):
            number = instance[row, column]
            if number != last:
                last, place = number, np.searchsorted(known, number)
            if place < len(known) and known[place] == number:
                k = order[place]
                if pixels[k] == 0:
                    boxes[k, 0], boxes[k, 1] = column, row
                pixels[k] += 1
                boxes[k, 0] = min(boxes[k, 0], column)
                boxes[k, 2], boxes[k, 3] = max(boxes[k, 2], column + 1), row + 1
    return pixels, boxes


@kernel
def _encode(instance, number, box, counts, letters):
    """Write one mask's letters, and give how many there are; runs go down each column, left to right."""
    height, width = instance.shape
    runs, inside, begun = 0, False, 0
    for column in range(box[0], box[2]):
        for row in range(box[1], box[3]):
            if (instance[row, column] == number) != inside:
                at = column * height + row
                counts[runs], begun, inside = at - begun, at, not inside
                runs += 1
        goes_on = box[1] == 0 and box[3] == height and column < box[2] - 1
        if inside and not goes_on:
            at = column * height + box[3]
            counts[runs], begun, inside = at - begun, at, False
            runs += 1
    if begun < height * width:
        counts[runs] = height * width - begun
        runs += 1
    used = 0
    for k in range(runs):
        left = counts[k] - (counts[k - 2] if k > 2 else 0)
        more = True
        while more:
            piece = left & 0x1F
            left >>= 5
            more = left != -1 if piece & 0x10 else left != 0
            letters[used] = (piece | 0x20 if more else piece) + 48
            used += 1
    return used
