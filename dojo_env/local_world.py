"""A world in this process: the managers in their order, decisions, observations, rewards and figures."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

from gymnasium import spaces

from dojo_env.config import EnvConfig
from dojo_env.controllers import Controller
from dojo_env.episode_files import EpisodeFiles
from dojo_env.errors import ConfigError, EpisodeOverError, SimulationError
from dojo_env.instant import Instant
from dojo_env.managers.base import Manager, Turn
from dojo_env.managers.looker import Looker, LookManager
from dojo_env.managers.map import MapManager
from dojo_env.managers.recorder import RecorderManager
from dojo_env.managers.signals import SignalManager
from dojo_env.managers.traffic import TrafficManager
from dojo_env.managers.watcher import WatchManager
from dojo_env.metrics import Metrics
from dojo_env.notes import say_once
from dojo_env.observations import Perceiver, build_observer
from dojo_env.reading import LaneGroups
from dojo_env.rewards import build_rewards, is_own
from dojo_env.scenario import open_map
from dojo_env.sensors.eyes import Eyes
from dojo_env.snapshot import Snapshot
from dojo_env.watching.board import read_board
from dojo_env.watching.views import Frame, choose_cameras, draw_views
from dojo_env.world import Answer, Beginning, Episode, World

SIGNAL_FIGURES = ("stopped", "accumulated_waiting_time", "average_speed", "phase")
"""What `info` tells of each signal, after its id."""


class LocalWorld(World):
    """Simulates in this process, of which libsumo allows one at a time.

    Attributes:
        config: all settings.
        managers: who does what in an episode, in their order.
        eyes: what sensors see with.
        observer: what agents see.
    """

    def __init__(self, config: EnvConfig) -> None:
        """Open the map and plan the signals; the simulation starts with `reset`.

        Args:
            config: all settings.

        Raises:
            ConfigError: a setting cannot work on this map.
            SourceError: a file of the scenario cannot be read.
        """
        self.config = config
        bundle = open_map(config.scenario)
        self.map = MapManager(bundle, config.signals, additional=config.additional)
        self.signals = tuple(self.map.plans)
        for words in self.map.list_warnings():
            say_once(words)
        self.traffic = TrafficManager(bundle, config)
        self.control = SignalManager(
            self.traffic.simulation,
            self.map.plans,
            config.signals,
            step=config.sumo.step,
            interval=config.sumo.interval,
        )
        self.eyes = Eyes(bundle, config.sensing)
        self.observer = build_observer(
            config.observation, self.eyes, self.map.plans, interval=config.sumo.interval
        )
        self.managers: tuple[Manager, ...] = (
            *self._lookers(),
            self.map,
            self.traffic,
            self.control,
            *self._recorders(),
        )
        self._lanes = LaneGroups([(p.lanes, p.limits, p.lengths) for p in self.map.plans.values()])
        self._names = {signal: [f"{signal}_{name}" for name in SIGNAL_FIGURES] for signal in self.signals}
        self._rewards = build_rewards(config.reward_fn, self.signals)
        self._measures_all = not all(map(is_own, self._rewards.values()))
        self._files = EpisodeFiles(config.episode.out_csv_name)
        self._metrics = Metrics(self.map.plans, begin=config.sumo.begin)
        self._instant: Instant | None = None
        self._figures: dict[str, Any] | None = None
        self._ended = False
        self._seed = 0
        self._episode = 0
        self._actions: list[dict[str, int]] = []

    @property
    def instant(self) -> Instant:
        """See `World`."""
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
        """See `World`."""
        return {
            signal: (self.observer.space(signal), spaces.Discrete(self.control.count_actions(signal)))
            for signal in self.signals
        }

    def prepare(self) -> None:
        """Load and draw what episodes need, for those to find that begin in forks of this process.

        It begins one, and ends it.
        """
        self.reset(seed=self.config.seed or 0)
        self.traffic.simulation.close()
        self._instant, self._episode = None, 0

    def reset(self, seed: int) -> Beginning:
        """See `World`."""
        self._finish_files()
        self._instant, self._figures, self._ended = None, None, False
        self._seed, self._actions = seed, []
        self._episode += 1
        turn = Turn(seed=seed, episode=self._episode)
        with self._guarded():
            for manager in self.managers:
                manager.before_reset(turn)
            for manager in self.managers:
                manager.reset(turn)
            self._metrics = Metrics(self.map.plans, begin=self.config.sumo.begin)
            self.eyes.reset(seed, begin=self.config.sumo.begin)
            self.observer.reset(seed)
            self._instant = self._look()
            return self._observe(self._instant), self._info(self._instant)

    def step(self, actions: Mapping[str, int]) -> Answer:
        """See `World`."""
        before = self.instant
        if self._ended:
            raise EpisodeOverError("the episode has ended; call reset to begin another")
        simulation = self.traffic.simulation
        with self._guarded():
            self._advance(Turn(seed=self._seed, episode=self._episode, actions=actions))
            self._actions.append({signal: int(action) for signal, action in actions.items()})
            now = self._instant = self._look()
            self._metrics.note(now, arrived=simulation.arrived, travelled=simulation.travelled)
            self._ended = now.time >= self.config.sumo.end
            info = self._info(now)
            self._files.add(info)
            rewards = {signal: float(self._rewards[signal](signal, before, now)) for signal in self.signals}
            answer = self._observe(now), rewards, self._ended, info
        if self._ended:
            self._figures = self.metrics()
            self._finish_files()
            simulation.is_over = True
        return answer

    def run(self, controller: Controller, seed: int) -> Episode:
        """See `World`."""
        controller.reset(seed)
        observations, _ = self.reset(seed)
        controller.meet(self.spaces())
        infos: list[dict[str, Any]] = []
        while not self._ended:
            controller.see(observations)
            observations, _, _, info = self.step(controller.act(self.perceive()))
            infos.append(info)
        return infos, self.metrics()

    def watch(self, on_second: Callable[[Snapshot], None]) -> None:
        """See `World`."""
        self.managers = (*self.managers, WatchManager(self.traffic.simulation, on_second))

    def draw(self, signal: str | None = None) -> Frame:
        """See `World`."""
        now = self.instant
        cameras = choose_cameras(self.eyes, self.signals if signal is None else (signal,))
        with self._guarded():
            return Frame(board=read_board(now), views=draw_views(self.eyes, cameras, now.snapshot))

    def metrics(self) -> dict[str, Any]:
        """See `World`."""
        if self._figures is not None:
            return self._figures
        simulation = self.traffic.simulation
        with self._guarded():
            pending, losses = simulation.read_pending_delays(), simulation.read_time_losses()
            locks = simulation.read_locks()
        return {
            **self._metrics.compute(simulation.trips, pending, losses),
            "longest_red": self.control.longest_red,
            "locks": locks,
            "violations": dict(self.control.safety.counts),
            "seed": self._seed,
        }

    def save(self) -> dict[str, Any]:
        """See `World`."""
        if self._instant is None:
            raise EpisodeOverError("no episode is running; call reset first")
        return {"seed": self._seed, "actions": [dict(actions) for actions in self._actions]}

    def restore(self, state: Mapping[str, Any]) -> Beginning:
        """See `World`."""
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
        """See `World`; the last manager ends first."""
        with ExitStack() as stack:
            for manager in self.managers:
                stack.callback(manager.close)
            self._finish_files()
            self.eyes.close()
        self._instant = None

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Let no failure of SUMO's out but as an error of ours, after which no episode is running."""
        simulation = self.traffic.simulation
        try:
            yield
        except SimulationError:
            self._instant = None
            raise
        except simulation.failures as error:
            self._instant = None
            raise simulation.fail(error) from error

    def perceive(self) -> Instant:
        """Give the present decision as controllers may see it."""
        return self.observer.perceive(self.instant) if isinstance(self.observer, Perceiver) else self.instant

    def _lookers(self) -> tuple[Manager, ...]:
        if not isinstance(self.observer, Looker):
            return ()
        return (LookManager(self.traffic.simulation, self.observer),)

    def _recorders(self) -> tuple[Manager, ...]:
        episode = self.config.episode
        if episode.record_name is None:
            return ()
        return (
            RecorderManager(
                self.traffic.simulation,
                episode.record_name,
                end=self.config.sumo.end,
                scenario=self.config.scenario.name,
                map_sha256=self.map.bundle.road_map.source.sha256,
            ),
        )

    def _advance(self, turn: Turn) -> None:
        for manager in self.managers:
            manager.before_step(turn)
        times = self.config.sumo
        left = min(times.interval, times.end - self.traffic.simulation.time)
        for _ in range(math.ceil(round(left / times.step, 6))):
            for manager in self.managers:
                manager.step(turn)
        for manager in self.managers:
            manager.after_step(turn)

    def _look(self) -> Instant:
        simulation, lanes = self.traffic.simulation, self._lanes.lanes
        traffic = simulation.read_traffic()
        on_lane, rows = simulation.read_lanes(lanes)
        views = {
            signal: self.control.view(signal, reading)
            for signal, reading in zip(self.signals, self._lanes.divide(rows), strict=True)
        }
        instant = Instant(simulation, traffic, views, dict(zip(lanes, on_lane, strict=True)))
        return instant.measure_all() if self._measures_all else instant

    def _observe(self, instant: Instant) -> dict[str, Any]:
        return {signal: self.observer.observe(signal, instant) for signal in self.signals}

    def _info(self, instant: Instant) -> dict[str, Any]:
        """Name the figures as SUMO-RL does; the keys are the same at every step."""
        info: dict[str, Any] = {"step": instant.time, **instant.traffic.figures}
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
            known = self._figures is not None or self.traffic.simulation.is_running
            self._files.finish(self.metrics() if known else {}, episode=self._episode)
