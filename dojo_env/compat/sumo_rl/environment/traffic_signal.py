"""One signal as SUMO-RL shows it to observations, rewards and scripts: measured by this environment."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from gymnasium import spaces

from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.reading import MIN_GAP
from dojo_env.signals.plan import SignalPlan

Environment = Any
"""A `SumoEnvironment`, which itself needs this class."""
Reward = Callable[["TrafficSignal"], float]


class Phase(NamedTuple):
    """A green phase: seconds that nobody counts, and letters."""

    duration: float
    state: str


class TrafficSignal:
    """A signal, its lanes and what is measured of them.

    Attributes:
        id: the signal's.
        env: the environment.
        lanes: ids of the lanes that lead to it.
        out_lanes: ids of those that lead away.
        lanes_length: metres, by lane.
        green_phases: the states to choose from.
        num_green_phases: how many.
        delta_time: seconds between decisions.
        yellow_time: seconds.
        min_green: seconds.
        max_green: seconds.
        last_measure: accumulated waiting at the last reward, in 100 s.
        last_reward: what was paid last.
        reward_dim: of the reward; 1 for a number.
        reward_space: of the rewards.
        observation_fn: observes.
        observation_space: of the observations.
        action_space: a number per green phase.
        time_since_last_phase_change: seconds since the last change began, or since the episode did.
    """

    MIN_GAP = MIN_GAP
    reward_fns: ClassVar[dict[str, Reward]] = {}

    def __init__(
        self,
        env: Environment,
        plan: SignalPlan,
        reward_fn: str | Reward | Sequence[str | Reward],
        lengths: dict[str, float],
    ) -> None:
        """Take what there is to control, and how it is paid.

        Args:
            env: the environment.
            plan: of the signal.
            reward_fn: a name, a function of this signal, or a list of these.
            lengths: metres, of all lanes.

        Raises:
            ConfigError: no reward has that name, or `reward_weights` has another number of them.
        """
        self.env, self.id, self._plan = env, plan.signal, plan
        self.lanes, self.out_lanes = list(plan.lanes), list(plan.out_lanes)
        self.lanes_length = {lane: lengths[lane] for lane in (*self.lanes, *self.out_lanes)}
        self.green_phases = [Phase(60, state) for state in plan.phases]
        self.num_green_phases = len(plan.phases)
        self.delta_time, self.yellow_time = env.delta_time, env.yellow_time
        self.min_green, self.max_green = env.min_green, env.max_green
        self.last_measure = 0.0
        self.last_reward: Any = None
        self._changed_at, self._phase = env.sim_step, 0
        self.reward_fn = reward_fn
        listed = [reward_fn] if isinstance(reward_fn, str) or callable(reward_fn) else list(reward_fn)
        self._rewards = [_find_reward(self.reward_fns, wanted) for wanted in listed]
        weights = env.reward_weights
        if weights is not None and len(weights) != len(listed):
            raise ConfigError(f"reward_weights={weights!r}: expected {len(listed)}, one for each reward")
        self.reward_dim = len(listed) if weights is None else 1
        self.reward_space = spaces.Box(-np.inf, np.inf, shape=(self.reward_dim,), dtype=np.float32)
        self.observation_fn = env.observation_class(self)
        self.observation_space: spaces.Space[Any] = self.observation_fn.observation_space()
        self.action_space: spaces.Discrete = spaces.Discrete(self.num_green_phases)

    @classmethod
    def register_reward_fn(cls, fn: Reward) -> None:
        """Give a reward function a name, its own.

        Args:
            fn: takes a `TrafficSignal` and gives a number; its `__name__` is what `reward_fn` may be then.

        Raises:
            KeyError: there is one of that name.
        """
        if fn.__name__ in cls.reward_fns:
            raise KeyError(f"there is a reward function {fn.__name__} already")
        cls.reward_fns[fn.__name__] = fn

    @property
    def sumo(self) -> Any:
        """SUMO's interface, as `traci` has it; None before the first reset."""
        return self.env.sumo

    @property
    def green_phase(self) -> int:
        """The phase that is green, or on its way."""
        return self._phase

    @property
    def is_yellow(self) -> bool:
        """Tell whether a change is under way."""
        return bool(self._view.state != self._plan.phases[self._phase])

    @property
    def time_since_last_phase_change(self) -> float:
        """Seconds since the last change began, or since the episode did."""
        return cast("float", self.env.sim_step - self._changed_at)

    @property
    def may_change(self) -> bool:
        """Tell whether a change would be granted now."""
        return self.time_since_last_phase_change >= self.min_green + self.yellow_time

    @property
    def time_to_act(self) -> bool:
        """Tell whether the signal can be told what to do: here always, all act at every decision."""
        return True

    @property
    def next_action_time(self) -> float:
        """The time of the decision that stands."""
        return cast("float", self.env.sim_step)

    def set_next_phase(self, new_phase: int) -> None:
        """Ask for a phase; before the minimum green and its yellow are over, nothing happens.

        Args:
            new_phase: number of a green phase; the one that is green, or on its way, changes nothing.
        """
        if self.may_change and int(new_phase) != self._phase:
            self.env.ask(self.id, int(new_phase))

    def note_decision(self, began: float) -> None:
        """Look at what the signal has done in an interval.

        Args:
            began: when the interval did, simulated seconds.
        """
        view = self._view
        if view.phase != self._phase:
            self._phase, self._changed_at = view.phase, began

    def compute_observation(self) -> Any:
        """Observe the signal."""
        return self.observation_fn()

    def compute_reward(self) -> Any:
        """Pay for the interval: a number, or (`reward_dim`,) where a list of rewards has no weights."""
        values = [reward(self) for reward in self._rewards]
        weights = self.env.reward_weights
        if weights is not None:
            self.last_reward = float(np.dot(values, weights))
        elif len(values) == 1:
            self.last_reward = values[0]
        else:
            self.last_reward = np.array(values, dtype=np.float32)
        return self.last_reward

    def get_accumulated_waiting_time_per_lane(self) -> list[float]:
        """Add up, for each lane, what its vehicles have waited on it, in seconds.

        SUMO tells what a vehicle has waited anywhere. What `env.vehicles` remembers from other lanes is taken
        off.
        """
        ask, known = self.sumo.vehicle.getAccumulatedWaitingTime, self.env.vehicles
        sums = []
        for lane in self.lanes:
            waited = 0.0
            for vehicle in self.env.world.instant.list_vehicles(lane):
                places = known.setdefault(vehicle, {})
                elsewhere = sum(seconds for place, seconds in places.items() if place != lane)
                places[lane] = ask(vehicle) - elsewhere
                waited += places[lane]
            sums.append(waited)
        return sums

    def get_average_speed(self) -> float:
        """Average, over the vehicles on the lanes, speed over what each may drive; 1 where there are none."""
        vehicles, ask = self._get_veh_list(), self.sumo.vehicle
        if not vehicles:
            return 1.0
        return sum(ask.getSpeed(name) / ask.getAllowedSpeed(name) for name in vehicles) / len(vehicles)

    def get_pressure(self) -> int:
        """Count the vehicles that leave, less those that come."""
        leaving = self.env.world.instant.count_vehicles(self.out_lanes).sum()
        return int(leaving - self._view.lanes.total_vehicles)

    def get_lanes_density(self) -> list[float]:
        """Tell the share of each lane's room that its vehicles take, at most 1."""
        lanes = self._view.lanes
        return self._shares(self.lanes, lanes.vehicles.tolist(), lanes.mean_length.tolist())

    def get_lanes_queue(self) -> list[float]:
        """Tell the share of each lane's room that halting vehicles take, at most 1."""
        lanes = self._view.lanes
        return self._shares(self.lanes, lanes.halting.tolist(), lanes.mean_length.tolist())

    def get_out_lanes_density(self) -> list[float]:
        """Tell the share of room taken of each lane that leads away, at most 1."""
        counts = self.env.world.instant.count_vehicles(self.out_lanes).tolist()
        means = [self.sumo.lane.getLastStepLength(lane) for lane in self.out_lanes]
        return self._shares(self.out_lanes, counts, means)

    def get_total_queued(self) -> int:
        """Count the halting vehicles on the lanes."""
        return int(self._view.lanes.total_halting)

    def _get_veh_list(self) -> list[str]:
        """List the vehicles on the lanes."""
        instant = self.env.world.instant
        return [vehicle for lane in self.lanes for vehicle in instant.list_vehicles(lane)]

    def _shares(self, lanes: list[str], counts: list[float], means: list[float]) -> list[float]:
        rooms = (self.lanes_length[lane] / (MIN_GAP + mean) for lane, mean in zip(lanes, means, strict=True))
        return [min(1.0, count / room) for count, room in zip(counts, rooms, strict=True)]

    @property
    def _view(self) -> SignalView:
        return cast("SignalView", self.env.world.instant.signals[self.id])


def _find_reward(known: dict[str, Reward], wanted: str | Reward) -> Reward:
    if callable(wanted):
        return wanted
    if wanted not in known:
        raise ConfigError(f"reward_fn={wanted!r}: expected one of {', '.join(known)}, or a function")
    return known[wanted]


def _diff_waiting_time(ts: TrafficSignal) -> float:
    waiting = sum(ts.get_accumulated_waiting_time_per_lane()) / 100.0
    ts.last_measure, before = waiting, ts.last_measure
    return before - waiting


TrafficSignal.reward_fns = {
    "diff-waiting-time": _diff_waiting_time,
    "average-speed": TrafficSignal.get_average_speed,
    "queue": lambda ts: -ts.get_total_queued(),
    "pressure": TrafficSignal.get_pressure,
}
