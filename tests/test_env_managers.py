"""The five hooks run in the managers' order, once each where they should, and close runs in reverse."""

import pytest

from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld
from dojo_env.managers.base import Manager, Turn

HOOKS = ("before_reset", "reset", "before_step", "step", "after_step")


class Witness(Manager):
    """Notes every call."""

    def __init__(self, name: str, calls: list[tuple[str, str]], *, fails: bool = False) -> None:
        self.name, self.calls, self.fails = name, calls, fails

    def __getattribute__(self, hook: str):
        if hook not in (*HOOKS, "close"):
            return super().__getattribute__(hook)

        def note(*_turn: Turn) -> None:
            self.calls.append((hook, self.name))
            if hook == "close" and self.fails:
                raise RuntimeError(self.name)

        return note

    def step(self, turn: Turn) -> None: ...


def test_hooks_run_in_order_and_as_often_as_promised() -> None:
    calls: list[tuple[str, str]] = []
    world = LocalWorld(build_config(scenario="two-way", num_seconds=10))
    world.managers = (Witness("first", calls), *world.managers, Witness("last", calls))
    world.reset(1)
    world.step({"t": 0})
    world.close()
    expected = ["before_reset", "reset", "before_step", *["step"] * 5, "after_step"]
    assert calls == [
        *((hook, name) for hook in expected for name in ("first", "last")),
        ("close", "last"),
        ("close", "first"),
    ]


def test_close_reaches_every_manager_after_a_failure() -> None:
    calls: list[tuple[str, str]] = []
    world = LocalWorld(build_config(scenario="two-way"))
    world.reset(1)
    world.managers = (*world.managers, Witness("last", calls, fails=True))
    with pytest.raises(RuntimeError, match="last"):
        world.close()
    assert not world.traffic.simulation.is_running


def test_hooks_of_the_base_do_nothing_and_are_called_alike() -> None:
    manager, turn = Manager(), Turn(seed=0, episode=1)
    assert [getattr(manager, hook)(turn) for hook in HOOKS] == [None] * 5
