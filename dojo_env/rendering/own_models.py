"""Models of a user's in place of ours: turned, scaled into the unit box, made simple, and coloured.

What a face shows follows from its material's name, where that tells: glass, tyres and lamps are drawn as ours
are, and `body` or `paint` takes the road user's own colour. All else keeps the colour that the file gives it.
"""

import re

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import ModelError
from dojo_env.rendering.lighting import SRGB, to_linear
from dojo_env.rendering.model_files import RawModel, read_model_file
from dojo_env.rendering.models import DETAILS, Model, Variant
from dojo_env.rendering.shapes import Part
from dojo_env.vehicle_models import VehicleModel

Floats = NDArray[np.float64]

MOST_FACES = (3600, 1000, 260, 70)
"""Faces by level of detail, and three quarters as many corners."""
_FINEST_GRID = 512
"""Cells along a model's longest side in which corners are one at first."""
_ROOM = 4 * _FINEST_GRID
"""Cells along each side for which numbers are kept."""
_COARSER = 0.82
"""How many times as many cells there are at the next try."""
_SHADES = 16
"""Steps of each colour channel of sRGB that are told apart."""
_PARTS: tuple[tuple[str, Part], ...] = (
    ("glass|window|windscreen|windshield", Part.GLASS),
    ("tyre|tire|rubber", Part.TYRE),
    ("(brake|tail|rear).*(lamp|light)|(lamp|light)s?.*(red|brake|rear)", Part.BRAKE),
    ("indicator|blinker|turn.*(signal|lamp|light)|(lamp|light)s?.*(orange|amber)", Part.LEFT),
    ("beacon|siren|blue.*(lamp|light)|(lamp|light)s?.*blue", Part.BLUE),
    ("head.*(lamp|light)|^(lamp|light)s?$", Part.HEADLAMP),
    ("chrome|^metal", Part.CHROME),
    ("body|paint|^car.?material", Part.BODY),
)
"""What materials of such names show; the first that fits counts. Right indicators are told by their place."""


def fit_model(model: VehicleModel) -> tuple[Variant, Floats]:
    """Read a model, and bring it into the unit box of ours.

    Args:
        model: its file, and the axes that it faces along and that point up.

    Returns:
        The look, and (c, 3) linear colours; a part of `len(Part) + k` shows the k-th of them.

    Raises:
        ModelError: its file cannot be read, it is flat, or nothing of it is left once it is made simple.
    """
    raw = read_model_file(model.file)
    places = raw.triangles @ _axes(model).T
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    size = high - low
    if not (size > 1e-6 * size.max()).all():
        raise ModelError(model.file, f"is flat: {size.tolist()} long, wide and high; export the whole model")
    unit = (places - [high[0], 0.5 * (low[1] + high[1]), low[2]]) / size
    parts, colours = _parts(raw, unit)
    levels, grid = [], float(_FINEST_GRID)
    for most in MOST_FACES:
        level, grid = _simplify(unit, parts, size / size.max(), most, grid)
        if not len(level.faces):
            raise ModelError(model.file, "has no surface left once it is made simple; is it one piece?")
        levels.append(level)
    length, width, height = size.tolist()
    return Variant(size=(length, width, height), front=0.0, poses=(tuple(levels[:DETAILS]),)), colours


def _axes(model: VehicleModel) -> Floats:
    """Rows that give what is ahead, left and up of a place in the file's axes."""
    ahead, up = np.zeros(3), np.zeros(3)
    ahead["xyz".index(model.front[1])] = 1.0 if model.front[0] == "+" else -1.0
    up["xyz".index(model.up)] = 1.0
    return np.array([ahead, np.cross(up, ahead), up])


def _parts(raw: RawModel, unit: Floats) -> tuple[NDArray[np.uint16], Floats]:
    """Tell what each triangle shows, and which colours those have that show their own."""
    shown = np.array([_part_of(name) for name in raw.names])[raw.materials]
    shown[(shown == Part.LEFT) & (unit[..., 1].mean(axis=1) < 0.0)] = Part.RIGHT
    bytes_ = SRGB[np.round(raw.colours * (len(SRGB) - 1)).astype(np.intp)].astype(np.float64)
    steps = np.round(bytes_ / 255 * (_SHADES - 1)).astype(np.int64)
    own = shown < 0
    found, numbers = np.unique(steps[own], axis=0, return_inverse=True)
    shown[own] = len(Part) + numbers.reshape(-1)
    return shown.astype(np.uint16), to_linear(found * 255.0 / (_SHADES - 1))


def _part_of(name: str) -> int:
    return next((int(part) for words, part in _PARTS if re.search(words, name.lower())), -1)


def _simplify(
    unit: Floats, parts: NDArray[np.uint16], shape: Floats, most: int, grid: float
) -> tuple[Model, float]:
    """Join the corners within each cell of a grid, and take wider cells until few enough faces are left.

    Args:
        unit: (n, 3, 3) triangles in the unit box.
        parts: (n,) what they show.
        shape: (3,) sides of the box as shares of the longest.
        most: faces.
        grid: cells along the longest side to begin with.
    """
    while True:
        model = _join_cells(unit, parts, shape, grid)
        if len(model.faces) <= most and len(model.vertices) <= most:
            return model, grid
        grid *= _COARSER


def _join_cells(unit: Floats, parts: NDArray[np.uint16], shape: Floats, grid: float) -> Model:
    corners = unit.reshape(-1, 3)
    cells = np.floor(corners * shape * grid + 0.5).astype(np.int64) + _FINEST_GRID
    _, numbers = np.unique(cells @ _ROOM ** np.arange(3), return_inverse=True)
    counts = np.bincount(numbers)
    vertices = np.column_stack([np.bincount(numbers, corners[:, axis]) / counts for axis in range(3)])
    faces = numbers.reshape(-1, 3)
    a, b, c = faces.T
    whole = np.flatnonzero((a != b) & (b != c) & (c != a))
    # The same three corners in the same turn are one face, whichever comes first.
    order = (faces[whole].argmin(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(faces[whole], order, axis=1)
    _, first = np.unique(turned @ len(vertices) ** np.arange(3), return_index=True)
    kept = whole[np.sort(first)]
    normals = np.cross(*(vertices[faces[kept, k]] - vertices[faces[kept, 0]] for k in (1, 2)))
    kept = kept[np.abs(normals).max(axis=1) > 1e-12]
    used, renumbered = np.unique(faces[kept], return_inverse=True)
    return Model(vertices=vertices[used], faces=renumbered.reshape(-1, 3).astype(np.int32), parts=parts[kept])
