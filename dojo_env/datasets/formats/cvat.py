"""CVAT for images 1.1: boxes that people can look at and correct. Source: docs.cvat.ai, XML format."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from dojo_env.datasets.formats.base import Format, Lines
from dojo_env.datasets.labels import Category, ObjectLabel, PictureLabels

if TYPE_CHECKING:
    from dojo_env.datasets.settings import DatasetSettings

_OCCLUDED = 0.9
"""A road user of which less shows is marked as occluded."""
_ATTRIBUTES = ("track", "kind", "parked", "visible", "truncated", "lane", "movement", "signal")


class Cvat(Format):
    """`annotations.xml` beside `images`; each split is a subset.

    Road users of which too little shows are left out.
    """

    def place(self, split: str, sequence: str, frame: int, number: int) -> tuple[str, str]:
        """See `Format`."""
        return f"images/{split}/{number:09d}", f"depth/{split}/{number:09d}"

    def write_lines(self, pictures: Sequence[PictureLabels]) -> Mapping[str, list[str]]:
        """See `Format`."""
        return {"images": [_write(picture) for picture in pictures]}

    def finish(self, settings: "DatasetSettings", lines: Lines) -> Iterable[tuple[str, Iterable[str]]]:
        """See `Format`."""
        yield "annotations.xml", _write_whole(settings, lines)


def _write_whole(settings: "DatasetSettings", lines: Lines) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n<meta><task>\n'
    yield f"<size>{settings.pictures}</size><mode>annotation</mode><labels>\n"
    attributes = "".join(
        f"<attribute><name>{name}</name><mutable>False</mutable><input_type>text</input_type>"
        "<default_value></default_value><values></values></attribute>"
        for name in _ATTRIBUTES
    )
    for category in Category:
        yield f"<label><name>{category.value}</name><attributes>{attributes}</attributes></label>\n"
    yield "</labels></task></meta>\n"
    for line in lines("images"):
        yield f"{line}\n"
    yield "</annotations>\n"


def _write(picture: PictureLabels) -> str:
    """Write a picture in one line; attributes escape line ends."""
    name = quoteattr(picture.file.partition("/")[2])
    head = f'<image id="{picture.number - 1}" name={name} subset="{picture.split}" '
    head += f'width="{picture.camera.width}" height="{picture.camera.height}">'
    boxes = (_write_box(each) for each in picture.objects if not each.is_ignored)
    return f"{head}{''.join(boxes)}</image>"


def _write_box(label: ObjectLabel) -> str:
    left, top, right, bottom = label.box
    values = {
        "track": str(label.track),
        "kind": label.kind.name.lower(),
        "parked": str(label.is_parked).lower(),
        "visible": f"{label.visible:.2f}",
        "truncated": f"{label.truncated:.2f}",
        "lane": label.lane,
        "movement": label.movement,
        "signal": "" if label.link is None else label.link.state,
    }
    attributes = "".join(
        f'<attribute name="{name}">{escape(" ".join(text.split()))}</attribute>'
        for name, text in values.items()
    )
    return (
        f'<box label="{label.category.value}" source="file" occluded="{int(label.visible < _OCCLUDED)}" '
        f'xtl="{left:.2f}" ytl="{top:.2f}" xbr="{right:.2f}" ybr="{bottom:.2f}" z_order="0">'
        f"{attributes}</box>"
    )
