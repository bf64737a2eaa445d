"""A CSV and a JSON file per episode; none is lost and none is overwritten."""

from pathlib import Path
from typing import Any

from dojo_maps.whole_file import write_json, write_table


class EpisodeFiles:
    """Collects an episode's rows and writes them when it ends: at its limit, at a reset or at the close.

    Attributes:
        label: tells environments that share a stem apart; None before the first file.
    """

    def __init__(self, stem: str | None) -> None:
        """Take the beginning of the files' names; None writes nothing."""
        self._stem = None if stem is None else Path(stem)
        self._rows: list[dict[str, Any]] = []
        self.label: int | None = None

    @property
    def has_rows(self) -> bool:
        """Tell whether an episode waits to be written."""
        return bool(self._rows)

    def add(self, row: dict[str, Any]) -> None:
        """Add a decision's figures.

        Args:
            row: by name; every row of an episode has the same names.
        """
        if self._stem is not None:
            self._rows.append(dict(row))

    def finish(self, figures: dict[str, Any], *, episode: int) -> None:
        """Write the episode as `{stem}_conn{label}_ep{number}.csv` and `.json`, in SUMO-RL's way.

        Args:
            figures: of the whole episode.
            episode: its number.
        """
        rows, self._rows = self._rows, []
        if self._stem is None or not rows:
            return
        head = list(rows[0])
        path = self._write(episode, head, [[row[name] for name in head] for row in rows])
        write_json(path.with_suffix(".json"), figures)

    def _write(self, episode: int, head: list[str], rows: list[list[Any]]) -> Path:
        """Take the first label that no environment, in whatever process, has taken with this stem."""
        label = 0 if self.label is None else self.label
        while True:
            path = Path(f"{self._stem}_conn{label}_ep{episode}.csv")
            try:
                write_table(path, head, rows, overwrite=False, parents=True)
            except FileExistsError:
                label += 1
            else:
                self.label = label
                return path
