"""Controllers that do not learn: who waits is served, whatever the shape of the junction."""

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import networks
import pytest
import sumolib  # type: ignore[import-untyped]

from dojo_env.benchmark.row_runs import describe
from dojo_env.benchmark.rows import find_row
from dojo_env.config import SignalConfig, build_config
from dojo_env.controllers import CONTROLLERS, Controller, make_controller
from dojo_env.controllers.ranking import choose_best
from dojo_env.local_world import LocalWorld
from dojo_env.managers.map import MapManager
from dojo_env.runs import run_controller
from dojo_env.scenario import PACKAGED, find_map, open_map
from dojo_env.signals.longest_red import LongestRed

OWN = [name for name in CONTROLLERS if not make_controller(name).settings]
"""Those that choose phases under the signal layer's limits."""
LIMITED = [*OWN, "actuated", "delay-based"]
"""Those and SUMO's logics, whose greens the layer limits."""
SHAPES: dict[str, tuple[str, ...]] = {
    f"{kind}-{lanes}-{turns}": (
        *("--grid", f"--grid.x-number={size[0]}", f"--grid.y-number={size[1]}", "--grid.length=160"),
        *("--grid.attach-length=200", f"--default.lanenumber={lanes}", f"--turn-lanes={turns}"),
        *(("--tls.left-green.time=0",) if kind == "permissive" else ()),
        *(("--tls.layout=incoming",) if kind == "split" else ()),
        *(("--sidewalks.guess", "--crossings.guess") if kind == "walkers" else ()),
    )
    for (kind, size), lanes, turns in product(
        {
            "cross": (1, 1),
            "permissive": (1, 1),
            "split": (1, 1),
            "walkers": (1, 1),
            "arterial": (3, 1),
        }.items(),
        (1, 2),
        (0, 1),
    )
}
"""Shared lanes, permissive lefts, one-lane approaches, an approach after the other, walkers, arterials."""


