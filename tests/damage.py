"""Networks that are damaged, odd, endless or large, for every command to survive."""

import math
import random
import re
from collections.abc import Callable

import commands  # noqa: F401 - finds the tools
import networks
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from random_damage import damage


def replaced(good: bytes, old: str, new: str, count: int = 1) -> bytes:
    """Change the first places where a text stands; it has to be there."""
    text = good.decode()
    assert old in text
    return text.replace(old, new, count).encode()


def swapped(good: bytes, pattern: str, new: str) -> bytes:
    """Change the first match of a pattern; there has to be one."""
    text, count = re.subn(pattern, new, good.decode(), count=1)
    assert count == 1
    return text.encode()


LANE = r'(<lane id="e_0"[^>]*) '
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "shape_nan": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="nan,0 1,1"'),
    "shape_inf": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="0,0 inf,1"'),
    "shape_overflow": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="0,0 1e400,1"'),
    "shape_words": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="left,right up,down"'),
    "shape_one_number": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="1 2 3"'),
    "shape_four_numbers": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="1,2,3,4 5,6,7,8"'),
    "shape_one_point": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="1,2"'),
    "shape_empty": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape=""'),
    "shape_missing": lambda good: swapped(good, LANE + 'shape="[^"]*"', r"\1 "),
    "shape_semicolons": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="1;2 3;4"'),
    "shape_hidden_line": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="a&#10;b,&#10;c"'),
    "lane_without_id": lambda good: replaced(good, '<lane id="e_0"', "<lane"),
    "lane_id_with_line_break": lambda good: swapped(
        good, '<lane id="e_0"([^>]*) shape="[^"]*"', r'<lane id="e&#10;rror: all is well"\1 shape="x"'
    ),
    "lane_without_index": lambda good: replaced(good, '<lane id="e_0" index="0"', '<lane id="e_0"'),
    "lane_index_word": lambda good: replaced(good, '<lane id="e_0" index="0"', '<lane id="e_0" index="one"'),
    "lane_index_negative": lambda good: replaced(
        good, '<lane id="e_0" index="0"', '<lane id="e_0" index="-1"'
    ),
    "lane_speed_word": lambda good: swapped(good, LANE + 'speed="[^"]*"', r'\1 speed="fast"'),
    "lane_speed_negative": lambda good: swapped(good, LANE + 'speed="[^"]*"', r'\1 speed="-5"'),
    "lane_length_nan": lambda good: swapped(good, LANE + 'length="[^"]*"', r'\1 length="nan"'),
    "width_negative": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" width="-3.2"'),
    "width_zero": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" width="0"'),
    "width_nan": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" width="nan"'),
    "width_word": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" width="wide"'),
    "width_huge": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" width="1e300"'),
    "edge_without_id": lambda good: replaced(good, '<edge id="e" ', "<edge "),
    "edge_without_from": lambda good: replaced(good, '<edge id="e" from="e" ', '<edge id="e" '),
    "edge_without_lanes": lambda good: swapped(good, r'(<edge id="e" [^>]*>)[\s\S]*?</edge>', r"\1</edge>"),
    "junction_without_id": lambda good: replaced(good, '<junction id="c"', "<junction"),
    "junction_x_missing": lambda good: swapped(good, '(<junction id="c"[^>]*) x="[^"]*"', r"\1"),
    "junction_x_inf": lambda good: swapped(good, '(<junction id="c"[^>]*) x="[^"]*"', r'\1 x="-inf"'),
    "junction_shape_words": lambda good: swapped(
        good, '(<junction id="c"[^>]*) shape="[^"]*"', r'\1 shape="round"'
    ),
    "connection_without_from": lambda good: replaced(good, '<connection from="e"', "<connection"),
    "connection_lane_word": lambda good: replaced(
        good, '<connection from="e" to="-n" fromLane="0"', '<connection from="e" to="-n" fromLane="x"'
    ),
    "connection_index_word": lambda good: replaced(good, 'linkIndex="3"', 'linkIndex="three"'),
    "phase_without_duration": lambda good: swapped(good, r'<phase duration="\d+"', "<phase"),
    "phase_duration_word": lambda good: swapped(good, r'<phase duration="\d+"', '<phase duration="long"'),
    "phase_without_state": lambda good: swapped(good, r'(<phase duration="\d+"[^>]*?) state="\w+"', r"\1"),
    "signal_without_id": lambda good: replaced(good, '<tlLogic id="c"', "<tlLogic"),
    "offset_word": lambda good: swapped(good, r'netOffset="[^"]*"', 'netOffset="here"'),
    "offset_one_number": lambda good: swapped(good, r'netOffset="[^"]*"', 'netOffset="7"'),
}


