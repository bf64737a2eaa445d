"""The whole scene: every mesh of a map, in the order they are drawn in."""

from collections.abc import Callable

import numpy as np
import shapely

from dojo_maps.description import RoadMap
from dojo_maps.geometry.arrangement import divide_ground
from dojo_maps.geometry.junction_markings import arrow_paint, crossing_paint, stop_line_paint
from dojo_maps.geometry.lane_lines import line_markings, rail_markings
from dojo_maps.geometry.paint import Canvas
from dojo_maps.geometry.pieces import Pieces, add_pieces
from dojo_maps.geometry.polylines import Shapes
from dojo_maps.meshes.decals import paint_meshes
from dojo_maps.meshes.furniture import signal_meshes
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.meshes.standing import stand_on_ground
from dojo_maps.meshes.surfaces import build_ground, surface_meshes
from dojo_maps.meshes.surroundings import surrounding_meshes

_RAMP = 1.5
"""How far a lowered kerb reaches into the pavement at each end of a crossing, metres."""
_MARGIN = 25.0
_MARGIN_SHARE = 0.05


def build_scene(
    road_map: RoadMap,
    pieces: Pieces,
    paved: shapely.Geometry,
    *,
    jobs: int = 1,
    on_stage: Callable[[str], None] = lambda _stage: None,
) -> tuple[RoadMap, tuple[Mesh, ...]]:
    """Build every mesh of a furnished map.

    Args:
        road_map: the description, furnished.
        pieces: the network's own claims to ground.
        paved: the network's own ground, in the frame of `origin`.
        jobs: how many threads cut triangles; the result is the same for any number.
        on_stage: told what begins.

    Returns:
        The map, with what stands around on the ground; and the ground's meshes, then paint, signals, and what
        stands around.
    """
    on_stage("Dividing the ground")
    pieces = add_pieces(pieces, road_map)
    size = np.subtract(road_map.bounds[1], road_map.bounds[0]).max()
    margin = max(_MARGIN, _MARGIN_SHARE * float(size))
    parts = divide_ground(pieces, paved, _ramps(road_map), margin=margin)
    on_stage("Cutting triangles")
    ground = build_ground(pieces, parts, jobs=jobs)
    road_map = stand_on_ground(road_map, ground)
    meshes = list(surface_meshes(ground, pieces))
    on_stage("Painting")
    canvas = Canvas(pieces, parts)
    paints = (
        rail_markings(road_map),
        line_markings(road_map, canvas),
        crossing_paint(road_map, canvas),
        stop_line_paint(road_map, canvas),
        arrow_paint(road_map, canvas),
    )
    shift = np.array([*road_map.origin, 0.0])
    lines = {lane.id: lane.shape - shift for lane in road_map.lanes}
    lines |= {crossing.id: crossing.shape - shift for crossing in road_map.crossings}
    meshes += paint_meshes(paints, ground, lines, jobs=jobs)
    return road_map, (*meshes, *signal_meshes(road_map), *surrounding_meshes(road_map))


def _ramps(road_map: RoadMap) -> Shapes:
    """Outline where kerbs are lowered: each crossing, carried on into the pavement at both ends."""
    shift = np.array(road_map.origin)
    areas = []
    for crossing in road_map.crossings:
        line = crossing.shape[[0, -1], :2] - shift
        length = float(np.hypot(*(line[1] - line[0])))
        if length < 0.1:
            continue
        ahead = (line[1] - line[0]) / length
        longer = [line[0] - ahead * _RAMP, *(crossing.shape[1:-1, :2] - shift), line[1] + ahead * _RAMP]
        areas.append(shapely.LineString(longer).buffer(crossing.width / 2, cap_style="flat"))
    return shapely.set_precision(np.array(areas, dtype=object), 1e-3)
