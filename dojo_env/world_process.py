"""A world in a process of its own: libsumo holds one simulation per process, so this makes room for more.

Each episode runs in a fork of that process, so it is the same whatever came before it (see `forks`), and a
crash of SUMO ends the fork alone: the call that it happened in raises, and the next episode begins.

Every call has a number. What comes back over the pipe says which call it belongs to:

    caller                server, or its fork
      (7, "reset", ...) ->
                         <- (7, "answer", ...)   or (7, "error", ...)
      (8, "run", ...)   ->
                         <- (8, "second", snapshot), where somebody watches; it waits for a word back
      "seen"            ->
                         <- (8, "death", None) from the server, when the fork that call 8 began has died
"""

import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from multiprocessing.reduction import ForkingPickler
from types import ModuleType
from typing import Any, NamedTuple

from dojo_env.config import EnvConfig
from dojo_env.controllers import Controller
from dojo_env.errors import ConfigError, SimulationDiedError, SimulationError
from dojo_env.forks import CAN_FORK, call_in_fork, interrupts_taken, interrupts_wait, receive
from dojo_env.instant import Instant
from dojo_env.local_world import LocalWorld
from dojo_env.snapshot import Snapshot
from dojo_env.watching.views import Frame
from dojo_env.world import Answer, Beginning, Episode, World
from dojo_maps.errors import DojoError

_PATIENCE = 60.0
"""Seconds that a process gets to write what there is of its episode and to end."""
_BEGINNINGS = ("reset", "restore", "run")
"""What begins an episode."""
_SEEN = "seen"
_UNPICKLABLE = (pickle.PicklingError, AttributeError, TypeError)
_GO_ON = "call reset to begin another episode"
_GUARD = (
    "the simulation's process has died at its start. It reads the script again, for a function of yours: put "
    'that into a module, or all other lines of the script under `if __name__ == "__main__":`'
)


class _Call(NamedTuple):
    """What is asked, by its name in `World`."""

    number: int
    name: str
    arguments: tuple[Any, ...] = ()


_CLOSE = _Call(0, "close")
_one_starts = threading.Lock()
"""What a start changes for a moment is the whole process's: threads start one after the other."""


class _CallerGoneError(Exception):
    """Whoever watches an episode wants something else, or is gone; holds the call that came instead."""


def open_world(config: EnvConfig, *, own_process: bool) -> World:
    """Open a world here, or in a process of its own.

    Args:
        config: all settings.
        own_process: whether it gets one.

    Returns:
        The world; `close` it.

    Raises:
        ConfigError: a setting cannot work.
        SourceError: a file of the scenario cannot be read.
    """
    return WorldProcess(config) if own_process else LocalWorld(config)


