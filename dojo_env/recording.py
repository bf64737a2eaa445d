"""An episode's snapshots in one compact file, to be drawn later without SUMO.

The file is a numpy archive without pickled objects. What does not change about a road user stands once in a
table; numbers keep all their digits, so a picture of a recording equals the picture of the episode. A file
is read within bounds and checked, whoever made it.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.charts import Plot, draw_lights, draw_series
from dojo_env.errors import ConfigError, RecordingError, SnapshotError
from dojo_env.plain_arrays import TEXT, read_arrays
from dojo_env.reading import HALTING
from dojo_env.series import Series
from dojo_env.snapshot import LARGEST_SIZE, Kind, Snapshot
from dojo_maps.short_repr import shortened
from dojo_maps.whole_file import replaced
from dojo_maps.wording import counted

_VERSION = 1
_MAX_BYTES = 1 << 31
"""The largest recording that is read, unpacked: an hour of about 8,000 road users."""
_COLUMNS = ("positions", "headings", "slopes", "speeds", "lights")
"""What changes from one snapshot to the next, a row per road user."""
_KINDS = {
    "version": "<i8", "scenario": TEXT, "map_sha256": TEXT, "seed": "<i8", "times": "<f8", "counts": "<i4",
    "positions": "<f8", "headings": "<f8", "slopes": "<f8", "speeds": "<f8", "lights": "|u1",
    "users": "<i4", "lanes": "<i4", "user_ids": TEXT, "numbers": "<i4", "kinds": "|u1", "sizes": "<f8",
    "colours": "|u1", "lane_ids": TEXT, "signals": TEXT, "states": TEXT, "shown": "<i4",
}  # fmt: skip
"""Every array of a file and its type."""
_OPTIONAL = {"user_types": TEXT}
"""Arrays that older files lack."""
_FARTHEST = {"times": 1e12, "positions": 1e8, "headings": 1e3, "slopes": 2.0, "speeds": 1e10}
"""What no value can be beyond: seconds, metres, radians, m/s."""


class Recorder:
    """Collects snapshots and writes them."""

    def __init__(self, *, scenario: str = "", map_sha256: str = "", seed: int = 0) -> None:
        """Begin with none, and note what the episode is: its scenario's name, its map and its seed."""
        self._origin = {"scenario": scenario, "map_sha256": map_sha256, "seed": seed}
        self._users: dict[tuple[Any, ...], int] = {}
        self._strings: dict[str, int] = {"": 0}
        self._states: dict[str, int] = {}
        self._rows: dict[str, list[NDArray[Any]]] = {name: [] for name in (*_COLUMNS, "users", "lanes")}
        self._times: list[float] = []
        self._counts: list[int] = []
        self._shown: list[list[int]] = []
        self._signals: tuple[str, ...] = ()

    def __len__(self) -> int:
        """How many snapshots there are."""
        return len(self._times)

    def add(self, snapshot: Snapshot) -> None:
        """Add the next snapshot.

        Args:
            snapshot: a later instant of the same episode.
        """
        self._signals = self._signals or tuple(snapshot.signals)
        self._times.append(snapshot.time)
        self._counts.append(len(snapshot.ids))
        self._shown.append([_number(self._states, snapshot.signals[name]) for name in self._signals])
        looks = zip(
            snapshot.ids,
            snapshot.numbers.tolist(),
            snapshot.kinds.tolist(),
            map(tuple, snapshot.sizes.tolist()),
            map(tuple, snapshot.colours.tolist()),
            snapshot.types or ("",) * len(snapshot.ids),
            strict=True,
        )
        self._rows["users"].append(np.array([_number(self._users, look) for look in looks], np.int32))
        self._rows["lanes"].append(
            np.array([_number(self._strings, lane) for lane in snapshot.lanes], np.int32)
        )
        for name in _COLUMNS:
            self._rows[name].append(getattr(snapshot, name))

    def write(self, path: Path) -> None:
        """Write the recording, whole or not at all.

        Args:
            path: of the file.

        Raises:
            RecordingError: nothing has been recorded.
        """
        if not self._times:
            raise RecordingError(path, "nothing has been recorded; step the environment first")
        users = list(self._users)
        arrays = {
            "version": np.array(_VERSION),
            **{name: np.array(value) for name, value in self._origin.items()},
            "times": np.array(self._times),
            "counts": np.array(self._counts, np.int32),
            **{name: np.concatenate(rows) for name, rows in self._rows.items()},
            "user_ids": np.array([user[0] for user in users] or [""]),
            "numbers": np.array([user[1] for user in users], np.int32),
            "kinds": np.array([user[2] for user in users], np.uint8),
            "sizes": np.array([user[3] for user in users], np.float64).reshape(-1, 3),
            "colours": np.array([user[4] for user in users], np.uint8).reshape(-1, 3),
            "user_types": np.array([user[5] for user in users] or [""]),
            "lane_ids": np.array(list(self._strings)),
            "signals": np.array(self._signals or ("",)),
            "states": np.array(list(self._states) or [""]),
            "shown": np.array(self._shown, np.int32).reshape(len(self._times), -1),
        }
        with replaced(path, parents=True) as fresh, fresh.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


