"""How fast environments are beside bare libsumo, all with the same decisions.

Each run has a process of its own, and the variants take turns. Seconds are of processor time, those of the
fastest of the rounds: others' work on the machine only ever adds to them. SUMO is bare where only its steps
and the signals' states are asked for. The floor of pictures is bare SUMO and the time that the same pictures
take to draw without it. `asking` is bare SUMO where everything that an observation and its `info` need is
asked for, and nothing is done with the answers: no environment over libsumo that tells the same is faster.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import starmap
from multiprocessing import get_context
from pathlib import Path
from typing import Any, cast

from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld
from dojo_env.scenario import find_scenario, open_map
from dojo_env.signals.switching import SignalSwitch
from dojo_maps.whole_file import write_json

SECONDS, INTERVAL, HOLD = 3600, 5, 3
"""An episode, a decision interval, and how many decisions a phase stays."""
ALL_SENSORS = {
    "bev": "bev", "depth": "bev:depth", "classes": "bev:semantic", "users": "bev:instance",
    "approach": "approach_0", "lidar": "lidar",
}  # fmt: skip
OBSERVED = ("features", "bev", "bev-camera", "multi_view", "detector", "all-sensors")
GOALS = {"features": 0.85, "bev": 0.75, "multi_view": 0.5}
"""Shares of bare libsumo's speed."""
OF_FLOOR = 0.8
"""Share of the floor's speed."""
FLOORS = ("bev", "multi_view")
BESIDE_SUMO_RL = 1.5
"""Times that pictures may take of SUMO-RL's time with features."""
SETTINGS = {"min_green": 8, "emission_class": None}


