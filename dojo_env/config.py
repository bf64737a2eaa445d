"""The settings, in frozen groups that refuse contradictions; users give them as plain keywords."""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Unpack

from dojo_env.camera import Camera
from dojo_env.camera_presets import find_preset
from dojo_env.conditions import LOOKS, Conditions, settle_conditions
from dojo_env.errors import ConfigError
from dojo_env.imaging import Imaging, settle_imaging
from dojo_env.keywords import Settings
from dojo_env.outages import CameraOutage
from dojo_env.ranges import Ranges
from dojo_env.scenario import Scenario, find_scenario, with_files
from dojo_env.sumo_settings import SumoSettings, settle
from dojo_env.timing_plans import TimingPlan
from dojo_env.vehicle_models import settle_models
from dojo_maps.short_repr import short_repr, shortened
from dojo_maps.wording import did_you_mean

ACTION_MODES = ("choose_phase", "next_or_keep", "set_duration")
PROGRAMS = ("network", "fixed", "actuated", "delay_based")
_DEFAULT_MAX_GREEN = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeConfig:
    """When an episode begins and ends, and what is written of it.

    Attributes:
        begin_time: simulated seconds; None takes the scenario's.
        num_seconds: how long it lasts; None takes the scenario's end, or 3,600 s where it tells none.
        delta_time: seconds from decision to decision, a whole number of SUMO's steps; None takes 5 s, or the
            next such number.
        out_csv_name: the beginning of the names of a CSV and a JSON file per episode.
        record_name: the beginning of the name of a recording per episode.
    """

    begin_time: float | None = None
    num_seconds: float | None = None
    delta_time: float | None = None
    out_csv_name: str | None = None
    record_name: str | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse times that cannot be."""
        for name, least in (("delta_time", 0.1), ("num_seconds", 1), ("begin_time", 0)):
            if getattr(self, name) is not None:
                _refuse_below(name, getattr(self, name), least)


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalConfig:
    """How signals are controlled. Times are whole seconds.

    Attributes:
        ts_ids: the signals that agents control; None takes all. The others run the network's own program.
        action_mode: `choose_phase`, `next_or_keep` or `set_duration`.
        yellow_time: seconds, or "speed" for what each approach's speed limit asks for.
        all_red: seconds after yellow in which nothing new turns green.
        min_green: seconds of green, yellow not counted, before a change is granted.
        max_green: seconds of green after which the next phase follows; None sets no limit.
        max_red: seconds after which who waits, on wheels or on foot, gets green, whatever agents ask for; or
            one and a half of the signal's shortest cycles, where that is longer. None sets no limit.
        enforce_max_green: as SUMO-RL has it: with False `max_green` is no limit; True alone means 60 s.
        always_transition: a change that only adds green takes the time of a yellow, too, and its letters stay
            as they are meanwhile; as SUMO-RL has it.
        walking_speed: m/s, of the slowest walker who must get across before traffic does.
        phases: `program` takes the green phases of the network's own program, `computed` builds sets of
            movements without conflicts.
        fixed_ts: no agent controls anything; `program` runs.
        program: with `fixed_ts`: the `network`'s own as it stands; or its greens with the changes set here,
            each as long as there (`fixed`), or as long as SUMO's `actuated` or `delay_based` logic lets it.
        timing: a signal timing plan, which stands for `fixed_ts` and a `program`, with cycles of its own.
    """

    ts_ids: tuple[str, ...] | None = None
    action_mode: str = "choose_phase"
    yellow_time: float | str = 2
    all_red: float = 0
    min_green: float = 10
    max_green: float | None = None
    max_red: float | None = 120
    enforce_max_green: bool | None = None
    always_transition: bool = False
    walking_speed: float = 1.2
    phases: str = "program"
    fixed_ts: bool = False
    program: str = "network"
    timing: TimingPlan | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse contradictions, and settle what depends on another setting."""
        if self.timing is not None:
            object.__setattr__(self, "fixed_ts", True)
            object.__setattr__(self, "program", self.timing.logic)
            if self.timing.logic != "fixed":
                object.__setattr__(self, "max_green", self.timing.max_green)
        _refuse_other("action_mode", self.action_mode, ACTION_MODES)
        _refuse_other("phases", self.phases, ("program", "computed"))
        _refuse_other("program", self.program, PROGRAMS)
        if self.yellow_time != "speed":
            _refuse_below("yellow_time", self.yellow_time, 1, hint=', or "speed"')
            _refuse_fraction("yellow_time", self.yellow_time)
        for name, least in (("all_red", 0), ("min_green", 1), ("walking_speed", 0.1)):
            _refuse_below(name, getattr(self, name), least)
        _refuse_fraction("all_red", self.all_red)
        _refuse_fraction("min_green", self.min_green)
        if self.max_red is not None:
            _refuse_below("max_red", self.max_red, self.min_green)
        self._settle_max_green()
        if isinstance(self.ts_ids, str):
            raise ConfigError(
                f"ts_ids={self.ts_ids!r}: expected a list of ids; write ts_ids=[{self.ts_ids!r}]"
            )
        if self.ts_ids is not None:
            object.__setattr__(self, "ts_ids", tuple(self.ts_ids))
        if self.program != "network" and not self.fixed_ts:
            raise ConfigError(f"program={self.program!r} needs fixed_ts=True: agents cannot act beside it")

    def _settle_max_green(self) -> None:
        needed = self.enforce_max_green or self.action_mode == "set_duration" or self.program in PROGRAMS[2:]
        if not needed and self.enforce_max_green is False:
            object.__setattr__(self, "max_green", None)
        elif needed and self.max_green is None:
            object.__setattr__(self, "max_green", _DEFAULT_MAX_GREEN)
        if self.max_green is None:
            return
        _refuse_fraction("max_green", self.max_green)
        if self.max_green < self.min_green:
            raise ConfigError(f"max_green={self.max_green} is below min_green={self.min_green}; change one")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrafficConfig:
    """How SUMO runs.

    Attributes:
        max_depart_delay: seconds after which a vehicle that found no place is dropped; -1 waits forever. None
            takes the scenario's, or else -1.
        waiting_time_memory: seconds over which waiting accumulates; None takes the scenario's, or else 1000.
        time_to_teleport: seconds after which a stuck vehicle is moved on; -1 never does. None takes the
            scenario's, or else -1.
        sumo_seed: of episodes that `reset` gives no seed; None takes the scenario's, or else draws one from
            the environment's generator, as "random" always does.
        emission_class: of vehicle types that name none and are no other than SUMO's cars; None keeps SUMO's.
        sumo_warnings: let SUMO print its warnings.
        additional_sumo_cmd: more of SUMO's options, as on a command line. They win over all else; only those
            are refused that would make signals unsafe or unknown: ports, other configurations and networks,
            saved states.
        backend: `libsumo` runs SUMO in this process, `traci` as a program of its own.
        use_gui: show SUMO's window; needs `traci`.
        sumo_outputs: a folder for the files that the scenario's own files want written; None writes none.
    """

    max_depart_delay: float | None = None
    waiting_time_memory: float | None = None
    time_to_teleport: float | None = None
    sumo_seed: int | str | None = None
    emission_class: str | None = "HBEFA3/PC_G_EU4"
    sumo_warnings: bool = False
    additional_sumo_cmd: str = ""
    backend: str = "libsumo"
    use_gui: bool = False
    sumo_outputs: Path | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse contradictions."""
        _refuse_other("backend", self.backend, ("libsumo", "traci"))
        if self.use_gui and self.backend == "libsumo":
            raise ConfigError('use_gui=True needs backend="traci": libsumo has no window')
        if self.sumo_seed not in (None, "random"):
            object.__setattr__(self, "sumo_seed", _whole_number("sumo_seed", self.sumo_seed))
        object.__setattr__(self, "additional_sumo_cmd", self.additional_sumo_cmd or "")
        if self.sumo_outputs is not None:
            object.__setattr__(self, "sumo_outputs", Path(self.sumo_outputs))
            unusable = [part for part in (":", ",", "${") if part in str(self.sumo_outputs)]
            if unusable:
                raise ConfigError(
                    f"sumo_outputs={str(self.sumo_outputs)!r}: SUMO misreads {unusable[0]!r} in a path"
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class SensingConfig:
    """How cameras and lidars see.

    Attributes:
        conditions: light, weather and clean lenses: `Conditions`, a name such as `night`, or ranges by name,
            from which each episode draws.
        imaging: how cameras work, from shutter to compression: `Imaging`, a name of `IMAGING_PRESETS`, or
            ranges by name, from which each episode draws.
        cameras: how those are hung that are placed from the map, a name of `CAMERA_PRESETS`; or cameras by
            signal, instead of the paper's.
        width: pixels, of the cameras that are placed.
        height: pixels.
        renderer: `raster`, or `bullet` for pybullet's.
        smooth: anti-alias what moves, too.
        show_links: draw each link's path in the colour it shows.
        look: `street`, or `plain` to draw road users faster and more simply.
        parked: cars stand parked where the map has room for them.
        models: 3D models by SUMO's vehicle type, in place of ours: files, `VehicleModel`s, or a TOML file.
        outages: when which cameras fail.
    """

    conditions: Conditions | Ranges | str = field(default_factory=Conditions)
    imaging: Imaging | Ranges | str = field(default_factory=Imaging)
    cameras: Mapping[str, Sequence[Camera]] | str = field(default_factory=dict)
    width: int = 356
    height: int = 256
    renderer: str = "raster"
    smooth: bool = False
    show_links: bool = False
    look: str = "street"
    parked: bool = True
    models: Mapping[str, Any] | Path | str = field(default_factory=dict)
    outages: Sequence[CameraOutage] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        if not all(isinstance(outage, CameraOutage) for outage in self.outages):
            raise ConfigError(f"outages={self.outages!r}: expected CameraOutage(begin=..., ...) in a list")
        _refuse_other("renderer", self.renderer, ("raster", "bullet"))
        _refuse_other("look", self.look, LOOKS)
        settle_conditions(self.conditions, seed=0)
        settle_imaging(self.imaging, seed=0)
        object.__setattr__(self, "models", settle_models(self.models))
        if isinstance(self.cameras, str):
            find_preset(self.cameras)
            return
        for signal, cameras in self.cameras.items():
            names = [camera.name for camera in cameras]
            if not names or len(set(names)) < len(names):
                raise ConfigError(f"cameras of signal {signal!r}: give at least one, each a name of its own")


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvConfig:
    """Everything an environment is made from.

    Attributes:
        scenario: what is simulated.
        episode: when it begins and ends, and what is written.
        signals: how signals are controlled.
        traffic: how SUMO runs.
        sensing: how cameras and lidars see.
        observation: a name, a dict of named sensors, or an object that observes; see `observations`.
        reward_fn: a name, a callable, a dict of names and weights, or a dict with one of these per signal.
    """

    scenario: Scenario
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)
    signals: SignalConfig = field(default_factory=SignalConfig)
    traffic: TrafficConfig = field(default_factory=TrafficConfig)
    sensing: SensingConfig = field(default_factory=SensingConfig)
    observation: Any = "features"
    reward_fn: str | Callable[..., float] | Mapping[str, Any] = "diff-waiting-time"
    sumo: SumoSettings = field(init=False)
    """What SUMO is run with, and the times of an episode: settled from all of these."""

    def __post_init__(self) -> None:
        """Put together what the scenario says and what the user asks for."""
        traffic, episode = self.traffic, self.episode
        given = {
            "begin": episode.begin_time,
            "max-depart-delay": traffic.max_depart_delay,
            "waiting-time-memory": traffic.waiting_time_memory,
            "time-to-teleport": traffic.time_to_teleport,
            "no-warnings": "false" if traffic.sumo_warnings else "true",
        }
        settled = settle(
            self.scenario,
            given,
            traffic.additional_sumo_cmd,
            seconds=episode.num_seconds,
            interval=episode.delta_time,
        )
        object.__setattr__(self, "sumo", settled)

    def __repr__(self) -> str:
        """Tell the scenario, and which settings are not the usual ones."""
        groups = (getattr(self, name) for name in _GROUPS)
        unusual = [
            f"{f.name}={getattr(group, f.name)!r}"
            for group in groups
            for f in fields(group)
            if getattr(group, f.name) != getattr(type(group)(), f.name)
        ]
        told = [
            repr(self.scenario.name),
            f"observation={self.observation!r}",
            f"reward_fn={self.reward_fn!r}",
        ]
        return shortened(f"EnvConfig({', '.join(told + unusual)})")

    @property
    def seed(self) -> int | None:
        """The seed of episodes for which `reset` is given none; None where each draws its own."""
        asked = self.traffic.sumo_seed
        return self.sumo.seed if asked is None else asked if isinstance(asked, int) else None

    @property
    def additional(self) -> tuple[Path, ...]:
        """The additional files that SUMO reads."""
        return self.sumo.files.get("additional-files", self.scenario.additional)


_GROUPS = {
    "episode": EpisodeConfig,
    "signals": SignalConfig,
    "traffic": TrafficConfig,
    "sensing": SensingConfig,
}
_PLACES = {f.name: group for group, cls in _GROUPS.items() for f in fields(cls)}
_SUMO_RL = ("single_agent", "add_system_info", "add_per_agent_info", "virtual_display", "reward_weights")
"""Keywords of SUMO-RL's that mean nothing here."""
_OTHERS = ("scenario", "net_file", "route_file", "routes", "observation", "observation_class", "reward_fn")


