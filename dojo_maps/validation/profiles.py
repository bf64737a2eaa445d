"""Profiles: the limits that checks measure against, and which findings matter to whom."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from dojo_maps.issue import Severity


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Every limit of every check; metres, seconds, metres per second, degrees and shares."""

    overlap: float = 1.0
    overlap_error: float = 10.0
    overlap_depth: float = 1.0
    pavement_overlap: float = 0.5
    junction_overlap: float = 1.0
    junction_lost: float = 1.0
    level_height: float = 4.0
    border: float = 2.0
    repeated_point: float = 0.05
    kink_deg: float = 99.0
    radius: float = 9.0
    gap: float = 0.1
    gap_error: float = 0.5
    z_jump: float = 0.1
    grade: float = 0.10
    drive_width: float = 2.5
    drive_width_error: float = 1.8
    drive_width_most: float = 4.5
    sidewalk_width: float = 1.2
    cycle_width: float = 1.0
    crossing_width: float = 2.0
    road_length: float = 5.0
    signal_road_length: float = 15.0
    connection_length: float = 1.0
    vehicle_length: float = 7.5
    node_offset: float = 20.0
    crossing_reach: float = 15.0
    pair_length: float = 0.1
    length_share: float = 0.05
    length_difference: float = 1.0
    turn_back_deg: float = 150.0
    straight_deg: float = 30.0
    path_on_road: float = 3.0
    yellow: float = 3.0
    yellow_tolerance: float = 0.5
    walking_speed: float = 1.2
    walk_error: float = 4.0
    walk: float = 7.0
    split_signals: float = 25.0
    minor_speed: float = 70 / 3.6
    cycle_least: float = 30.0
    cycle_most: float = 120.0
    green_share: float = 0.01
    car_width: float = 2.5
    clearance_tolerance: float = 0.5
    walking_area: float = 1.0
    twisted: float = 0.01
    waiting_depth: float = 1.0
    car: float = 1.8
    in_path: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Limits for a purpose, and the severities that differ for it."""

    name: str
    limits: Limits = field(default_factory=Limits)
    severities: Mapping[str, Severity] = field(default_factory=lambda: MappingProxyType({}))


_LOOKS = ("geometry.kink", "geometry.tight_radius", "geometry.node_offset", "topology.lane_no_entry")
_DRIVES = (
    "signals.missing_yellow", "signals.rl_form", "signals.tls_trivial",
    "signals.unused_index", "signals.state_length",
)  # fmt: skip

DEFAULT = Profile(name="default")
PROFILES = {
    profile.name: profile
    for profile in (
        DEFAULT,
        Profile(
            name="rl",
            severities=MappingProxyType(
                {**dict.fromkeys(_LOOKS, Severity.NOTE), **dict.fromkeys(_DRIVES, Severity.ERROR)}
            ),
        ),
        Profile(
            name="strict",
            limits=replace(
                Limits(),
                overlap=0.25,
                pavement_overlap=0.1,
                kink_deg=60.0,
                gap=0.02,
                gap_error=0.1,
                drive_width=2.75,
                yellow_tolerance=0.0,
                walking_speed=1.07,
                waiting_depth=3.0,
                grade=0.08,
            ),
        ),
    )
}
"""`rl`: for signal control, what the environment cannot drive is an error, looks are notes. `strict`: tighter
limits, walkers at MUTCD's 3.5 ft/s."""
