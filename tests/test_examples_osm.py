"""Every example junction builds with its one command, without a network, and can be driven and trained on."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_sources_osm import helsinki

from dojo_maps.bundle import read_bundle
from dojo_maps.cli import main

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "osm"
CUT_OUT = ("liisankatu", "bulevardi", "mannerheimintie", "arkadiankatu", "kaisaniemi", "erottaja")
DRAWN = ("left_hand_t", "dual_carriageway", "dog_leg")


def run_example(script: str, *arguments: str, folder: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(EXAMPLES.parents[1])}
    command = [sys.executable, "-W", "error", str(EXAMPLES / script), *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", CUT_OUT)
def test_junction_of_helsinki_builds(name: str, tmp_path: Path) -> None:
    helsinki()
    said = run_example("helsinki.py", name, folder=tmp_path)
    assert "0 errors" in said
    assert "vehicles and" in said
    bundle = read_bundle(tmp_path / f"{name}.dojo")
    assert bundle.road_map.signals
    assert {"building"} <= {prop.kind for prop in bundle.road_map.props}
    size = np.subtract(*bundle.road_map.bounds[::-1])
    assert size.max() < 800, "the cut ends near its circle"


@pytest.mark.parametrize("name", DRAWN)
def test_drawn_junction_builds(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import-osm", str(EXAMPLES / f"{name}.osm"), "-o", str(tmp_path / f"{name}.dojo")]) == 0
    assert "0 errors" in capsys.readouterr().out
    road_map = read_bundle(tmp_path / f"{name}.dojo").road_map
    assert road_map.left_hand is (name == "left_hand_t")
    assert len(road_map.signals) == 1


def test_readme_names_every_example() -> None:
    readme = (EXAMPLES / "README.md").read_text()
    assert "OpenStreetMap contributors" in readme
    assert all(f"helsinki.py {name}" in readme for name in CUT_OUT)
    assert all(f"{name}.osm" in readme for name in DRAWN)
    assert {path.stem for path in EXAMPLES.glob("*.osm")} == set(DRAWN)


@pytest.mark.slow
def test_training_runs_and_keeps_its_weights(tmp_path: Path) -> None:
    bundle = tmp_path / "dual.dojo"
    assert main(["import-osm", str(EXAMPLES / "dual_carriageway.osm"), "-o", str(bundle)]) == 0
    said = run_example("train_on.py", str(bundle), "--rounds", "1", "--seconds", "200", folder=tmp_path)
    assert "max-pressure" in said
    assert np.load(tmp_path / "dual.npy").ndim == 2
