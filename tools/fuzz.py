"""Damage inputs of every kind at random and see that each ends in a result or in one clear line.

    python tools/fuzz.py --count 10000 --jobs 2
    python tools/fuzz.py --kinds network osm --seed 7 --count 500 --keep findings

A trial damages one small good input, gives it to the program in a forked process within bounds of time and
memory, and looks at the end: a traceback, a defect that the program admits, a crash, a hang, more than one
line of error, or something left half written is a finding. Where SUMO itself crashes or hangs, and with it
the process that it runs in, the trial is done once more through the command that must survive it.
"""

import argparse
import contextlib
import importlib.util
import io
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import dojo_env.cli
import dojo_maps.cli
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.local_world import LocalWorld
from dojo_maps.errors import DojoError
from random_damage import (
    Mutate,
    damage,
    damage_archive,
    damage_binary_gltf,
    damage_bytes,
    damage_json,
)

MEMORY = 8 << 30
"""Bytes of address space that a trial gets."""
PATIENCE = 120.0
"""Seconds after which a trial counts as hanging."""
SECONDS = 20
"""Simulated seconds of an episode."""
_LONGEST_ERROR = 1500
_UNNOTICED = 5
"""The status of a trial whose damage was taken for good."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of input.

    Attributes:
        files: good inputs, of which a trial damages one.
        name: what the damaged file is called.
        mutate: damages bytes.
        run: runs the program in a trial's folder; returns an exit status.
        beside: what lies beside the damaged file, by its name there.
        command: what is run once more where SUMO itself has crashed.
    """

    files: Sequence[Path]
    name: str
    mutate: Mutate
    run: Callable[[Path, random.Random], int]
    beside: Mapping[str, Path]
    command: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A trial that did not end well."""

    kind: str
    seed: int
    problem: str
    said: str


def make_kinds(folder: Path) -> dict[str, Kind]:
    """Make the good inputs and say what is done with each.

    Args:
        folder: an empty folder to make them in.

    Returns:
        Kinds by name.
    """
    network = _make_network(folder)
    routes, additional, config = folder / "r.rou.xml", folder / "a.add.xml", folder / "s.sumocfg"
    routes.write_text(_ROUTES, encoding="utf-8")
    additional.write_text(_ADDITIONAL, encoding="utf-8")
    config.write_text(_CONFIG, encoding="utf-8")
    osm = folder / "m.osm"
    osm.write_text(_make_osm(), encoding="utf-8")
    bundle = folder / "b.dojo"
    _quietly(dojo_maps.cli.main, ["convert", str(network), "-o", str(bundle)])
    shutil.copy(routes, bundle / "demand.rou.xml")
    world = LocalWorld(
        build_config(scenario=str(config), num_seconds=SECONDS, record_name=str(folder / "recorded"))
    )
    with closing(world):
        world.run(make_controller("max-pressure"), 0)
        cameras = folder / "cameras.json"
        from dojo_env.camera import write_cameras

        write_cameras(world.eyes.cameras(world.signals[0]), cameras)
    recording = folder / "recorded_ep1.npz"
    scenario = {"n.net.xml": network, "r.rou.xml": routes, "a.add.xml": additional, "s.sumocfg": config}
    whole = {"b.dojo": bundle}
    driven = ("-m", "dojo_env.cli", "run", "--controller", "max-pressure", "--seconds", str(SECONDS))
    from_config = {"run": partial(_drive, "s.sumocfg"), "command": (*driven, "--scenario", "s.sumocfg")}
    from_bundle = {"run": partial(_use_bundle, "b.dojo"), "command": (*driven, "--scenario", "b.dojo")}
    recorded = {"r.npz": recording, "n.net.xml": network}
    learned = {}
    if importlib.util.find_spec("torch") and importlib.util.find_spec("stable_baselines3"):
        policy = _make_policy(folder)
        learned["policy"] = Kind(
            files=[policy], name="policy.pt", mutate=damage_bytes, run=_load_policy, beside={}
        )
    return {
        **learned,
        "network": Kind(files=[network], name="n.net.xml", mutate=damage, run=_use_network, beside={}),
        "osm": Kind(files=[osm], name="m.osm", mutate=damage, run=_use_osm, beside={}),
        "routes": Kind(files=[routes], name="r.rou.xml", mutate=damage, beside=scenario, **from_config),
        "additional": Kind(
            files=[additional], name="a.add.xml", mutate=damage, beside=scenario, **from_config
        ),
        "sumocfg": Kind(files=[config], name="s.sumocfg", mutate=damage, beside=scenario, **from_config),
        "driven_network": Kind(
            files=[network], name="n.net.xml", mutate=damage, beside=scenario, **from_config
        ),
        "map": Kind(
            files=[bundle / "map.json"], name="b.dojo/map.json", mutate=damage_json, beside=whole,
            **from_bundle,
        ),
        "scene": Kind(
            files=[bundle / "scene.glb"], name="b.dojo/scene.glb", mutate=damage_binary_gltf, beside=whole,
            **from_bundle,
        ),
        "bundle_network": Kind(
            files=[bundle / "network.net.xml"], name="b.dojo/network.net.xml", mutate=damage, beside=whole,
            **from_bundle,
        ),
        "recording": Kind(
            files=[recording], name="r.npz", mutate=damage_archive, run=_replay, beside=recorded
        ),
        "cameras": Kind(
            files=[cameras], name="c.json", mutate=damage_json, run=_replay, beside=recorded
        ),
    }  # fmt: skip


_ROUTES = """<routes>
<vType id="c" vClass="passenger" length="5" minGap="2.5" accel="2.6" decel="4.5" sigma="0.5"/>
<route id="straight" edges="left0A0 A0right0"/>
<vehicle id="v0" type="c" depart="0"><route edges="bottom0A0 A0left0"/></vehicle>
<trip id="v1" type="c" depart="1" from="left0A0" to="A0bottom0"/>
<vehicle id="v2" type="c" depart="2" route="straight" departLane="best"/>
<person id="p0" depart="3"><walk from="bottom0A0" to="A0top0"/></person>
<flow id="f" type="c" begin="4" end="20" vehsPerHour="900" from="left0A0" to="A0right0"/>
</routes>
"""
_ADDITIONAL = """<additional>
<vType id="slow" vClass="truck" maxSpeed="10"/>
<inductionLoop id="e1" lane="left0A0_1" pos="-10" period="10" file="e1.xml"/>
<laneAreaDetector id="e2" lane="left0A0_1" pos="0" endPos="20" period="10" file="e2.xml"/>
<busStop id="stop" lane="A0right0_0" startPos="5" endPos="20"/>
<edgeData id="mean" file="edges.xml" period="10"/>
<variableSpeedSign id="sign" lanes="A0left0_1"><step time="0" speed="8"/></variableSpeedSign>
</additional>
"""
_CONFIG = """<configuration>
<input><net-file value="n.net.xml"/><route-files value="r.rou.xml"/>
<additional-files value="a.add.xml"/></input>
<time><begin value="0"/><end value="100"/><step-length value="1"/></time>
<processing><time-to-teleport value="300"/><lateral-resolution value="0"/></processing>
<report><verbose value="true"/><no-step-log value="true"/></report>
<random><seed value="23"/></random>
<output><tripinfo-output value="trips.xml"/></output>
</configuration>
"""


def _make_network(folder: Path) -> Path:
    """Make a small network of one signal with sidewalks and crossings."""
    from dojo_maps.sumo_programs import find_program

    network = folder / "n.net.xml"
    subprocess.run(  # noqa: S603 - SUMO's own program
        [
            str(find_program("netgenerate")), "--grid", "--grid.x-number", "1", "--grid.y-number", "1",
            "--grid.attach-length", "80", "--default.lanenumber", "2", "--tls.set", "A0",
            "--sidewalks.guess", "--crossings.guess", "-o", str(network),
        ],
        check=True, capture_output=True,
    )  # fmt: skip
    return network


def _make_policy(folder: Path) -> Path:
    """Make weights such as a training keeps, sealed as it seals them."""
    import torch

    from dojo_env.learning.tensor_files import save_tensors

    torch.set_num_threads(1)
    path = folder / "policy.pt"
    save_tensors({"layer": torch.arange(600.0).reshape(20, 30), "steps": 7}, path)
    return path


def _make_osm() -> str:
    """Draw a crossroads with a signal, crossings, a roundabout, a building and a tram."""
    places = {
        1: (0, 0), 2: (0.001, 0), 3: (-0.001, 0), 4: (0, 0.001), 5: (0, -0.001), 6: (0.0001, 0),
        7: (0.0012, 0.0002), 8: (0.0014, 0), 9: (0.0012, -0.0002), 10: (0.002, 0), 11: (0.0003, 0.0003),
        12: (0.0005, 0.0003), 13: (0.0005, 0.0005), 14: (0, 0.0005),
    }  # fmt: skip
    tags = {1: {"highway": "traffic_signals"}, 6: {"highway": "crossing", "crossing": "traffic_signals"}}
    ways: list[tuple[list[int], dict[str, str]]] = [
        ([3, 1, 6, 2], {"highway": "primary", "lanes": "4", "sidewalk": "both", "name": "Main & Co"}),
        (
            [4, 14, 1, 5],
            {"highway": "secondary", "lanes": "2", "maxspeed": "50", "turn:lanes": "left|through"},
        ),
        ([2, 7, 8, 9, 2], {"highway": "primary", "junction": "roundabout"}),
        ([8, 10], {"highway": "residential", "oneway": "yes"}),
        ([11, 12, 13, 11], {"building": "yes", "height": "12"}),
        ([14, 13], {"highway": "footway"}),
    ]
    lines = ['<osm version="0.6">']
    for number, (x, y) in places.items():
        inner = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.get(number, {}).items())
        lines.append(f'<node id="{number}" lat="{52 + y:.7f}" lon="{13 + x:.7f}">{inner}</node>')
    for number, (nodes, named) in enumerate(ways, 100):
        lines.append(f'<way id="{number}">')
        lines += [f'<nd ref="{node}"/>' for node in nodes]
        lines += [f'<tag k="{k}" v="{v.replace("&", "&amp;")}"/>' for k, v in named.items()]
        lines.append("</way>")
    relation = '<member type="way" ref="100" role="from"/><member type="node" ref="1" role="via"/>'
    relation += '<member type="way" ref="101" role="to"/><tag k="type" v="restriction"/>'
    lines.append(f'<relation id="1">{relation}<tag k="restriction" v="no_left_turn"/></relation>')
    return "\n".join([*lines, "</osm>"])


def _quietly(main: Callable[[list[str]], int], arguments: list[str]) -> int:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        return main(arguments)


def _use_network(folder: Path, chance: random.Random) -> int:
    path, output = str(folder / "n.net.xml"), str(folder / "out.dojo")
    command = chance.choice(
        [
            ["convert", path, "-o", output],
            ["convert", path, "-o", output, "--export", "geojson", "metadrive"],
            ["validate", path, "--html", str(folder / "out.html"), "--json", str(folder / "out.json")],
            ["fix", path, "-o", str(folder / "out.net.xml")],
        ]
    )
    return dojo_maps.cli.main(command)


def _use_osm(folder: Path, _chance: random.Random) -> int:
    return dojo_maps.cli.main(["import-osm", str(folder / "m.osm"), "-o", str(folder / "out.dojo")])


def _drive(name: str, folder: Path, _chance: random.Random) -> int:
    """Run an episode in this process, as the command does in another."""
    try:
        config = build_config(scenario=str(folder / name), num_seconds=SECONDS)
        with closing(LocalWorld(config)) as world:
            world.traffic.simulation.has_stderr = True
            world.run(make_controller("max-pressure"), 0)
    except DojoError as error:
        print(f"dojo-env: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_status
    return 0


def _use_bundle(name: str, folder: Path, chance: random.Random) -> int:
    kind = chance.randrange(4)
    if kind == 0:
        return dojo_maps.cli.main(["validate", str(folder / name)])
    if kind == 1:
        return dojo_maps.cli.main(["view", str(folder / name), "-o", str(folder / "out.html")])
    return _drive(name, folder, chance)


def _replay(folder: Path, _chance: random.Random) -> int:
    command = ["replay", str(folder / "r.npz"), "--map", str(folder / "n.net.xml")]
    if (folder / "c.json").exists():
        command += ["--cameras", str(folder / "c.json"), "--video", str(folder / "out.mp4")]
    else:
        command += ["--export", "metadrive", "-o", str(folder / "out")]
    return dojo_env.cli.main(command)


def _load_policy(folder: Path, _chance: random.Random) -> int:
    """Load weights: whatever is damaged in them must be noticed."""
    from dojo_env.learning.tensor_files import load_tensors

    try:
        load_tensors(folder / "policy.pt")
    except DojoError as error:
        print(f"dojo-env: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_status
    return _UNNOTICED


def run_trial(kinds: Mapping[str, Kind], name: str, seed: int, place: Path) -> Finding | None:
    """Damage an input and see how the program ends.

    Args:
        kinds: by name.
        name: of the kind to try.
        seed: of the damage.
        place: a folder to work in; it is left only where something was found.
    """
    kind, chance = kinds[name], random.Random(seed)  # noqa: S311 - the same damage on every run
    folder = place / f"{name}-{seed}"
    folder.mkdir(parents=True)
    for beside, path in kind.beside.items():
        copy: Any = shutil.copytree if path.is_dir() else shutil.copy
        copy(path, folder / beside)
    good = chance.choice(list(kind.files)).read_bytes()
    damaged = kind.mutate(good, chance)
    while damaged == good:
        damaged = kind.mutate(good, chance)
    (folder / kind.name).write_bytes(damaged)
    before = {path.name for path in folder.iterdir()}
    status, said = _run_bounded(partial(kind.run, folder, chance), folder)
    if status in {-signal.SIGSEGV, -signal.SIGABRT, -signal.SIGKILL} and kind.command:
        done = subprocess.run(  # noqa: S603 - our own command
            [sys.executable, *kind.command], cwd=folder, capture_output=True, text=True, timeout=PATIENCE,
            check=False,
        )  # fmt: skip
        status, said = done.returncode, done.stderr
    problem = _judge(status, said)
    if problem is None and not said.rstrip().endswith(
        "the rest is written"
    ):  # But for one export, all is well.
        problem = _find_leftovers(folder, before, status)
    if problem is None:
        shutil.rmtree(folder)
        return None
    return Finding(kind=name, seed=seed, problem=problem, said=said[-2000:])


def _run_bounded(run: Callable[[], int], folder: Path) -> tuple[int, str]:
    """Run in a fork, with bounds; returns its status, below 0 for a signal, and what it said."""
    said = folder / ".said"
    process = os.fork()
    if process == 0:
        _run_and_end(run, said, folder)
    end = time.monotonic() + PATIENCE
    while True:
        done, code = os.waitpid(process, os.WNOHANG)
        if done:
            break
        if time.monotonic() > end:
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
            code = signal.SIGKILL
            break
        time.sleep(0.005)
    text = said.read_text(encoding="utf-8", errors="replace")
    said.unlink()
    return os.waitstatus_to_exitcode(code), text


def _run_and_end(run: Callable[[], int], said: Path, folder: Path) -> None:
    status = 99
    try:
        os.setsid()
        error = os.open(said, os.O_WRONLY | os.O_CREAT)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(error, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.environ["TMPDIR"] = tempfile.tempdir = str(folder)
        status = run()
    except BaseException:  # noqa: BLE001 - a finding
        import traceback

        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(status)


def _judge(status: int, said: str) -> str | None:
    """Name what is wrong with an end, if anything."""
    notes = (": left out ", " gives way to ")
    lines = [line for line in said.splitlines() if not any(note in line for note in notes)]
    errors = [line for line in lines if line.startswith(("dojo-maps:", "dojo-env:"))]
    failed = status >= 2
    problems = {
        "a traceback": "Traceback" in said,
        "a defect that the program admits": "a defect of this program" in said,
        "a hang": status == -signal.SIGKILL,
        "the damage was not noticed": status == _UNNOTICED,
        f"ended with {status}": status not in {0, 1, 2, 3, 4},
        f"{len(lines)} lines of error": failed and not len(errors) == len(lines) == 1,
        f"an error of {len(said)} characters": failed and len(said) > _LONGEST_ERROR,
    }
    return next((problem for problem, there in problems.items() if there), None)


def _find_leftovers(folder: Path, before: set[str], status: int) -> str | None:
    """Find what is neither there from the beginning nor one of the results."""
    results = {path.name for path in folder.iterdir()} - before
    strange = {name for name in results if not name.startswith("out")}
    if strange:
        return f"left behind: {', '.join(sorted(strange))}"
    if status >= 2 and results:
        return f"half written: {', '.join(sorted(results))}"
    return None


def run_trials(
    kinds: Mapping[str, Kind], trials: Sequence[tuple[str, int]], place: Path, jobs: int
) -> Iterator[Finding | None]:
    """Run trials side by side; gives what each has found, in order."""
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(lambda trial: run_trial(kinds, *trial, place), trials)


def main() -> int:
    """Run the command; the status is 1 where something was found."""
    parser = argparse.ArgumentParser(description="Damage inputs at random and see how each ends.")
    parser.add_argument("--count", type=int, default=110, help="trials in all (default: 110)")
    parser.add_argument("--seed", type=int, default=0, help="of the first trial; the others count on")
    parser.add_argument("--jobs", type=int, default=1, help="trials at a time (default: 1)")
    parser.add_argument("--kinds", nargs="+", metavar="KIND", help="of inputs (default: all)")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep findings here")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        good = Path(temporary) / "good"
        good.mkdir()
        kinds = make_kinds(good)
        names = options.kinds or list(kinds)
        unknown = set(names) - set(kinds)
        if unknown:
            parser.error(f"no kind {sorted(unknown)[0]!r}; there are {', '.join(kinds)}")
        trials = [(names[k % len(names)], options.seed + k) for k in range(options.count)]
        place = options.keep or Path(temporary) / "trials"
        found: Counter[str] = Counter()
        for number, finding in enumerate(run_trials(kinds, trials, place, options.jobs), 1):
            if finding is not None:
                found[finding.kind] += 1
                last = finding.said.strip().splitlines()[-1:] or [""]
                print(f"{finding.kind} {finding.seed}: {finding.problem}: {last[0][:300]}", flush=True)
            if number % 500 == 0:
                print(f"{number} trials, {found.total()} findings", file=sys.stderr, flush=True)
    print(f"{options.count} damaged inputs of {len(names)} kinds: {found.total()} findings")
    return int(found.total() > 0)


if __name__ == "__main__":
    sys.exit(main())
