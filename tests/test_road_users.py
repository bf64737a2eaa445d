"""What never changes of a road user is asked once, and forgotten when it is gone."""

from contextlib import closing

import numpy as np
import pytest

from dojo_env import road_users
from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld
from dojo_env.snapshot import Snapshot

NAMES = ("numbers", "kinds", "colours", "sizes", "types")


def watch() -> list[Snapshot]:
    """Take a snapshot of each second of some minutes with cars, buses and lorries."""
    seen: list[Snapshot] = []
    with closing(LocalWorld(build_config(scenario="cologne1-mixed", num_seconds=300))) as world:
        world.watch(seen.append)
        world.reset(1)
        while world.instant.time < world.config.sumo.end:
            world.step({})
    return seen


def test_however_many_have_come_and_gone_all_look_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = watch()
    monkeypatch.setattr(road_users, "_SPARE", 2)
    often = watch()
    assert len({name for each in usual for name in each.ids}) > 100
    assert len({kind for each in usual for kind in each.types}) > 1
    for one, other in zip(usual, often, strict=True):
        assert one.ids == other.ids
        for name in NAMES:
            assert np.array_equal(getattr(one, name), getattr(other, name)), (one.time, name)
