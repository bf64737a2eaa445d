"""The proof: real rules hold on every map, broken ones are caught, and what it collapses changes nothing."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import networks
import numpy as np
import pytest
from commands import run_tool
from test_env_signals import plans

from dojo_env.cli import main
from dojo_env.config import ACTION_MODES, SignalConfig
from dojo_env.scenario import PACKAGED
from dojo_env.signals import proof
from dojo_env.signals.plan import SignalPlan, build_plan
from dojo_env.signals.proof import Counterexample, prove
from dojo_env.signals.switching import SignalSwitch, Stage, SwitchState
from dojo_maps.sources.sumo_net import read_network

TWO_WAY = "2way-single-intersection-single-intersection"
WITH_CROSSINGS = ("cologne1+", "ingolstadt1+", "RiLSA1-rilsa1", "hiking", "fkk_in-ingolstadt")
SETTINGS = (
    {},
    {"all_red": 2, "min_green": 1, "max_green": 12},
    {"yellow_time": "speed", "min_green": 5, "max_green": 15, "walking_speed": 0.5},
    {"yellow_time": 1, "min_green": 1, "walking_speed": 0.8, "max_green": 3, "all_red": 4},
    {"phases": "computed", "min_green": 1, "all_red": 1, "walking_speed": 0.8, "max_green": 10},
)


def prove_all(found: list[SignalPlan], **settings: object) -> int:
    """Prove plans in every action mode; returns how many states they have."""
    states = 0
    for mode in ACTION_MODES:
        # Every pair of a green's age and its end is a state.
        longest = {"max_green": 15} if mode == "set_duration" else {}
        config = SignalConfig(action_mode=mode, **{**longest, **settings})
        for one in (prove(plan, config) for plan in found):
            assert not one.counterexamples, f"{one.signal}, {mode}: {one.counterexamples[0]}"
            states += one.states
    return states


@pytest.mark.sampled(6)
@pytest.mark.parametrize("name", [TWO_WAY if name == "two-way" else name for name in PACKAGED])
@pytest.mark.parametrize("phases", ["program", "computed"])
def test_packaged_scenarios_are_proved(name: str, phases: str) -> None:
    assert prove_all(plans(name, SignalConfig(phases=phases)), phases=phases) > 100


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", WITH_CROSSINGS)
@pytest.mark.parametrize("settings", SETTINGS)
def test_maps_with_crossings_are_proved(name: str, settings: dict[str, object]) -> None:
    found = plans(name, SignalConfig(**settings))
    assert any(plan.clearance.any() for plan in found)
    assert prove_all(found, **settings) > 100


@pytest.mark.slow
@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", ["six_legs", "left_hand", "mixed_lanes", "two_programs", "walkers_signal"])
def test_built_networks_are_proved(name: str, network_path: Callable[[str], Path]) -> None:
    path = network_path(name)
    found, _ = read_network(path.read_bytes(), path=path, name=name, sha256="")
    for settings in SETTINGS[1:]:
        config = SignalConfig(**settings)
        prove_all([build_plan(found, signal, config) for signal in found.signals], **settings)


class SkippedYellow(SignalSwitch):
    def _enter(
        self, phase: int, stages: tuple[Stage, ...], walk_ended: tuple[tuple[int, float], ...]
    ) -> SwitchState:
        return super()._enter(phase, tuple(s for s in stages if "y" not in s[1]), walk_ended)


class ShortYellow(SignalSwitch):
    def _enter(
        self, phase: int, stages: tuple[Stage, ...], walk_ended: tuple[tuple[int, float], ...]
    ) -> SwitchState:
        state = super()._enter(phase, stages, walk_ended)
        return replace(state, due=state.due - 1) if "y" in state.letters else state


class YellowTakenBack(SignalSwitch):
    def request_phase(self, phase: int) -> bool:
        if "y" in self.state:
            self.now = self._green(phase, self.now.walk_ended)
        return super().request_phase(phase)


class ShortGreen(SignalSwitch):
    @property
    def may_change(self) -> bool:
        return not self.now.stages and self.green_time >= self._config.min_green - 1


class ShortGreenAfterDuration(SignalSwitch):
    def request_duration(self, seconds: float) -> None:
        self.now = replace(self.now, due=min(self.now.due, self.now.green_since + seconds - 1))


class LongGreen(SignalSwitch):
    def _green(self, phase: int, walk_ended: tuple[tuple[int, float], ...]) -> SwitchState:
        state = super()._green(phase, walk_ended)
        return replace(state, due=state.due + 1)


class NoAllRed(SignalSwitch):
    def __init__(self, plan: SignalPlan, config: SignalConfig) -> None:
        super().__init__(plan, replace(config, all_red=0))


class NoClearance(SignalSwitch):
    def _walking_time(self, gained: list[int], walk_ended: dict[int, float]) -> float:
        return min(0.0, super()._walking_time(gained, walk_ended))


class ShortClearance(SignalSwitch):
    def _walking_time(self, gained: list[int], walk_ended: dict[int, float]) -> float:
        return super()._walking_time(gained, walk_ended) - 1


class OnlyTheLastWalk(SignalSwitch):
    def _begin_change(self, phase: int) -> None:
        self.now = replace(self.now, walk_ended=())
        super()._begin_change(phase)


class PriorityAtOnce(SignalSwitch):
    def _walking_time(self, gained: list[int], walk_ended: dict[int, float]) -> float:
        turned = [link for link in gained if self.now.letters[link] not in "Gg"]
        return super()._walking_time(turned, walk_ended)


class SuddenYield(SignalSwitch):
    def _list_yielding(self, new: str, gained: list[int]) -> list[int]:
        return super()._list_yielding(new, gained)[:0]


class BlindToSharedLinks(SignalSwitch):
    def __init__(self, plan: SignalPlan, config: SignalConfig) -> None:
        super().__init__(replace(plan, clearance=plan.clearance * plan.is_crossing), config)


BROKEN = (
    (SkippedYellow, TWO_WAY, {}, "skipped_yellow"),
    (ShortYellow, TWO_WAY, {}, "short_yellow"),
    (YellowTakenBack, TWO_WAY, {}, "short_yellow"),
    (ShortGreen, TWO_WAY, {}, "short_green"),
    (ShortGreenAfterDuration, TWO_WAY, {"action_mode": "set_duration", "max_green": 15}, "short_green"),
    (LongGreen, TWO_WAY, {"max_green": 20}, "long_green"),
    (NoAllRed, TWO_WAY, {"all_red": 2}, "short_red"),
    (SuddenYield, "cologne1", {}, "sudden_yield"),
    (NoClearance, "cologne1+", {}, "walker_cut_off"),
    (ShortClearance, "cologne1+", {}, "walker_cut_off"),
    (PriorityAtOnce, "RiLSA1-rilsa1", {}, "walker_cut_off"),
    (BlindToSharedLinks, "fkk_in-ingolstadt", {}, "walker_cut_off"),
)


@pytest.mark.parametrize(("switch", "name", "settings", "rule"), BROKEN)
def test_broken_rules_are_caught(
    switch: type[SignalSwitch], name: str, settings: dict[str, object], rule: str
) -> None:
    config = SignalConfig(**settings)
    plan = plans(name, config)[-1]
    assert not prove(plan, config).counterexamples
    caught = {example.rule: example for example in prove(plan, config, switch).counterexamples}
    assert rule in caught
    replay(caught[rule], switch(plan, config))


def test_forgetting_a_walk_that_ended_two_phases_ago_is_caught() -> None:
    """Vehicles go on alone for a second, and then come the walkers' foes."""
    config = SignalConfig(min_green=1)
    (plan,) = plans("cologne1+", config)
    alone = "".join("r" if walks else a for a, walks in zip(plan.phases[0], plan.is_crossing, strict=True))
    plan = replace(plan, phases=(plan.phases[0], alone, *plan.phases[1:]))
    assert not prove(plan, config).counterexamples
    (example,) = prove(plan, config, OnlyTheLastWalk).counterexamples
    assert example.rule == "walker_cut_off"
    assert next(words for words, _ in example.seconds if words) == "phase 1"
    replay(example, OnlyTheLastWalk(plan, config))


