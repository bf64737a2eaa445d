"""The signal layer: no action can make a signal unsafe, and the watch sees it when one is."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import networks
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.signals.plan import SignalPlan, build_plan
from dojo_env.signals.safety import SafetyLog, SignalWatch
from dojo_env.signals.switching import SignalSwitch
from dojo_maps.description import LinkKind, RoadMap
from dojo_maps.signals.programs import GREEN
from dojo_maps.sources.enrich_net import enrich_network
from dojo_maps.sources.sumo_net import read_network

NETWORKS = ("cologne1", "cologne3", "ingolstadt7", "RiLSA1-rilsa1", "fkk_in-ingolstadt", "grid4x4")
ENRICHED = ("cologne1", "ingolstadt1")


@lru_cache
def road_map(name: str) -> RoadMap:
    enriched = name.endswith("+")
    path = networks.installed_networks()[name.rstrip("+")]
    data = networks.read_network_bytes(path)
    if enriched:
        data, _ = enrich_network(data, path=path)
    return read_network(data, path=path, name=name, sha256="0" * 64)[0]


def plans(name: str, config: SignalConfig) -> list[SignalPlan]:
    found = road_map(name)
    usable = [s for s in found.signals if any(link.kind is LinkKind.VEHICLE for link in s.links)]
    return [build_plan(found, signal, config) for signal in usable]


def drive(
    plan: SignalPlan, config: SignalConfig, choose: Callable[[SignalSwitch], int | None], seconds: int = 400
) -> tuple[SafetyLog, list[str]]:
    """Let a signal run and be watched every second."""
    log, switch, states = SafetyLog(), SignalSwitch(plan, config), []
    watch = SignalWatch(plan, config, log, time=0.0)
    watch.look(0.0, switch.state)
    for second in range(seconds):
        wanted = choose(switch)
        if wanted is not None:
            switch.request_phase(wanted)
            watch.look(float(second), switch.state)
        switch.advance()
        watch.look(second + 1.0, switch.state)
        watch.look_back(second + 1.0)
        states.append(switch.state)
    return log, states


CONFIGS = st.builds(
    SignalConfig,
    yellow_time=st.sampled_from([1, 2, 3, 5, "speed"]),
    all_red=st.integers(0, 4),
    min_green=st.integers(1, 20),
    max_green=st.sampled_from([None, 20, 45]),
    phases=st.sampled_from(["program", "computed"]),
    walking_speed=st.sampled_from([0.8, 1.2]),
)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", [*NETWORKS, *(f"{name}+" for name in ENRICHED)])
@settings(max_examples=8, derandomize=True)
@given(config=CONFIGS, seed=st.integers(0, 1000))
def test_random_requests_never_break_a_rule(name: str, config: SignalConfig, seed: int) -> None:
    draw = np.random.default_rng(seed)
    for plan in plans(name, config)[:4]:
        wishes = iter(draw.integers(len(plan.phases), size=400).tolist())
        log, _ = drive(plan, config, lambda _, wishes=wishes: next(wishes))
        assert not log.counts, log.first


def _wish(count: int, step: int | None, switch: SignalSwitch) -> int | None:
    """Always want another phase, or never say anything."""
    return None if step is None else (switch.phase + step) % count


GREEDY = (
    "cologne1", "cologne1+", "ingolstadt1+", "ingolstadt7",
    "ingolstadt21",  # has letters that no lane heeds
    "RiLSA1-rilsa1",  # gives left turns priority after walkers
    "fkk_in-ingolstadt",  # has letters for cyclists and walkers at once, and phases within others
)  # fmt: skip


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", GREEDY)
@pytest.mark.parametrize("phases", ["program", "computed"])
def test_greedy_requests_never_break_a_rule(name: str, phases: str) -> None:
    config = SignalConfig(yellow_time="speed", all_red=2, min_green=1, max_green=30, phases=phases)
    for plan in plans(name, config):
        count = len(plan.phases)
        wishes = (1, -1, None)
        attacks = [partial(_wish, count, step) for step in wishes]
        for attack in attacks:
            log, states = drive(plan, config, attack)
            assert not log.counts, log.first
            assert count == 1 or len(set(states)) > 2


@pytest.mark.parametrize("name", ["cologne1", "ingolstadt7", "RiLSA1-rilsa1", "cologne1+"])
def test_computed_phases_have_no_conflict_and_serve_every_lane(name: str) -> None:
    for plan in plans(name, SignalConfig(phases="computed")):
        served: set[int] = set()
        for state in plan.phases:
            green = [index for index, letter in enumerate(state) if letter in GREEN]
            assert not plan.conflicts.foes[green][:, green].any()
            served.update(green)
        assert {index for index, _, _ in plan.links} <= served


def test_phases_of_the_program_stay_as_they_are() -> None:
    (plan,) = plans("cologne1", SignalConfig())
    assert plan.phases == (
        "rrrrrGGGggrrrrrGGGgg", "rrrrrrrrGGrrrrrrrrGG", "GGGggrrrrrGGGggrrrrr", "rrrGGrrrrrrrrGGrrrrr",
    )  # fmt: skip
    assert not plan.changes


def test_conflicting_priorities_are_told_and_made_permissive() -> None:
    changed = [plan for plan in plans("ingolstadt7", SignalConfig()) if plan.changes]
    assert changed
    for plan in changed:
        assert not any(plan.conflicts.find_unsafe(state) for state in plan.phases)


def test_links_that_vehicles_and_walkers_share_get_yellow_and_clearance() -> None:
    plan = plans("fkk_in-ingolstadt", SignalConfig())[1]
    shared = np.flatnonzero((plan.yellow > 0) & (plan.clearance > 0))
    assert shared.tolist() == [11, 13, 15, 17]
    assert not plan.is_crossing[shared].any()


def test_yellow_by_speed_is_that_of_a_links_fastest_lane() -> None:
    found = road_map("fkk_in-ingolstadt")
    config = SignalConfig(yellow_time="speed")
    (signal,) = (signal for signal in found.signals if signal.id == "gneJ21")
    lanes = [link.from_id for link in signal.links if link.index == 1 and link.kind is LinkKind.VEHICLE]
    for fast in lanes:
        changed = tuple(replace(lane, speed=30.0) if lane.id == fast else lane for lane in found.lanes)
        assert build_plan(replace(found, lanes=changed), signal, config).yellow[1] == 6
    assert len(lanes) == 3


def test_crossings_are_cleared_before_traffic_gets_green() -> None:
    config = SignalConfig(min_green=5)
    (plan,) = plans("cologne1+", config)
    assert plan.is_crossing.any()
    assert plan.clearance[plan.is_crossing].min() >= 3
    switch = SignalSwitch(plan, config)
    for _ in range(5):
        switch.advance()
    first = switch.state
    assert switch.request_phase(2 % len(plan.phases))
    waited = 0
    while switch.green_time == 0 and waited < 60:
        switch.advance()
        waited += 1
    walked = [k for k, letter in enumerate(first) if plan.is_crossing[k] and letter in GREEN]
    cut = [k for k in walked if switch.state[k] not in GREEN]
    assert not cut or waited >= max(plan.clearance[k] for k in cut)


@pytest.mark.parametrize(
    ("states", "rule"),
    [
        ((("GGrrrrGGrrrr", 20), ("rrGrrrrrGrrr", 9)), "skipped_yellow"),
        ((("GGrrrrGGrrrr", 5), ("yyrrrryyrrrr", 2), ("rrGrrrrrGrrr", 20)), "short_green"),
        ((("GGrrrrGGrrrr", 20), ("yyrrrryyrrrr", 1), ("rrGrrrrrGrrr", 20)), "short_yellow"),
        ((("GGrGGrGGrGGr", 20),), "conflict"),
        ((("GGrrrrGG", 20),), "unknown_state"),
        ((("GGrrrrGGrrrr", 70),), "long_green"),
        ((("gGrrrrgGrrrr", 20), ("yyrrrryyrrrr", 2), ("rrGrrrrrGrrr", 61)), "long_green"),
    ],
)
def test_watch_counts_what_breaks_a_rule(states: tuple[tuple[str, int], ...], rule: str) -> None:
    config = SignalConfig(max_green=60)
    (plan,) = plans("2way-single-intersection-single-intersection", config)
    log, time = SafetyLog(), 0.0
    watch = SignalWatch(plan, config, log, time=time)
    for state, seconds in states:
        watch.look(time, state)
        time += seconds
        watch.look_back(time)
    assert set(log.counts) == {rule}


@pytest.mark.parametrize(
    "keywords",
    [
        {"min_green": 20, "max_green": 10},
        {"yellow_time": 0},
        {"yellow_time": "fast"},
        {"yellow_time": 2.5},
        {"action_mode": "fly"},
        {"program": "actuated"},
        {"min_green": float("nan")},
    ],
)
def test_contradictions_are_refused(keywords: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        SignalConfig(**keywords)  # type: ignore[arg-type]


def test_watch_counts_walkers_that_are_cut_off_and_greens_without_all_red() -> None:
    lax = SignalConfig(walking_speed=50.0)
    strict = SignalConfig(walking_speed=0.5, all_red=3)
    counted: set[str] = set()
    for careless, careful in zip(plans("cologne1+", lax), plans("cologne1+", strict), strict=True):
        log, switch = SafetyLog(), SignalSwitch(careless, lax)
        watch = SignalWatch(careful, strict, log, time=0.0)
        for second in range(400):
            watch.look(float(second), switch.state)
            switch.advance()
            switch.request_phase(switch.next_phase)
        counted |= set(log.counts)
    assert {"walker_cut_off", "short_red"} <= counted


def test_watch_counts_priority_before_walkers_are_across() -> None:
    """Left turns that yielded to the walkers get priority two seconds after these lost their green."""
    config = SignalConfig()
    (plan,) = plans("RiLSA1-rilsa1", config)
    log = SafetyLog()
    watch = SignalWatch(plan, config, log, time=0.0)
    for time, state in ((0, "rrrgGgrrrgGgGrGr"), (20, "rrrgygrrrgygrrrr"), (22, "rrrGrgrrrGrgrrrr")):
        watch.look(float(time), state)
    assert set(log.counts) == {"walker_cut_off"}


def test_walkers_of_both_directions_are_cleared_by_letters_of_their_own(
    network_path: Callable[[str], Path],
) -> None:
    """SUMO's second link index of a crossing: the way that leaves it is a link, too."""
    path = network_path("right_hand")
    text = path.read_text(encoding="utf-8")
    there = {c: int(k) for c, k in re.findall(r'to=":(c_c\d)".* linkIndex="(\d+)"', text)}
    first = len(re.findall(r'state="(\w+)"/>\n', text.partition("<phase ")[2])[0])
    back = {crossing: first + k for k, crossing in enumerate(there)}
    for crossing, index in back.items():
        text = re.sub(f'(from=":{crossing}" to=":c_w.*?") dir', rf'\1 tl="c" linkIndex="{index}" dir', text)
    letters = [there[crossing] for crossing in back]
    text = re.sub(
        r'(<phase .*state=")(\w+)"', lambda m: f'{m[1]}{m[2]}{"".join(m[2][k] for k in letters)}"', text
    )
    found, _ = read_network(text.encode(), path=path, name="w", sha256="")
    plan = build_plan(found, found.signals[0], SignalConfig())
    assert len(back) == 4
    for crossing, index in back.items():
        assert plan.is_crossing[index]
        assert plan.clearance[index] == plan.clearance[there[crossing]] > 5
        assert (plan.conflicts.foes[index] == plan.conflicts.foes[there[crossing]]).all()
        assert plan.conflicts.foes[index].any()


@pytest.mark.parametrize("phases", ["program", "computed"])
def test_walkers_with_a_signal_of_their_own_get_a_phase(
    phases: str, network_path: Callable[[str], Path]
) -> None:
    path = network_path("walkers_signal")
    found, _ = read_network(path.read_bytes(), path=path, name="w", sha256="")
    config = SignalConfig(phases=phases, min_green=5, all_red=1)
    plan = build_plan(found, found.signals[0], config)
    assert plan.phases == ("GGGGr", "rrrrG")
    log, states = drive(plan, config, lambda switch: switch.next_phase)
    assert not log.counts, log.first
    assert {"GGGGr", "yyyyr", "rrrrG"} <= set(states)
