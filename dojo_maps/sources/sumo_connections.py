"""Ways between lanes, and steps on foot, from a SUMO network's connection records.

What names a thing that the network does not have, or comes twice, becomes an issue.
"""

import itertools
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from dojo_maps.description import Connection, Lane, Points, Walk, points
from dojo_maps.geometry.polylines import along
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.safe_xml import Attributes
from dojo_maps.sources.permissions import allowed_classes
from dojo_maps.sources.values import read_link


class ConnectionReader:
    """Sorts connection records into ways between lanes, steps on foot, and signalled ways onto crossings.

    Attributes:
        connections: lane to lane, each once.
        walks: between sidewalks, walking areas and crossings.
        signalled: records with a signal that start or end inside a junction.
        issues: what could not be kept.
    """

    def __init__(
        self, path: Path, lanes: Mapping[str, Lane], internal: Mapping[str, Points], pavement: Collection[str]
    ) -> None:
        """Take what records may name: lanes and internal lanes by id, ids of crossings and walking areas."""
        self.connections: list[Connection] = []
        self.walks: list[Walk] = []
        self.signalled: list[Attributes] = []
        self.issues: list[Issue] = []
        self._path = path
        self._lanes = lanes
        self._internal = internal
        self._pavement = pavement

    def read(self, records: Sequence[Attributes]) -> None:
        """Read all records into the reader's attributes.

        Args:
            records: the network's connections, in file order.

        Raises:
            SourceError: a connection with a signal has a link index that is missing or no whole number.
        """
        onward: dict[str, str] = {}
        for a in records:
            if a.get("via") and a.get("from", "").startswith(":"):
                onward[f"{a['from']}_{a.get('fromLane')}"] = a["via"]
        known: set[tuple[str, str]] = set()
        for a in records:
            source, target = (self._name(a, "from", "fromLane"), self._name(a, "to", "toLane"))
            if source.startswith(":") or target.startswith(":"):
                self._read_step(a, source, target)
            elif (source, target) in known:
                self._report("topology.duplicate_id", source, target, "is listed more than once")
            else:
                known.add((source, target))
                self._read_connection(a, source, target, onward)

    def _name(self, a: Attributes, edge: str, lane: str) -> str:
        name = a.get(edge, "")
        return name if name in self._pavement else f"{name}_{a.get(lane)}"

    def _read_step(self, a: Attributes, source: str, target: str) -> None:
        if "tl" in a:
            self.signalled.append(a)
        missing = [
            name
            for name in (source, target)
            if not (name in self._lanes or name in self._internal or name in self._pavement)
        ]
        if missing:
            self._report_dangling(source, target, missing)
        elif source in self._pavement or target in self._pavement:
            self.walks.append(Walk(from_id=source, to_id=target))

    def _read_connection(self, a: Attributes, source: str, target: str, onward: Mapping[str, str]) -> None:
        missing = [lane for lane in (source, target) if lane not in self._lanes]
        if missing:
            self._report_dangling(source, target, missing)
            return
        via: list[str] = []
        lane = a.get("via", "")
        while lane in self._internal and lane not in via:
            via.append(lane)
            lane = onward.get(lane, "")
        if lane:
            loops = lane in via
            problem = f"passes {lane} again and again" if loops else f"names {lane}, which is not there"
            self._report("topology.dangling_reference", source, target, problem)
        signal, link_index = read_link(a, self._path, f"connection {source}->{target}")
        shape, joints = _join(
            [
                self._lanes[source].shape[-1:],
                *(self._internal[name] for name in via),
                self._lanes[target].shape[:1],
            ]
        )
        self.connections.append(
            Connection(
                from_lane=source,
                to_lane=target,
                via=tuple(via),
                direction=a.get("dir", ""),
                state=a.get("state", ""),
                signal=signal,
                link_index=link_index,
                shape=shape,
                joints=joints if via else (),
                waits=float(along(self._internal[via[0]])[-1]) if len(via) > 1 else None,
                allow=(
                    allowed_classes(a.get("allow"), a.get("disallow"))
                    if "allow" in a or "disallow" in a
                    else None
                ),
            )
        )

    def _report_dangling(self, source: str, target: str, missing: list[str]) -> None:
        problem = f"names {' and '.join(missing)}, which the network does not have"
        self._report("topology.dangling_reference", source, target, problem)

    def _report(self, check: str, source: str, target: str, problem: str) -> None:
        ends = ((source, -1), (target, 0))
        at = next((self._lanes[lane].shape[k] for lane, k in ends if lane in self._lanes), np.zeros(3))
        self.issues.append(
            Issue(
                check=check,
                severity=Severity.ERROR,
                elements=(
                    Element(kind="connection", id=f"{source}->{target}"),
                    *(Element(kind="lane", id=lane) for lane, _ in ends),
                ),
                position=(float(at[0]), float(at[1]), float(at[2])),
                message=f"the connection {source}->{target} {problem}",
                hint="remove the connection or correct what it names, then rebuild with netconvert",
            )
        )


def _join(parts: Sequence[Points]) -> tuple[Points, tuple[tuple[float, float], ...]]:
    """Put the parts of a way together, without repeated places, and measure how far apart they lie."""
    joints = []
    for part, following in itertools.pairwise(parts):
        x, y, z = (following[0] - part[-1]).tolist()
        joints.append(((x * x + y * y) ** 0.5, abs(z)))
    path = np.concatenate(parts)
    moved = np.ones(len(path), dtype=bool)
    moved[1:-1] = np.abs(path[1:-1] - path[:-2]).max(axis=1) > 0
    return points(path[moved]), tuple(joints)