def replay(example: Counterexample, switch: SignalSwitch) -> None:
    """Ask a switch that runs from the begin, as in an episode: it shows what the counterexample says."""
    for words, letters in example.seconds:
        kind, _, number = words.partition(" ")
        if kind == "phase":
            switch.request_phase(int(number))
        elif number:
            switch.request_duration(int(kind))
        assert switch.state == letters
        switch.advance()


def test_a_counterexample_is_the_shortest_and_reads_like_a_table() -> None:
    config = SignalConfig()
    (plan,) = plans(TWO_WAY, config)
    (example,) = prove(plan, config, SkippedYellow).counterexamples
    assert str(example) == (
        "skipped_yellow at second 10, link 0:\n        0-9  GGrrrrGGrrrr\n         10  rrGrrrrrGrrr  phase 1"
    )


def test_conflicting_greens_are_caught() -> None:
    config = SignalConfig()
    (plan,) = plans("cologne1", config)
    both = "".join("G" if "G" in letters else "r" for letters in zip(*plan.phases[:2], strict=True))
    unsafe = replace(plan, phases=(plan.phases[0], both, *plan.phases[2:]))
    example = next(e for e in prove(unsafe, config).counterexamples if e.rule == "conflict")
    assert example.seconds[-1][1] == both
    assert plan.conflicts.foes[example.links]


