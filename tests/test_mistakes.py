"""What newcomers get wrong is said in a line that tells what, where and what to do."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import run_env, run_maps

import dojo_env
import dojo_maps
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import Training
from dojo_maps.errors import UsageError

FILES = {
    "notes.txt": "no map",
    "table.csv": "x,y\n1,2\n",
    "five.toml": 'seconds = "five"\n',
    "folder/x.txt": "",
    "nobody.rou.xml": "<routes/>",
}
COMMANDS = {
    "maps convert notes.txt": (
        3,
        "notes.txt: line 1: not well-formed ...; it is damaged, or no SUMO network",
    ),
    "maps convert folder": (3, "folder: a folder, not a file; name a file in it"),
    "maps convert colgne1": (3, "colgne1: no such file; give a path, ...; did you mean cologne1?"),
    "maps convert two-way --ouput x": (
        2,
        "--ouput: no such option; did you mean --output?; dojo-maps convert --help ...",
    ),
    "maps convert two-way three-way": (
        2,
        "three-way: not expected here; dojo-maps convert --help tells more",
    ),
    "maps import-osm --point 60.1, 24.9": (
        2,
        "argument --point: '60.1,': expected LAT,LON in degrees, without spaces; ...",
    ),
    "maps import-osm --bbox 1,2,3": (
        2,
        "argument --bbox: '1,2,3': expected W,S,E,N in degrees, without spaces; ...",
    ),
    "maps import-osm x.net.xml": (
        2,
        "x.net.xml: not named as OpenStreetMap ...; dojo-maps convert takes other maps",
    ),
    "maps demand two-way --seed x": (
        2,
        "argument --seed: 'x': expected a whole number from 0 to 4294967295; ...",
    ),
    "maps demand two-way --volume x": (2, "argument --volume: 'x': expected 0 or more per hour, ..."),
    "maps demand two-way --counts table.csv": (
        3,
        "table.csv: row 1: has no from_edge; expected columns ..., found x, y",
    ),
    "env run --scenario two-way --controller maxpressure": (
        2,
        "controller 'maxpressure': ...; did you mean max-pressure?",
    ),
    "env run --scenario colone1 --controller cycle": (
        2,
        "scenario 'colone1' is not known; ...; did you mean cologne1?",
    ),
    "env run --scenario two-way --controller cycle --seeds x": (
        2,
        "argument --seeds: 'x': expected a whole number; ...",
    ),
    "env train --observation bev --size 84": (
        2,
        "argument --size: '84': expected HEIGHTxWIDTH, such as 84x84; ...",
    ),
    "maps convert two-way --jobs 0": (2, "argument --jobs: '0': expected a whole number above 0; ..."),
    "env run --config five.toml": (2, "five.toml: seconds = 'five': expected a whole number"),
    "env run --scenario two-way --controller folder": (
        3,
        "folder: no training; dojo-env train --out FOLDER makes one",
    ),
    "env run --scenario two-way --controller table.npz": (
        3,
        "table.npz: cannot be read as a universal policy, ...",
    ),
    "env replay notes.txt": (
        3,
        "notes.txt: cannot be read as a recording, such as dojo-env run --record writes (...)",
    ),
    "env evaluate folder": (3, "folder: no training; dojo-env train --out FOLDER makes one"),
    "env benchmark --rows Maxpressure": (2, "row 'Maxpressure': ...; did you mean MaxPressure?"),
}


@pytest.mark.parametrize("line", COMMANDS)
def test_command_says_what_to_do(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in {**FILES, "table.npz": "x"}.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
    program, *words = line.split()
    done = {"maps": run_maps, "env": run_env}[program](*words)
    status, told = COMMANDS[line]
    assert done.returncode == status
    expected = ".*".join(map(re.escape, f"dojo-{program}: {told}".split("...")))
    assert re.fullmatch(expected, done.stderr.rstrip("\n")), done.stderr


CALLS: dict[str, tuple[type[Exception], Callable[[], Any]]] = {
    "seeds='3': expected how many": (
        ConfigError,
        lambda: dojo_env.run_controller("cycle", "3", scenario="two-way"),
    ),
    "seeds=[1.5]: expected how many": (
        ConfigError,
        lambda: dojo_env.record("o", scenario="two-way", seed=1.5),
    ),
    "expected a name, or an object such as MyController()": (
        ConfigError,
        lambda: dojo_env.run_controller(dojo_env.Controller, 1, scenario="two-way"),
    ),
    "num_seconds='60': expected a number, at least 1": (
        ConfigError,
        lambda: dojo_env.build_config(scenario="two-way", num_seconds="60"),
    ),
    "outputs='rgb': expected a list": (ConfigError, lambda: next(dojo_env.replay("x.npz", outputs="rgb"))),
    "expected a list; write cameras=[...]": (
        ConfigError,
        lambda: next(dojo_env.replay("x.npz", dojo_env.Camera(name="a", position=(0, 0, 9)))),
    ),
    "options={}: expected dojo_maps.ConvertOptions(...)": (
        UsageError,
        lambda: dojo_maps.convert("two-way", "x", {}),
    ),
    "exports='geojson': expected a tuple with some of": (
        UsageError,
        lambda: dojo_maps.ConvertOptions(exports="geojson"),
    ),
    "only='signals.yellow_short': expected a list": (
        UsageError,
        lambda: dojo_maps.fix("two-way", only="signals.yellow_short"),
    ),
    "volume=-1: expected a number, 0 or more": (UsageError, lambda: dojo_maps.DemandOptions(volume=-1)),
    "end=5: expected seconds after the begin, 10": (
        UsageError,
        lambda: dojo_maps.DemandOptions(begin=10, end=5),
    ),
    "signal='x': name one of the signals of two-way: t": (
        UsageError,
        lambda: dojo_maps.draw_signal(dojo_maps.convert("two-way", "x.dojo")[0], "x"),
    ),
    "scenario=['two-way']: expected a name, a path or a Scenario": (
        ConfigError,
        lambda: dojo_env.build_config(scenario=["two-way"]),
    ),
    "conditions 'nite': expected day, dusk": (
        ConfigError,
        lambda: dojo_env.build_config(scenario="two-way", conditions="nite"),
    ),
    "training={}: expected dojo_env.Training(...)": (ConfigError, lambda: dojo_env.train({}, "x")),
    "no episode to summarize": (ConfigError, lambda: dojo_env.summarize([])),
    "options={}: expected dojo_maps.DemandOptions(...)": (
        UsageError,
        lambda: dojo_maps.add_demand("two-way", {}),
    ),
    "point=(1, 2, 3): expected latitude and longitude": (
        UsageError,
        lambda: dojo_maps.import_osm(point=(1, 2, 3)),
    ),
    "there is no setting 'condition' of sight; did you mean conditions?": (
        ConfigError,
        lambda: next(
            dojo_env.replay(dojo_env.record("o", scenario="two-way", num_seconds=5), condition="day")
        ),
    ),
    "seconds=7: expected a multiple of delta_time=5": (ConfigError, lambda: Training(seconds=7)),
    "n_steps=90: expected a divisor of 60, the decisions of an episode of 300 s": (
        ConfigError,
        lambda: Training(seconds=300, hyperparameters={"n_steps": 90}),
    ),
}


@pytest.mark.parametrize("told", CALLS)
def test_call_says_what_to_do(told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    kind, call = CALLS[told]
    with pytest.raises(kind, match=re.escape(told)):
        call()


def test_updates_fit_short_episodes() -> None:
    """What is not asked for is made to fit: an update waits for whole parts of an episode."""
    usual = Training(processes=2).hyperparameters
    assert (usual["n_steps"], usual["batch_size"]) == (90, 180)
    short = Training(seconds=300, processes=3).hyperparameters
    assert (short["n_steps"], short["batch_size"]) == (60, 180)
    assert Training(seconds=35, algorithm="dqn").hyperparameters["train_freq"] == 1
