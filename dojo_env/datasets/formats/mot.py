"""MOTChallenge: sequences of frames with tracks. Source: motchallenge.net, MOT16's paper, section 3.3."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from dojo_env.datasets.formats.base import Format
from dojo_env.datasets.labels import Category, PictureLabels

if TYPE_CHECKING:
    from dojo_env.datasets.settings import DatasetSettings

_CLASSES = {Category.PERSON: 1, Category.BICYCLE: 4, Category.MOTORCYCLE: 5, Category.BOAT: 6}
"""MOT16's classes; 3 is a car there, and every larger motor vehicle here."""
_CAR = 3


class Mot(Format):
    """A folder per camera and episode: `img1`, `gt/gt.txt`, `seqinfo.ini`.

    Boxes hold the whole of a road user, hidden or not, up to the picture's border. Those of which too little
    shows are marked as not to be considered.
    """

    is_sequential = True

    def place(self, split: str, sequence: str, frame: int, number: int) -> tuple[str, str]:
        """See `Format`."""
        return f"{split}/{sequence}/img1/{frame:06d}", f"{split}/{sequence}/depth/{frame:06d}"

    def write_part(self, pictures: Sequence[PictureLabels], settings: "DatasetSettings") -> Mapping[str, str]:
        """See `Format`."""
        files = {}
        by_sequence = sorted(pictures, key=lambda picture: (picture.sequence, picture.frame))
        for sequence, group in groupby(by_sequence, key=lambda picture: picture.sequence):
            frames = list(group)
            folder = f"{frames[0].split}/{sequence}"
            rows = sorted(row for picture in frames for row in _list_rows(picture))
            files[f"{folder}/gt/gt.txt"] = "".join(
                f"{frame},{track},{left:.2f},{top:.2f},{width:.2f},{height:.2f},{asked},{kind},{visible:.4f}\n"
                for frame, track, left, top, width, height, asked, kind, visible in rows
            )
            files[f"{folder}/seqinfo.ini"] = (
                f"[Sequence]\nname={sequence}\nimDir=img1\nframeRate={1 / (settings.interval or 1):g}\n"
                f"seqLength={len(frames)}\nimWidth={frames[0].camera.width}\n"
                f"imHeight={frames[0].camera.height}\nimExt=.{settings.picture}\n"
            )
        return files


def _list_rows(picture: PictureLabels) -> list[tuple[int, int, float, float, float, float, int, int, float]]:
    """List what gt.txt says of a frame; pixels count from 1 there."""
    rows = []
    for each in picture.objects:
        left, top, right, bottom = each.cut_box(picture.camera)
        box = (left + 1, top + 1, right - left, bottom - top)
        kind = _CLASSES.get(each.category, _CAR)
        share = each.visible * (1 - each.truncated)
        rows.append((picture.frame, each.track, *box, int(not each.is_ignored), kind, share))
    return rows
