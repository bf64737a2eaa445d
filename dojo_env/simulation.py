"""SUMO itself: the only module that talks to libsumo or TraCI.

libsumo holds one simulation per process. Who starts a second one gets a clear error that names the way out.
Whatever SUMO refuses or breaks off is a `SimulationError` in SUMO's own words. A network that SUMO crashes on
while it loads would end this process, too, so SUMO's program loads it once before libsumo does.
"""

import os
import subprocess
import weakref
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from dojo_env.config import EnvConfig
from dojo_env.errors import SimulationBusyError, SimulationError
from dojo_env.forks import must_return_within
from dojo_env.notes import say_once
from dojo_env.reading import HALTING, Figures, TrafficReading, Trip
from dojo_env.road_users import RoadUsers
from dojo_env.signals.cycle import CycleStep
from dojo_env.snapshot import Snapshot
from dojo_env.sumo_files import SumoFiles
from dojo_env.sumo_messages import SumoMessages
from dojo_maps.sumo_programs import find_program, signal_name

_LOGICS = {"fixed": 0, "actuated": 3, "delay_based": 5}
"""SUMO's numbers of its logics."""
_USUAL_CAR = "DEFAULT_VEHTYPE"
_LARGEST_SEED = 2**31 - 1
_LOADING_LIMIT = 300.0
"""Seconds that SUMO may take to load a scenario; the largest cities in public use take a third of it."""
_LONGEST_SECOND = 60.0
"""Seconds of processor time that SUMO may take for a step; with impossible values it comes to no end."""
_LOCKED = 180.0
"""Seconds after which who stands inside a junction does not wait for a gap in the oncoming traffic."""
_owner: "weakref.ref[Simulation] | None" = None
_labels = iter(range(1 << 62))
_loadable: list[dict[str, str]] = []
"""Options, files among them, with which SUMO does not crash when it loads."""


