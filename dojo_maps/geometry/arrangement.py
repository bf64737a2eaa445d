"""Cut the ground along the outlines of all claims and give each face one owner per level.

One planar arrangement instead of a union and a difference per piece: every outline is noded with every
other on one raster, so no ground is covered twice, none is lost, and neighbours share their corners. Where
roads pass over each other, the claims on a face fall into levels by their heights.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.geometry.pieces import GRID, RAISED, Layer, Pieces, flat_polygons
from dojo_maps.geometry.polylines import Flags, Floats, HeightLines, Ints, Shapes

LEVEL_GAP = 2.0
"""Claims on one place that are farther apart in height than this, metres, lie on different levels."""
_SEAM = 0.025
"""Half the width of the gaps between a network's own surfaces that are closed, metres: SUMO writes two
decimals, so a gap of up to 3 cm is none. Wider ones are the network's own; they become islands."""
_WEDGE_ENCLOSED = 0.7
"""Share of a wedge's outline that must lie along paved ground for it to be filled."""

TERRAIN = -1
"""The owner of faces that nothing claims."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The ground, divided: simple polygons whose neighbours share all corners.

    Attributes:
        polygons: (n,) polygons.
        owners: (n,) indices of pieces, or `TERRAIN`.
        ramps: (n,) whether the part lies where a kerb is lowered.
        lowest: (n,) whether no other part lies under it.
    """

    polygons: Shapes
    owners: Ints
    ramps: Flags
    lowest: Flags


def paved_ground(pieces: Pieces) -> shapely.Geometry:
    """Join the network's own surfaces and close the slits that its rounded coordinates leave between them.

    Args:
        pieces: as `build_pieces` makes them; only the leading `paved` ones count.

    Returns:
        A multipolygon on the raster, metres, in the frame of the map's origin.
    """
    # Buffering all surfaces at once joins them, in a fifth of the time that a union takes.
    joined = shapely.multipolygons(pieces.polygons[: pieces.paved])
    for distance in (_SEAM, -_SEAM):
        joined = shapely.buffer(joined, distance, join_style="mitre", mitre_limit=2.0)
    # Mitred buffers may come out crossing themselves, and mended they may hold lines.
    mended = shapely.set_precision(shapely.make_valid(joined), GRID)
    return shapely.multipolygons(flat_polygons(np.array([mended]), larger_than=0.0)[0])


def join_coverage(polygons: Sequence[shapely.Polygon] | Shapes) -> shapely.Geometry:
    """Join polygons that share their corners; where some lie on each other after all, by the slower way.

    Args:
        polygons: (n,), in any one frame; none give an empty shape.

    Returns:
        The ground of all of them.
    """
    try:
        return shapely.coverage_union_all(polygons)
    except shapely.errors.GEOSException:
        return shapely.union_all(polygons, grid_size=GRID)


def divide_ground(pieces: Pieces, paved: shapely.Geometry, ramps: Shapes, *, margin: float) -> Parts:
    """Give every place within the map's rectangle, widened by `margin` metres, to one owner per level.

    Args:
        pieces: the claims; on one level the first one wins.
        paved: the network's own ground without seams, from `paved_ground`.
        ramps: (n,) polygons in which kerbs are lowered.
        margin: metres of terrain around the map.

    Returns:
        The parts, in the frame of the pieces. Faces of one owner are joined, unless the pieces have cuts.
    """
    bounds = shapely.total_bounds(pieces.polygons) if len(pieces.polygons) else np.zeros(4)
    frame = shapely.box(*_widened(bounds, margin))
    shapely.prepare(paved)
    mouths = pieces.mouths[~shapely.covers(paved, pieces.mouths)]
    areas = [*pieces.polygons, *mouths, *ramps, paved, frame]
    outlines = np.concatenate([shapely.boundary(np.array(areas, dtype=object)), pieces.cuts])
    lines = shapely.union_all(outlines, grid_size=GRID)
    faces = shapely.get_parts(shapely.polygonize([lines]))
    faces = faces[shapely.area(faces) > 0]
    face_indices, owners, lowest = _assign_owners(faces, pieces, mouths, paved)
    chosen = faces[face_indices]
    ramp_faces = _inside_any(chosen, ramps) & np.isin(owners, _raised(pieces))
    faces_as_parts = Parts(polygons=chosen, owners=owners, ramps=ramp_faces, lowest=lowest)
    # Where a surface bends it must keep the faces that the cuts across it make.
    return faces_as_parts if len(pieces.cuts) else _merge(faces_as_parts)


def _widened(bounds: Floats, margin: float) -> Floats:
    low, high = np.floor(bounds[:2] - margin), np.ceil(bounds[2:] + margin)
    return np.concatenate([low, high])


