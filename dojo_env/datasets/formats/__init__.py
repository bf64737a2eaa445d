"""The formats of data sets by name. Another one is a module here and its entry."""

from collections.abc import Mapping
from types import MappingProxyType

from dojo_env.datasets.formats.base import Format
from dojo_env.datasets.formats.coco import Coco
from dojo_env.datasets.formats.cvat import Cvat
from dojo_env.datasets.formats.kitti import Kitti
from dojo_env.datasets.formats.mot import Mot
from dojo_env.datasets.formats.yolo import Yolo

FORMATS: Mapping[str, Format] = MappingProxyType(
    {"coco": Coco(), "yolo": Yolo(), "kitti": Kitti(), "mot": Mot(), "cvat": Cvat()}
)
"""By the name that users give."""

__all__ = ["FORMATS", "Format"]
