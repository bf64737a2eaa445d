"""The recording of the episode: a snapshot of every simulated second, in one file."""

from pathlib import Path

from dojo_env.managers.base import Manager, Turn
from dojo_env.recording import Recorder
from dojo_env.simulation import Simulation


class RecorderManager(Manager):
    """Writes `{stem}_ep{number}.npz` when an episode ends, or is broken off by a reset or the close."""

    def __init__(
        self, simulation: Simulation, stem: str, *, end: float, scenario: str, map_sha256: str
    ) -> None:
        """Take the beginning of the files' names, when an episode ends, and what it is an episode of."""
        self._simulation, self._stem, self._end = simulation, stem, end
        self._origin = {"scenario": scenario, "map_sha256": map_sha256}
        self._recorder = Recorder()
        self._episode = 0

    def before_reset(self, turn: Turn) -> None:
        """Write what is left of the last episode."""
        self._write()

    def reset(self, turn: Turn) -> None:
        """Record the first instant."""
        self._episode = turn.episode
        self._recorder = Recorder(**self._origin, seed=turn.seed)
        self._recorder.add(self._simulation.read_snapshot())

    def step(self, turn: Turn) -> None:
        """Record a second."""
        if self._simulation.is_new_second:
            self._recorder.add(self._simulation.read_snapshot())

    def after_step(self, turn: Turn) -> None:
        """Write the episode when it is over."""
        if self._simulation.time >= self._end:
            self._write()

    def close(self) -> None:
        """Write what is left."""
        self._write()

    def _write(self) -> None:
        recorder, self._recorder = self._recorder, Recorder()
        if len(recorder) > 1:
            recorder.write(Path(f"{self._stem}_ep{self._episode}.npz"))
