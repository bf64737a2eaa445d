"""Outlines as closed solids: buildings with walls up to flat roofs or gables, and hedges."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.description import BUILDING_FOOTING, Prop, foot_of
from dojo_maps.geometry.pieces import GRID, flat_polygons
from dojo_maps.geometry.polylines import Floats, Ints, Shapes
from dojo_maps.meshes.mesh import Mesh, compact
from dojo_maps.meshes.solids import extrude
from dojo_maps.meshes.surfaces import triangulate

_FAR = 1e4


def raise_outlines(name: str, buildings: Sequence[Prop], shift: Floats) -> Mesh:
    """Raise the outlines of props; each stands by itself, as high and as low as its own ground says.

    Args:
        name: the mesh's.
        buildings: props with polygons, map frame, at least one.
        shift: (3,) the origin of the scene, metres.

    Returns:
        Closed solids in the frame of the scene; their sources are the props' ids.
    """
    outlines = [np.asarray(prop.polygon) - shift for prop in buildings]
    ground = np.array([foot_of(prop) for prop in buildings]) - shift[2]
    slope = max(float(np.ptp(outline[:, 2])) for outline in outlines)
    shapes = [
        shapely.Polygon(outline[:, :2], [hole[:, :2] - shift[:2] for hole in prop.holes])
        for outline, prop in zip(outlines, buildings, strict=True)
    ]
    valid = shapely.set_precision(shapely.make_valid(np.array(shapes, dtype=object)), GRID)
    roofs = _find_roofs(buildings, outlines)
    polygons, source = flat_polygons(roofs.divide(valid), larger_than=0.01)
    corners, polygon = triangulate(polygons)
    owner = source[polygon] % len(buildings)
    rows = np.column_stack([np.repeat(owner, 3), corners.reshape(-1, 2)])
    places, faces = np.unique(rows, axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    solid = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces, owner = faces[solid], owner[solid]
    building = places[:, 0].astype(np.int64)
    vertices = np.column_stack([places[:, 1:], ground[building]])
    rise = roofs.heights(building, vertices[:, :2])
    vertices, faces, origin = extrude(vertices, faces, rise, BUILDING_FOOTING + slope)
    return compact(name, vertices, faces, owner[origin], [prop.id for prop in buildings])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Roofs:
    """The roofs of n buildings: flat, or two slopes down from a ridge over the middle.

    Source of the tags: https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings.

    Attributes:
        tops: (n,) metres above the ground.
        rises: (n,) how far a ridge stands above the eaves, metres; 0 where the roof is flat.
        down: (n, 2) unit vectors across the ridges.
        ridges: (n,) where along these the ridges lie, metres.
        halves: (n,) from there to the eaves, metres.
    """

    tops: Floats
    rises: Floats
    down: Floats
    ridges: Floats
    halves: Floats

    def divide(self, shapes: Shapes) -> Shapes:
        """Cut outlines (n,) along their ridges: (2 n,), one side of each, then the others, empty if flat."""
        parts = np.full((2, len(shapes)), shapely.Polygon(), dtype=object)
        parts[0] = shapes
        cut = np.flatnonzero(self.rises)
        down = self.down[cut] * _FAR
        across = np.column_stack([-down[:, 1], down[:, 0]])
        ridge = self.down[cut] * self.ridges[cut, None]
        for part, way in zip(parts, (down, -down), strict=True):
            corners = [ridge - across, ridge + across, ridge + across + way, ridge - across + way]
            halves = shapely.polygons(np.stack(corners, axis=1))
            part[cut] = shapely.intersection(shapes[cut], halves, grid_size=GRID)
        return parts.ravel()

    def heights(self, building: Ints, places: Floats) -> Floats:
        """Tell how high the roofs of buildings (m,) are over places (m, 2) in them: (m,) metres."""
        away = np.abs((places * self.down[building]).sum(axis=1) - self.ridges[building])
        lower = self.rises[building] * np.minimum(1.0, away / self.halves[building])
        heights: Floats = self.tops[building] - lower
        return heights


def _find_roofs(buildings: Sequence[Prop], outlines: Sequence[Floats]) -> _Roofs:
    tags = [dict(prop.tags) for prop in buildings]
    gabled = [tag.get("roof:shape") == "gabled" for tag in tags]
    compass = [float(tag["roof:direction"]) if g else 0.0 for tag, g in zip(tags, gabled, strict=True)]
    down = np.column_stack([np.sin(np.radians(compass)), np.cos(np.radians(compass))])
    spans = [outline[:, :2] @ way for outline, way in zip(outlines, down, strict=True)]
    low, high = np.array([span.min() for span in spans]), np.array([span.max() for span in spans])
    return _Roofs(
        tops=np.array([prop.height for prop in buildings]),
        rises=np.array([float(t["roof:height"]) if g else 0.0 for t, g in zip(tags, gabled, strict=True)]),
        down=down,
        ridges=(low + high) / 2,
        halves=np.maximum((high - low) / 2, 0.1),
    )
