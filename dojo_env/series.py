"""Figures over time: what was measured at each decision of an episode, in each second of a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import ConfigError
from dojo_maps.wording import counted, did_you_mean

Numbers = NDArray[np.float64]
CURVES = {
    "co2": "agents_total_co2", "delay": "agents_total_delay",
    "accumulated_waiting": "agents_total_accumulated_waiting_time", "queue": "agents_total_stopped",
}  # fmt: skip
"""Those of the six figures that are measured at every decision, and their names in `info`."""
TITLES = {
    "travel_time": "travel time (s)",
    "travel_time_all": "mean trip, of all vehicles (s)",
    "throughput": "throughput (vehicles/h)",
    "delay": "delay, summed over lanes",
    "accumulated_waiting": "accumulated waiting (s)",
    "queue": "queue (vehicles)",
    "co2": "CO₂ (g/s)",
    "reward": "reward of an episode",
    "pedestrians": "people on foot",
    "system_total_running": "vehicles on the road",
    "system_total_backlogged": "vehicles that wait to enter",
    "system_total_stopped": "vehicles that stand",
    "system_total_waiting_time": "waiting since they last moved (s)",
    "system_mean_waiting_time": "mean waiting since they last moved (s)",
    "system_mean_speed": "mean speed (m/s)",
}
"""What is written over the curve of a figure; another one has its own name."""
_SHORT = {long: name for name, long in CURVES.items()}
_USUAL = (
    *("queue", "accumulated_waiting", "delay", "co2"),
    *("system_total_running", "system_mean_speed", "system_total_stopped", "pedestrians"),
)
_USUAL_OF_TRAININGS = ("travel_time_all", "accumulated_waiting", "queue", "reward", "throughput", "co2")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """Figures over an episode, or over a training.

    Attributes:
        at: (n,) seconds since the episode's begin, or how far a training was.
        unit: of `at`: `seconds`, or a training's `steps`, `round` or `epoch`.
        figures: (n,) values by name.
    """

    at: Numbers
    unit: str
    figures: Mapping[str, Numbers]

    @classmethod
    def of_infos(cls, infos: Sequence[Mapping[str, Any]]) -> "Series":
        """Collect what `info` told at each decision.

        Args:
            infos: of an episode, in their order.

        Returns:
            The series.
        """
        columns = {name: np.array([info[name] for info in infos], float) for name in (infos or [{}])[0]}
        return cls.of_columns(columns, "step")

    @classmethod
    def of_columns(cls, columns: Mapping[str, Numbers], time: str) -> "Series":
        """Take columns of an episode, one of which has the times at the end of each interval.

        Args:
            columns: (n,) by name.
            time: the name of the column of simulated seconds.

        Returns:
            The series; `agents_total_stopped` and so on have the names of the table of six figures.
        """
        times = columns.get(time, np.empty(0))
        begin = 2 * times[0] - times[1] if len(times) > 1 else times[:1]
        figures = {_SHORT.get(name, name): values for name, values in columns.items() if name != time}
        return cls(at=times - begin, unit="seconds", figures=figures)

    def __repr__(self) -> str:
        """Tell how many values there are of how many figures."""
        values, figures = counted(len(self.at), "value"), counted(len(self.figures), "figure")
        return f"Series({values} over {self.unit} of {figures})"

    def choose(self, names: Sequence[str] = ()) -> tuple[str, ...]:
        """Check the names of figures, or choose those that tell most.

        Args:
            names: of figures; none for a choice.

        Returns:
            Names of `figures`.

        Raises:
            ConfigError: there is no figure of a name.
        """
        if not names:
            told = _USUAL if self.unit == "seconds" else _USUAL_OF_TRAININGS
            usual = tuple(name for name in told if name in self.figures)
            return (usual or tuple(self.figures))[:6]
        wanted = tuple(_SHORT.get(name, name) for name in names)
        for name in wanted:
            if name not in self.figures:
                meant, there = did_you_mean(name, self.figures), ", ".join(sorted(self.figures))
                raise ConfigError(f"figure {name!r}: not measured here; there is {there}{meant}")
        return wanted
