"""Stages of a signal, on links of a few lines each."""

from dataclasses import replace
from pathlib import Path

import pytest
from networks import run_sumo_tool

from dojo_maps.conversion import convert
from dojo_maps.sources.osm.signals.programs import compute_program
from dojo_maps.sources.osm.signals.stage_order import order_stages
from dojo_maps.sources.osm.signals.stages import SignalLink, build_stages, read_links

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


@pytest.mark.parametrize(("circle", "together"), [(False, True), (True, False)])
def test_cyclists_let_each_other_pass_but_not_in_a_circle(circle: bool, together: bool) -> None:
    """Three tracks cross; the last lets the first go, or nobody."""
    track = replace(CAR, cycles=True, direction="s", room=50.0)
    links = {
        k: replace(
            track,
            index=k,
            road=f"track {k}",
            heading=120.0 * k,
            foes=frozenset({0, 1, 2} - {k}),
            yields_to=frozenset({0: {1, 2}, 1: {2}, 2: set()}[k]) if not circle else frozenset({(k + 1) % 3}),
        )
        for k in range(3)
    }
    assert (len(build_stages(links)) == 1) == together


@pytest.mark.parametrize(("length", "together"), [(20.0, True), (60.0, False)])
def test_cyclists_on_a_long_way_wait_for_no_gap_in_a_stream(length: float, together: bool) -> None:
    """To the left across who comes the other way: a car finds a gap, and a bicycle if it is across soon."""
    track = replace(CAR, cycles=True, far=True, length=length, foes=frozenset({1}), yields_to=frozenset({1}))
    oncoming = replace(CAR, index=1, road="main", heading=-90.0, direction="s", foes=frozenset({0}))
    assert (len(build_stages({0: track, 1: oncoming})) == 1) == together


def test_stage_whose_links_go_in_others_is_left_out() -> None:
    """The third road goes with both others, but people walk with the side road only: without the third."""
    roads = (("main", {1, 3}), ("side", {0}), ("third", {3}))
    links = {
        k: replace(CAR, index=k, road=name, direction="s", heading=90.0 * k, foes=frozenset(foes))
        for k, (name, foes) in enumerate(roads)
    }
    stages = build_stages(links | {3: replace(WALK, index=3, foes=frozenset({0, 2}))})
    assert [(set(stage.vehicles), set(stage.walks)) for stage in stages] == [({0, 2}, set()), ({1}, {3})]


@pytest.mark.parametrize(("room", "later"), [(8.0, True), (60.0, False)])
def test_short_road_between_stop_lines_ends_after_those_who_fill_it(room: float, later: bool) -> None:
    filling = replace(CAR, road="main", to="between", onto="between", direction="s")
    between = replace(CAR, index=1, road="between", to="exit", direction="s", room=room)
    side = replace(CAR, index=2, road="side", to="end", heading=0.0, direction="s")
    links = {
        0: replace(filling, foes=frozenset({2})),
        1: replace(between, foes=frozenset({2})),
        2: replace(side, foes=frozenset({0, 1})),
    }
    rows = compute_program(links)
    ends = [next(k for k, (_, state) in enumerate(rows) if state[link] == "y") for link in (0, 1)]
    assert (ends[1] > ends[0]) == later
    lag = sum(seconds for seconds, state in rows if state[0] != "G" and state[1] == "G")
    assert lag <= 3 + 6, "its green is no green of its own for who chooses phases"
    assert all(state[2] != "G" or state[:2] == "rr" for _, state in rows)


@pytest.mark.parametrize(("room", "greens"), [(8.0, "0121"), (60.0, "012")])
def test_short_road_is_cleared_between_two_that_fill_it(room: float, greens: str) -> None:
    roads = (("one", "between"), ("between", ""), ("other", "between"))
    links = {
        k: replace(
            CAR, index=k, road=road, onto=onto, heading=90.0 * k, direction="s",
            foes=frozenset({0, 1, 2} - {k}), room=room if road == "between" else 99.0,
        )
        for k, (road, onto) in enumerate(roads)
    }  # fmt: skip
    rows = compute_program(links)
    assert "".join(str(state.index("G")) for _, state in rows if "G" in state) == greens
    assert sum(seconds for seconds, _ in rows) <= 120