class Recording(Sequence[Snapshot]):
    """A recording in memory; its items are snapshots, made as they are asked for.

    Attributes:
        times: simulated seconds of the snapshots.
        signals: ids of the signals.
        scenario: the name of the episode's scenario.
        map_sha256: of the source that the episode's map was converted from.
        seed: of the episode.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]], path: Path) -> None:
        """Check that the arrays fit each other.

        Args:
            arrays: of the file, by name.
            path: of the file.

        Raises:
            RecordingError: they do not.
        """
        self._arrays, self._path = arrays, path
        arrays.setdefault("user_types", np.full(max(len(arrays["numbers"]), 1), ""))
        self._check()
        self._take()

    def _take(self) -> None:
        """Take out what is asked for often."""
        arrays = self._arrays
        self._ends = np.cumsum(arrays["counts"], dtype=np.int64)
        self.times: NDArray[np.float64] = arrays["times"]
        self.signals: tuple[str, ...] = tuple(arrays["signals"].tolist()) if arrays["shown"].size else ()
        self.scenario, self.map_sha256 = str(arrays["scenario"]), str(arrays["map_sha256"])
        self.seed = int(arrays["seed"])
        self._states: list[str] = arrays["states"].tolist()

    @classmethod
    def open(cls, path: Path | str) -> "Recording":
        """Read a recording; see `read_recording`.

        Args:
            path: of the file, such as out_ep1.npz.

        Returns:
            The recording.

        Raises:
            RecordingError: the file is missing or damaged.
        """
        return read_recording(path)

    @property
    def path(self) -> Path:
        """The file that it was read from."""
        return self._path

    @property
    def series(self) -> Series:
        """Vehicles, those that stand, their mean speed, and walkers, by the names that `info` has."""
        a, count = self._arrays, len(self.times)
        instants = np.repeat(np.arange(count), a["counts"])
        walks = a["kinds"][a["users"]] == Kind.PEDESTRIAN
        driving, speeds = instants[~walks], a["speeds"][~walks]
        vehicles = np.bincount(driving, minlength=count).astype(np.float64)
        figures = {
            "system_total_running": vehicles,
            "system_total_stopped": np.bincount(driving[speeds < HALTING], minlength=count).astype(
                np.float64
            ),
            "system_mean_speed": np.bincount(driving, speeds, minlength=count) / np.maximum(vehicles, 1.0),
        }
        if walks.any():
            figures["pedestrians"] = np.bincount(instants[walks], minlength=count).astype(np.float64)
        return Series(at=self.times - self.times[:1], unit="seconds", figures=figures)

    def plot(self, *names: str, smooth: float = 60.0) -> Plot:
        """Draw figures over time; `dojo_env.plot` draws several recordings beside each other.

        Args:
            names: of `series.figures`; none for all.
            smooth: seconds that values are averaged over, with those before.

        Returns:
            The chart, which shows itself in a notebook.

        Raises:
            ConfigError: no figure has a name.
            ToolMissingError: matplotlib is not installed.
        """
        return draw_series({self.scenario: [self.series]}, names, smooth=smooth)

    def plot_signals(self, *signals: str) -> Plot:
        """Draw what signals showed, a row for each of their links.

        Args:
            signals: ids; none for all.

        Returns:
            The chart, which shows itself in a notebook.

        Raises:
            ConfigError: no signal has an id.
            ToolMissingError: matplotlib is not installed.
        """
        if unknown := [name for name in signals if name not in self.signals]:
            raise ConfigError(f"signals {unknown}: not in the recording; it has {', '.join(self.signals)}")
        shown = self._arrays["shown"]
        states = {
            name: [self._states[k] for k in shown[:, self.signals.index(name)].tolist()]
            for name in signals or self.signals
        }
        return draw_lights(self.times - self.times[0], states)

    def __repr__(self) -> str:
        """Tell of what it is, and how long."""
        span = f" from {self.times[0]:g} to {self.times[-1]:g} s" if len(self) else ""
        return shortened(
            f"Recording({self._path.name!r}, {self.scenario or 'unnamed'}, seed {self.seed}, "
            f"{counted(len(self), 'snapshot')}{span}, {counted(len(self.signals), 'signal')})"
        )

    def __len__(self) -> int:
        """How many snapshots there are."""
        return len(self.times)

    def __getitem__(self, number: Any) -> Any:
        """Make a snapshot, or for a slice a recording of a part of this one.

        Raises:
            RecordingError: the file holds what no instant can be.
        """
        if isinstance(number, slice):
            return self._cut(np.arange(len(self))[number])
        k = range(len(self))[number]
        a, end = self._arrays, int(self._ends[k])
        rows = slice(end - int(a["counts"][k]), end)
        users = a["users"][rows]
        try:
            return Snapshot(
                time=float(self.times[k]),
                ids=tuple(a["user_ids"][users].tolist()),
                **{name: a[name][users] for name in ("numbers", "kinds", "sizes", "colours")},
                **{name: a[name][rows] for name in _COLUMNS},
                lanes=tuple(a["lane_ids"][a["lanes"][rows]].tolist()),
                types=tuple(a["user_types"][users].tolist()),
                signals={
                    name: self._states[shown]
                    for name, shown in zip(self.signals, a["shown"][k].tolist(), strict=True)
                },
            )
        except SnapshotError as error:
            raise RecordingError(self._path, str(error)) from error

    def _cut(self, instants: NDArray[np.int64]) -> "Recording":
        a = self._arrays
        rows = [np.arange(self._ends[k] - a["counts"][k], self._ends[k]) for k in instants]
        chosen = np.concatenate([np.empty(0, np.int64), *rows])
        part = object.__new__(Recording)
        part._path = self._path
        part._arrays = {
            **a,
            **{name: a[name][instants] for name in ("times", "counts", "shown")},
            **{name: a[name][chosen] for name in (*_COLUMNS, "users", "lanes")},
        }
        part._take()
        return part

    def __iter__(self) -> Iterator[Snapshot]:
        """Go through the snapshots in order."""
        return (self[k] for k in range(len(self)))

    def _check(self) -> None:
        a = self._arrays
        if a["version"].shape != () or int(a["version"]) != _VERSION:
            raise RecordingError(self._path, f"version {a['version']}, this program reads {_VERSION}")
        wrong = self._find_misfits() or self._find_impossible()
        if wrong:
            raise RecordingError(self._path, f"its {wrong} do not fit the rest; record the episode again")

    def _find_misfits(self) -> str | None:
        """Name an array whose length or indices do not go with the others'."""
        a = self._arrays
        instants, total, users = a["times"].size, int(a["counts"].sum(dtype=np.int64)), a["numbers"].size
        shapes = {
            "times": (instants,), "counts": (instants,), "users": (total,), "lanes": (total,),
            "positions": (total, 3), "headings": (total,), "slopes": (total,), "speeds": (total,),
            "lights": (total,), "numbers": (users,), "kinds": (users,), "sizes": (users, 3),
            "colours": (users, 3), "user_ids": (max(users, 1),), "user_types": (max(users, 1),),
            "scenario": (), "map_sha256": (), "seed": (),
            "signals": (max(a["shown"].shape[-1:], (1,))), "lane_ids": (a["lane_ids"].size,),
            "states": (a["states"].size,), "shown": (instants, *a["shown"].shape[1:2]),
        }  # fmt: skip
        bounds = {"users": users, "lanes": a["lane_ids"].size, "shown": a["states"].size}
        wrong = [name for name, shape in shapes.items() if a[name].shape != shape]
        wrong += [
            name
            for name, end in bounds.items()
            if a[name].size and not 0 <= a[name].min() <= a[name].max() < end
        ]
        return wrong[0] if wrong else None

    def _find_impossible(self) -> str | None:
        """Name an array with a value that no instant can have."""
        a = self._arrays
        possible = {name: (np.abs(a[name]) <= most).all() for name, most in _FARTHEST.items()}
        possible["times"] &= len(a["times"]) > 0 and (np.diff(a["times"]) > 0).all()
        possible["counts"] = (a["counts"] >= 0).all()
        possible["seed"] = a["seed"] >= 0
        possible["sizes"] = ((a["sizes"] > 0) & (a["sizes"] < LARGEST_SIZE)).all()
        possible["kinds"] = (a["kinds"] <= max(Kind)).all()
        possible["numbers"] = (a["numbers"] >= 1).all() and self._are_apart(a["numbers"])
        possible["user_ids"] = self._are_apart(a["user_ids"])
        possible["signals"] = len(set(a["signals"].tolist())) == len(a["signals"])
        return next((name for name, is_possible in possible.items() if not is_possible), None)

    def _are_apart(self, names: NDArray[Any]) -> bool:
        """Tell whether no two road users of one instant have the same name or number."""
        a = self._arrays
        known, codes = np.unique(names, return_inverse=True)
        instants = np.repeat(np.arange(len(a["counts"])), np.maximum(a["counts"], 0))
        pairs = instants * len(known) + codes[a["users"]]
        return len(np.unique(pairs)) == len(pairs)


def read_recording(path: Path | str) -> Recording:
    """Read a recording.

    Args:
        path: of the file, such as out_ep1.npz.

    Returns:
        The recording.

    Raises:
        RecordingError: the file is missing, damaged, too large, or no recording.
    """
    path = Path(path)
    what = "a recording, such as dojo-env run --record writes"
    arrays = read_arrays(path, _KINDS, optional=_OPTIONAL, most=_MAX_BYTES, error=RecordingError, what=what)
    return Recording(arrays, path)


def _number(table: dict[Any, int], key: Any) -> int:
    return table.setdefault(key, len(table))
