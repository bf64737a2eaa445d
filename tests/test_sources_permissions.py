"""Vehicle classes and lane kinds, held against SUMO's own reading."""

import pytest

from dojo_maps.description import LaneKind
from dojo_maps.sources.permissions import VEHICLE_CLASSES, allowed_classes, lane_kind


@pytest.mark.parametrize(
    ("allow", "disallow", "kind"),
    [
        (None, None, LaneKind.DRIVING),
        ("all", None, LaneKind.DRIVING),
        (None, "all", LaneKind.SHOULDER),
        ("", None, LaneKind.SHOULDER),
        ("emergency authority", None, LaneKind.SHOULDER),
        ("pedestrian", None, LaneKind.SIDEWALK),
        ("bicycle", None, LaneKind.BICYCLE),
        ("pedestrian bicycle", None, LaneKind.BICYCLE),
        ("bus taxi bicycle", None, LaneKind.BUS),
        ("bus tram", None, LaneKind.BUS),
        ("tram rail_urban", None, LaneKind.RAIL),
        ("cityrail", None, LaneKind.RAIL),
        ("ship", None, LaneKind.WATERWAY),
        ("aircraft drone", None, LaneKind.OTHER),
        ("vip", None, LaneKind.DRIVING),
        ("pedestrian delivery bicycle", None, LaneKind.DRIVING),
        (None, "pedestrian tram rail_urban rail rail_electric rail_fast ship", LaneKind.DRIVING),
    ],
)
def test_lane_kind_follows_the_classes(allow: str | None, disallow: str | None, kind: LaneKind) -> None:
    assert lane_kind(allowed_classes(allow, disallow)) is kind


def test_allowed_classes_are_all_but_the_disallowed() -> None:
    assert set(VEHICLE_CLASSES) - set(allowed_classes(None, "tram bus")) == {"tram", "bus"}
