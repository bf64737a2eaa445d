"""Run every check on a map and put what they find into one report."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from dojo_maps.description import RoadMap
from dojo_maps.issue import Issue, Severity
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.validation.geometry_checks import check_mesh_health
from dojo_maps.validation.osm_checks import OSM_CHECKS

REPORT_FORMAT = "dojo-report"
REPORT_VERSION = 1

_Run = Callable[[RoadMap, Sequence[Mesh]], Iterable[Issue]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check; those without `run` are made while the source is read."""

    id: str
    title: str
    severity: Severity
    limit: str
    source: str
    run: _Run | None = None


CHECKS = (
    Check(
        id="geometry.mesh_health",
        title="Raised surfaces are closed, and every position is a number",
        severity=Severity.ERROR,
        limit="every edge shared by two faces",
        source="glTF 2.0, trimesh",
        run=check_mesh_health,
    ),
    Check(
        id="topology.dangling_reference",
        title="Connections name lanes that exist",
        severity=Severity.ERROR,
        limit="none",
        source="SUMO net format",
    ),
    Check(
        id="topology.duplicate_id",
        title="Ids are unique",
        severity=Severity.ERROR,
        limit="none",
        source="SUMO net format",
    ),
    *(
        Check(id=name, title=title, severity=severity, limit=limit, source="OpenStreetMap")
        for name, title, severity, limit in OSM_CHECKS
    ),
)


def run_checks(road_map: RoadMap, meshes: Sequence[Mesh], known: Iterable[Issue]) -> dict[str, Any]:
    """Run every check.

    Args:
        road_map: the description.
        meshes: its scene.
        known: what was found while reading the source.

    Returns:
        The report as JSON values. A check that breaks is `crashed` and counts as an error.
    """
    issues = list(known)
    broken: set[str] = set()
    for check in CHECKS:
        if check.run is None:
            continue
        try:
            issues += check.run(road_map, meshes)
        except Exception as error:  # noqa: BLE001 - one broken check must not hide what the others find
            broken.add(check.id)
            issues.append(_crash(check, error, road_map))
    order = {check.id: k for k, check in enumerate(CHECKS)}
    issues.sort(key=lambda issue: order.get(issue.check, len(order)))
    return {
        "format": REPORT_FORMAT,
        "version": REPORT_VERSION,
        "map": road_map.name,
        "counts": {severity.value: sum(i.severity is severity for i in issues) for severity in Severity},
        "checks": [
            {
                "id": check.id,
                "title": check.title,
                "status": "crashed" if check.id in broken else "completed",
                "count": sum(issue.check == check.id for issue in issues),
            }
            for check in CHECKS
        ],
        "issues": [_encode(issue, road_map) for issue in issues],
    }


def _crash(check: Check, error: Exception, road_map: RoadMap) -> Issue:
    return Issue(
        check=check.id,
        severity=Severity.ERROR,
        elements=(),
        position=(*road_map.origin, 0.0),
        message=f"the check itself failed: {type(error).__name__}: {error}",
        hint="report this with the network; the other checks are not affected",
    )


def _encode(issue: Issue, road_map: RoadMap) -> dict[str, Any]:
    values = asdict(issue)
    values["severity"] = issue.severity.value
    values["lonlat"] = _lonlat(issue.position, road_map)
    return values


def _lonlat(position: tuple[float, float, float], road_map: RoadMap) -> list[float] | None:
    if road_map.projection.proj is None:
        return None
    import pyproj  # noqa: PLC0415 - slow to load and needed only for findings on the earth

    offset = road_map.projection.net_offset
    try:
        lon, lat = pyproj.Proj(road_map.projection.proj)(
            position[0] - offset[0], position[1] - offset[1], inverse=True, errcheck=True
        )
    except pyproj.exceptions.ProjError:
        return None
    return [lon, lat]