def wanted_phase(decision: int, phases: int) -> int:
    """Take the phases in turn: the same decisions whatever is seen."""
    return (decision // HOLD) % phases


Asked = list[list[tuple[str, list[tuple[Any, ...]]]]]
"""For each step, SUMO's getters by name, in turn, and what each was asked about."""


class Recorder:
    """Stands for libsumo's getters, and notes what they are asked."""

    def __init__(self, getters: Any) -> None:
        """Record nothing but the getters; `asked` fills up by steps."""
        self.getters, self.asked = getters, cast(Asked, [[]])

    def __getattr__(self, name: str) -> Any:
        """Find a getter that notes its arguments."""
        getter = getattr(self.getters, name)
        if name == "simulation_step":

            def ask() -> Any:
                self.asked.append([])
                return getter()

            return ask

        def note(*about: Any) -> Any:
            now = self.asked[-1]
            if not now or now[-1][0] != name:
                now.append((name, []))
            now[-1][1].append(about)
            return getter(*about)

        return note


def open_world(scenario: str, observation: str) -> LocalWorld:
    """Make our environment's world with one of `OBSERVED`."""
    wanted: Any = ALL_SENSORS if observation == "all-sensors" else observation
    more: dict[str, Any] = {}
    if observation == "bev-camera":  # With all that a camera does to its pictures.
        wanted, more = "bev", {"imaging": "traffic_camera"}
    return LocalWorld(
        build_config(scenario=scenario, observation=wanted, num_seconds=SECONDS, **SETTINGS, **more)
    )


def record(scenario: str, observation: str) -> Asked:
    """Play an episode, and list what SUMO was asked after each step."""
    world = open_world(scenario, observation)
    world.reset(1)
    simulation = world.traffic.simulation
    recorder = Recorder(vars(simulation)["_get"])
    vars(simulation)["_get"] = vars(vars(simulation)["_users"])["_get"] = recorder
    finish(world)
    world.close()
    return recorder.asked[1:]


def run_bare(scenario: str, asked: Asked | None = None) -> dict[str, Any]:
    """Step libsumo and set states from a list made before; then ask for what an episode asked."""
    import libsumo

    found = find_scenario(scenario)
    world = LocalWorld(build_config(scenario=scenario, **SETTINGS))
    shown = {signal: _states(world, signal) for signal in world.signals}
    questions = [[(getattr(libsumo._libsumo, name), about) for name, about in now] for now in asked or ()]
    network = open_map(found).network
    options = ["-n", str(network), "-r", str(found.routes[0]), "-b", str(found.begin), "--seed", "1"]
    options += ["--no-step-log", "--no-warnings", "--xml-validation", "never", "--time-to-teleport", "-1"]
    start = time.process_time()
    libsumo.start(["sumo", *options, "--waiting-time-memory", "1000", "--max-depart-delay", "-1"])
    arrived = 0
    for second in range(SECONDS):
        for signal, states in shown.items():
            if second in states:
                libsumo.trafficlight.setRedYellowGreenState(signal, states[second])
        libsumo.simulationStep()
        arrived += libsumo.simulation.getArrivedNumber()
        for getter, about in questions[second] if questions else ():
            list(starmap(getter, about))
    seconds = time.process_time() - start
    libsumo.close()
    return {"seconds": seconds, "arrived": arrived}


def _states(world: LocalWorld, signal: str) -> dict[int, str]:
    """List the states that the decisions lead to, by the second at which they begin."""
    switch = SignalSwitch(world.map.plans[signal], world.config.signals)
    states, last = {0: switch.state}, switch.state
    for second in range(SECONDS):
        if second % INTERVAL == 0:
            switch.request_phase(wanted_phase(second // INTERVAL, len(world.map.plans[signal].phases)))
        if switch.state != last:
            states[second] = last = switch.state
        if switch.advance():
            states[second + 1] = last = switch.state
    return states


def run_sumo_rl(scenario: str) -> dict[str, Any]:
    """Run SUMO-RL's environment on libsumo."""
    found = find_scenario(scenario)
    from sumo_rl import SumoEnvironment

    env = SumoEnvironment(
        net_file=str(found.map), route_file=str(found.routes[0]), begin_time=int(found.begin),
        num_seconds=SECONDS, delta_time=INTERVAL, yellow_time=2, min_green=8, sumo_seed=1,
        sumo_warnings=False, additional_sumo_cmd="--no-step-log --xml-validation never",
    )  # fmt: skip
    start = time.process_time()
    env.reset()
    decision, ended = 0, False
    while not ended:
        actions = {
            name: wanted_phase(decision, signal.num_green_phases)
            for name, signal in env.traffic_signals.items()
        }
        _, _, dones, _ = env.step(actions)
        decision, ended = decision + 1, dones["__all__"]
    seconds = time.process_time() - start
    arrived = int(float(env.sumo.simulation.getParameter("", "stats.vehicles.inserted"))) - len(
        env.sumo.vehicle.getIDList()
    )
    env.close()
    return {"seconds": seconds, "arrived": arrived}


def play(world: LocalWorld) -> None:
    """Run an episode."""
    world.reset(1)
    finish(world)


def finish(world: LocalWorld) -> None:
    """Run an episode that has been reset to its end."""
    counts = {signal: len(plan.phases) for signal, plan in world.map.plans.items()}
    decision, ended = 0, False
    while not ended:
        _, _, ended, _ = world.step({name: wanted_phase(decision, count) for name, count in counts.items()})
        decision += 1


def run_ours(scenario: str, observation: str) -> dict[str, Any]:
    """Run our environment with one kind of observation."""
    world = open_world(scenario, observation)
    world.reset(1)  # Loading libsumo and drawing backgrounds come once, as does the end of the run before.
    world.traffic.simulation.close()
    start = time.process_time()
    play(world)
    seconds = time.process_time() - start
    arrived = world.traffic.simulation.arrived
    world.close()
    return {"seconds": seconds, "arrived": arrived}


def run_drawing(scenario: str, observation: str) -> dict[str, Any]:
    """Draw once more what an episode has drawn, without SUMO."""
    world = open_world(scenario, observation)
    draw, drawn = world.eyes.look, []

    def look(*what: Any) -> Any:
        drawn.append(what)
        return draw(*what)

    vars(world.eyes)["look"] = look
    play(world)
    start = time.process_time()
    for what in drawn:
        draw(*what)
    seconds = time.process_time() - start
    arrived = world.traffic.simulation.arrived
    world.close()
    return {"seconds": seconds, "arrived": arrived}


def measure(variant: str, scenario: str) -> dict[str, Any]:
    """Run a variant in a process of its own."""
    home = Path(__import__("sumo").__file__).parent
    environment = {**os.environ, "SUMO_HOME": str(home), "LIBSUMO_AS_TRACI": "1"}
    command = [sys.executable, __file__, "--variant", variant, "--scenarios", scenario]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)  # noqa: S603
    if done.returncode:
        raise RuntimeError(f"{variant} on {scenario} failed: {done.stderr[-2000:]}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def run_variant(variant: str, scenario: str) -> dict[str, Any]:
    """Run a variant here, and measure the memory it took."""
    runners = {"bare": run_bare, "sumo-rl": run_sumo_rl}
    kind, _, observation = variant.partition(":")
    if kind == "drawing":
        result = run_drawing(scenario, observation)
    elif kind == "asking":
        with ProcessPoolExecutor(1, get_context("spawn")) as another:  # SUMO's first episode is repeatable.
            asked = another.submit(record, scenario, observation).result()
        result = run_bare(scenario, asked)
    else:
        result = runners[variant](scenario) if variant in runners else run_ours(scenario, variant)
    result["megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return result


def compare(scenario: str, variants: list[str], rounds: int) -> list[dict[str, Any]]:
    """Measure the variants in turns; a table row each."""
    runs = [{variant: measure(variant, scenario) for variant in variants} for _ in range(rounds)]
    rows = []
    fastest = {variant: min(run[variant]["seconds"] for run in runs) for variant in variants}
    for variant, seconds in fastest.items():
        drawing = fastest.get(f"drawing:{variant}")
        rows.append(
            {
                "scenario": scenario,
                "variant": variant,
                "seconds": seconds,
                "simulated_per_s": SECONDS / seconds,
                "steps_per_s": SECONDS / INTERVAL / seconds,
                "of_bare": fastest["bare"] / seconds,
                "of_floor": None if drawing is None else (fastest["bare"] + drawing) / seconds,
                "of_sumo_rl": seconds / fastest["sumo-rl"],
                "arrived": runs[0][variant]["arrived"],
                "megabytes": max(run[variant]["megabytes"] for run in runs),
            }
        )
    return rows


def main() -> int:
    """Print a table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenarios", nargs="+", default=["two-way", "cologne1", "cologne8", "ingolstadt21"])
    parser.add_argument("--observations", nargs="+", default=list(OBSERVED), choices=list(OBSERVED))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--variant", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.variant:
        print(json.dumps(run_variant(options.variant, options.scenarios[0])))
        return 0
    print(
        f"{'scenario':14}{'variant':20}{'seconds':>8}{'sim s/s':>9}{'steps/s':>9}{'of bare':>9}"
        f"{'arrived':>9}{'MB':>6}"
    )
    rows = []
    for scenario in options.scenarios:
        open_map(find_scenario(scenario))
        floors = [f"drawing:{name}" for name in options.observations if name in FLOORS]
        floors += [f"asking:{name}" for name in options.observations]
        variants = ["bare", "sumo-rl", *options.observations, *floors]
        for row in compare(scenario, variants, options.rounds):
            rows.append(row)
            print(
                f"{row['scenario']:14}{row['variant']:20}{row['seconds']:8.2f}{row['simulated_per_s']:9.0f}"
                f"{row['steps_per_s']:9.0f}{row['of_bare']:9.2f}{row['arrived']:9d}{row['megabytes']:6.0f}"
            )
    for row in rows:
        if row["variant"].startswith("bev"):
            word = "holds" if row["of_sumo_rl"] <= BESIDE_SUMO_RL else "MISSED"
            print(
                f"{word:8}{row['scenario']}, {row['variant']}: {row['of_sumo_rl']:.2f} times SUMO-RL's time "
                f"with features, goal {BESIDE_SUMO_RL}"
            )
        if row["of_floor"] is not None:
            word = "holds" if row["of_floor"] >= OF_FLOOR else "MISSED"
            print(
                f"{word:8}{row['scenario']}, {row['variant']}: {row['of_floor']:.2f} of bare SUMO and of "
                f"drawing alone, goal {OF_FLOOR}"
            )
        if row["variant"] in GOALS:
            goal = GOALS[row["variant"]]
            word = "holds" if row["of_bare"] >= goal else "MISSED"
            print(f"{word:8}{row['scenario']}, {row['variant']}: {row['of_bare']:.2f} of bare, goal {goal}")
    if options.json:
        write_json(options.json, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
