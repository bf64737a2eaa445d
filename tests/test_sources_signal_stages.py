"""Stages of a signal, on links of a few lines each."""

from dataclasses import replace

import pytest

from dojo_maps.sources.signal_stages import SignalLink, build_stages

CAR = SignalLink(
    index=0, road="stem", walks=False, foes=frozenset(), yields_to=frozenset(), length=15.0, speed=13.9,
    heading=90.0, direction="l", far=False, alone=False,
)  # fmt: skip
WALK = replace(CAR, index=2, road=":c0", walks=True, speed=0.0, heading=0.0, direction="s")


@pytest.mark.parametrize(("over", "together"), [("stem", False), ("exit", True)])
def test_people_walk_with_who_turns_into_their_road_not_with_who_starts_from_it(
    over: str, together: bool
) -> None:
    turning = replace(CAR, foes=frozenset({1, 2}), yields_to=frozenset({2}))
    through = replace(CAR, index=1, road="main", heading=0.0, direction="s", foes=frozenset({0}))
    walk = replace(WALK, foes=frozenset({0}), over=frozenset({over}))
    stages = build_stages({link.index: link for link in (turning, through, walk)})
    (stage,) = (stage for stage in stages if 0 in stage.vehicles)
    assert (2 in stage.walks) == together
    assert any(2 in stage.walks for stage in stages)


@pytest.mark.parametrize(
    ("to", "far", "together"), [("exit", False, False), ("exit", True, True), ("", False, True)]
)
def test_who_turns_merges_with_no_stream_in_its_green(to: str, far: bool, together: bool) -> None:
    turning = replace(CAR, to=to or "other", far=far, foes=frozenset({1}), yields_to=frozenset({1}))
    through = replace(CAR, index=1, road="main", to="exit", heading=-90.0, direction="s", foes=frozenset({0}))
    stages = build_stages({0: turning, 1: through})
    assert (len(stages) == 1) == together
