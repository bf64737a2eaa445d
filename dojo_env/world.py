"""One environment's world: the managers in their order, decisions, observations, rewards and figures.

`env` and `parallel_env` are two faces of it. It runs in their process, or in one of its own (`worker`).
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any

from gymnasium import spaces

from dojo_env.config import EnvConfig
from dojo_env.controllers import Controller
from dojo_env.episode_files import EpisodeFiles
from dojo_env.errors import ConfigError, EpisodeOverError, SimulationError
from dojo_env.eyes import Eyes
from dojo_env.instant import Instant
from dojo_env.managers.base import Manager, Turn
from dojo_env.managers.map import MapManager
from dojo_env.managers.recorder import RecorderManager
from dojo_env.managers.signals import SignalManager
from dojo_env.managers.traffic import TrafficManager
from dojo_env.managers.watcher import WatchManager
from dojo_env.metrics import Metrics
from dojo_env.observations import build_observer
from dojo_env.reading import LaneGroups, TrafficReading
from dojo_env.rewards import build_rewards
from dojo_env.scenario import open_map
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Snapshot
from dojo_env.watching.board import read_board
from dojo_env.watching.views import Frame, choose_cameras, draw_views

SIGNAL_FIGURES = ("stopped", "accumulated_waiting_time", "average_speed", "phase")
"""What `info` tells of each signal, after its id."""
Answer = tuple[dict[str, Any], dict[str, float], bool, dict[str, Any]]
Episode = tuple[list[dict[str, Any]], dict[str, Any]]


class World:
    """The traffic and the signals of one environment, a decision at a time."""

    def __init__(self, config: EnvConfig) -> None:
        """Open the map and plan the signals; the simulation starts with `reset`."""
        self.config = config
        bundle = open_map(config.scenario)
        self.map = MapManager(bundle, config.signals, additional=config.scenario.additional)
        self.signals: tuple[str, ...] = tuple(self.map.plans)
        self.simulation = Simulation(bundle.network, config.scenario, config.traffic, begin=config.begin)
        traffic = TrafficManager(self.simulation, config.scenario.routes)
        self.control = SignalManager(
            self.simulation, self.map.plans, config.signals, interval=config.episode.delta_time
        )
        self.managers: tuple[Manager, ...] = (self.map, traffic, self.control, *self._recorders())
        self.eyes = Eyes(bundle, config.sensing)
        self.observer = build_observer(config.observation, self.eyes, self.map.plans)
        self._lanes = LaneGroups([(p.lanes, p.limits, p.lengths) for p in self.map.plans.values()])
        self._names = {signal: [f"{signal}_{name}" for name in SIGNAL_FIGURES] for signal in self.signals}
        self._rewards = build_rewards(config.reward_fn, self.signals)
        self._files = EpisodeFiles(config.episode.out_csv_name)
        self._metrics = Metrics(self.map.plans, begin=config.begin)
        self._instant: Instant | None = None
        self._figures: dict[str, Any] | None = None
        self._ended = False
        self._seed = 0
        self._episode = 0
        self._actions: list[dict[str, int]] = []

    @property
    def instant(self) -> Instant:
        """The present decision.

        Raises:
            EpisodeOverError: no episode is running.
        """
        if self._instant is None:
            raise EpisodeOverError("no episode is running; call reset first")
        return self._instant

    @property
    def lasting(self) -> tuple[int, int | None]:
        """What an episode leaves to the next one: its number, and the label of its files."""
        return self._episode, self._files.label

    @lasting.setter
    def lasting(self, left: tuple[int, int | None]) -> None:
        self._episode, self._files.label = left

    def spaces(self) -> dict[str, tuple[spaces.Space[Any], spaces.Discrete]]:
        """Give each signal's observation and action space."""
        return {
            signal: (self.observer.space(signal), spaces.Discrete(self.control.count_actions(signal)))
            for signal in self.signals
        }

    def prepare(self) -> None:
        """Load and draw what episodes need, for those to find that begin in forks of this process.

        It begins one, and ends it.
        """
        self.reset(seed=0)
        self.simulation.close()
        self._instant, self._episode = None, 0

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; returns observations and figures.

        Raises:
            SimulationError: SUMO refuses the input.
        """
        self._finish_files()
        self._instant, self._figures, self._ended = None, None, False
        self._seed, self._actions = seed, []
        self._episode += 1
        turn = Turn(seed=seed, episode=self._episode)
        for manager in self.managers:
            manager.before_reset(turn)
        for manager in self.managers:
            manager.reset(turn)
        self._metrics = Metrics(self.map.plans, begin=self.config.begin)
        self.eyes.reset(seed)
        self.observer.reset(seed)
        self._instant = self._look()
        info = self._info(self._instant)
        return self._observe(self._instant), info

    def step(self, actions: Mapping[str, int]) -> Answer:
        """Act and simulate until the next decision; returns observations, rewards, end and figures.

        Raises:
            EpisodeOverError: no episode is running.
            ConfigError: an action is none of its signal's; nothing has happened then.
            SimulationError: SUMO stopped; `reset` begins anew.
        """
        before = self.instant
        if self._ended:
            raise EpisodeOverError("the episode has ended; call reset to begin another")
        try:
            self._advance(Turn(seed=self._seed, episode=self._episode, actions=actions))
        except SimulationError:
            self._instant = None
            raise
        self._actions.append({signal: int(action) for signal, action in actions.items()})
        now = self._instant = self._look()
        simulation = self.simulation
        self._metrics.note(now, arrived=simulation.arrived, travelled=simulation.travelled)
        self._ended = now.time >= self.config.begin + self.config.episode.num_seconds
        info = self._info(now)
        self._files.add(info)
        rewards = {signal: float(self._rewards[signal](signal, before, now)) for signal in self.signals}
        answer = self._observe(now), rewards, self._ended, info
        if self._ended:
            self._figures = self.metrics()
            self._finish_files()
            self.simulation.is_over = True
        return answer

    def run(self, controller: Controller, seed: int) -> Episode:
        """Run a whole episode; returns what `info` told at each decision, and its figures.

        Raises:
            SimulationError: SUMO refuses the input.
        """
        controller.reset(seed)
        self.reset(seed)
        infos: list[dict[str, Any]] = []
        while not self._ended:
            infos.append(self.step(controller.act(self.instant))[3])
        return infos, self.metrics()

    def draw(self, signal: str | None = None) -> Frame:
        """Draw what there is to see of the present decision, or of one signal, with the figures of all."""
        now = self.instant
        cameras = choose_cameras(self.eyes, self.signals if signal is None else (signal,))
        return Frame(board=read_board(now), views=draw_views(self.eyes, cameras, now.snapshot))

    def watch(self, on_second: Callable[[Snapshot], None]) -> None:
        """Show every simulated second to a function, from the next reset on."""
        self.managers = (*self.managers, WatchManager(self.simulation, on_second))

    def metrics(self) -> dict[str, Any]:
        """Compute the figures of the episode so far; see `metrics`."""
        if self._figures is not None:
            return self._figures
        pending = self.simulation.read_pending_delays()
        return {
            **self._metrics.compute(self.simulation.trips, pending),
            "violations": dict(self.control.safety.counts),
            "seed": self._seed,
        }

    def save(self) -> dict[str, Any]:
        """Save the full state: the seed and every action, from which `restore` simulates it anew, exactly.

        SUMO's own saved states lose the last digits of positions, so that a branch would drift.
        """
        if self._instant is None:
            raise EpisodeOverError("no episode is running; call reset first")
        return {"seed": self._seed, "actions": [dict(actions) for actions in self._actions]}

    def restore(self, state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Go to a saved state; returns its observations and figures.

        Raises:
            ConfigError: the state was not made by `save`, or by another scenario's.
        """
        try:
            seed, actions = int(state["seed"]), [dict(step) for step in state["actions"]]
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError(f"not a saved state ({error}); give what save returned") from error
        answer = self.reset(seed)
        for step in actions:
            observations, _, _, info = self.step(step)
            answer = observations, info
        return answer

    def close(self) -> None:
        """End everything, last manager first, and write what is left of the episode; safe at any time."""
        with ExitStack() as stack:
            for manager in self.managers:
                stack.callback(manager.close)
            self._finish_files()
            self.eyes.close()
        self._instant = None

    def _recorders(self) -> tuple[Manager, ...]:
        episode = self.config.episode
        if episode.record_name is None:
            return ()
        end = self.config.begin + episode.num_seconds
        return (
            RecorderManager(
                self.simulation,
                episode.record_name,
                end=end,
                scenario=self.config.scenario.name,
                map_sha256=self.map.bundle.road_map.source.sha256,
            ),
        )

    def _advance(self, turn: Turn) -> None:
        for manager in self.managers:
            manager.before_step(turn)
        # A hook that its manager leaves to the base does nothing, 3,600 times an episode.
        steps = [m.step for m in self.managers if type(m).step is not Manager.step]
        for _ in range(int(self.config.episode.delta_time)):
            for step in steps:
                step(turn)
        for manager in self.managers:
            manager.after_step(turn)

    def _look(self) -> Instant:
        simulation, control = self.simulation, self.control
        traffic = simulation.read_traffic()
        readings = self._lanes.divide(simulation.read_lanes(self._lanes.lanes))
        views = {
            signal: control.view(signal, lanes) for signal, lanes in zip(self.signals, readings, strict=True)
        }
        return Instant(simulation, traffic, views)

    def _observe(self, instant: Instant) -> dict[str, Any]:
        return {signal: self.observer.observe(signal, instant) for signal in self.signals}

    def _info(self, instant: Instant) -> dict[str, Any]:
        """Name the figures as SUMO-RL does; the keys are the same at every step."""
        info: dict[str, Any] = {"step": instant.time, **_system_figures(instant.traffic)}
        stopped = waiting = delay = co2 = 0.0
        for signal, view in instant.signals.items():
            lanes = view.lanes
            own = (int(lanes.total_halting), lanes.total_waiting, lanes.average_speed, view.phase)
            info.update(zip(self._names[signal], own, strict=True))
            stopped, waiting = stopped + lanes.total_halting, waiting + lanes.total_waiting
            delay, co2 = delay + lanes.delay, co2 + lanes.total_co2
        info["agents_total_stopped"] = int(stopped)
        info["agents_total_accumulated_waiting_time"] = waiting
        info["agents_total_delay"], info["agents_total_co2"] = delay, co2
        info["safety_violations"] = self.control.safety.counts.total()
        return info

    def _finish_files(self) -> None:
        if self._files.has_rows:
            known = self._figures is not None or self.simulation.is_running
            self._files.finish(self.metrics() if known else {}, episode=self._episode)


def _system_figures(traffic: TrafficReading) -> dict[str, float]:
    return {
        "system_total_running": traffic.running,
        "system_total_backlogged": traffic.backlogged,
        "system_total_stopped": traffic.stopped,
        "system_total_arrived": traffic.arrived,
        "system_total_departed": traffic.departed,
        "system_total_teleported": traffic.teleported,
        "system_total_waiting_time": traffic.waiting_time,
        "system_mean_waiting_time": traffic.waiting_time / traffic.running if traffic.running else 0.0,
        "system_mean_speed": traffic.mean_speed,
    }
