"""The network that tells from a lane's strip what stands, moves and hurries on it; it runs on numpy alone.

It looks at each strip by itself, with the same weights, so it serves any number of lanes. `learning.vision`
trains it.

    strip (64, 12, 9 colours of two looks and the background + 6 of geometry)
      -> three convolutions, coarser each time, and one across -> 16 cells
      -> two convolutions along the lane -> 4 chances of each cell
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from dojo_env.errors import PolicyError
from dojo_env.plain_arrays import read_arrays
from dojo_env.sensors.strip_geometry import COLUMNS, GEOMETRY, ROWS

Array = NDArray[np.float32]

SEEN = ("standing", "moving", "bus", "emergency")
"""What is told of each cell: the chance that the front of somebody who stands is in it, or of who moves; that
it is a bus; that it flashes blue."""
CHANNELS = 9 + len(GEOMETRY)
"""Of a strip: colours now, before, and of the background; geometry."""
LAYERS: Mapping[str, tuple[tuple[int, int], tuple[int, int], tuple[int, int], int]] = {
    "look1": ((3, 4), (1, 2), (1, 1), 16),
    "look2": ((4, 3), (2, 1), (1, 1), 24),
    "look3": ((4, 3), (2, 2), (1, 1), 32),
    "join": ((1, 3), (1, 1), (0, 0), 48),
    "along1": ((5, 1), (1, 1), (2, 0), 48),
    "along2": ((5, 1), (1, 1), (2, 0), 48),
    "tell": ((1, 1), (1, 1), (0, 0), len(SEEN)),
}
"""Each convolution's window, stride and padding, along and across, and what it gives."""
WEIGHTS = tuple(f"{layer}_{part}" for layer in LAYERS for part in ("weight", "bias"))
PACKAGED = Path(__file__).parent / "weights" / "lanes.npz"
"""The network that ships with the package."""
_MOST = 1 << 22
_SUREST = 30.0
"""Logits beyond which nobody is surer."""


def find_chances(weights: Mapping[str, Array], strips: NDArray[np.uint8], geometry: Array) -> Array:
    """Tell what is on each lane.

    Args:
        weights: of `read_weights`.
        strips: (n, rows, columns, 9) colours now, before, and of the background.
        geometry: (n, rows, columns, 6) of `strip_geometry.Strip`.

    Returns:
        (n, cells, 4) chances of `SEEN`.
    """
    values = np.concatenate([scale_colours(strips), geometry], axis=3)
    for name, (window, stride, padding, _) in LAYERS.items():
        values = _convolve(values, weights[f"{name}_weight"], window, stride, padding)
        values += weights[f"{name}_bias"]
        if name != "tell":
            np.maximum(values, 0.0, out=values)
    chances: Array = 1.0 / (1.0 + np.exp(-values[:, :, 0].clip(-_SUREST, _SUREST)))
    return chances


def scale_colours(strips: NDArray[np.uint8]) -> Array:
    """Turn colours into numbers from -1 to 1.

    Args:
        strips: of any shape, 0 to 255.

    Returns:
        The same shape.
    """
    return strips.astype(np.float32) * np.float32(2.0 / 255.0) - np.float32(1.0)


def _convolve(
    values: Array, weight: Array, window: tuple[int, int], stride: tuple[int, int], padding: tuple[int, int]
) -> Array:
    """Convolve (n, h, w, c) with weights (out, c * window); what lies outside is 0."""
    if any(padding):
        values = np.pad(values, ((0, 0), (padding[0],) * 2, (padding[1],) * 2, (0, 0)))
    seen = sliding_window_view(values, window, axis=(1, 2))[:, :: stride[0], :: stride[1]]
    count, rows, columns = seen.shape[:3]
    return (seen.reshape(count * rows * columns, -1) @ weight.T).reshape(count, rows, columns, -1)


def read_weights(path: Path) -> dict[str, Array]:
    """Read a network's weights.

    Args:
        path: of a file that `dojo-env train --vision` has kept, or `PACKAGED`.

    Returns:
        Float32 arrays by the names in `WEIGHTS`.

    Raises:
        PolicyError: the file is missing, damaged, or of other sizes.
    """
    what = "a network that sees lanes"
    weights = read_arrays(path, dict.fromkeys(WEIGHTS, "<f4"), most=_MOST, error=PolicyError, what=what)
    channels = CHANNELS
    for name, (window, _, _, out) in LAYERS.items():
        wanted = (out, channels * window[0] * window[1])
        if weights[f"{name}_weight"].shape != wanted or weights[f"{name}_bias"].shape != (out,):
            raise PolicyError(path, f"its layer {name} does not fit; take weights of this version")
        channels = out
    return weights


__all__ = ["CHANNELS", "COLUMNS", "LAYERS", "PACKAGED", "ROWS", "SEEN", "WEIGHTS", "find_chances"]