def _wave(*, points: int, step: float, width: float, length: float) -> str:
    """A shape that swings from side to side."""
    places = (
        (index * step, width * math.sin(2 * math.pi * index * step / length)) for index in range(points)
    )
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in places)


ODDITIES: dict[str, Callable[[bytes], bytes]] = {
    "coordinates_beyond_reason": lambda good: swapped(
        good, LANE + 'shape="[^"]*"', r'\1 shape="0,0 1e300,1e300"'
    ),
    "coordinates_across_the_earth": lambda good: swapped(
        good, LANE + 'shape="[^"]*"', r'\1 shape="0,0 40000000,0"'
    ),
    "lane_of_no_length": lambda good: swapped(good, LANE + 'shape="[^"]*"', r'\1 shape="1,2 1,2"'),
    "lane_id_twice": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_1"'),
    "edge_id_twice": lambda good: replaced(good, '<edge id="e" ', '<edge id="n" '),
    "edge_called_like_a_crossing": lambda good: replaced(good, '<edge id="e" ', '<edge id=":c_c9" '),
    "edge_to_nowhere": lambda good: replaced(good, '<edge id="e" from="e"', '<edge id="e" from="gone"'),
    "connection_to_nowhere": lambda good: replaced(
        good, '<connection from="e" to="-n"', '<connection from="e" to="gone"'
    ),
    "connection_lane_out_of_range": lambda good: replaced(
        good, '<connection from="e" to="-n" fromLane="0"', '<connection from="e" to="-n" fromLane="77"'
    ),
    "connection_index_beyond_state": lambda good: replaced(good, 'linkIndex="3"', 'linkIndex="99999999"'),
    "connection_twice": lambda good: swapped(good, r'(<connection from="e" [^>]*/>)', r"\1\1"),
    "via_to_nowhere": lambda good: swapped(good, r' via=":c_[^"]*"', ' via=":gone_0_0"'),
    "via_to_itself": lambda good: swapped(
        good, r'(<connection from=":c_1" to="[^"]*" fromLane="0" [^>]*?)dir', r'\1via=":c_1_0" dir'
    ),
    "phase_states_of_two_lengths": lambda good: swapped(good, r'state="\w+"', 'state="rG"'),
    "phase_state_of_digits": lambda good: swapped(good, r'state="\w+"', 'state="0123"'),
    "program_without_phases": lambda good: swapped(
        good, r"(<tlLogic [^>]*>)[\s\S]*?</tlLogic>", r"\1</tlLogic>"
    ),
    "unknown_class": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" allow="dragon bus"'),
    "allow_nobody": lambda good: replaced(good, '<lane id="e_0"', '<lane id="e_0" allow="" disallow=""'),
    "no_location": lambda good: swapped(good, r"<location [^>]*/>", ""),
    "wrong_projection": lambda good: swapped(good, r'projParameter="[^"]*"', 'projParameter="+proj=moon"'),
    "hostile_projection": lambda good: swapped(
        good, r'projParameter="[^"]*"', 'projParameter="+proj=pipeline +step +init=../../etc:1"'
    ),
    "no_version": lambda good: swapped(good, r' version="[\d.]+"', ""),
    "future_version": lambda good: swapped(good, r'<net version="[\d.]+"', '<net version="99.0"'),
    "id_that_climbs": lambda good: good.replace(b'"e_0"', b'"../../../../e_0"').replace(
        b'id="c"', b'id="../c"'
    ),
    "id_of_markup": lambda good: good.replace(b'"e_0"', b'"&lt;img src=x onerror=alert(1)&gt;"'),
    "long_name": lambda good: replaced(good, '<edge id="e" ', f'<edge id="e" name="{"x" * 5_000_000}" '),
    "deep_nesting": lambda good: replaced(
        good, "</net>", "<param>" * 100_000 + "</param>" * 100_000 + "</net>"
    ),
    "many_attributes": lambda good: replaced(
        good, '<edge id="e" ', '<edge id="e" ' + " ".join(f'a{i}="1"' for i in range(50_000)) + " "
    ),
    "long_shape": lambda good: swapped(
        good, LANE + 'shape="[^"]*"', rf'\1 shape="{_wave(points=5_000, step=0.5, width=20.0, length=200.0)}"'
    ),
    "folded_shape": lambda good: swapped(
        good, LANE + 'shape="[^"]*"', rf'\1 shape="{_wave(points=400, step=0.01, width=1.0, length=0.04)}"'
    ),
}


