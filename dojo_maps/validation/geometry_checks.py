"""Checks of shapes and meshes."""

from collections.abc import Iterator, Sequence

import numpy as np

from dojo_maps.description import RoadMap
from dojo_maps.geometry.pieces import RAISED
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.meshes.mesh import Mesh, is_watertight

_KINDS = {"walking_area": "walking_area", "sidewalk": "sidewalk", "island": "prop"}


def check_mesh_health(road_map: RoadMap, meshes: Sequence[Mesh]) -> Iterator[Issue]:
    """Report raised surfaces that are not closed, and positions that are not numbers."""
    for mesh in meshes:
        if mesh.name in RAISED and not is_watertight(mesh):
            yield _issue(road_map, mesh, "is not watertight")
        if not np.isfinite(mesh.vertices).all():
            yield _issue(road_map, mesh, "has positions that are not numbers")


def _issue(road_map: RoadMap, mesh: Mesh, problem: str) -> Issue:
    return Issue(
        check="geometry.mesh_health",
        severity=Severity.ERROR,
        elements=tuple(Element(kind=_KINDS.get(mesh.layer, mesh.layer), id=id_) for id_ in mesh.ids[:1]),
        position=(*road_map.origin, 0.0),
        message=f"the mesh {mesh.name} {problem}",
        hint="report this with the network: the converter should never write such a mesh",
    )