def build_config(**settings: Unpack[Settings]) -> EnvConfig:
    """Sort keywords into the groups they belong to; a group itself may be given under its name, too.

    Args:
        settings: `scenario` says what to simulate, by name or path, with routes of its own, or such as
            `routes` names; `net_file` is a network in place of the scenario's. See `Settings`.

    Returns:
        All of them, in their groups.

    Raises:
        ConfigError: a keyword is unknown, a value cannot work, or two contradict each other.
    """
    keywords: dict[str, Any] = dict(settings)
    scenario, net_file, route_file, routes = (
        keywords.pop(name, None) for name in ("scenario", "net_file", "route_file", "routes")
    )
    if routes is not None and route_file is not None:
        raise ConfigError("routes and route_file are two names of the same; leave one out")
    route_file = routes if route_file is None else route_file
    if scenario is None:
        if net_file is None or route_file is None:
            raise ConfigError("name a scenario, such as scenario='cologne1', or net_file and route_file")
        found = with_files(Scenario(map=Path(net_file)), route_file=route_file)
    else:
        found = with_files(find_scenario(scenario, routes=route_file), net_file=net_file)
    if "observation_class" in keywords:
        keywords["observation"] = keywords.pop("observation_class")
    top = {name: keywords.pop(name) for name in ("observation", "reward_fn") if name in keywords}
    groups: dict[str, Any] = {}
    for group, cls in _GROUPS.items():
        named = {name: keywords.pop(name) for name in list(keywords) if _PLACES.get(name) == group}
        given = keywords.pop(group, None)
        if given is not None and named:
            raise ConfigError(f"{group} is given whole, and {', '.join(named)} beside it; leave one out")
        groups[group] = given if given is not None else _build_group(cls, named)
    if keywords:
        raise ConfigError(_unknown(next(iter(keywords))))
    return EnvConfig(scenario=found, **groups, **top)


