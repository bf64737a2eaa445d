"""YOLO, as Ultralytics lays it out: a text per picture, and data.yaml. Source: docs.ultralytics.com."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from dojo_env.datasets.formats.base import Format, Lines
from dojo_env.datasets.labels import Category, PictureLabels

if TYPE_CHECKING:
    from dojo_env.datasets.settings import DatasetSettings

_NAMES = tuple(Category)


class Yolo(Format):
    """`images/train`, `labels/train` and so on; classes are numbered from 0 without gaps.

    Road users of which too little shows are left out.
    """

    def place(self, split: str, sequence: str, frame: int, number: int) -> tuple[str, str]:
        """See `Format`."""
        return f"images/{split}/{number:09d}", f"depth/{split}/{number:09d}"

    def write_part(self, pictures: Sequence[PictureLabels], settings: "DatasetSettings") -> Mapping[str, str]:
        """See `Format`."""
        return {f"labels/{picture.split}/{picture.number:09d}.txt": _write(picture) for picture in pictures}

    def finish(self, settings: "DatasetSettings", lines: Lines) -> Iterable[tuple[str, Iterable[str]]]:
        """See `Format`."""
        splits = {split: split for split in settings.splits}
        splits.setdefault("train", settings.splits[0])
        splits.setdefault("val", settings.splits[-1])  # Ultralytics asks for one.
        text = [f"{split}: images/{found}\n" for split, found in splits.items()]
        text += ["names:\n", *(f"  {k}: {name.value}\n" for k, name in enumerate(_NAMES))]
        yield "data.yaml", text


def _write(picture: PictureLabels) -> str:
    width, height = picture.camera.width, picture.camera.height
    rows = []
    for each in picture.objects:
        if not each.is_ignored:
            left, top, right, bottom = each.box
            middle = (left + right) / 2 / width, (top + bottom) / 2 / height
            values = (*middle, (right - left) / width, (bottom - top) / height)
            rows.append(" ".join([str(_NAMES.index(each.category)), *(f"{value:.6f}" for value in values)]))
    return "".join(f"{row}\n" for row in rows)
