"""What a format is: where pictures lie, and which files tell what is in them.

A part of a data set is one episode's, written by one process, and whole or not there. A format writes files
of a part's own (a text per picture, a sequence), and lines for files of the whole, which are put together
from all parts in their order in the end.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from dojo_env.datasets.labels import PictureLabels

if TYPE_CHECKING:
    from dojo_env.datasets.settings import DatasetSettings

Lines = Callable[[str], Iterator[str]]
"""Gives the lines that all parts have written under a name, without line ends."""


class Format(Protocol):
    """A way to write a data set. Inherit from it, and give what is not as here.

    Attributes:
        picture: suffix of pictures, unless asked for: `jpg` or `png`.
        is_sequential: pictures of a camera follow each other frame by frame.
    """

    picture: str = "jpg"
    is_sequential: bool = False

    def place(self, split: str, sequence: str, frame: int, number: int) -> tuple[str, str]:
        """Say where a picture and its depths lie, from the data set's folder on, without suffix.

        Args:
            split: `train`, `val` or `test`.
            sequence: name of the camera's pictures of an episode.
            frame: place in it, from 1.
            number: of the picture in the data set, from 1.

        Returns:
            The path of the picture, and that of its depths.
        """
        ...

    def write_part(self, pictures: Sequence[PictureLabels], settings: "DatasetSettings") -> Mapping[str, str]:
        """Write files of a part's own.

        Args:
            pictures: the labels of all pictures of the part, at least one, in the order of their numbers.
            settings: of the data set.

        Returns:
            Their texts by path, from the data set's folder on.

        Raises:
            ConfigError: the format cannot say what there is to say of a picture.
        """
        return {}

    def write_lines(self, pictures: Sequence[PictureLabels]) -> Mapping[str, list[str]]:
        """Write lines for files of the whole.

        Args:
            pictures: the labels of all pictures of the part, at least one, in the order of their numbers.

        Returns:
            Lines without line ends, by a name of the format's choice, under which `finish` finds them.
        """
        return {}

    def finish(self, settings: "DatasetSettings", lines: Lines) -> Iterable[tuple[str, Iterable[str]]]:
        """Write files of the whole.

        Args:
            settings: of the data set.
            lines: gives what `write_lines` made under a name, of all parts in their order.

        Returns:
            The path of each file, from the data set's folder on, and its text piece by piece.
        """
        return ()
