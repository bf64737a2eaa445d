"""Compare controllers on junctions that they never met, beside a rule that learns nothing.

Each bundle or scenario is run with several demands and seeds under every controller, all within one set of
constraints. A place is a pair of junction and demand, and its figures are means over the seeds. The table
tells geometric means beside the rule's of the travel time of all trips and of waiting, at how many places a
controller is faster and waits less, by how much it is slower at the worst of them, the waiting of walkers
beside fixed-time and at how many places it is no longer, the longest red, and the episodes that jam where the
rule's do not.

    python tools/compare_controllers.py one.dojo other.dojo --controllers learned fixed-time actuated

The controller `blind` is the best timing plan that sees nothing, searched for each junction with its demand.
The plans are kept, so that a search that was interrupted goes on. Name it as the rule to compare with it.

    python tools/compare_controllers.py one.dojo other.dojo --rule blind
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from dojo_env.commands.options import find_controller, read_yellow
from dojo_env.learning.episode_pools import open_processes
from dojo_env.learning.pace import Pace
from dojo_env.plan_search import Memory, search_plan
from dojo_env.runs import JAMMED, run_controller
from dojo_env.scenario import find_scenario, open_map
from dojo_env.timing_plans import write_plan
from dojo_maps.progress import say
from dojo_maps.whole_file import write_json

FIXED = "fixed-time"
"""What walkers are not to wait longer than under."""
BLIND = "blind"
"""The plan that a search finds."""
FIGURES = ("travel_time_all", "accumulated_waiting", "pedestrian_waiting", "longest_red", "late")


@dataclass(frozen=True, slots=True)
class Job:
    """An episode."""

    controller: str
    scenario: str
    demand: float
    seed: int
    seconds: int
    yellow: float | str
    all_red: float
    plans: Path

    @property
    def plan(self) -> Path:
        """Where the junction's blind plan is kept."""
        constraints = f"{self.seconds} {self.yellow} {self.all_red:g}"
        return self.plans / f"{Path(self.scenario).stem} {_identify(self.scenario)} {constraints}.json"

    @property
    def settings(self) -> dict[str, Any]:
        """What holds for all controllers."""
        return {"scenario": self.scenario, "num_seconds": self.seconds,
                "yellow_time": self.yellow, "all_red": self.all_red}  # fmt: skip


@cache
def _identify(scenario: str) -> str:
    """Tell a map's source from others of its name."""
    return open_map(find_scenario(scenario)).road_map.source.sha256[:12]


def search(job: Job) -> None:
    """Search the blind plan of a job's junction, where it is not kept yet."""
    if not job.plan.is_file():
        memory = Memory(job.plan.with_suffix(".search"))
        write_plan(search_plan(job.settings, memory=memory).found, job.plan)
        memory.forget()


def measure(job: Job) -> dict[str, float]:
    """Run an episode."""
    name = str(job.plan) if job.controller == BLIND else job.controller
    (found,) = run_controller(
        find_controller(name, job.scenario),
        [job.seed],
        additional_sumo_cmd=f"--scale {job.demand:g}",
        **job.settings,
    )
    return {figure: float(found[figure]) for figure in FIGURES}


def tabulate(
    found: dict[Job, dict[str, float]], controllers: Sequence[str], rule: str
) -> dict[str, dict[str, float]]:
    """Compare means over seeds; a row for each controller."""
    places = sorted({(job.scenario, job.demand) for job in found})

    def values(controller: str, figure: str) -> np.ndarray:
        """Give (places, seeds)."""
        return np.array([
            [each[figure] for job, each in found.items()
             if (job.controller, job.scenario, job.demand) == (controller, *place)]
            for place in places
        ])  # fmt: skip

    rows = {}
    for name in controllers:
        time, waiting, walkers = (values(name, figure).mean(1) for figure in FIGURES[:3])
        time0, waiting0 = (values(rule, figure).mean(1) for figure in FIGURES[:2])
        fixed = values(FIXED, FIGURES[2]).mean(1)
        rows[name] = {
            "travel_time_all": _ratio(time, time0),
            "accumulated_waiting": _ratio(waiting + 1, waiting0 + 1),
            "faster": float((time < time0).mean()),
            "worst": float((time / time0).max() - 1.0),
            "waits_less": float((waiting < waiting0).mean()),
            "walkers_beside_fixed_time": _ratio(walkers + 0.1, fixed + 0.1),
            "walkers_no_longer": float((walkers <= fixed + 0.01).mean()),
            "longest_red": float(values(name, "longest_red").max()),
            "jams": int(((values(name, "late") > JAMMED) & (values(rule, "late") <= JAMMED)).sum()),
        }
    return rows


def _ratio(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.exp(np.mean(np.log(ours / theirs))) - 1.0)


def main() -> int:
    """Run all, print the table, and write every episode as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenarios", nargs="+", metavar="SCENARIO")
    parser.add_argument("--controllers", nargs="+", default=["learned"], help="names, folders, blind")
    parser.add_argument("--rule", default="queue-pressure", help="what learns nothing")
    parser.add_argument("--demands", nargs="+", type=float, default=[0.9, 1.1], help="shares of the own")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--seconds", type=int, default=1800)
    parser.add_argument("--yellow", default=2, type=read_yellow, help="seconds, or speed")
    parser.add_argument("--all-red", default=0, type=float, help="seconds")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--plans", type=Path, default=Path("blind-plans"), help="where blind plans are kept")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    controllers = list(dict.fromkeys([options.rule, FIXED, *options.controllers]))
    seeds = range(options.seeds)
    jobs = [
        Job(*each, options.seconds, options.yellow, options.all_red, options.plans)
        for each in product(controllers, options.scenarios, options.demands, seeds)
    ]
    found: dict[Job, dict[str, float]] = {}
    pace = Pace(len(jobs), say, "episodes")
    with open_processes(options.processes) as run_all:
        if BLIND in controllers:
            options.plans.mkdir(parents=True, exist_ok=True)
            say(f"searching the blind plans of {len(options.scenarios)} junctions, some minutes each")
            run_all(search, list({job.scenario: job for job in jobs}.values()))
        for scenario in options.scenarios:
            here = [job for job in jobs if job.scenario == scenario]
            found |= zip(here, run_all(measure, here), strict=True)
            pace.note(len(found))
    rows = tabulate(found, controllers, options.rule)
    places = len(options.scenarios) * len(options.demands)
    print(f"{places} places, {options.seeds} seeds each, beside {options.rule}")
    print(f"{'':24}{'all trips':>10}{'waiting':>9}{'faster':>8}{'worst':>8}{'waits less':>12}"
          f"{'walkers':>9}{'no longer':>11}{'red':>6}{'jams':>6}")  # fmt: skip
    for name, row in rows.items():
        print(
            f"{name[-24:]:24}{row['travel_time_all']:+10.1%}{row['accumulated_waiting']:+9.0%}"
            f"{row['faster']:8.0%}{row['worst']:+8.1%}{row['waits_less']:12.0%}{row['walkers_beside_fixed_time']:+9.0%}"
            f"{row['walkers_no_longer']:11.0%}{row['longest_red']:6.0f}{row['jams']:6.0f}"
        )
    if options.json:
        episodes = [
            {"controller": job.controller, "scenario": Path(job.scenario).name, "demand": job.demand,
             "seed": job.seed, **figures} for job, figures in found.items()
        ]  # fmt: skip
        write_json(options.json, {"table": rows, "episodes": episodes})
    return 0


if __name__ == "__main__":
    sys.exit(main())
