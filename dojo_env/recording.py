"""An episode's snapshots in one compact file, to be drawn later without SUMO.

The file is a numpy archive without pickled objects. What does not change about a road user stands once in a
table; numbers keep all their digits, so a picture of a recording equals the picture of the episode. A file
is read within bounds and checked, whoever made it.
"""

import math
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import RecordingError, SnapshotError
from dojo_env.snapshot import Snapshot
from dojo_maps.whole_file import replaced

_VERSION = 1
_MAX_BYTES = 1 << 31
"""The largest recording that is read, unpacked: an hour of about 8,000 road users."""
_COLUMNS = ("positions", "headings", "slopes", "speeds", "lights")
"""What changes from one snapshot to the next, a row per road user."""
_ARRAYS = (
    "version", "times", "counts", "users", "lanes", "user_ids", "numbers", "kinds", "sizes", "colours",
    "lane_ids", "signals", "states", "shown", "scenario", "map_sha256", "seed", *_COLUMNS,
)  # fmt: skip


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
        """Add the next snapshot."""
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
            "lane_ids": np.array(list(self._strings)),
            "signals": np.array(self._signals or ("",)),
            "states": np.array(list(self._states) or [""]),
            "shown": np.array(self._shown, np.int32).reshape(len(self._times), -1),
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced(path) as fresh, fresh.open("wb") as file:
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

        Raises:
            RecordingError: they do not.
        """
        self._arrays, self._path = arrays, path
        self._check()
        self._ends = np.cumsum(arrays["counts"], dtype=np.int64)
        self.times: NDArray[np.float64] = arrays["times"]
        self.signals: tuple[str, ...] = tuple(arrays["signals"].tolist()) if arrays["shown"].size else ()
        self.scenario, self.map_sha256 = str(arrays["scenario"]), str(arrays["map_sha256"])
        self.seed = int(arrays["seed"])

    @classmethod
    def open(cls, path: Path | str) -> "Recording":
        """Read a recording; see `read_recording`."""
        return read_recording(path)

    @property
    def path(self) -> Path:
        """The file that it was read from."""
        return self._path

    def __len__(self) -> int:
        """How many snapshots there are."""
        return len(self.times)

    def __getitem__(self, number: Any) -> Any:
        """Make a snapshot, or a list of them for a slice.

        Raises:
            RecordingError: the file holds what no instant can be.
        """
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        k = range(len(self))[number]
        a, end = self._arrays, int(self._ends[k])
        rows = slice(end - int(a["counts"][k]), end)
        users, states = a["users"][rows], a["states"].tolist()
        try:
            return Snapshot(
                time=float(self.times[k]),
                ids=tuple(a["user_ids"][users].tolist()),
                **{name: a[name][users] for name in ("numbers", "kinds", "sizes", "colours")},
                **{name: a[name][rows] for name in _COLUMNS},
                lanes=tuple(a["lane_ids"][a["lanes"][rows]].tolist()),
                signals={
                    name: states[shown]
                    for name, shown in zip(self.signals, a["shown"][k].tolist(), strict=True)
                },
            )
        except SnapshotError as error:
            raise RecordingError(self._path, str(error)) from error

    def __iter__(self) -> Iterator[Snapshot]:
        """Go through the snapshots in order."""
        return (self[k] for k in range(len(self)))

    def _check(self) -> None:
        a = self._arrays
        if a["version"].shape != () or int(a["version"]) != _VERSION:
            raise RecordingError(self._path, f"version {a['version']}, this program reads {_VERSION}")
        instants, total, users = len(a["times"]), int(a["counts"].sum(dtype=np.int64)), len(a["numbers"])
        shapes = {
            "times": (instants,), "counts": (instants,), "users": (total,), "lanes": (total,),
            "positions": (total, 3), "headings": (total,), "slopes": (total,), "speeds": (total,),
            "lights": (total,), "numbers": (users,), "kinds": (users,), "sizes": (users, 3),
            "colours": (users, 3), "user_ids": (max(users, 1),), "scenario": (), "map_sha256": (), "seed": (),
        }  # fmt: skip
        wrong = [name for name, shape in shapes.items() if a[name].shape != shape]
        bounds = (("users", users), ("lanes", len(a["lane_ids"])), ("shown", len(a["states"])))
        wrong += [
            name for name, end in bounds if a[name].size and not 0 <= a[name].min() <= a[name].max() < end
        ]
        if a["seed"].dtype.kind not in "iu":
            wrong.append("seed")
        if not (instants and np.isfinite(a["times"]).all() and (np.diff(a["times"]) > 0).all()):
            wrong.append("times")
        if not np.isfinite(a["speeds"]).all():
            wrong.append("speeds")
        if a["shown"].ndim != 2 or len(a["shown"]) != instants or (a["counts"] < 0).any():
            wrong.append("shown")
        elif a["shown"].size and a["signals"].shape != a["shown"].shape[1:]:
            wrong.append("signals")
        if wrong:
            raise RecordingError(self._path, f"its {wrong[0]} do not fit the rest; record the episode again")


def read_recording(path: Path | str) -> Recording:
    """Read a recording.

    Raises:
        RecordingError: the file is missing, damaged, too large, or no recording.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = {entry.filename: entry.file_size for entry in archive.infolist()}
            if set(sizes) != {f"{name}.npy" for name in _ARRAYS}:
                raise RecordingError(path, "not a recording: it holds other arrays")
            if sum(sizes.values()) > _MAX_BYTES:
                raise RecordingError(path, f"unpacks to more than {_MAX_BYTES} bytes; refused as unsafe")
            arrays = {name: _read_array(archive, f"{name}.npy", sizes[f"{name}.npy"]) for name in _ARRAYS}
        return Recording(arrays, path)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise RecordingError(path, f"cannot be read ({error}); record the episode again") from error


def _read_array(archive: zipfile.ZipFile, name: str, size: int) -> NDArray[Any]:
    """Read plain numbers or text, no more than the archive says there is."""
    with archive.open(name) as member:
        version = np.lib.format.read_magic(member)
        if version != (1, 0):
            raise ValueError(f"{name} has format {version}")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(member)
        wanted = math.prod(shape) * dtype.itemsize
        if dtype.kind not in "fiuU" or fortran or wanted > size:
            raise ValueError(f"{name} is not a plain array of {size} bytes")
        data = member.read(wanted)
    if len(data) != wanted:
        raise ValueError(f"{name} ends early")
    return np.frombuffer(data, dtype=dtype).reshape(shape)


def _number(table: dict[Any, int], key: Any) -> int:
    return table.setdefault(key, len(table))
