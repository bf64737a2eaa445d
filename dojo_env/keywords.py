"""The settings as keywords, for type checkers and editors; `config` and `datasets.settings` explain each."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

if TYPE_CHECKING:
    from dojo_env.camera import Camera
    from dojo_env.conditions import Conditions
    from dojo_env.config import EpisodeConfig, SensingConfig, SignalConfig, TrafficConfig
    from dojo_env.imaging import Imaging
    from dojo_env.outages import CameraOutage
    from dojo_env.ranges import Ranges
    from dojo_env.scenario import Scenario
    from dojo_env.timing_plans import TimingPlan


class EpisodeSettings(TypedDict, total=False):
    """The fields of `EpisodeConfig`: when an episode begins and ends, and what is written of it."""

    begin_time: float | None
    num_seconds: float | None
    delta_time: float | None
    out_csv_name: str | None
    record_name: str | None


class SignalSettings(TypedDict, total=False):
    """The fields of `SignalConfig`: which signals are controlled, and under which constraints."""

    ts_ids: Sequence[str] | None
    action_mode: str
    yellow_time: float | str
    all_red: float
    min_green: float
    max_green: float | None
    max_red: float | None
    enforce_max_green: bool | None
    always_transition: bool
    walking_speed: float
    phases: str
    fixed_ts: bool
    program: str
    timing: "TimingPlan | None"


class TrafficSettings(TypedDict, total=False):
    """The fields of `TrafficConfig`: how SUMO runs."""

    max_depart_delay: float | None
    waiting_time_memory: float | None
    time_to_teleport: float | None
    sumo_seed: int | str | None
    emission_class: str | None
    sumo_warnings: bool
    additional_sumo_cmd: str | None
    backend: str
    use_gui: bool
    sumo_outputs: Path | str | None


class DrawingSettings(TypedDict, total=False):
    """The fields of `SensingConfig` but for `cameras` and `outages`: how cameras and lidars see."""

    conditions: "Conditions | Ranges | str"
    imaging: "Imaging | Ranges | str"
    width: int
    height: int
    renderer: str
    smooth: bool
    show_links: bool
    look: str
    parked: bool
    models: Mapping[str, Any] | Path | str


class SensingSettings(DrawingSettings, total=False):
    """The fields of `SensingConfig`: which cameras there are, how they see, and when they fail."""

    cameras: "Mapping[str, Sequence[Camera]] | str"
    outages: "Sequence[CameraOutage]"


class Settings(EpisodeSettings, SignalSettings, TrafficSettings, SensingSettings, total=False):
    """Every setting of an environment, by the names that its keywords have.

    `scenario`, `observation` and `reward_fn` are explained at `EnvConfig`; `routes` (or `route_file`) and
    `net_file` replace files of the scenario, `observation_class` is SUMO-RL's name of `observation`. A group
    may be given whole, under the name that it has in `EnvConfig`.
    """

    scenario: "str | Path | Scenario | None"
    net_file: str | Path | None
    routes: str | Path | Sequence[str | Path] | None
    route_file: str | Path | Sequence[str | Path] | None
    observation: Any
    observation_class: Any
    reward_fn: str | Callable[..., float] | Mapping[str, Any]
    episode: "EpisodeConfig"
    signals: "SignalConfig"
    traffic: "TrafficConfig"
    sensing: "SensingConfig"


class DatasetKeywords(TypedDict, total=False):
    """The fields of `DatasetSettings`."""

    scenarios: Sequence[str] | str
    pictures: int
    format: str
    cameras: Sequence[str] | str
    conditions: Sequence[str] | str
    imaging: Sequence[str] | str
    controllers: Sequence[str] | str
    size: tuple[int, int]
    split: Sequence[float]
    split_by: str
    interval: float | None
    per_episode: int | None
    seconds: float | None
    seed: int
    least_pixels: int
    least_visible: float
    negatives: float | None
    depth: bool
    picture: str | None
    quality: int
    smooth: bool
    parked: bool
