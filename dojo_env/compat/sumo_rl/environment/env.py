"""SUMO-RL's environment: its keywords, attributes and answers, over this project's simulation and signals."""

import math
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import gymnasium
from gymnasium import spaces

from dojo_env.config import build_config
from dojo_env.env import open_viewer
from dojo_env.episode_files import EpisodeFiles
from dojo_env.errors import ConfigError, SimulationBusyError
from dojo_env.local_world import LocalWorld
from dojo_env.notes import say_once
from dojo_env.scenario import Files
from dojo_maps.whole_file import write_table

from .observations import DefaultObservationFunction
from .petting_zoo import SumoEnvironmentPZ, env, parallel_env
from .traffic_signal import TrafficSignal

__all__ = ["SumoEnvironment", "SumoEnvironmentPZ", "env", "parallel_env"]

_LARGEST_SEED = 2**31 - 2


class SumoEnvironment(gymnasium.Env[Any, Any]):
    """One signal (`single_agent`) or all of them, with SUMO-RL's answers.

    `reset` returns observations by signal, and `step` those with rewards, a dict of what is done and figures;
    with `single_agent` both return what Gymnasium asks for.

    Attributes:
        ts_ids: ids of the signals that agents control.
        traffic_signals: these signals, by id; new ones at each reset.
        observations: the last ones, by signal.
        rewards: the last ones, by signal.
        metrics: the figures of each decision of the episode.
        vehicles: by vehicle and lane, seconds waited there.
        episode: its number, from 1.
        sim_max_time: seconds at which an episode ends.
        label: tells environments of a process apart.
        world: this project's environment below, with its own figures: `world.metrics()`.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 4}  # noqa: RUF012 - Gymnasium's own way
    CONNECTION_LABEL = 0

    def __init__(  # noqa: PLR0913, PLR0917 - SUMO-RL's own
        self,
        net_file: str | Path,
        route_file: Files,
        out_csv_name: str | None = None,
        use_gui: bool = False,
        virtual_display: tuple[int, int] | None = None,
        begin_time: float = 0,
        num_seconds: float = 20000,
        max_depart_delay: float = -1,
        waiting_time_memory: float = 1000,
        time_to_teleport: float = -1,
        delta_time: int = 5,
        yellow_time: int = 2,
        min_green: int = 5,
        max_green: int = 50,
        single_agent: bool = False,
        reward_fn: Any = "diff-waiting-time",
        observation_class: Callable[[TrafficSignal], Any] = DefaultObservationFunction,
        add_system_info: bool = True,
        add_per_agent_info: bool = True,
        sumo_seed: str | int = "random",
        fixed_ts: bool = False,
        sumo_warnings: bool = True,
        additional_sumo_cmd: str | None = None,
        render_mode: str | None = None,
        *,
        enforce_max_green: bool = False,
        reward_weights: Sequence[float] | None = None,
        ts_ids: Sequence[str] | None = None,
    ) -> None:
        """Open the map and plan its signals.

        Args:
            net_file: a SUMO network, or a bundle.
            route_file: one, several by commas, or a list.
            out_csv_name: the beginning of the names of a CSV and a JSON file per episode; None writes none.
            use_gui: show SUMO's window.
            virtual_display: width and height in pixels of what `rgb_array` renders; None leaves it as drawn.
            begin_time: simulated seconds.
            num_seconds: how long an episode lasts, its last decision's interval whole.
            max_depart_delay: seconds after which a vehicle that found no place is dropped; -1 waits forever.
            waiting_time_memory: seconds over which waiting accumulates.
            time_to_teleport: seconds after which a stuck vehicle is moved on; -1 never does.
            delta_time: seconds between decisions.
            yellow_time: seconds.
            min_green: seconds.
            max_green: seconds; a limit only with `enforce_max_green`.
            single_agent: control the first signal alone, with Gymnasium's interface.
            reward_fn: `diff-waiting-time`, `average-speed`, `queue`, `pressure`, a function of a
                `TrafficSignal`, a list of these, or a dict of all this by signal: those that it names are
                controlled.
            observation_class: makes what observes, of a `TrafficSignal`.
            add_system_info: tell figures of all traffic.
            add_per_agent_info: tell figures of each signal.
            sumo_seed: of the episodes, or "random". A seed given to `reset` holds from then on.
            fixed_ts: let the network's own programs run.
            sumo_warnings: let SUMO print its warnings.
            additional_sumo_cmd: more of SUMO's options.
            render_mode: `human`, a live page on the loopback address; `rgb_array`; or None.
            enforce_max_green: let the next phase follow after `max_green` seconds.
            reward_weights: of a list of rewards, which are then added up.
            ts_ids: the signals to control; None takes all.

        Raises:
            ConfigError: a setting cannot work on this map.
            SourceError: a file cannot be read.
        """
        by_signal = reward_fn if isinstance(reward_fn, Mapping) else None
        wanted = tuple(by_signal) if by_signal is not None and ts_ids is None else ts_ids
        self._config = build_config(
            net_file=net_file,
            route_file=route_file,
            begin_time=begin_time,
            num_seconds=math.ceil(num_seconds / delta_time) * delta_time if delta_time > 0 else num_seconds,
            max_depart_delay=max_depart_delay,
            waiting_time_memory=waiting_time_memory,
            time_to_teleport=time_to_teleport,
            delta_time=delta_time,
            yellow_time=yellow_time,
            min_green=min_green,
            max_green=max_green if enforce_max_green else None,
            max_red=None,
            always_transition=True,
            ts_ids=wanted,
            fixed_ts=fixed_ts,
            sumo_warnings=sumo_warnings,
            additional_sumo_cmd=additional_sumo_cmd,
            emission_class=None,
            backend="traci" if use_gui else "libsumo",
            use_gui=use_gui,
        )
        self.delta_time, self.yellow_time = delta_time, yellow_time
        self.min_green, self.max_green = min_green, max_green
        self.single_agent, self.fixed_ts = single_agent, fixed_ts
        self.reward_fn, self.reward_weights = reward_fn, reward_weights
        self.observation_class = observation_class
        self.add_system_info, self.add_per_agent_info = add_system_info, add_per_agent_info
        self.sumo_seed, self.out_csv_name = sumo_seed, out_csv_name
        self.begin_time, self.sim_max_time = begin_time, begin_time + num_seconds
        self.virtual_display, self.render_mode = virtual_display, render_mode
        self.label = str(SumoEnvironment.CONNECTION_LABEL)
        SumoEnvironment.CONNECTION_LABEL += 1
        self.world = LocalWorld(self._config)
        self.ts_ids = list(wanted) if wanted is not None else sorted(self.world.signals)  # SUMO's order.
        if single_agent and len(self.ts_ids) > 1:
            self.ts_ids = self.ts_ids[:1]
            signals = replace(self._config.signals, ts_ids=tuple(self.ts_ids))
            self._config = replace(self._config, signals=signals)
            self.world = LocalWorld(self._config)
        self._lengths = {lane.id: lane.length for lane in self.world.map.bundle.road_map.lanes}
        self.episode = 0
        self.vehicles: dict[str, dict[str, float]] = {}
        self.metrics: list[dict[str, Any]] = []
        self._asked: dict[str, int] = {}
        self._files = EpisodeFiles(out_csv_name)
        self.traffic_signals = self._make_signals()
        self.observations: dict[str, Any] = dict.fromkeys(self.ts_ids)
        self.rewards: dict[str, Any] = dict.fromkeys(self.ts_ids)
        self._viewer = open_viewer(self.world, self._config, render_mode, 0)

    @property
    def sumo(self) -> Any:
        """SUMO's interface, as `traci` has it; None while no episode runs."""
        return self.world.traffic.simulation.interface

    @property
    def sim_step(self) -> float:
        """The simulated second."""
        return self.world.traffic.simulation.time

    @property
    def observation_space(self) -> spaces.Space[Any]:  # type: ignore[override]
        """The space of the first signal's observations."""
        return self.observation_spaces(self.ts_ids[0])

    @property
    def action_space(self) -> spaces.Discrete:  # type: ignore[override]
        """The space of the first signal's actions."""
        return self.action_spaces(self.ts_ids[0])

    def observation_spaces(self, ts_id: str) -> spaces.Space[Any]:
        """Tell the space of a signal's observations.

        Args:
            ts_id: id of one of `ts_ids`.

        Returns:
            The space.
        """
        return self.traffic_signals[ts_id].observation_space

    def action_spaces(self, ts_id: str) -> spaces.Discrete:
        """Tell the space of a signal's actions.

        Args:
            ts_id: id of one of `ts_ids`.

        Returns:
            A number for each green phase.
        """
        return self.traffic_signals[ts_id].action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode; where another simulation of this process runs, SUMO is a program of its own.

        Args:
            seed: of this episode, and of those after it that are given none.
            options: nothing heeds them.

        Returns:
            Observations by signal; or, with `single_agent`, the observation and the figures.

        Raises:
            ConfigError: `sumo_seed` is neither a whole number nor "random".
            SimulationError: SUMO refuses the input.
        """
        super().reset(seed=seed, options=options)
        self._save_episode()
        self.episode += 1
        self.metrics, self._asked, self.vehicles = [], {}, {}
        if seed is not None:
            self.sumo_seed = seed
        drawn = self.sumo_seed == "random"
        chosen = int(self.np_random.integers(_LARGEST_SEED)) if drawn else _read_seed(self.sumo_seed)
        try:
            self.world.reset(chosen)
        except SimulationBusyError:
            say_once("another simulation of this process is running: SUMO runs as a program of its own")
            self.world.close()
            traffic = replace(self._config.traffic, backend="traci")
            self.world = LocalWorld(replace(self._config, traffic=traffic))
            self.world.reset(chosen)
        self.traffic_signals = self._make_signals()
        self._viewer.follow(self.world.draw)
        observations = self._compute_observations()
        if self.single_agent:
            return observations[self.ts_ids[0]], self._compute_info()
        return observations

    def step(self, action: Any) -> Any:
        """Act, and simulate until the next decision.

        Args:
            action: phases by signal, or with `single_agent` a phase; None and {} leave all as it is.

        Returns:
            Observations and rewards by signal, a dict with what is done (`__all__`), and figures; or, with
            `single_agent`, Gymnasium's five.

        Raises:
            EpisodeOverError: no episode is running.
            ConfigError: a phase is none of its signal's; nothing has happened then.
            SimulationError: SUMO stopped; `reset` begins anew.
        """
        if action is not None and not self.fixed_ts:
            self._apply_actions(action)
        self._run_steps()
        observations, rewards = self._compute_observations(), self._compute_rewards()
        dones, info = self._compute_dones(), self._compute_info()
        if self.single_agent:
            first = self.ts_ids[0]
            return observations[first], rewards[first], False, dones["__all__"], info
        return observations, rewards, dones, info

    def ask(self, signal: str, phase: int) -> None:
        """Note what a signal is to do in the next interval.

        Args:
            signal: one of `ts_ids`.
            phase: number of a green phase; where there is none of that number, the next `step` is refused.
        """
        self._asked[signal] = phase

    def render(self) -> Any:
        """Draw the views with the phase and the figures: (h, w, 3) uint8 with `rgb_array`, else nothing."""
        picture = self._viewer.render(self.world.draw)
        if picture is None or self.virtual_display is None:
            return picture
        return cv2.resize(picture, self.virtual_display, interpolation=cv2.INTER_AREA)

    def save_csv(self, out_csv_name: str | None, episode: int) -> None:
        """Write the episode, a row per decision, as `{out_csv_name}_conn{label}_ep{episode}.csv`.

        Args:
            out_csv_name: the beginning of the file's path, whose folders are made; None writes nothing.
            episode: the number in the file's name; what is written is always the present episode.

        Raises:
            UsageError: a folder has the file's name, or a file is in a folder's way.
            WriteError: the file cannot be written.
        """
        if out_csv_name is not None and self.metrics:
            head = list(self.metrics[0])
            rows = [[row[name] for name in head] for row in self.metrics]
            path = Path(f"{out_csv_name}_conn{self.label}_ep{episode}.csv")
            write_table(path, head, rows, overwrite=True, parents=True)

    def encode(self, state: Any, ts_id: str) -> tuple[int, ...]:
        """Make a default observation a key of a table.

        Args:
            state: what `DefaultObservationFunction` has seen, (phases + 1 + 2 lanes,).
            ts_id: the signal that it is of.

        Returns:
            The green phase, the flag as 0 or 1, and each density and then each queue in tenths, 0 to 9.
        """
        phases = self.traffic_signals[ts_id].num_green_phases
        shares = (self._discretize_density(share) for share in state[phases + 1 :])
        return (int(state[:phases].argmax()), int(state[phases]), *shares)

    def close(self) -> None:
        """Write what is left of the episode, and end the simulation and the page; safe at any time."""
        if hasattr(self, "_viewer"):
            self._save_episode()
            self._viewer.close()
        if hasattr(self, "world"):
            self.world.close()

    def _make_signals(self) -> dict[str, TrafficSignal]:
        env = weakref.proxy(self)  # An environment that nobody holds any more ends at once.
        rewards = self.reward_fn if isinstance(self.reward_fn, Mapping) else {}
        if isinstance(self.reward_fn, Mapping) and not set(self.ts_ids) <= set(rewards):
            missing = ", ".join(signal for signal in self.ts_ids if signal not in rewards)
            raise ConfigError(
                f"reward_fn names no reward for {missing}; add one, or leave them out of ts_ids"
            )
        return {
            signal: TrafficSignal(
                env, self.world.map.plans[signal], rewards.get(signal, self.reward_fn), self._lengths
            )
            for signal in self.ts_ids
        }

    def _apply_actions(self, actions: Any) -> None:
        if self.single_agent and not isinstance(actions, Mapping):
            actions = {self.ts_ids[0]: actions}
        for signal, action in actions.items():
            self.traffic_signals[signal].set_next_phase(action)

    def _run_steps(self) -> None:
        began, asked = self.sim_step, self._asked
        self._asked = {}
        ended = self.world.step(asked)[2]
        for signal in self.traffic_signals.values():
            signal.note_decision(began)
        self._viewer.follow(self.world.draw, ended=ended)

    def _compute_observations(self) -> dict[str, Any]:
        self.observations = {ts: signal.compute_observation() for ts, signal in self.traffic_signals.items()}
        return dict(self.observations)

    def _compute_rewards(self) -> dict[str, Any]:
        self.rewards = {ts: signal.compute_reward() for ts, signal in self.traffic_signals.items()}
        return dict(self.rewards)

    def _compute_dones(self) -> dict[str, bool]:
        return {**dict.fromkeys(self.ts_ids, False), "__all__": self.sim_step >= self.sim_max_time}

    def _compute_info(self) -> dict[str, Any]:
        info: dict[str, Any] = {"step": self.sim_step}
        if self.add_system_info:
            info |= self._get_system_info()
        if self.add_per_agent_info:
            info |= self._get_per_agent_info()
        self.metrics.append(dict(info))
        self._files.add(info)
        return info

    def _get_system_info(self) -> dict[str, float]:
        return self.world.instant.traffic.figures

    def _get_per_agent_info(self) -> dict[str, float]:
        info: dict[str, float] = {}
        stopped = waiting = 0.0
        for ts, signal in self.traffic_signals.items():
            own = signal.get_total_queued(), sum(signal.get_accumulated_waiting_time_per_lane())
            info[f"{ts}_stopped"], info[f"{ts}_accumulated_waiting_time"] = own
            info[f"{ts}_average_speed"] = signal.get_average_speed()
            stopped, waiting = stopped + own[0], waiting + own[1]
        return info | {
            "agents_total_stopped": int(stopped),
            "agents_total_accumulated_waiting_time": waiting,
        }

    def _save_episode(self) -> None:
        if self._files.has_rows and self.sim_step > self.begin_time:
            known = self.sumo is not None
            self._files.finish(self.world.metrics() if known else {}, episode=self.episode)

    def _discretize_density(self, density: float) -> int:
        return min(int(density * 10), 9)


def _read_seed(value: Any) -> int:
    try:
        return int(value)
    except (TypeError, ValueError):
        raise ConfigError(f'sumo_seed={value!r}: expected a whole number, or "random"') from None
