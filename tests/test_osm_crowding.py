"""Roads that are drawn over each other end in one clear line; what streets have does not."""

import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import dojo_maps
from osm_drawings import Drawing

from dojo_maps.errors import SourceError
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.graph.steps import build_graph

pytestmark = pytest.mark.sampled(5)

STREET = {"highway": "primary"}
Place = tuple[float, float]


def draw(*lines: list[Place]) -> Drawing:
    drawing = Drawing()
    for line in lines:
        drawing.way(*line, **STREET)
    return drawing


def stack(count: int, x: float, y: float) -> Drawing:
    """Roads that lie almost on one place, each moved on by a little."""
    return draw(*[[(k * x, k * y), (k * x, k * y + 110)] for k in range(count)])


def fan(count: int, share: float = 1.0) -> Drawing:
    """Roads from one node to all sides."""
    angles = [2 * math.pi * share * k / count for k in range(count)]
    return draw(*[[(0, 0), (100 * math.cos(angle), 100 * math.sin(angle))] for angle in angles])


def parallel(count: int, gap: float) -> Drawing:
    """Streets beside each other, tied together at one end."""
    streets = [[(k * gap, 0.0), (k * gap, 500.0)] for k in range(count)]
    return draw(*streets, [street[0] for street in streets])


def folded(count: int, size: float) -> Drawing:
    """A road that runs to and fro on one place."""
    places = [((k % 2) * size, k * size / count) for k in range(count)]
    return draw(places, [places[0], (-200.0, 0.0)], [places[-1], (200.0, 0.0)])


def lattice(count: int, gap: float) -> Drawing:
    """Roads that cross each other without a common node."""
    size = count * gap
    north = [[(k * gap, -1.0), (k * gap, size)] for k in range(count)]
    return draw(*north, *[[(y, x) for x, y in line] for line in north])


def grid(count: int, gap: float) -> Drawing:
    """Blocks of a town."""
    rows = [[(k * gap, j * gap) for k in range(count)] for j in range(count)]
    return draw(*rows, *map(list, zip(*rows, strict=True)))


CROWDED: dict[str, tuple[Callable[[], Drawing], str]] = {
    "stack, along": (lambda: stack(200, 0.0, 1e-4), "way 1001: 200 pieces of road lie within 8 m"),
    "stack, aside": (lambda: stack(200, 1e-3, 0.0), "pieces of road lie within 8 m"),
    "stack, a lane aside": (lambda: stack(200, 0.2, 0.1), "pieces of road lie within 8 m"),
    "fan": (lambda: fan(300), "node 1: 300 pieces of road meet here"),
    "narrow fan": (lambda: fan(60, 0.1), "node 1: 60 pieces of road meet here"),
    "one node in thousands of ways": (lambda: fan(10_000), "node 1: 10000 pieces of road meet here"),
    "the same way thousands of times": (lambda: draw(*[[(0, 0), (99, 0)]] * 5000), "5000 pieces"),
    "thousands side by side": (lambda: parallel(2000, 3.0), "its roads lie on each other"),
    "folded": (lambda: folded(2000, 1.0), "pieces of road lie within 8 m"),
    "folded on a centimetre": (lambda: folded(2000, 0.01), "pieces of road lie within 8 m"),
    "lattice": (lambda: lattice(40, 20.0), "cross each other at 1600 places without a common node"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", CROWDED)
def test_roads_over_each_other_are_refused_in_one_line(name: str, tmp_path: Path) -> None:
    make, words = CROWDED[name]
    path = make().write(tmp_path / "crowded.osm")
    with pytest.raises(SourceError, match=rf"crowded\.osm: .*{words}"):
        build_graph(read_osm(path), path)


STREETS: dict[str, Callable[[], Drawing]] = {
    "eight arms": lambda: fan(8),
    "a few on one place": lambda: stack(5, 0.0, 1e-4),
    "the same way twice": lambda: draw(*[[(0, 0), (99, 0)]] * 2),
    "dual carriageways": lambda: parallel(100, 8.0),
    "blocks": lambda: grid(20, 60.0),
    "hairpins": lambda: folded(12, 30.0),
    "crossings without nodes": lambda: lattice(10, 50.0),
}


@pytest.mark.parametrize("name", STREETS)
def test_streets_are_taken(name: str, tmp_path: Path) -> None:
    path = STREETS[name]().write(tmp_path / "streets.osm")
    assert build_graph(read_osm(path), path).sections


def import_osm(path: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    return dojo_maps("import-osm", path, "-o", path.with_suffix(".dojo"), "--quiet", *arguments)


def test_a_stack_ends_the_command_with_one_line(tmp_path: Path) -> None:
    done = import_osm(stack(200, 0.0, 1e-4).write(tmp_path / "a.osm"))
    assert (done.returncode, done.stdout) == (3, "")
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.osm"]


@pytest.mark.slow
def test_a_junction_of_many_short_ways_is_crossed_in_time(tmp_path: Path) -> None:
    """Each way through a block of a metre was followed, of which there are more than anybody can count."""
    done = import_osm(grid(15, 8.0).write(tmp_path / "a.osm"), "--demand", 0)
    assert done.returncode in {0, 1}, done.stderr