def _assign_owners(
    faces: Shapes, pieces: Pieces, mouths: Shapes, paved: shapely.Geometry
) -> tuple[Ints, Ints, Flags]:
    """List (face, owner, lowest or not): one for each level of a face, or one with `TERRAIN`."""
    inner = shapely.point_on_surface(faces)
    face, piece = shapely.STRtree(pieces.polygons).query(inner, predicate="within")
    # Nobody tells how high a lawn lies: like bare ground, it is only where nothing else is.
    is_green = np.array([layer is Layer.GREEN for layer in pieces.layers], dtype=bool)[piece]
    kept = ~is_green | ~np.isin(face, face[~is_green])
    face, piece = face[kept], piece[kept]
    heights = HeightLines(pieces.lines).at(piece, shapely.get_coordinates(inner)[face])
    order = np.lexsort((piece, heights, face))
    face, piece, heights = face[order], piece[order], heights[order]
    starts = np.ones(len(face), dtype=bool)
    starts[1:] = (np.diff(face) > 0) | (np.diff(heights) > LEVEL_GAP)
    first = np.flatnonzero(starts)
    owners = np.minimum.reduceat(piece, first) if len(first) else piece
    owned = face[first]

    covered = np.zeros(len(faces), dtype=bool)
    covered[owned[owners < pieces.paved]] = True
    within = shapely.contains(paved, inner)
    seams = np.flatnonzero(~covered & (within | _fill_wedges(faces, inner, mouths, paved)))
    kept = ~np.isin(owned, seams)
    rest = np.setdiff1d(np.arange(len(faces)), np.union1d(owned, seams))
    lowest = np.diff(owned, prepend=-1) > 0
    return (
        np.concatenate([owned[kept], seams, rest]),
        np.concatenate([owners[kept], _nearest(inner[seams], pieces), np.full(len(rest), TERRAIN)]),
        np.concatenate([lowest[kept], np.ones(len(seams) + len(rest), dtype=bool)]),
    )


def _fill_wedges(faces: Shapes, inner: Shapes, mouths: Shapes, paved: shapely.Geometry) -> Flags:
    """Find the faces between a lane's end and an oblique junction border: almost enclosed by paved ground."""
    filled = np.zeros(len(faces), dtype=bool)
    candidates = np.unique(shapely.STRtree(mouths).query(inner, predicate="within")[0])
    candidates = candidates[~shapely.contains(paved, inner[candidates])]
    wedges = shapely.get_parts(join_coverage(faces[candidates]))
    if not len(wedges):
        return filled
    outline = shapely.segmentize(shapely.get_exterior_ring(wedges), 0.05)
    places, wedge = shapely.get_coordinates(outline, return_index=True)
    touching = shapely.dwithin(paved, shapely.points(places), 2 * GRID)
    share = np.bincount(wedge, weights=touching) / np.bincount(wedge)
    chosen = shapely.STRtree(wedges[share > _WEDGE_ENCLOSED]).query(inner[candidates], predicate="within")[0]
    filled[candidates[chosen]] = True
    return filled


def _nearest(places: Shapes, pieces: Pieces) -> Ints:
    """Find the paved piece next to each place; of several at the same distance, the one that wins."""
    tree = shapely.STRtree(pieces.polygons[: pieces.paved])
    place, piece = tree.query_nearest(places, all_matches=True)
    nearest = np.full(len(places), len(pieces.polygons))
    np.minimum.at(nearest, place, piece)
    return nearest


def _inside_any(faces: Shapes, areas: Shapes) -> Flags:
    inside = np.zeros(len(faces), dtype=bool)
    if len(areas):
        inner = shapely.point_on_surface(faces)
        inside[shapely.STRtree(areas).query(inner, predicate="within")[0]] = True
    return inside


def _raised(pieces: Pieces) -> Ints:
    return np.flatnonzero([layer in RAISED for layer in pieces.layers])


def _merge(faces: Parts) -> Parts:
    """Join the faces of each owner; their outlines keep every corner that a neighbour has there."""
    group = faces.owners * 4 + faces.ramps * 2 + faces.lowest
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=group[order][:1] - 1))
    ends = [*starts[1:], len(order)]
    joined = []
    for start, end in zip(starts, ends, strict=True):
        run = faces.polygons[order[start:end]]
        joined.append(run[0] if len(run) == 1 else join_coverage(run))
    polygons, index = shapely.get_parts(np.array(joined, dtype=object), return_index=True)
    source = order[starts][index]
    return Parts(
        polygons=polygons,
        owners=faces.owners[source],
        ramps=faces.ramps[source],
        lowest=faces.lowest[source],
    )
