"""Environments in processes of their own, each episode in a fork of its environment's process.

So an episode depends on its seed and the policy alone, and a run that was interrupted between two episodes
goes on to the same result.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any

from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from dojo_env.errors import SimulationError
from dojo_env.forks import call_in_fork, receive
from dojo_env.learning.seeded_episodes import SeededEpisodes

LOADED_ONCE = ["stable_baselines3", "libsumo", "dojo_env.parallel", "dojo_env.sensor_observations"]
"""What takes seconds to import; processes are forks of one that has."""
_CLOSE = ("close", None)
_PIECE = 1 << 16
"""Bytes that are read at once of an answer that nobody waits for."""


class Processes(SubprocVecEnv):
    """An environment per process, for Stable-Baselines3; each makes a `SeededEpisodes`."""

    def __init__(self, makers: Sequence[Callable[[], Any]]) -> None:
        """Start the processes.

        Raises:
            SimulationError: one ends at its start.
        """
        multiprocessing.set_forkserver_preload(LOADED_ONCE)
        context = multiprocessing.get_context("forkserver")
        self.waiting = self.closed = False
        self.remotes, ends = zip(*(context.Pipe() for _ in makers), strict=True)
        self.processes = [
            context.Process(target=_serve, args=(end, make), daemon=True)
            for end, make in zip(ends, makers, strict=True)
        ]
        with _own_modules():
            for process, end in zip(self.processes, ends, strict=True):
                process.start()
                end.close()
        with _deaths_told():
            spaces = [remote.recv() for remote in self.remotes]
        VecEnv.__init__(self, len(makers), *spaces[0])

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:  # noqa: ARG002
        """Tell what Stable-Baselines3 asks for: nothing is shown.

        Args:
            attr_name: `render_mode`; the processes answer for no other attribute.
            indices: has no effect: all environments are alike.

        Returns:
            None for each environment.

        Raises:
            AttributeError: something else is asked for.
        """
        if attr_name != "render_mode":
            raise AttributeError(attr_name)
        return [None] * self.num_envs

    def reset(self) -> Any:
        """Begin the next episode everywhere."""
        with _deaths_told():
            return super().reset()

    def step_wait(self) -> Any:
        """Collect what came of the actions."""
        with _deaths_told():
            return super().step_wait()

    def close(self) -> None:
        """Let each finish what it does, and end.

        Where a step was interrupted, Stable-Baselines3 waits for an answer of each; of one that has answered
        already it waits forever.
        """
        if self.closed:
            return
        for remote in self.remotes:
            with contextlib.suppress(BrokenPipeError):
                remote.send(("close", None))
        for remote, process in zip(self.remotes, self.processes, strict=True):
            # As bytes: an answer may have been read in part.
            with contextlib.suppress(ConnectionResetError):
                while os.read(remote.fileno(), _PIECE):
                    pass
            process.join()
            remote.close()
        self.closed = True


@contextlib.contextmanager
def _own_modules() -> Iterator[None]:
    """Let the process that forks find modules where this one does, not in the present folder first."""
    ours = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "PYTHONSAFEPATH": "1"}
    before = {name: os.environ.get(name) for name in ours}
    os.environ |= ours
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _deaths_told() -> Iterator[None]:
    try:
        yield
    except (EOFError, ConnectionResetError, BrokenPipeError) as error:
        raise SimulationError("an environment's process has ended; its words are above") from error


def _serve(pipe: Connection, make: Callable[[], SeededEpisodes]) -> None:
    """Answer as Stable-Baselines3's processes do. Once it is prepared, this one only waits for its forks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the learner, which closes us.
    env = make()
    env.prepare()
    pipe.send((env.observation_space, env.action_space))
    (command, _), ended, number = receive(pipe, _CLOSE), None, 0
    while command == "reset":
        command, ended = call_in_fork(_run_episode, env, number, pipe, ended)
        number += 1


def _run_episode(env: SeededEpisodes, number: int, pipe: Connection, ended: Any) -> tuple[str, Any]:
    """Run an episode; its first observation is the answer to the last one's end.

    Returns:
        What is wanted next, and how this episode ended if it came to its end: reward, True, info.
    """
    env.episode = number
    seen, told = env.reset()
    pipe.send((seen, told) if ended is None else (seen, *ended, told))
    while True:
        command, action = receive(pipe, _CLOSE)
        if command != "step":
            return command, None
        seen, reward, _, is_over, info = env.step(action)
        info["TimeLimit.truncated"] = is_over
        if is_over:
            info["terminal_observation"] = seen
            return "reset", (reward, True, info)
        pipe.send((seen, reward, False, info, {}))
