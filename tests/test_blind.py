"""What sees nothing: observations that no traffic changes, and the way from the best blind plan in tables."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dojo_env.benchmark.rows import read_row
from dojo_env.benchmark.tables import write_tables
from dojo_env.config import build_config
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import Training
from dojo_env.local_world import LocalWorld
from dojo_env.metrics import SIX


@cache
def see(observation: str, seed: int) -> list[Any]:
    """Act in one way and list what is observed."""
    config = build_config(
        scenario="cologne1", observation=observation, num_seconds=120, min_green=8, height=40, width=64
    )
    world = LocalWorld(config)
    (signal,) = world.signals
    seen = [world.reset(seed)[0][signal]]
    seen += [world.step({signal: (step // 4) % 4})[0][signal] for step in range(20)]
    space, _ = world.spaces()[signal]
    world.close()
    assert all(each in space for each in seen)
    return seen


def test_blind_observations_follow_the_phase_and_no_traffic() -> None:
    features, others = (np.array(see("features", seed)) for seed in (1, 2))
    assert not np.array_equal(features, others)
    blind, again = (np.array(see("blind", seed)) for seed in (1, 2))
    assert np.array_equal(blind, again)
    assert blind.shape == features.shape
    assert np.array_equal(blind[:, :4], features[:, :4])  # Phases.
    assert not blind[:, 5:].any()  # Lanes.
    assert len(np.unique(blind[:, 4])) > 2  # For how long it has been green.


def test_a_blind_picture_tells_the_phase_and_how_long() -> None:
    pictures = see("blind_picture", 1)
    assert all(np.array_equal(a, b) for a, b in zip(pictures, see("blind_picture", 2), strict=True))
    blind = see("blind", 1)
    for picture, features in zip(pictures, blind, strict=True):
        phase = int(features[:4].argmax())
        assert picture[0, :, 0].nonzero()[0].tolist() == list(range(16 * phase, 16 * phase + 16))
        assert (picture[-1, :, 0] > 0).sum() == round(64 * features[4])


def test_a_blind_training_sees_in_the_shape_of_the_other() -> None:
    assert Training(blind=True).environment["observation"] == "blind"
    for observation in ("bev", "multi_view"):
        assert Training(blind=True, observation=observation).environment["observation"] == "blind_picture"
    for wrong in ({"observation": "detector"}, {"observation": "bev", "encoder": "efficientnet-lite0"}):
        with pytest.raises(ConfigError, match="blind=True"):
            Training(blind=True, **wrong)


def test_a_row_is_a_plan_of_a_logic_or_a_controller(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('name = "Mine"\nlogic = "actuated"\n[settings]\nmin_green = 7\n')
    row = read_row(path)
    assert not row.learns
    assert row.find_settings("cologne1") == {"min_green": 7}
    for text in ('logic = "clever"', 'logic = "fixed"\ncontroller = "cycle"'):
        path.write_text(f'name = "Mine"\n{text}\n')
        with pytest.raises(ConfigError, match="logic"):
            read_row(path)


def test_a_scenario_with_a_pattern_has_the_settings_of_its_map(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('name = "Mine"\ncontroller = "cycle"\n[scenarios.cologne1]\nmin_green = 8\n')
    row = read_row(path)
    assert row.find_settings("cologne1-surges") == row.find_settings("cologne1") == {"min_green": 8}
    assert row.find_settings("cologne3-surges") == row.find_settings("cologne1-tides") == {}


def test_tables_tell_the_way_from_the_blind_plan_to_the_best_row(tmp_path: Path) -> None:
    def keep(row: str, travel: float, *, throughput: float = 2000.0, late: float = 0.0, **more: Any) -> None:
        figures = {name: {"mean": 10.0, "std": 0.0} for name in SIX}
        figures["travel_time"] = {"mean": travel, "std": 1.0}
        figures["throughput"] = {"mean": throughput, "std": 0.0}
        episodes = [{"travel_time_all": travel + k, "late": late * (k > 1), "seed": k} for k in range(3)]
        folder = tmp_path / "results" / "somewhere" / row.replace(" ", "-")
        folder.mkdir(parents=True)
        result = {"row": row, "seeds": 3, "figures": figures, "episodes": episodes, **more}
        (folder / "figures.json").write_text(json.dumps(result))

    keep("Blind", 60.0)
    keep("MaxPressure", 40.0)
    keep("Random", 70.0, late=0.2)
    keep("SOTL", 20.0, throughput=1000.0)
    keep("PPO-F", 45.0, training={}, trainings=3, between_trainings={"travel_time": 0.5})
    published = {"somewhere": {"PPO-F": {name: {"mean": 35.0, "std": 0.0} for name in SIX}}}
    published["somewhere"]["PPO-F"]["throughput"]["mean"] = 2000.0
    lines = write_tables(tmp_path / "results", published).splitlines()
    cells = {line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ") for line in lines}
    assert cells["row"][7:] == ["median of all trips (s)", "jams", "of the way", "trainings"]
    assert {name: cells[name][9] for name in ("Blind", "MaxPressure", "PPO-F", "Random", "*published*")} == {
        "Blind": "0%", "MaxPressure": "80%", "PPO-F": "60%", "Random": "-40%", "*published*": "100%",
    }  # fmt: skip
    assert cells["SOTL"][9] == "jams"
    assert cells["Random"][7:9] == ["71.00", "1 of 3"]
    assert cells["PPO-F"][10] == "3, ± 0.50 s"
