"""From a description to its furnished street and its scene; one spot that cannot be drawn costs that spot.

Surfaces are cut along each other all at once. Where that fails, the smallest neighbourhoods that fail by
themselves are found by halving the map. They are left out, and drawn afterwards as they are described,
uncut: every other surface comes out as if they were not there, and each of theirs becomes an issue.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dojo_maps.description import Points, RoadMap, outline_of, points
from dojo_maps.enrichment import furnish
from dojo_maps.errors import GeometryError
from dojo_maps.geometry.arrangement import Parts, paved_ground
from dojo_maps.geometry.pieces import add_pieces, build_pieces
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.meshes.mesh import Mesh, concatenate
from dojo_maps.meshes.scene import build_scene
from dojo_maps.meshes.surfaces import build_ground, surface_meshes

CHECK = "geometry.uncut_surface"
_BAND = 50.0
"""Surfaces this close to where a map is halved, metres, are tried together, too."""
_MOST_ROUNDS = 5
"""Of leaving out what fails; more are needed only where what is left fails in new ways."""

Drawn = tuple[RoadMap, tuple[Mesh, ...]]


@dataclass(frozen=True, slots=True)
class _Thing:
    """What can be left out: a road with its lanes, a junction, a walking area, a crossing, a prop."""

    kind: str
    id: str
    place: tuple[float, float]


def draw(
    described: RoadMap,
    *,
    generated: bool = True,
    surroundings: bool = True,
    far_side_signals: bool = False,
    jobs: int = 1,
    on_stage: Callable[[str], None] = lambda _stage: None,
) -> tuple[RoadMap, tuple[Mesh, ...], tuple[Issue, ...]]:
    """Add what a street has to a description, and build its scene.

    Args:
        described: as a source describes it.
        generated: add what the source does not tell of to look at: sidewalks, crossings, surroundings.
        surroundings: whether houses, trees and street lamps are among it.
        far_side_signals: give traffic signal heads across the junction, too.
        jobs: threads for cutting triangles; the result is the same for any number.
        on_stage: told what begins.

    Returns:
        The furnished map, its meshes, and an issue for each surface that could not be cut.

    Raises:
        GeometryError: what cannot be drawn is not a matter of single spots.
    """

    def attempt(road_map: RoadMap) -> Drawn:
        on_stage("Joining surfaces")
        pieces = build_pieces(road_map)
        paved = paved_ground(pieces)
        on_stage("Furnishing the street")
        furnished = furnish(
            road_map,
            paved,
            generated=generated,
            surroundings=surroundings,
            far_side_signals=far_side_signals,
        )
        return build_scene(furnished, pieces, paved, jobs=jobs, on_stage=on_stage)

    left_out: list[_Thing] = []
    reason: Exception | None = None
    for _ in range(_MOST_ROUNDS):
        try:
            road_map, meshes = attempt(_without(described, left_out))
        except (OSError, MemoryError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever fails, it must not cost the rest of the map
            reason = error
            on_stage("Looking for what cannot be drawn")
            kept = [thing for thing in _things(described) if thing not in set(left_out)]
            left_out += _find_spots(kept, lambda shown: _fails(attempt, described, shown))
        else:
            if left_out:
                road_map, meshes = (
                    _restored(described, road_map, left_out),
                    _with_plain(described, meshes, left_out),
                )
            return road_map, meshes, tuple(_issue(thing, reason) for thing in left_out)
    raise GeometryError(f"{described.name}: its shapes cannot be cut along each other: {reason}") from reason


def _things(road_map: RoadMap) -> list[_Thing]:
    lane_of = MapIndex(road_map).lanes
    found = [("road", road.id, lane_of[road.lanes[0]].shape) for road in road_map.roads]
    found += [("junction", j.id, points([j.position])) for j in road_map.junctions]
    found += [("walking_area", area.id, area.polygon) for area in road_map.walking_areas]
    found += [("crossing", crossing.id, crossing.shape) for crossing in road_map.crossings]
    found += [("prop", prop.id, outline_of(prop)) for prop in road_map.props]
    return [_Thing(kind, id_, _middle(shape, road_map.origin)) for kind, id_, shape in found]


def _middle(shape: Points, otherwise: tuple[float, float]) -> tuple[float, float]:
    usable = shape[np.isfinite(shape).all(axis=1)] if len(shape) else shape
    x, y = usable[len(usable) // 2, :2].tolist() if len(usable) else otherwise
    return (x, y)


def _find_spots(things: list[_Thing], fails: Callable[[Sequence[_Thing]], bool]) -> list[_Thing]:
    """Find the smallest neighbourhoods that fail by themselves, in things that fail together."""
    halves, band = _halved(things)
    failing = [part for part in halves if part and fails(part)]
    if not failing and 0 < len(band) < len(things) and fails(band):
        failing = [band]
    if len(things) == 1 or not failing:
        return things
    return [thing for part in failing for thing in _find_spots(part, fails)]


def _halved(things: list[_Thing]) -> tuple[tuple[list[_Thing], list[_Thing]], list[_Thing]]:
    """Halve things across their longer side; also gives those near the middle."""
    places = np.array([thing.place for thing in things])
    axis = int(np.argmax(np.ptp(places, axis=0)))
    order = np.argsort(places[:, axis], kind="stable")
    middle = len(order) // 2
    near = np.abs(places[:, axis] - places[order[middle], axis]) < _BAND
    halves = [things[k] for k in order[:middle]], [things[k] for k in order[middle:]]
    return halves, [thing for thing, is_near in zip(things, near, strict=True) if is_near]


def _fails(attempt: Callable[[RoadMap], Drawn], described: RoadMap, shown: Sequence[_Thing]) -> bool:
    kept = set(shown)
    try:
        attempt(_without(described, [thing for thing in _things(described) if thing not in kept]))
    except (OSError, MemoryError):
        raise
    except Exception:  # noqa: BLE001 - that it fails is the answer
        return True
    return False


def _without(described: RoadMap, left_out: Iterable[_Thing]) -> RoadMap:
    """Take the shapes of things away; the things stay, so that what refers to them does so still."""
    ids = _ids(left_out)
    if not ids:
        return described
    nowhere = points([[*described.origin, 0.0]] * 2)

    def blank(items: tuple[Any, ...], kind: str, key: str = "id", **shapes: Points) -> tuple[Any, ...]:
        return tuple(replace(i, **shapes) if getattr(i, key) in ids[kind] else i for i in items)

    return replace(
        described,
        lanes=blank(described.lanes, "road", "road", shape=nowhere),
        junctions=blank(described.junctions, "junction", polygon=points([])),
        walking_areas=blank(described.walking_areas, "walking_area", polygon=points([])),
        crossings=blank(described.crossings, "crossing", shape=nowhere, polygon=nowhere[[0, 0, 0]]),
        sidewalks=tuple(walk for walk in described.sidewalks if walk.road not in ids["road"]),
        props=tuple(prop for prop in described.props if prop.id not in ids["prop"]),
    )


def _restored(described: RoadMap, drawn: RoadMap, left_out: Iterable[_Thing]) -> RoadMap:
    """Give what was left out its shapes back, without what a street has there."""
    ids = _ids(left_out)
    own = {walk.id for walk in described.sidewalks}
    lines = {lane.id for lane in described.lanes if lane.road in ids["road"]}
    crossings = {crossing.id for crossing in described.crossings}
    return replace(
        drawn,
        lanes=described.lanes,
        junctions=described.junctions,
        walking_areas=described.walking_areas,
        crossings=described.crossings + tuple(c for c in drawn.crossings if c.id not in crossings),
        sidewalks=described.sidewalks + tuple(walk for walk in drawn.sidewalks if walk.id not in own),
        stop_lines=tuple(line for line in drawn.stop_lines if line.lane not in lines),
        props=drawn.props + tuple(prop for prop in described.props if prop.id in ids["prop"]),
    )


def _ids(things: Iterable[_Thing]) -> dict[str, set[str]]:
    found: dict[str, set[str]] = defaultdict(set)
    for thing in things:
        found[thing.kind].add(thing.id)
    return found


def _with_plain(described: RoadMap, meshes: tuple[Mesh, ...], left_out: Sequence[_Thing]) -> tuple[Mesh, ...]:
    """Add the surfaces of things as they are described, uncut, to the meshes of their layers."""
    added = [mesh for thing in left_out for mesh in _plain(described, thing)]
    names = dict.fromkeys(mesh.name for mesh in (*meshes, *added))
    return tuple(concatenate([m for m in (*meshes, *added) if m.name == name]) for name in names)


def _plain(described: RoadMap, thing: _Thing) -> Iterator[Mesh]:
    """Draw one thing alone; nothing where even that fails."""
    try:
        shown = _without(described, [other for other in _things(described) if other != thing])
        pieces = add_pieces(build_pieces(shown), shown)
        count = len(pieces.polygons)
        parts = Parts(
            polygons=pieces.polygons,
            owners=np.arange(count),
            ramps=np.zeros(count, dtype=bool),
            lowest=np.ones(count, dtype=bool),
        )
        yield from list(surface_meshes(build_ground(pieces, parts), pieces)) if count else []
    except (OSError, MemoryError):
        raise
    except Exception:  # noqa: BLE001 - its issue says that it is missing
        return


def _issue(thing: _Thing, reason: Exception | None) -> Issue:
    problem = f"{type(reason).__name__}: {' '.join(str(reason).split())[:200]}"
    return Issue(
        check=CHECK,
        severity=Severity.WARNING,
        elements=(Element(kind=thing.kind, id=thing.id),),
        position=(*thing.place, 0.0),
        message=f"the {thing.kind} {thing.id} cannot be cut along its neighbours and is drawn as it is "
        f"described, where it has ground at all: {problem}",
        hint="look for an outline that crosses or touches itself there, and draw it anew in netedit",
    )
