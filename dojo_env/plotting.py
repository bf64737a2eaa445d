"""What a program or a command wants to see: figures over time of whatever holds some, and films."""

import base64
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from html import escape
from pathlib import Path
from typing import Any, Unpack

from dojo_env.charts import Plot, draw_series
from dojo_env.errors import ConfigError
from dojo_env.keywords import DrawingSettings
from dojo_env.learning.result_files import read_columns
from dojo_env.learning.settings import CURVE, RunFileError
from dojo_env.recording import Recording, read_recording
from dojo_env.runs import Episodes
from dojo_env.series import Series
from dojo_maps.input_files import is_there, read_bytes, read_table

Infos = list[dict[str, Any]]
Source = Episodes | Recording | Series | Infos | str | Path
"""What has figures over time: episodes, a recording, a file of either, or a training's folder."""
_TIMES = ("step", "second")
"""Columns of seconds in files of episodes."""
_PROGRESS = ("steps", "round", "epoch")
"""Columns of how far a training is."""
_LARGEST_SHOWN = 20 << 20
"""Bytes of a film that a notebook takes in."""


def plot(what: Source | Sequence[Source] | Mapping[str, Source], *names: str, smooth: float = 60.0) -> Plot:
    """Draw figures over time, of one thing or of several beside each other.

    Args:
        what: episodes that `run_controller` gave, a recording, a `.npz` that `record` wrote, a `.csv` that
            `run --csv` wrote, a list of what `info` told at each step, or the folder of a training;
            several in a list, or in a mapping from what the legend calls them.
        names: of figures, such as `queue` or `co2`; none for those that tell most.
        smooth: seconds that values are averaged over, with those before.

    Returns:
        The chart, which shows itself in a notebook; `save` writes it.

    Raises:
        ConfigError: there is nothing to draw, or no figure has a name.
        SourceError: a file is missing, damaged, or holds no figures.
        ToolMissingError: matplotlib is not installed.
    """
    named: dict[str, Any]
    if isinstance(what, Mapping):
        named = dict(what)
    elif isinstance(what, list | tuple) and not _are_infos(what):
        named = {}
        for source in what:
            name = _name(source, what)
            named[f"{name} ({len(named) + 1})" if name in named else name] = source
    else:
        named = {_name(what, ()): what}
    return draw_series({label: _read(source) for label, source in named.items()}, names, smooth=smooth)


def _are_infos(what: Any) -> bool:
    """Tell a list of what is known of steps or of episodes from a list of several sources."""
    return isinstance(what, Episodes) or (
        isinstance(what, list) and all(isinstance(each, dict) for each in what)
    )


def _name(source: Any, beside: Sequence[Any]) -> str:
    """Name a thing in the legend: by its file, or the folder that tells it from the others."""
    if isinstance(source, Episodes):
        return source.title
    if isinstance(source, Recording):
        return source.path.stem
    if not isinstance(source, str | Path):
        return "episode"
    path, paths = Path(source), [Path(each) for each in beside if isinstance(each, str | Path)]
    if sum(other.stem == path.stem for other in paths) < 2:
        return path.stem
    return (
        path.parent.name if sum(other.parent.name == path.parent.name for other in paths) < 2 else str(path)
    )


def _read(source: Any) -> Sequence[Series]:
    if isinstance(source, Episodes):
        return source.series
    if isinstance(source, Recording):
        return [source.series]
    if isinstance(source, Series):
        return [source]
    if isinstance(source, list) and _are_infos(source):
        return [Series.of_infos(episode) for episode in _divide(source)]
    if not isinstance(source, str | Path):
        raise ConfigError(
            f"plot: {type(source).__name__}: has no figures over time; give what run_controller or record "
            "returned, or the path of a .csv, an .npz or a training's folder"
        )
    path = Path(source)
    if path.suffix == ".npz":
        return [read_recording(path).series]
    if is_there(path) and path.is_dir():
        if not is_there(path / CURVE):
            raise RunFileError(path, f"no training: it has no {CURVE}")
        path /= CURVE
    return [read_series(path)]


def _divide(infos: Infos) -> list[Infos]:
    """Divide what was told at each step into episodes: where time goes back, another one begins."""
    times = [info.get("step", 0.0) for info in infos]
    begins = [0, *(k for k in range(1, len(times)) if times[k] <= times[k - 1])]
    return [infos[begin:end] for begin, end in zip(begins, [*begins[1:], len(infos)], strict=True)]


def read_series(path: Path) -> Series:
    """Read a table that `run --csv`, a training or the benchmark wrote.

    Args:
        path: of the `.csv` file.

    Returns:
        Its figures; of a training those of its validations.

    Raises:
        RunFileError: the file is missing or damaged, or a table of something else.
    """
    head = next(iter(read_table(path, (), error=RunFileError)), {})
    time = next((name for name in (*_TIMES, *_PROGRESS) if name in head), None)
    if time is None:
        raise RunFileError(
            path, "no figures over time; give a .csv that run --csv wrote, a recording or a training's folder"
        )
    columns = read_columns(path, (), part="validation" if "part" in head else None)
    if time in _TIMES:
        return Series.of_columns(columns, time)
    return Series(at=columns.pop(time), unit=time, figures=columns)


class Film:
    """A film in a file; a notebook plays it.

    Attributes:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        """Take where it is.

        Args:
            path: of the file.
        """
        self.path = path

    def _repr_html_(self) -> str:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        if self.path.stat().st_size > _LARGEST_SHOWN:
            return f"<code>{escape(str(self.path))}</code>: too large to be shown here"
        data = base64.b64encode(read_bytes(self.path)).decode("ascii")
        kind = self.path.suffix.lower().removeprefix(".")
        return f'<video controls loop width="720" src="data:video/{kind};base64,{data}"></video>'

    def __repr__(self) -> str:
        """Tell where it is."""
        return f"Film({str(self.path)!r})"


def film(
    recording: Recording | str | Path,
    path: str | Path,
    *,
    map: str | Path | None = None,  # noqa: A002 - as in `Scenario`
    signals: Sequence[str] | None = None,
    on_stage: Callable[[str], None] = lambda _stage: None,
    **sensing: Unpack[DrawingSettings],
) -> Film:
    """Film a recording: every camera, what the signals show and the figures, ten seconds in one.

    Args:
        recording: the episode, or its file.
        path: of the film, `.webm` or `.mp4`.
        map: the map that it was made on, where that is not a packaged scenario's.
        signals: ids of those to look at; None for all.
        on_stage: told now and then how far it is.
        sensing: as an environment takes them: `conditions`, `width`, `height` and so on.

    Returns:
        The film, which plays in a notebook.

    Raises:
        RecordingError: the map is not the one of the recording, or cannot be found.
        ConfigError: a setting or the path cannot work.
        ToolMissingError: no codec for it is installed.
    """
    from dojo_env.watch import Rerun  # noqa: PLC0415 - draws, which loads a compiler

    path = Path(path)
    if not isinstance(recording, Recording):
        recording = read_recording(recording)
    with closing(Rerun.of(recording, map=map, signals=signals, **sensing)) as rerun:
        rerun.film(path, on_stage=on_stage)
    return Film(path)