class WorldProcess(World):
    """Stands in for a `LocalWorld` and hands every call on to its process."""

    def __init__(self, config: EnvConfig) -> None:
        """Start the process; it opens the map.

        Args:
            config: all settings.

        Raises:
            ConfigError: it cannot get a setting, such as a lambda.
            SimulationError: it ends before that, as it does when it needs a script that has no guard.
        """
        self._config = config
        self._process: SpawnProcess | None = None
        self._number = self._beginning = self._episodes = 0
        self._on_second: Callable[[Snapshot], None] | None = None
        self.signals: tuple[str, ...] = self._open()

    def _open(self) -> tuple[str, ...]:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._number = self._beginning = 0
        self._process = context.Process(
            target=_serve, args=(theirs, self._config, self._episodes), daemon=True
        )
        try:
            start_process(self._process, self._config)
            theirs.close()
            signals: tuple[str, ...] = self._receive(SimulationError(_GUARD))
            if self._on_second is not None:
                self._call("watch")
        except BaseException:
            self.close()
            raise
        return signals

    @property
    def instant(self) -> Instant:
        """See `World`; it holds all that can be asked of it."""
        found: Instant = self._call("instant")
        return found

    def spaces(self) -> Any:
        """See `World`."""
        return self._call("spaces")

    def reset(self, seed: int) -> Beginning:
        """See `World`."""
        found: Beginning = self._begin("reset", seed)
        return found

    def step(self, actions: Mapping[str, int]) -> Answer:
        """See `World`."""
        found: Answer = self._call("step", dict(actions))
        return found

    def run(self, controller: Controller, seed: int) -> Episode:
        """See `World`."""
        found: Episode = self._begin("run", controller, seed)
        return found

    def watch(self, on_second: Callable[[Snapshot], None]) -> None:
        """See `World`; the function is called here, while the process waits."""
        self._on_second = on_second
        self._call("watch")

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

    def restore(self, state: Mapping[str, Any]) -> Beginning:
        """See `World`."""
        found: Beginning = self._begin("restore", dict(state))
        return found

    def close(self) -> None:
        """See `World`; the process ends."""
        if self._process is None:
            return
        process, self._process = self._process, None
        failure = self._ask_to_close() if process.pid is not None else None
        self._pipe.close()
        if process.pid is not None:
            process.join(_PATIENCE)
        if process.is_alive():
            process.kill()
            process.join()
        if failure is not None:
            raise failure

    def _ask_to_close(self) -> Exception | None:
        """Tell the process to end; returns what kept it from writing the rest of its episode."""
        self._number += 1
        end = time.monotonic() + _PATIENCE
        with contextlib.suppress(EOFError, OSError):
            self._pipe.send(_Call(self._number, "close"))
            while self._pipe.poll(max(0.0, end - time.monotonic())):
                number, kind, value = self._pipe.recv()
                if number == self._number:
                    return value if kind == "error" else None
        return None

    def _begin(self, name: str, *arguments: Any) -> Any:
        """Begin an episode, in a new process where the last one has died."""
        if self._process is not None and not self._process.is_alive():
            self.close()
            self._open()
        self._episodes += 1
        self._beginning = self._number + 1
        return self._call(name, *arguments)

    def _call(self, name: str, *arguments: Any) -> Any:
        if self._process is None:
            raise SimulationError("the environment is closed; make a new one")
        self._number += 1
        died = SimulationDiedError(f"the simulation's process has died; {_GO_ON}")
        try:
            self._pipe.send(_Call(self._number, name, arguments))
        except OSError as error:
            raise died from error
        return self._receive(died)

    def _receive(self, died: SimulationError) -> Any:
        """Wait for the answer to the last call; `died` is raised where there will be none."""
        try:
            while True:
                try:
                    number, kind, value = self._pipe.recv()
                except (EOFError, OSError) as problem:
                    raise died from problem
                if kind == "second" and self._on_second is not None:
                    self._on_second(value)
                    self._pipe.send(_SEEN)
                elif kind == "death" and number == self._beginning:
                    raise SimulationDiedError(f"{value}; {_GO_ON}")
                elif number == self._number and kind == "error":
                    raise value
                elif number == self._number and kind == "answer":
                    return value
        except KeyboardInterrupt:
            self._interrupt()
            raise

    def _interrupt(self) -> None:
        """Close at once, but let it write what there is of the episode."""
        if self._process is not None and self._process.pid is not None:
            os.kill(self._process.pid, signal.SIGINT)
        self.close()


def start_process(process: SpawnProcess, sent: Any) -> None:
    """Start a process that reads this one's script only where what is sent names something of it.

    So a script needs no guard against being read twice, and what it imports is not imported again.

    Args:
        process: to start.
        sent: the settings that it gets.

    Raises:
        ConfigError: the settings cannot be pickled.
    """
    try:
        pickled = bytes(ForkingPickler.dumps(sent))
    except _UNPICKLABLE as error:
        raise ConfigError(
            f"the settings cannot be handed to a process of its own ({error}); give functions that a module "
            "defines by name, not lambdas or local ones"
        ) from error
    with _one_starts:
        script = sys.modules["__main__"]
        if b"__main__" not in pickled:
            sys.modules["__main__"] = ModuleType("__main__")
        try:
            with interrupts_wait(), _children_allowed():
                process.start()
        finally:
            sys.modules["__main__"] = script


@contextlib.contextmanager
def _children_allowed() -> Iterator[None]:
    """Let a daemonic process, such as a worker of Gymnasium's AsyncVectorEnv, have a child.

    multiprocessing forbids it, since such a process may be killed and leave its children behind. Ours end by
    themselves once nobody holds the other end of their pipe.
    """
    settings: dict[str, Any] = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    before = settings.pop("daemon", None)
    try:
        yield
    finally:
        if before is not None:
            settings["daemon"] = before


