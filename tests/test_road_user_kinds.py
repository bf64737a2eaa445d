"""What SUMO's vehicle types look like: by class, guiShape and name, as SUMO itself tells them."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld
from dojo_env.snapshot import Kind, Snapshot

NETWORK = "2way-single-intersection-single-intersection"

TYPES = {
    "hatch": ('guiShape="passenger/hatchback"', Kind.HATCHBACK),
    "sedan": ('guiShape="passenger/sedan"', Kind.SALOON),
    "wagon": ('guiShape="passenger/wagon"', Kind.ESTATE),
    "van": ('guiShape="passenger/van"', Kind.VAN),
    "any": ("", Kind.CAR),
    "my_pickup": ("", Kind.PICKUP),
    "parcels": ('vClass="delivery"', Kind.VAN),
    "semi": ('vClass="truck" guiShape="truck/semitrailer"', Kind.TRAILER),
    "drawbar": ('vClass="truck" guiShape="truck/trailer"', Kind.ROAD_TRAIN),
    "long_bus": ('vClass="bus" guiShape="bus/flexible" length="18"', Kind.ARTICULATED_BUS),
    "coach": ('vClass="coach"', Kind.COACH),
    "fire": ('vClass="emergency" guiShape="firebrigade"', Kind.FIRE_ENGINE),
    "police": ('vClass="emergency" guiShape="police"', Kind.POLICE),
    "rescue": ('vClass="emergency"', Kind.AMBULANCE),
    "cab": ('vClass="taxi"', Kind.TAXI),
    "vespa": ('vClass="moped"', Kind.MOPED),
}


@pytest.fixture(scope="module")
def snapshots(
    tmp_path_factory: pytest.TempPathFactory, network_path: Callable[[str], Path]
) -> list[Snapshot]:
    """A minute in which a vehicle of each type sets out."""
    lines = [f'<vType id="{name}" {text}/>' for name, (text, _) in TYPES.items()]
    lines += ['<route id="through" edges="n_t t_s"/>']
    for k, name in enumerate(TYPES):
        lines.append(
            f'<vehicle id="{name}" type="{name}" route="through" depart="{k}" departLane="{k % 2}"/>'
        )
    routes = tmp_path_factory.mktemp("types") / "types.rou.xml"
    routes.write_text(f"<routes>{''.join(lines)}</routes>", encoding="utf-8")
    world = LocalWorld(build_config(net_file=network_path(NETWORK), route_file=routes, num_seconds=60))
    try:
        world.reset(1)
        seen = []
        for _ in range(10):
            world.step({world.signals[0]: 0})
            seen.append(world.instant.snapshot)
        return seen
    finally:
        world.close()


def test_kinds_follow_from_class_shape_and_name(snapshots: list[Snapshot]) -> None:
    kinds = {name: Kind(kind) for each in snapshots for name, kind in zip(each.ids, each.kinds, strict=True)}
    assert kinds == {name: kind for name, (_, kind) in TYPES.items()}


def test_snapshots_tell_vehicle_types(snapshots: list[Snapshot]) -> None:
    assert all(each.types == each.ids for each in snapshots)
