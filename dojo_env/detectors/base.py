"""What a detector is, what it finds, and the names of classes that it may have learned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dojo_env.snapshot import Kind

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

COCO_80 = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow",
    "elephant", "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee",
    "skis", "snowboard", "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard",
    "tennis racket", "bottle", "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple",
    "sandwich", "orange", "broccoli", "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch",
    "potted plant", "bed", "dining table", "toilet", "tv", "laptop", "mouse", "remote", "keyboard",
    "cell phone", "microwave", "oven", "toaster", "sink", "refrigerator", "book", "clock", "vase", "scissors",
    "teddy bear", "hair drier", "toothbrush",
)  # fmt: skip
"""The classes of COCO in the order in which most networks have them."""
_NOT_IN_COCO_91 = (0, 12, 26, 29, 30, 45, 66, 68, 69, 71, 83)
COCO_91 = tuple(
    "" if number in _NOT_IN_COCO_91 else COCO_80[number - sum(other < number for other in _NOT_IN_COCO_91)]
    for number in range(91)
)
"""The same by the numbers of the data set itself, which have gaps, and where 0 is nothing."""
CLASS_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType({"coco-80": COCO_80, "coco-91": COCO_91})
"""Lists of classes that go by a name."""

KIND_OF_NAME: Mapping[str, Kind] = MappingProxyType(
    {
        "person": Kind.PEDESTRIAN, "pedestrian": Kind.PEDESTRIAN, "people": Kind.PEDESTRIAN,
        "bicycle": Kind.BICYCLE, "bike": Kind.BICYCLE, "cyclist": Kind.BICYCLE, "rider": Kind.BICYCLE,
        "car": Kind.CAR, "vehicle": Kind.CAR, "suv": Kind.CAR, "taxi": Kind.TAXI, "van": Kind.VAN,
        "motorcycle": Kind.MOTORCYCLE, "motorbike": Kind.MOTORCYCLE, "motor": Kind.MOTORCYCLE,
        "scooter": Kind.SCOOTER, "bus": Kind.BUS, "truck": Kind.TRUCK, "lorry": Kind.TRUCK,
        "trailer": Kind.TRAILER, "train": Kind.TRAM, "tram": Kind.TRAM, "ambulance": Kind.AMBULANCE,
        "police": Kind.POLICE, "fire engine": Kind.FIRE_ENGINE,
    }
)  # fmt: skip
"""Road users by the names that data sets give them (COCO, KITTI, VisDrone, UA-DETRAC, BDD); others are left
out."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detections:
    """The road users that a detector finds in a picture; arrays have one row each, the surest first.

    Attributes:
        boxes: (n, 4) left, top, right, bottom, pixels of the picture.
        scores: (n,) 0 to 1.
        kinds: (n,) `Kind`.
    """

    boxes: Floats
    scores: Floats
    kinds: NDArray[np.uint8]

    def __len__(self) -> int:
        """Count them."""
        return len(self.boxes)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Detections":
        """Choose rows, by their numbers or by a mask.

        Args:
            rows: their numbers, in the order wanted, or an (n,) mask.

        Returns:
            These rows alone.
        """
        return Detections(boxes=self.boxes[rows], scores=self.scores[rows], kinds=self.kinds[rows])


NOTHING = Detections(boxes=np.empty((0, 4)), scores=np.empty(0), kinds=np.empty(0, np.uint8))
"""An empty street."""


@runtime_checkable
class DetectorModel(Protocol):
    """Finds road users in a picture; the same picture gives the same detections."""

    def detect(self, picture: Image) -> Detections:
        """Look at one picture.

        Args:
            picture: (h, w, 3), red first.

        Returns:
            Who is in it, the surest first.
        """
        ...


def find_kinds(names: Sequence[str]) -> dict[int, Kind]:
    """Tell which of a network's classes are road users.

    Args:
        names: of the classes, in their order.

    Returns:
        The kind by the class's number.
    """
    known = {number: KIND_OF_NAME.get(name.strip().lower()) for number, name in enumerate(names)}
    return {number: kind for number, kind in known.items() if kind is not None}