@pytest.fixture(scope="module")
def scenario_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Make a scenario of a shape: some demand from everywhere to everywhere, for ten minutes."""
    made: dict[str, Path] = {}

    def make(shape: str) -> Path:
        if shape not in made:
            folder = tmp_path_factory.mktemp(shape)
            networks.run_sumo_tool(
                "netgenerate",
                *SHAPES[shape],
                "-j=traffic_light",
                "--no-turnarounds",
                "-o",
                folder / "x.net.xml",
            )
            (folder / "x.rou.xml").write_text(f"<routes>{''.join(flows(folder / 'x.net.xml'))}</routes>")
            (folder / "x.sumocfg").write_text(
                '<configuration><input><net-file value="x.net.xml"/><route-files value="x.rou.xml"/></input>'
                '<time><end value="900"/></time></configuration>'
            )
            made[shape] = folder / "x.sumocfg"
        return made[shape]

    return make


def flows(network: Path) -> Iterator[str]:
    """From every edge that begins at the border to every one that ends there."""
    edges = sumolib.net.readNet(str(network)).getEdges()
    sources = [edge for edge in edges if not edge.getIncoming()]
    sinks = [edge for edge in edges if not edge.getOutgoing()]
    pairs = [(a, b) for a in sources for b in sinks if a.getFromNode() != b.getToNode()]
    for number, (a, b) in enumerate(pairs):
        yield (
            f'<flow id="{number}" begin="{number}" end="600" period="{3 * len(pairs)}" departLane="best"'
            f' from="{a.getID()}" to="{b.getID()}"/>'
        )


@pytest.mark.slow
@pytest.mark.sampled(4)
@pytest.mark.parametrize("controller", LIMITED)
@pytest.mark.parametrize("shape", SHAPES)
def test_every_link_with_demand_is_served(
    scenario_of: Callable[[str], Path], shape: str, controller: str
) -> None:
    (figures,) = run_controller(controller, [1], scenario=scenario_of(shape))
    assert figures["departed"] > 100
    assert figures["missing"] < 0.1
    assert figures["longest_red"] <= 150
    assert not figures["violations"]


@pytest.mark.parametrize("controller", ["queue-pressure", "rolling-horizon", "max-pressure", "sotl"])
def test_who_waits_before_a_lane_that_holds_nobody_is_served(controller: str, tmp_path: Path) -> None:
    ends = {"w": (-200, 0), "m": (-30, 0), "c": (0, 0), "e": (200, 0), "s": (0, -200), "n": (0, 200)}
    nodes = "".join(
        f'<node id="{name}" x="{x}" y="{y}" type="{"traffic_light" if name == "c" else "priority"}"/>'
        for name, (x, y) in ends.items()
    )
    (tmp_path / "x.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    lanes = {"wm": "", "mc": 'length="0.9"', "ce": "", "sc": "", "cn": ""}
    edges = "".join(f'<edge id="{k}" from="{k[0]}" to="{k[1]}" {more}/>' for k, more in lanes.items())
    (tmp_path / "x.edg.xml").write_text(f"<edges>{edges}</edges>")
    networks.run_sumo_tool("netconvert", "-n", tmp_path / "x.nod.xml", "-e", tmp_path / "x.edg.xml",
                  "-o", tmp_path / "x.net.xml")  # fmt: skip
    (tmp_path / "x.rou.xml").write_text(
        '<routes><flow id="few" begin="0" end="500" period="50" from="wm" to="ce"/>'
        '<flow id="many" begin="0" end="900" period="3" from="sc" to="cn"/></routes>'
    )
    (tmp_path / "x.sumocfg").write_text(
        '<configuration><input><net-file value="x.net.xml"/><route-files value="x.rou.xml"/></input>'
        '<time><end value="900"/></time></configuration>'
    )
    world = LocalWorld(build_config(scenario=tmp_path / "x.sumocfg"))
    world.run(make_controller(controller), 1)
    late = [name for name, trip in world.traffic.simulation.trips.items()
            if name.startswith("few") and trip.arrival is None]  # fmt: skip
    world.close()
    assert not late


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("controller", LIMITED)
@pytest.mark.parametrize("scenario", PACKAGED)
def test_nobody_waits_longer_than_the_longest_red(scenario: str, controller: str) -> None:
    (figures,) = run_controller(controller, [1], scenario=scenario, num_seconds=600)
    config = SignalConfig()
    plans = MapManager(open_map(find_map(scenario)), config).plans.values()
    limits = [LongestRed(plan, config, interval=5, time=0).limit for plan in plans]
    assert 120 <= max(limits) <= 180
    assert 0 < figures["longest_red"] <= max(limits)


def test_a_longest_red_is_kept_in_every_action_mode() -> None:
    reds: dict[Any, float] = {}
    for mode, limit in product(("choose_phase", "next_or_keep"), (60, None)):
        world = LocalWorld(build_config(scenario="two-way", action_mode=mode, max_red=limit, num_seconds=600))
        world.reset(1)
        ended = False
        while not ended:
            _, _, ended, _ = world.step({"t": 0})
        reds[mode, limit] = world.metrics()["longest_red"]
        world.close()
    for mode in ("choose_phase", "next_or_keep"):
        assert reds[mode, 60] <= 95
        assert reds[mode, None] > 400


class Watching(Controller):
    """Keeps its first picture of the first approach."""

    def __init__(self) -> None:
        super().__init__({"observation": "multi_view", "width": 64, "height": 48})
        self.pictures: list[Any] = []

    def see(self, observations: Mapping[str, Any]) -> None:
        """Keep it."""
        self.pictures.append(observations["GS_cluster_357187_359543"]["approach_0"])


def test_what_a_controller_prefers_holds_unless_the_user_says_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("dojo_env.runs._is_known_elsewhere", lambda _: False)

    def look(preferred: str | None, **keywords: Any) -> Any:
        controller = Watching()
        if preferred:
            controller.preferred = {"cameras": preferred}
        run_controller(controller, [0], scenario="cologne1", num_seconds=5, **keywords)
        return controller.pictures[0]

    usual, preferred = look(None), look("long_view")
    assert (usual != preferred).any()
    assert (look(None, cameras="long_view") == preferred).all()
    assert (look("long_view", cameras="paper") == usual).all()


def test_learned_vision_hangs_its_cameras_so_that_they_see_far() -> None:
    assert make_controller("learned-vision").preferred == {"cameras": "long_view"}
    task = describe(find_row("Learned-vision"), "cologne1", seeds=1, seconds=60)
    assert task["settings"]["cameras"] == "long_view"


def test_ties_do_not_freeze_a_phase() -> None:
    assert choose_best([1.0, 2.0, 2.0], 2) == 2
    assert choose_best([2.0, 1.0, 2.0], 1) == 2
    assert choose_best([0.0, 0.0, 0.0], 1) == 2
    assert choose_best([0.0, 0.0, 0.0], 2) == 0