def written(positions: list[tuple[float, float]]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in positions)


def zigzag(count: int, step: float) -> str:
    return written([(step * k, 50.0 * (k % 2)) for k in range(count)])


def network_of(*shapes: str, floor: str = "0,0 1,0 1,1") -> bytes:
    """A network of one-lane roads, all between the same two junctions."""
    edges = "".join(
        f'<edge id="e{k}" from="a" to="b" priority="1">'
        f'<lane id="e{k}_0" index="0" speed="13" length="9" shape="{shape}"/></edge>'
        for k, shape in enumerate(shapes)
    )
    junctions = "".join(
        f'<junction id="{name}" type="priority" x="0" y="0" incLanes="" intLanes="" shape="{ring}"/>'
        for name, ring in (("a", floor), ("b", "100,0 101,0 101,1"))
    )
    return f'<net version="1.20">{edges}{junctions}</net>'.encode()


def _scribble(count: int, size: float) -> str:
    chance = random.Random(1)  # noqa: S311 - any scribble will do
    return written([(chance.uniform(0, size), chance.uniform(0, size)) for _ in range(count)])


ENDLESS: dict[str, Callable[[], bytes]] = {
    "zigzag": lambda: network_of(zigzag(2000, 0.05)),
    "scribble": lambda: network_of(_scribble(5000, 100.0)),
    "tiny_scribble": lambda: network_of(_scribble(5000, 0.1)),
    "scribbled_floor": lambda: network_of("0,0 100,0", floor=_scribble(400, 500.0)),
    "comb_as_floor": lambda: network_of("0,0 100,0", floor=f"{zigzag(4000, 0.05)} 200,-1 0,-1"),
    "thousands_on_one_place": lambda: network_of(*["0,0 100,0"] * 5000),
    "thousands_almost_on_one_place": lambda: network_of(*[f"0,0 100,{k / 100}" for k in range(5000)]),
    "lane_of_many_positions": lambda: network_of(zigzag(100_000, 10.0)),
    "floor_of_many_positions": lambda: network_of("0,0 100,0", floor=_scribble(100_000, 500.0)),
}


LARGE: dict[str, Callable[[], bytes]] = {
    "widezigzag": lambda: network_of(zigzag(5000, 1.5)),
    "winding_road": lambda: network_of(written([(k, 5 * math.sin(k / 10)) for k in range(5000)])),
    "round_floor": lambda: network_of(
        "0,0 100,0",
        floor=written([(500 * math.cos(k / 800), 500 * math.sin(k / 800)) for k in range(5000)]),
    ),
    "stack": lambda: network_of(*["0,0 100,0"] * 80),
}


def fuzz(name: str, examples: int, check: Callable[[bytes], None]) -> None:
    """Check an installed network, damaged at random so many times, always in the same ways."""
    good = networks.read_network_bytes(networks.installed_networks()[name])

    @settings(max_examples=examples, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(st.randoms(use_true_random=True))
    def run(chance: random.Random) -> None:
        check(damage(good, chance))

    run()