def _build_group(cls: Any, named: dict[str, Any]) -> Any:
    try:
        return cls(**named)
    except TypeError as error:
        shown = ", ".join(f"{name}={value!r}" for name, value in named.items())
        raise ConfigError(f"{shown}: a value has the wrong type ({error})") from error


def _unknown(name: str) -> str:
    if name in _SUMO_RL:
        return f"{name} is SUMO-RL's: dojo_env.compat.sumo_rl.SumoEnvironment takes it"
    known = (*_PLACES, *_OTHERS)
    hint = did_you_mean(name, known) or f"; known are {', '.join(known)}"
    return f"there is no setting {name!r}{hint}"


def _refuse_below(name: str, value: Any, least: float, *, hint: str = "") -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not number or value < least:
        raise ConfigError(f"{name}={value!r}: expected a number, at least {least}{hint}")


def _refuse_fraction(name: str, value: Any) -> None:
    if value != int(value):
        raise ConfigError(f"{name}={value!r}: expected whole seconds")


def _whole_number(name: str, value: Any) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        number = -1
    if number < 0 or isinstance(value, bool):
        raise ConfigError(f'{name}={value!r}: expected a whole number from 0, or "random"')
    return number


def _refuse_other(name: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ConfigError(f"{name}={value!r}: expected one of {', '.join(known)}")
