"""Outlines of junctions that cross themselves are drawn around the same ground."""

import re
from pathlib import Path

import networks
import pytest
import shapely

from dojo_maps.repair.fixing import patch_of
from dojo_maps.repair.rounds import State, fix_network

CHECK = "geometry.junction_invalid"


def _outline(state: State) -> shapely.Polygon:
    return shapely.Polygon(state.site.facts.junctions["c"].polygon[:, :2])


@pytest.mark.parametrize("height", ["", ",3.00"])
def test_twisted_outline_is_untwisted_and_nothing_else_changes(height: str, tmp_path: Path) -> None:
    nodes, ends = networks._star("priority", tilt=(0.0, 0.0) if height else None)
    path = networks._build(tmp_path, "star", nodes, networks._star_edges(ends, numLanes=2))
    found = re.search(r'<junction id="c"[^>]* shape="([^"]*)"', path.read_text())
    assert found is not None
    corners = found.group(1).split()
    half = len(corners) // 2
    corners[half:] = corners[: half - 1 : -1]
    twisted = " ".join(",".join(corner.split(",")[:2]) + height for corner in corners)
    data = path.read_bytes().replace(found.group(1).encode(), twisted.encode())
    fixed = fix_network(data, path, [CHECK])
    assert fixed.before.counts[CHECK][0] == 1
    assert CHECK not in fixed.after.counts, fixed.refused
    whole, was = _outline(fixed.after), shapely.make_valid(_outline(fixed.before))
    assert whole.is_valid
    assert was.difference(whole).area < 0.1
    assert whole.area <= was.convex_hull.area + 0.1
    changed = re.search(rb'<junction id="c"[^>]* shape="([^"]*)"', fixed.after.data)
    assert changed is not None
    assert fixed.after.data.replace(changed.group(1), twisted.encode()) == data
    assert all(corner.endswith(height) for corner in changed.group(1).decode().split())
    assert f'<node id="c" shape="{changed.group(1).decode()}"/>' in patch_of(fixed)["repair.nod.xml"]