def test_permissive_greens_need_the_right_of_way_of_the_network() -> None:
    config = SignalConfig()
    (plan,) = plans("cologne1", config)
    nobody = replace(plan.conflicts, yields=np.zeros_like(plan.conflicts.yields))
    assert prove(replace(plan, conflicts=nobody), config).counterexamples[0].rule == "conflict"


@pytest.mark.parametrize("mode", ["choose_phase", "set_duration"])
@pytest.mark.parametrize("name", ["cologne1+", "hiking", "fkk_in-ingolstadt"])
def test_times_measured_from_now_change_nothing(name: str, mode: str) -> None:
    """A switch whose state is collapsed after every second shows the letters of one that runs on."""
    config = SignalConfig(action_mode=mode, min_green=2, all_red=1, max_green=9, walking_speed=0.5)
    draw = np.random.default_rng(3)
    for plan in plans(name, config):
        running, collapsed = SignalSwitch(plan, config), SignalSwitch(plan, config)
        seen: set[SwitchState] = set()
        for phase, seconds in draw.integers(-2, (len(plan.phases), 12), (4000, 2)).tolist():
            for switch in (running, collapsed):
                if mode == "set_duration":
                    switch.request_duration(seconds)
                elif phase >= 0:
                    switch.request_phase(phase)
            assert running.state == collapsed.state
            assert running.advance() == collapsed.advance()
            collapsed.now, collapsed.clock = proof._measure_from_now(collapsed, plan, config), 0.0
            seen.add(collapsed.now)
        assert len(seen) < 2000


def test_more_states_than_memory_holds_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "_MOST", 100)
    config = SignalConfig()
    (plan,) = plans(TWO_WAY, config)
    with pytest.raises(proof.ConfigError, match="too many to visit"):
        prove(plan, config)


def test_the_command_proves_scenarios_and_bare_networks(
    capsys: pytest.CaptureFixture[str], network_path: Callable[[str], Path]
) -> None:
    assert main(["prove", "cologne1", "--all-red", "2", "--yellow", "speed", "--max-green", "20"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("cologne1: 1 of 1 signal proved in every action mode, ")
    path = network_path("right_hand")
    assert main(["prove", str(path), "--signals", "c", "--phases", "computed", "--max-green", "20"]) == 0
    _, row, _ = capsys.readouterr().out.splitlines()
    assert row.split()[0] == "proved"
    assert row.split()[-1] == "c"


def test_the_command_ends_with_1_where_a_rule_is_broken(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, network_path: Callable[[str], Path]
) -> None:
    monkeypatch.setattr(SignalSwitch, "_walking_time", lambda *_: 0.0)
    assert main(["prove", str(network_path("right_hand")), "--max-green", "20"]) == 1
    out = capsys.readouterr().out
    assert "VIOLATED" in out
    assert "choose_phase: walker_cut_off at second " in out
    assert "0 of 1 signal proved" in out


@pytest.mark.parametrize(
    "arguments", [["nowhere"], ["cologne1", "--signals", "x"], ["cologne1", "--max-green", "2"]]
)
def test_the_command_refuses_in_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.slow
def test_an_independent_judge_finds_nothing_in_what_sumo_shows() -> None:
    found = networks.installed_networks()
    maps = ("cologne3", "arterial4x4", found["RiLSA1-rilsa1"], found["fkk_in-ingolstadt"])
    done = run_tool("judge_signals", "--actions", 20_000, "--maps", *maps)
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[-1].endswith(" actions, 0 violations")


def test_the_independent_judge_sees_broken_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SignalSwitch, "_walking_time", lambda *_: 0.0)
    monkeypatch.setattr(SignalSwitch, "may_change", ShortGreen.may_change)
    path = networks.installed_networks()["RiLSA1-rilsa1"]
    done = run_tool("judge_signals", "--actions", 5000, "--maps", path)
    assert done.returncode == 1
    assert "short_green" in done.stdout
    assert "walker_cut_off" in done.stdout