class Simulation:
    """One run of SUMO, from `start` to `close`; it may be started again."""

    def __init__(self, network: Path, config: EnvConfig) -> None:
        """Note what is to be run, and check its files; nothing starts yet.

        Args:
            network: the map's SUMO network.
            config: of the environment.

        Raises:
            ScenarioError: a file cannot be read, or is unsafe.
        """
        self._config, self._settings, self._scenario = config.traffic, config.sumo, config.scenario
        self._files = SumoFiles(network, config.scenario, config.traffic.sumo_outputs, config.sumo.options)
        self._sumo: Any = None
        self._get: Any = None
        self.failures: tuple[type[Exception], ...] = ()
        """What SUMO's interface raises."""
        self._trips: dict[str, Trip] = {}
        self._known_types = 0
        self._usual_class = ""
        self._users: RoadUsers | None = None
        self._moving: tuple[tuple[str, ...], list[float]] | None = None
        self._process = os.getpid()
        self._messages: SumoMessages | None = None
        self.time = config.sumo.begin
        self.is_new_second = True
        """The last step has ended in another second than the one before."""
        self.moment = 0
        """Another number whenever the simulation has moved on."""
        self.lane_ids: tuple[str, ...] = ()
        """Every lane of the network, those inside of junctions, too."""
        self.has_stderr = False
        """This process's standard error is SUMO's alone."""
        self.is_over = False
        """The episode is over: another simulation of this process may take its place."""
        self.arrived = 0
        """Vehicles arrived since the start."""
        self.travelled = 0.0
        """The seconds that these were on their way, together."""

    @property
    def interface(self) -> Any:
        """SUMO's own interface, as `traci` has it; None while no simulation runs."""
        return self._sumo

    @property
    def is_running(self) -> bool:
        """Tell whether SUMO runs."""
        return self._sumo is not None

    @property
    def is_of_this_process(self) -> bool:
        """Tell whether it was started here; what a fork has inherited is its parent's."""
        return self._process == os.getpid()

    @property
    def trips(self) -> Mapping[str, Trip]:
        """Every vehicle that has departed, by its id."""
        return self._trips

    def start(self, seed: int, *, routes: str | None = None, more: Sequence[str] = ()) -> None:
        """Start SUMO at the begin of the episode.

        Args:
            seed: of all of SUMO's random numbers.
            routes: this episode's traffic as SUMO's XML, where the scenario names no files of it.
            more: further options.

        Raises:
            SimulationError: SUMO refuses the input, or this process runs another simulation.
        """
        self.close()
        self._trips, self._known_types, self.time, self._moving = {}, 0, self._settings.begin, None
        self.arrived, self.travelled, self.is_over = 0, 0.0, False
        self._process = os.getpid()
        if self._config.backend == "libsumo":
            self._try_loading()
        command = [*self._options(seed), *more]
        if routes is not None:
            command.append(f"--route-files={self._files.keep('episode.rou.xml', routes)}")
        self._messages = SumoMessages() if self._config.backend == "libsumo" else None
        try:
            if self._messages is not None:
                self._messages.begin()
            self._connect(command)
            if self._messages is not None and not self.has_stderr:
                self._messages.end()
            self.lane_ids = tuple(self._get.lane_getIDList())
            self._users = RoadUsers(self._get)
            self._usual_class = self._sumo.vehicletype.getEmissionClass(_USUAL_CAR)
            self._force_emission_class()
        except self.failures as error:
            raise self.fail(error, "SUMO does not start") from error
        except BaseException:
            self.close()
            raise
        for note in (*self._files.notes, *self._settings.notes, *self._note_seed(seed)):
            say_once(note)

    def fail(self, error: Exception, what: str | None = None) -> SimulationError:
        """End the simulation after one of `failures`, and make the error that tells it.

        Args:
            error: what SUMO's interface has raised.
            what: has happened; None says when SUMO stopped.

        Returns:
            An error that holds SUMO's own words.
        """
        words = " ".join(str(error).split()) if self._messages is None else self._messages.explain(error)
        words = self._files.name_originals(words)
        self.close()
        return SimulationError(f"{what or f'SUMO stopped after {self.time:g} s'}: {words}")

    def step(self) -> None:
        """Simulate one of SUMO's steps and note who departed and who arrived.

        Raises:
            SimulationError: no simulation is running.
        """
        self._running()
        get = self._get
        must_return_within(_LONGEST_SECOND)
        try:
            get.simulation_step()
        finally:
            must_return_within(0.0)
        before, self.time = self.time, round(self.time + self._settings.step, 3)
        self.is_new_second = int(self.time) > int(before)
        self.moment += 1
        self._moving = None
        for vehicle in get.simulation_getDepartedIDList():
            self._note_departure(vehicle)
        for vehicle in get.simulation_getArrivedIDList():
            self._note_arrival(vehicle)

    def show(self, signal: str, state: str) -> None:
        """Set a signal's letters.

        Args:
            signal: its id.
            state: a letter per link.
        """
        self._running().trafficlight.setRedYellowGreenState(signal, state)

    def read_state(self, signal: str) -> str:
        """Read the letters that a signal shows.

        Args:
            signal: its id.

        Returns:
            A letter per link.
        """
        state: str = self._get.trafficlight_getRedYellowGreenState(signal)
        return state

    def list_vehicles(self, lane: str) -> tuple[str, ...]:
        """List the vehicles on a lane by their ids.

        Args:
            lane: its id.

        Returns:
            Their ids.

        Raises:
            SimulationError: there is no such lane.
        """
        try:
            return tuple(self._get.lane_getLastStepVehicleIDs(lane))
        except self.failures as error:
            raise SimulationError(" ".join(str(error).split())) from error

    def list_approaching(self, signal: str, lanes: Iterable[str]) -> list[tuple[int, float, float, bool]]:
        """List the vehicles on these lanes whose next signal this is.

        Args:
            signal: its id.
            lanes: ids.

        Returns:
            The link that each will take, metres to the stop line, m/s, and whether it is an emergency
            vehicle, which flashes blue.
        """
        get, found = self._get, []
        for vehicle in (vehicle for lane in lanes for vehicle in get.lane_getLastStepVehicleIDs(lane)):
            for other, link, metres, _ in get.vehicle_getNextTLS(vehicle)[:1]:
                if other == signal:
                    is_urgent = get.vehicle_getVehicleClass(vehicle) == "emergency"
                    found.append((link, metres, get.vehicle_getSpeed(vehicle), is_urgent))
        return found

    def list_next_links(self, vehicles: Iterable[str]) -> list[tuple[str, int, float] | None]:
        """Tell the next signal of each vehicle, the link that it will take, and metres to the stop line.

        Args:
            vehicles: ids.

        Returns:
            The signal, the link and the metres of each; None where no signal comes.
        """
        coming = (self._get.vehicle_getNextTLS(vehicle)[:1] for vehicle in vehicles)
        return [found[0][:3] if found else None for found in coming]

    def count_halting(self, lanes: Iterable[str]) -> list[int]:
        """Count the vehicles slower than 0.1 m/s on each lane.

        Args:
            lanes: ids.

        Returns:
            A number per lane.
        """
        return list(map(self._get.lane_getLastStepHaltingNumber, lanes))

    def list_wanted_crossings(self) -> set[str]:
        """List the crossings at which somebody on foot stands and waits.

        Returns:
            Ids of the crossings.
        """
        get = self._get
        people = (person for person in get.person_getIDList() if get.person_getWaitingTime(person))
        return set(map(get.person_getNextEdge, people))

    def read_lanes(self, lanes: Sequence[str]) -> tuple[list[tuple[str, ...]], list[list[float]]]:
        """Measure lanes, and note for how long each vehicle on the road has waited so far.

        Args:
            lanes: ids, n of them.

        Returns:
            The vehicles on each lane, and the first rows of a `LaneReading`, of n values each: vehicles,
            halting ones, mean speed, mean length, waiting, CO2.
        """
        get = self._get
        on_lane = list(map(get.lane_getLastStepVehicleIDs, lanes))
        ids, _ = self._list_moving()
        waited = dict(zip(ids, map(get.vehicle_getAccumulatedWaitingTime, ids), strict=True))
        for vehicle in waited.keys() & self._trips.keys():
            self._trips[vehicle].waiting = waited[vehicle]
        return on_lane, [
            list(map(len, on_lane)),
            list(map(get.lane_getLastStepHaltingNumber, lanes)),
            list(map(get.lane_getLastStepMeanSpeed, lanes)),
            list(map(get.lane_getLastStepLength, lanes)),
            [sum(waited.get(vehicle, 0.0) for vehicle in vehicles) for vehicles in on_lane],
            list(map(get.lane_getCO2Emission, lanes)),
        ]

    def measure_slowness(self, lanes: Iterable[str]) -> float:
        """Measure how much slower than the speed limits traffic is.

        Args:
            lanes: ids.

        Returns:
            The sum over the lanes' vehicles of 1 - mean speed of the lane / speed limit, none below 0: one
            that stands counts 1.
        """
        get, slow = self._get, 0.0
        for lane in lanes:
            count = get.lane_getLastStepVehicleNumber(lane)
            if count:
                slow += count * max(0.0, 1 - get.lane_getLastStepMeanSpeed(lane) / get.lane_getMaxSpeed(lane))
        return slow

    def read_position(self, signal: str) -> tuple[int, float]:
        """Tell the number of the phase that a signal's program shows, and for how many seconds it has.

        Args:
            signal: its id.

        Returns:
            The phase's number, and seconds.
        """
        get = self._get
        return get.trafficlight_getPhase(signal), get.trafficlight_getSpentDuration(signal)

    def show_step(self, signal: str, number: int) -> None:
        """Have a signal's program go on with a step.

        Args:
            signal: its id.
            number: of the step.
        """
        self._running().trafficlight.setPhase(signal, number)

    def run_program(
        self,
        signal: str,
        kind: str,
        steps: Sequence[CycleStep],
        *,
        limits: tuple[float, float],
        start: tuple[int, float] | None = None,
        parameters: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        """Let SUMO's own logic run a cycle.

        Args:
            signal: that gets it.
            kind: `fixed`, `actuated` or `delay_based`.
            steps: of the cycle.
            limits: the least and the most seconds of a green whose length varies.
            start: the step to begin with, and how long it still lasts; None begins with the first.
            parameters: of SUMO's logic, by its names.
        """
        lights = self._running().trafficlight
        least, most = limits
        phases = [
            lights.Phase(
                step.seconds, step.state, *((least, most) if step.varies else (step.seconds, step.seconds))
            )
            for step in steps
        ]
        number, left = start or (0, steps[0].seconds)
        words = {name: f"{value:g}" for name, value in parameters.items()}
        lights.setProgramLogic(signal, lights.Logic("dojo", _LOGICS[kind], number, phases, words))
        if start is not None:
            lights.setPhaseDuration(signal, left)

    def read_traffic(self) -> TrafficReading:
        """Measure all traffic.

        Returns:
            Figures of the whole network.
        """
        self._running()
        get = self._get
        self._force_emission_class()
        ids, speeds = self._list_moving()
        # Who moves has a waiting time of zero.
        stopped = [vehicle for vehicle, speed in zip(ids, speeds, strict=True) if speed < HALTING]
        people = get.person_getIDList()
        return TrafficReading(
            running=len(ids),
            backlogged=int(float(get.simulation_getParameter("", "stats.vehicles.waiting"))),
            stopped=len(stopped),
            waiting_time=float(sum(map(get.vehicle_getWaitingTime, stopped))),
            mean_speed=sum(speeds) / len(speeds) if speeds else 0.0,
            arrived=self.arrived,
            departed=len(self._trips),
            teleported=int(float(get.simulation_getParameter("", "stats.teleports.total"))),
            pedestrians=len(people),
            pedestrian_waiting=float(sum(map(get.person_getWaitingTime, people))),
        )

    def read_pending_delays(self) -> Figures:
        """Measure how long each vehicle waits that has not found a place yet, seconds.

        Returns:
            (n,) seconds.
        """
        self._running()
        return _floats(map(self._get.vehicle_getDepartDelay, self._get.simulation_getPendingVehicles()))

    def read_time_losses(self) -> tuple[float, int]:
        """Add up what vehicles have lost by driving slower than they may, seconds, and count them.

        Returns:
            Seconds of all vehicles together, and how many these are.
        """
        get = self._get
        arrived = int(float(get.simulation_getParameter("", "device.tripinfo.count")))
        running = list(map(get.vehicle_getTimeLoss, get.vehicle_getIDList()))
        mean = float(get.simulation_getParameter("", "device.tripinfo.timeLoss"))
        return mean * arrived + sum(running), arrived + len(running)

    def read_locks(self) -> dict[str, int]:
        """Count the vehicles that stand inside junctions, and have for longer than any red lasts.

        Returns:
            How many there are, by the junction's id; junctions without any are left out.
        """
        get, (ids, speeds) = self._get, self._list_moving()
        stopped = (vehicle for vehicle, speed in zip(ids, speeds, strict=True) if speed < HALTING)
        lanes = (get.vehicle_getLaneID(v) for v in stopped if get.vehicle_getWaitingTime(v) > _LOCKED)
        return dict(Counter(lane[1:].rsplit("_", 2)[0] for lane in lanes if lane.startswith(":")))

    def read_snapshot(self) -> Snapshot:
        """Picture every road user and every signal.

        Returns:
            The present second.

        Raises:
            SimulationError: no simulation has been started.
        """
        self._running()
        if self._users is None:
            raise SimulationError("the simulation has not been started; call reset first")
        return self._users.read_snapshot(self.time, *self._list_moving())

    def close(self) -> None:
        """End SUMO; safe at any time and more than once."""
        global _owner  # noqa: PLW0603 - the process has one libsumo, so it has one owner
        sumo, self._sumo, self._users = self._sumo, None, None
        messages, self._messages = self._messages, None
        if messages is not None:
            messages.close()
        self.moment += 1
        if _owner is not None and _owner() is self:
            _owner = None
        if sumo is not None and self.is_of_this_process:
            try:
                sumo.close()
            except self.failures:
                return  # It is gone already.

    def __del__(self) -> None:
        """End SUMO with who held it last, so that a notebook's cell can be run again."""
        if getattr(self, "_sumo", None) is not None:
            with suppress(Exception):  # The interpreter may be ending.
                self.close()

    def _running(self) -> Any:
        if self._sumo is None:
            raise SimulationError("no simulation is running; call reset first")
        return self._sumo

    def _list_moving(self) -> tuple[tuple[str, ...], list[float]]:
        """List the vehicles on the road and their speeds: once, for figures and picture alike."""
        if self._moving is None:
            ids = self._get.vehicle_getIDList()
            self._moving = ids, list(map(self._get.vehicle_getSpeed, ids))
        return self._moving

    def _note_departure(self, vehicle: str) -> None:
        get = self._get
        self._trips[vehicle] = Trip(
            mode=get.vehicle_getVehicleClass(vehicle),
            route=tuple(get.vehicle_getRoute(vehicle)),
            depart=self.time,
            depart_delay=get.vehicle_getDepartDelay(vehicle),
        )

    def _note_arrival(self, vehicle: str) -> None:
        trip = self._trips.get(vehicle)
        if trip is not None:
            trip.arrival = self.time
            self.arrived += 1
            self.travelled += self.time - trip.depart

    def _force_emission_class(self) -> None:
        """Give vehicle types that emit like SUMO's usual car the class asked for; some come only later."""
        wanted, types = self._config.emission_class, self._sumo.vehicletype
        if wanted is None or types.getIDCount() == self._known_types:
            return
        for name in types.getIDList():
            if types.getEmissionClass(name) == self._usual_class:
                types.setEmissionClass(name, wanted)
        self._known_types = types.getIDCount()

    def _try_loading(self) -> None:
        """Let SUMO's program load what there is to load, once in a process.

        Raises:
            SimulationError: it crashes, or does not come to an end.
        """
        asked, network = self._files.options, self._files.options["net-file"]
        if asked in _loadable:
            return
        options = {**asked, "end": str(self._settings.begin + 1)}
        command = [str(find_program("sumo")), *(f"--{name}={value}" for name, value in options.items())]
        try:
            done = subprocess.run(  # noqa: S603 - SUMO's own program, without a shell
                command, stdin=subprocess.DEVNULL, capture_output=True, timeout=_LOADING_LIMIT, check=False
            )
        except subprocess.TimeoutExpired:
            raise SimulationError(f"SUMO has not loaded {network} after {_LOADING_LIMIT:g} s") from None
        if done.returncode < 0:
            name = signal_name(-done.returncode)
            raise SimulationError(
                f"SUMO crashes ({name}) when it loads {network} with its demand; try dojo-maps validate on it"
            )
        _loadable.append(asked)  # What SUMO refuses, libsumo will tell in SUMO's own words.

    def _note_seed(self, seed: int) -> list[str]:
        """Tell that the configuration's own seed does not hold, if so."""
        own, path = self._settings.seed, self._scenario.config
        if path is None or own in (None, seed) or "seed" in self._settings.options:
            return []
        return [f"{path.name}: seed {own} gives way to the episodes' own, as you ask"]

    def _options(self, seed: int) -> list[str]:
        """Write SUMO's command line; a value stands in one word with its name, or it could be an option."""
        options = {"seed": str(seed % _LARGEST_SEED), **self._files.options}
        return [f"--{name}={value}" for name, value in options.items()]

    def _connect(self, command: list[str]) -> None:
        if self._config.backend == "libsumo":
            self._connect_libsumo(command)
        else:
            self._connect_traci(command)

    def _connect_libsumo(self, command: list[str]) -> None:
        global _owner
        import libsumo  # noqa: PLC0415 - only who runs it loads it

        other = _owner() if _owner is not None else None
        if other is not None and other.is_running and not other.is_over and other.is_of_this_process:
            raise SimulationBusyError(
                "another environment of this process is running, and libsumo holds one simulation per "
                "process; close it first, or give own_process=True to run this one in a process of its own"
            )
        if other is not None:
            other.close()
        self.failures = (libsumo.TraCIException, libsumo.FatalTraCIError)
        # Its getters without their Python wrappers, which cost as much again.
        _owner, self._sumo, self._get = weakref.ref(self), libsumo, libsumo._libsumo
        libsumo.start(["sumo", *command])

    def _connect_traci(self, command: list[str]) -> None:
        import traci  # noqa: PLC0415

        self.failures = (traci.TraCIException, traci.FatalTraCIError, OSError)
        program = "sumo-gui" if self._config.use_gui else "sumo"
        if self._config.use_gui:
            command = [*command, "--start", "--quit-on-end"]
        label = f"dojo-{os.getpid()}-{next(_labels)}"
        # What SUMO and traci print is no output of ours; 2 is the number of standard error.
        with redirect_stdout(StringIO()):
            traci.start([str(find_program(program)), *command], label=label, numRetries=20, stdout=2)
        self._sumo = traci.getConnection(label)
        self._get = _TraciGetters(self._sumo)


class _TraciGetters:
    """Gives a TraCI connection's getters the names that libsumo's have: `vehicle_getSpeed`."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection
        self.simulation_step = connection.simulationStep

    def __getattr__(self, name: str) -> Any:
        domain, _, getter = name.partition("_")
        found = getattr(getattr(self._connection, domain), getter)
        setattr(self, name, found)
        return found


def _floats(values: Iterable[float]) -> Figures:
    return np.array(list(values), dtype=np.float64)