def test_stages_are_ordered_so_that_a_short_road_is_cleared_before_it_is_filled_again() -> None:
    """Two roads in turn, each filled from two sides: in the order of their names, both are filled twice."""
    roads = (("a", "x"), ("b", "y"), ("c", "x"), ("d", "y"), ("x", ""), ("y", ""))
    links = {
        k: replace(
            CAR, index=k, road=road, onto=onto, heading=60.0 * k, direction="s",
            foes=frozenset(set(range(6)) - {k}), room=8.0 if road in "xy" else 99.0,
        )
        for k, (road, onto) in enumerate(roads)
    }  # fmt: skip
    stages = build_stages(links)
    repeated, once = order_stages(links, stages)
    assert sorted(map(id, once)) == sorted(map(id, stages)), "each stays, once"
    for order, most in ((repeated, 0), (once, 2)):
        shown = [min(stage.vehicles) for stage in order]
        twice = 0
        for short, filling in ((4, {0, 2}), (5, {1, 3})):
            seen = [k for k in shown if k in filling | {short}]
            twice += sum(
                {one, other} <= filling for one, other in zip(seen, [*seen[1:], seen[0]], strict=True)
            )
        assert twice <= most


@pytest.mark.parametrize(
    ("room", "alone", "together"), [(8.0, False, False), (60.0, False, True), (8.0, True, True)]
)
def test_turns_out_of_short_roads_do_not_wait_for_who_stands_behind_the_other(
    room: float, alone: bool, together: bool
) -> None:
    """A road between two junctions, both ways; on each, whoever turns waits for the stream onto the other."""
    links = {}
    for k, own in enumerate(("east", "west")):
        ahead = replace(CAR, heading=180.0 * k, direction="s", road=own, room=room)
        onto, through, turn = 3 * k, 3 * k + 1, 3 * k + 2
        oncoming = 3 * (1 - k)  # What fills the other road crosses who turns out of this one.
        links[onto] = replace(
            ahead, index=onto, road=f"to {own}", onto=own, to=own, foes=frozenset({5 - 3 * k})
        )
        links[through] = replace(ahead, index=through, to=f"{own} on")
        links[turn] = replace(
            ahead, index=turn, direction="l", far=True, alone=alone, to=f"{own} aside",
            foes=frozenset({oncoming}), yields_to=frozenset({oncoming}),
        )  # fmt: skip
    stages = build_stages(links)
    assert any({0, 3} <= stage.vehicles for stage in stages) == together


@pytest.mark.parametrize(("length", "known"), [(12, True), (60, False)])
def test_next_stop_line_is_known_behind_a_fork(length: int, known: bool, tmp_path: Path) -> None:
    """A road forks right after a junction; on one branch the next stop line of the signal follows."""
    places = {"w": (-100, 0), "s": (0, -100), "j": (0, 0), "f": (length + 8, 0), "l": (length + 30, 0)}
    places |= {"e": (200, 0), "b": (length + 60, 80), "n": (length + 30, 90), "m": (length + 30, -90)}
    kinds = dict.fromkeys("jl", 'type="traffic_light" tl="t"')
    nodes = "".join(
        f'<node id="{name}" x="{x}" y="{y}" {kinds.get(name, "")}/>' for name, (x, y) in places.items()
    )
    edges = "".join(
        f'<edge id="{start}{end}" from="{start}" to="{end}" numLanes="1" speed="10"/>'
        for start, end in ("wj", "sj", "jf", "fl", "fb", "le", "nl", "lm")
    )
    (tmp_path / "a.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (tmp_path / "a.edg.xml").write_text(f"<edges>{edges}</edges>")
    net = tmp_path / "a.net.xml"
    run_sumo_tool("netconvert", "-n", tmp_path / "a.nod.xml", "-e", tmp_path / "a.edg.xml", "-o", net)
    road_map = convert(str(net), tmp_path / "a.dojo")[0].road_map
    (signal,) = road_map.signals
    found = {link.road: link.onto for link in read_links(road_map, signal).values() if link.to == "jf"}
    assert found == dict.fromkeys(("wj", "sj"), "fl" if known else "")