def _serve(pipe: Connection, config: EnvConfig, episodes: int) -> None:
    """Answer calls until told to close, or until the other end is gone; forks answer for their episodes."""
    with contextlib.suppress(KeyboardInterrupt, OSError), interrupts_taken():
        try:
            world = LocalWorld(config)
        except Exception as error:  # noqa: BLE001 - it is raised at the other end
            pipe.send((0, "error", portable(error)))
            return
        world.lasting = (episodes, world.lasting[1])
        world.traffic.simulation.has_stderr = True
        with contextlib.suppress(OSError):  # It may have none.
            sys.stderr = open(os.dup(2), "w", buffering=1, errors="backslashreplace")  # noqa: PTH123, SIM115
        with closing(world):
            pipe.send((0, "answer", world.signals))
            _answer_calls(world, pipe)


def _answer_calls(world: LocalWorld, pipe: Connection) -> None:
    call, is_prepared = _receive_call(pipe), False
    while call.name != "close":
        if not is_prepared and call.name in (*_BEGINNINGS, "watch"):
            with contextlib.suppress(Exception):  # What fails, the episode will tell.
                world.prepare()
            is_prepared = True
        if call.name in _BEGINNINGS:
            call = _run_in_fork(world, pipe, call)
        else:
            _send_answer(world, pipe, call)
            call = _receive_call(pipe)
    _send_answer(world, pipe, call)


def _run_in_fork(world: LocalWorld, pipe: Connection, call: _Call) -> _Call:
    """Let a fork answer for an episode; returns the call that follows."""
    episode, label = world.lasting
    try:
        following, world.lasting, failure = call_in_fork(_run_episode, world, pipe, call)
    except SimulationDiedError as died:
        world.lasting = (episode + 1, label)
        pipe.send((call.number, "death", str(died)))
        return _receive_call(pipe)
    if failure is None:
        return following
    pipe.send((following.number, "error", failure))
    return _CLOSE if following.name == "close" else _receive_call(pipe)


def _run_episode(world: LocalWorld, pipe: Connection, call: _Call) -> tuple[_Call, Any, Exception | None]:
    """Answer until the next episode is to begin, or none.

    Returns:
        That call, what is left to it, and what kept the episode from being written.
    """
    failure = None
    try:
        while True:
            _send_answer(world, pipe, call)
            call = _receive_call(pipe)
            if call.name in (*_BEGINNINGS, "close"):
                break
    except _CallerGoneError as gone:
        (call,) = gone.args
    finally:
        if CAN_FORK:  # Nobody else can: it writes what there is of the episode.
            failure = _close(world)
    return call, world.lasting, failure


def _close(world: LocalWorld) -> Exception | None:
    try:
        world.close()
    except Exception as error:  # noqa: BLE001 - it is raised at the other end
        return portable(error)
    return None


def _send_answer(world: LocalWorld, pipe: Connection, call: _Call) -> None:
    try:
        arguments = (partial(_show_second, pipe),) if call.name == "watch" else call.arguments
        found = getattr(world, call.name)
        answer = found(*arguments) if callable(found) else found
        sent = bytes(ForkingPickler.dumps((call.number, "answer", answer)))
    except _CallerGoneError:
        raise
    except Exception as error:  # noqa: BLE001 - it is raised at the other end
        pipe.send((call.number, "error", portable(error)))
    else:
        pipe.send_bytes(sent)


def _show_second(pipe: Connection, snapshot: Snapshot) -> None:
    """Show a second to who watches, and wait until that is done."""
    try:
        pipe.send((0, "second", snapshot))
        word = pipe.recv()
    except (EOFError, OSError) as error:
        raise _CallerGoneError(_CLOSE) from error
    if word != _SEEN:
        raise _CallerGoneError(_Call(*word))


def portable(error: Exception) -> Exception:
    """Make an error fit for a pipe: with where it was raised, if that is not our own, and always readable.

    Args:
        error: any.

    Returns:
        The same, or one that says the same.
    """
    if not isinstance(error, DojoError):
        error.add_note("In the simulation's process:\n" + "".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - we have just made it
    except Exception:  # noqa: BLE001 - a class may do anything here
        return SimulationError(f"{type(error).__name__}: {error}")
    return error


def _receive_call(pipe: Connection) -> _Call:
    """Wait for a call; who is gone wants us to close. A word for a fork that has died is nobody's."""
    while (word := receive(pipe, _CLOSE)) == _SEEN:
        pass
    return _Call(*word)
