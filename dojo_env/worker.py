"""A world in a process of its own: libsumo holds one simulation per process, so this makes room for more.

Each episode runs in a fork of that process, so it is the same whatever came before it; see `forks`.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Mapping
from contextlib import closing
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from multiprocessing.reduction import ForkingPickler
from pickle import PicklingError
from types import ModuleType
from typing import Any

from dojo_env.config import EnvConfig
from dojo_env.controllers import Controller
from dojo_env.errors import ConfigError, SimulationError
from dojo_env.forks import (
    CAN_FORK,
    Call,
    call_in_fork,
    interrupts_taken,
    interrupts_wait,
    receive_call,
)
from dojo_env.watching.views import Frame
from dojo_env.world import Answer, Episode, World

_PATIENCE = 10.0
"""Seconds that a process gets to end by itself."""
_BEGINNINGS = ("reset", "restore", "run")
"""What begins an episode."""
_DIED = "the simulation's process has died; make a new environment"


def open_world(config: EnvConfig, *, own_process: bool) -> Any:
    """Open a world here, or in a process of its own."""
    return WorldProcess(config) if own_process else World(config)


class WorldProcess:
    """Stands in for a world and hands every call on to its process."""

    def __init__(self, config: EnvConfig) -> None:
        """Start the process; it opens the map.

        Raises:
            ConfigError: it cannot get a setting, such as a lambda.
            SimulationError: it ends before that, as it does when it needs a script that has no guard.
        """
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process: SpawnProcess | None = context.Process(
            target=_serve, args=(theirs, config), daemon=True
        )
        _start(self._process, config)
        theirs.close()
        try:
            self.signals: tuple[str, ...] = self._receive(
                "the simulation's process has died at its start; a script whose functions an environment in "
                'a process of its own needs opens it under `if __name__ == "__main__":`'
            )
        except BaseException:
            self.close()
            raise

    def spaces(self) -> Any:
        """See `World`."""
        return self._call("spaces")

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `World`."""
        found: tuple[dict[str, Any], dict[str, Any]] = self._call("reset", seed)
        return found

    def step(self, actions: Mapping[str, int]) -> Answer:
        """See `World`."""
        found: Answer = self._call("step", dict(actions))
        return found

    def run(self, controller: Controller, seed: int) -> Episode:
        """See `World`."""
        found: Episode = self._call("run", controller, seed)
        return found

    def draw(self, signal: str | None = None) -> Frame:
        """See `World`."""
        found: Frame = self._call("draw", signal)
        return found

    def metrics(self) -> dict[str, Any]:
        """See `World`."""
        found: dict[str, Any] = self._call("metrics")
        return found

    def save(self) -> dict[str, Any]:
        """See `World`."""
        found: dict[str, Any] = self._call("save")
        return found

    def restore(self, state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `World`."""
        found: tuple[dict[str, Any], dict[str, Any]] = self._call("restore", dict(state))
        return found

    def close(self) -> None:
        """End the process; safe at any time."""
        if self._process is None:
            return
        process, self._process = self._process, None
        with contextlib.suppress(OSError):
            self._pipe.send(("close", ()))
        self._pipe.close()
        process.join(_PATIENCE)
        if process.is_alive():
            process.kill()
            process.join()

    def _interrupt(self) -> None:
        """Close at once, but let it write what there is of the episode."""
        if self._process is not None and self._process.pid is not None:
            os.kill(self._process.pid, signal.SIGINT)
        self.close()

    def _call(self, name: str, *arguments: Any) -> Any:
        if self._process is None:
            raise SimulationError("the environment is closed; make a new one")
        try:
            self._pipe.send((name, arguments))
        except OSError as error:
            raise SimulationError(_DIED) from error
        return self._receive(_DIED)

    def _receive(self, died: str) -> Any:
        try:
            error, value = self._pipe.recv()
        except (EOFError, OSError) as problem:
            raise SimulationError(died) from problem
        except KeyboardInterrupt:
            self._interrupt()
            raise
        if error is not None:
            raise error
        return value


def _start(process: SpawnProcess, config: EnvConfig) -> None:
    """Start a process that reads this one's script only where the settings name something of it.

    So a script needs no guard against being read twice, and what it imports is not imported again.
    """
    script = sys.modules["__main__"]
    try:
        sent = bytes(ForkingPickler.dumps(config))
    except (PicklingError, AttributeError, TypeError) as error:
        raise ConfigError(
            f"the settings cannot be handed to a process of its own ({error}); give functions that a module "
            "defines by name, not lambdas or local ones"
        ) from error
    if b"__main__" not in sent:
        sys.modules["__main__"] = ModuleType("__main__")
    try:
        with interrupts_wait():
            process.start()
    finally:
        sys.modules["__main__"] = script


def _answer(world: World, name: str, arguments: tuple[Any, ...]) -> tuple[Exception | None, Any]:
    try:
        return None, getattr(world, name)(*arguments)
    except Exception as error:  # noqa: BLE001 - it is raised at the other end
        return error, None


def _serve(pipe: Connection, config: EnvConfig) -> None:
    """Answer calls until told to close, or until the other end is gone; forks answer for their episodes."""
    with contextlib.suppress(KeyboardInterrupt, SimulationError), interrupts_taken():
        try:
            world = World(config)
        except Exception as error:  # noqa: BLE001 - it is raised at the other end
            pipe.send((error, None))
            return
        with closing(world):
            pipe.send((None, world.signals))
            _answer_calls(world, pipe)


def _answer_calls(world: World, pipe: Connection) -> None:
    call, is_prepared = receive_call(pipe), False
    while call[0] != "close":
        if call[0] not in _BEGINNINGS:
            pipe.send(_answer(world, *call))
            call = receive_call(pipe)
            continue
        if not is_prepared:
            _answer(world, "prepare", ())  # What fails, the episode will tell.
            is_prepared = True
        call, world.lasting = call_in_fork(_run_episode, world, pipe, call)


def _run_episode(world: World, pipe: Connection, call: Call) -> tuple[Call, Any]:
    """Answer until the next episode is to begin, or none; returns that call, and what is left to it."""
    try:
        while True:
            pipe.send(_answer(world, *call))
            call = receive_call(pipe)
            if call[0] in (*_BEGINNINGS, "close"):
                break
    finally:
        if CAN_FORK:
            world.close()  # Nobody else can: it writes what there is of the episode.
    return call, world.lasting
