"""SUMO's vehicles wait at red before their stop line, and on no crossing: measured in real traffic."""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import Conversion

import dojo_env
from dojo_env.snapshot import Snapshot
from dojo_maps import RoadMap, read_bundle
from dojo_maps.demand import write_demand
from dojo_maps.description import Origin

PAST = 0.1
"""How far a front may stand past the middle of its line, which is half a metre wide, metres."""
NEAR = 8.0
"""Who stands farther from the end of a lane waits for something else, metres."""


@dataclass(frozen=True)
class Waiting:
    """A vehicle that waits first in its lane at red: where its front is, metres past its stop line."""

    lane: str
    past_line: float
    on_crossing: bool


def first_in_lanes(snapshot: Snapshot, road_map: RoadMap) -> Iterator[tuple[str, int]]:
    """Find the lanes whose links are all red, and the row of the foremost vehicle if that stands there."""
    ends = {lane.id: lane.shape[-1, :2] for lane in road_map.lanes}
    shown: dict[str, set[str]] = {}
    for signal in road_map.signals:
        for link in signal.links:
            shown.setdefault(link.from_id, set()).add(snapshot.signals[signal.id][link.index])
    nearest: dict[str, tuple[float, int]] = {}
    for row, lane in enumerate(snapshot.lanes):
        if shown.get(lane) == {"r"}:
            away = float(np.hypot(*(snapshot.positions[row, :2] - ends[lane])))
            nearest[lane] = min(nearest.get(lane, (NEAR, -1)), (away, row))
    for lane, (_, row) in nearest.items():
        if row >= 0 and snapshot.speeds[row] < 0.1:
            yield lane, row


def watch_red(scenario: str | dojo_env.Scenario, seconds: int) -> tuple[RoadMap, list[Waiting]]:
    """Run a map's own programs and list everyone who waits first at a red, once for each lane."""
    found: dict[tuple[str, str], Waiting] = {}
    env = dojo_env.parallel_env(scenario=scenario, fixed_ts=True, num_seconds=seconds)
    with contextlib.closing(env):
        env.reset(seed=3)
        road_map: RoadMap = env.world.map.bundle.road_map  # type: ignore[attr-defined]
        lines = {line.lane: line.shape[:, :2] for line in road_map.stop_lines}
        crossings = shapely.union_all([shapely.Polygon(c.polygon[:, :2]) for c in road_map.crossings])
        while env.agents:
            env.step({})
            snapshot = env.instant.snapshot
            for lane, row in first_in_lanes(snapshot, road_map):
                front, heading = snapshot.positions[row, :2], snapshot.headings[row]
                ahead = np.array([np.cos(heading), np.sin(heading)])
                length, width = snapshot.sizes[row, :2]
                body = shapely.LineString([front, front - length * ahead]).buffer(width / 2, cap_style="flat")
                found[snapshot.ids[row], lane] = Waiting(
                    lane,
                    float((front - lines[lane].mean(axis=0)) @ ahead),
                    bool(body.intersection(crossings).area > 0.01),
                )
    return road_map, list(found.values())


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("scenario", ["two-way", "cologne1", "cologne3", "ingolstadt1", "arterial4x4"])
def test_nobody_waits_past_a_stop_line_or_on_a_generated_crossing(scenario: str) -> None:
    road_map, waiting = watch_red(scenario, 300)
    assert len(waiting) > 10
    assert {crossing.origin for crossing in road_map.crossings} == {Origin.GENERATED}
    assert [each for each in waiting if each.past_line > PAST or each.on_crossing] == []


def test_nobody_waits_on_a_crossing_of_the_network(
    converted: Callable[..., Conversion], tmp_path: Path
) -> None:
    bundle, routes = read_bundle(converted("right_hand").folder), tmp_path / "traffic.rou.xml"
    write_demand(bundle.road_map, bundle.network, routes)
    _, waiting = watch_red(dojo_env.Scenario(map=bundle.folder, routes=routes), 300)
    assert len(waiting) > 15
    assert not any(each.on_crossing for each in waiting)
    # SUMO lets single vehicles roll up to a hand's breadth before the end of their lane.
    assert sum(each.past_line > PAST for each in waiting) <= 0.05 * len(waiting)
