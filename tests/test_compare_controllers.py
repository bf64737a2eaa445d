"""tools/compare_controllers.py: the plan that sees nothing is searched for each junction, once."""

import shutil
from dataclasses import replace
from pathlib import Path

import commands  # noqa: F401 - leads to the tools

import compare_controllers
from dojo_env.scenario import find_scenario, open_map
from dojo_env.timing_plans import read_plan


def test_blind_plan_is_searched_for_the_junction_and_kept(tmp_path: Path) -> None:
    job = compare_controllers.Job(compare_controllers.BLIND, "two-way", 1.1, 0, 60, 2, 0.0, tmp_path)
    compare_controllers.search(job)
    (signal,) = read_plan(job.plan).signals.values()
    assert len(signal.stages) > 1
    found, kept = compare_controllers.measure(job), job.plan.stat().st_mtime_ns
    compare_controllers.search(job)
    assert job.plan.stat().st_mtime_ns == kept
    assert [path.name for path in tmp_path.iterdir()] == [job.plan.name]
    rule = compare_controllers.measure(replace(job, controller="queue-pressure"))
    assert found["travel_time_all"] != rule["travel_time_all"]
    assert replace(job, yellow=3).plan != job.plan


def test_another_map_of_the_same_name_has_a_plan_of_its_own(tmp_path: Path) -> None:
    job = compare_controllers.Job(compare_controllers.BLIND, "two-way", 1.1, 0, 60, 2, 0.0, tmp_path)
    other = shutil.copytree(open_map(find_scenario("cologne1")).folder, tmp_path / "two-way.dojo")
    (other / "demand.rou.xml").write_text("<routes/>")
    assert replace(job, scenario=str(other)).plan != job.plan
