"""The models of road users: in their box, facing outward, at every level of detail; and which is chosen."""

import numpy as np
import pytest
from rays import nearest_hits

from dojo_env.rendering.fleet import MOST_FACES, MOST_VERTICES, usual_fleet
from dojo_env.rendering.models import build_models
from dojo_env.rendering.shapes import Part
from dojo_env.rendering.traffic import place_users
from dojo_env.snapshot import Kind, Snapshot

MODELS = [
    pytest.param(model, id=f"{kind.name}-{number}-{level}")
    for kind, variants in build_models().items()
    for number, variant in enumerate(variants)
    if number in (0, 1, 3, 7, 11)
    for level, model in enumerate(variant.poses[0 if variant.turns else -1])
]
_FIGURES = {"MOTORCYCLE", "MOPED", "BICYCLE", "SCOOTER", "PEDESTRIAN", "WHEELCHAIR", "PRAM"}
"""Feet, hands and umbrellas stand out of these."""


@pytest.mark.parametrize("model", MODELS)
def test_model_fills_its_unit_box(model, request):
    """The finest level touches all six sides; others may leave out wheels. Mirrors and limbs stand out."""
    low, high = model.vertices.min(axis=0) - (-1.0, -0.5, 0.0), (0.0, 0.5, 1.0) - model.vertices.max(axis=0)
    kind, *_, level = request.node.callspec.id.split("-")
    out = (
        [0.65, 0.65, 0.25] if kind in _FIGURES else [0.02, 0.12, 0.35 if kind in ("TRAM", "TRAIN") else 0.01]
    )
    for gaps in (low, high):
        assert (gaps > -np.array(out)).all()
        assert (gaps < ([0.45, 0.3, 0.08] if kind in _FIGURES else 1e-5 if level == "0" else 0.3)).all()


@pytest.mark.parametrize("model", MODELS)
def test_model_faces_outward(model):
    """Seen from outside, whatever a ray meets first shows its front."""
    a, b, c = (model.vertices[model.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    generator = np.random.default_rng(1)
    towards = generator.normal(size=(120, 3))
    towards[:, 2] = np.abs(towards[:, 2])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    aims = generator.uniform((-0.95, -0.45, 0.05), (-0.05, 0.45, 0.95), (120, 3))
    fronts = []
    for aim, direction in zip(aims, towards, strict=True):
        _, hits = nearest_hits(model.vertices, model.faces, aim + 5 * direction, -direction[None])
        if hits[0] >= 0:
            fronts.append(normals[hits[0]] @ direction > 0)
    assert len(fronts) > 20
    assert np.mean(fronts) > 0.97


@pytest.mark.parametrize("kind", [Kind.CAR, Kind.VAN, Kind.BUS, Kind.TRUCK])
def test_lamps_and_plates_lie_before_the_body(kind):
    """Nothing of the body stands in front of what is painted on nose and tail."""
    for variant in build_models()[kind]:
        for model in variant.poses[0][:2]:
            a, b, c = (model.vertices[model.faces[:, k]] for k in range(3))
            normals, middles = np.cross(b - a, c - a), (a + b + c) / 3
            for part, way in ((Part.HEADLAMP, 1.0), (Part.BRAKE, -1.0), (Part.WHITE, 1.0)):
                along = normals[:, 0] / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
                ends = (model.parts == part) & (way * along > 0.5) & (np.abs(middles[:, 0] + 0.5) > 0.4)
                assert ends.any()
                shown = set()
                for middle in middles[ends]:
                    from_afar = middle + np.array([2.0 * way, 0.0, 0.0])
                    _, hits = nearest_hits(
                        model.vertices, model.faces, from_afar, np.array([[-way, 0.0, 0.0]])
                    )
                    shown.add(Part(model.parts[hits[0]]))
                assert part in shown
                assert Part.BODY not in shown


def test_coarser_levels_have_fewer_faces():
    spans = usual_fleet().library.spans
    counts = spans[:, :, 3] - spans[:, :, 2]
    assert (np.diff(counts, axis=1) <= 0).all()
    assert counts.max() < MOST_FACES
    assert (spans[:, :, 1] - spans[:, :, 0]).max() < MOST_VERTICES


def _walker(way: float, *, speed: float = 1.3, heading: float = 0.0, **changes: object) -> Snapshot:
    values: dict[str, object] = {
        "ids": ("somebody",), "numbers": [1], "kinds": [Kind.PEDESTRIAN],
        "positions": [(way * np.cos(heading), way * np.sin(heading), 0.0)], "headings": [heading],
        "slopes": [0.0], "sizes": [(0.215, 0.478, 1.719)], "colours": [(255, 255, 0)], "lights": [0],
        "speeds": [speed], "lanes": ("",),
    }  # fmt: skip
    return Snapshot(time=0.0, **{**values, **changes})  # type: ignore[arg-type]


def _placed(snapshot: Snapshot, rain: float = 0.0) -> tuple[int, np.ndarray]:
    """Model, and its finest vertices in the world."""
    users, models = place_users(snapshot, np.zeros(3), rain=rain), usual_fleet().library
    first, last, *_ = models.spans[users.models[0], 0]
    return int(users.models[0]), models.vertices[first:last] @ users.frames[0].T + users.places[0]


def test_foot_on_the_ground_stays_where_it_is():
    """While somebody walks on, the lowest part of the sole that bears him moves much less than he does."""
    ways = np.arange(0.0, 2.52, 0.02)
    drawn = [_placed(_walker(way)) for way in ways]
    assert len({model for model, _ in drawn}) == 6
    slid = 0
    for (_, before), (_, after), way in zip(drawn[:-1], drawn[1:], ways[:-1], strict=True):
        soles = [np.sort(each[each[:, 2] < 0.03, 0]) for each in (before, after)]
        shared = min(abs(a - b) for a in soles[0] for b in soles[1])
        slid += shared > 0.15
        assert abs(after[:, 0].mean() - way) < 0.5
    assert slid == 0


def test_walker_stands_where_sumo_has_him_whatever_the_heading():
    for heading in (0.0, 1.0, 2.5):
        _, corners = _placed(_walker(10.0, heading=heading, speed=0.0))
        middle = np.array([np.cos(heading), np.sin(heading)]) * (10.0 - 0.215 / 2)
        assert np.linalg.norm(corners[:, :2].mean(axis=0) - middle) < 0.12


def test_people_differ_and_small_types_are_children():
    people = [_walker(3.0, ids=(f"p{k}",)) for k in range(60)]
    heights = np.array([_placed(each)[1][:, 2].max() for each in people])
    assert 0 < (heights < 1.45).sum() < 20
    assert 0.1 < np.ptp(heights[heights > 1.45]) < 0.4
    colours = [place_users(each, np.zeros(3)).colours[0] for each in people]
    assert all(len({tuple(each[row]) for each in colours}) > 3 for row in range(5))
    child = _walker(3.0, sizes=[(0.2, 0.4, 1.2)])
    assert _placed(child)[1][:, 2].max() == pytest.approx(1.2, abs=0.03)


def test_umbrellas_are_open_in_rain_only():
    people = [_walker(3.0, ids=(f"p{k}",)) for k in range(40)]
    dry, wet = ([_placed(each, rain)[0] for each in people] for rain in (0.0, 1.0))
    assert 20 < sum(a != b for a, b in zip(dry, wet, strict=True)) < 40


def test_sumo_s_colour_wins_over_paint_and_clothes():
    for kind in (Kind.CAR, Kind.PEDESTRIAN, Kind.BUS):
        red = place_users(_walker(0.0, kinds=[kind], colours=[(255, 0, 0)]), np.zeros(3)).colours[0, 0]
        assert red == pytest.approx([1.0, 0.0, 0.0])


def test_cars_have_the_paints_of_a_real_fleet():
    """Four in five are grey, white, black or silver."""
    cars = [_walker(0.0, ids=(f"c{k}",), kinds=[Kind.CAR]) for k in range(400)]
    paints = np.array([place_users(each, np.zeros(3)).colours[0, 0] for each in cars])
    grey = paints.max(axis=1) < 1.5 * paints.min(axis=1)
    assert 0.75 < grey.mean() < 0.9


@pytest.mark.parametrize("number", range(7))
def test_no_leg_shows_through_a_coat(number):
    """In every pose: level rays at thighs meet cloth, arms or hands first, never a trouser leg."""
    coat = build_models()[Kind.PEDESTRIAN][3]
    model = coat.poses[number][0]
    vertices = model.vertices * coat.size + [coat.front, 0.0, 0.0]
    angles = np.arange(16) * np.pi / 8
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(16)])
    for height in np.linspace(0.38, 0.58, 9) * coat.size[2]:
        middle = vertices[abs(vertices[:, 2] - height) < 0.06].mean(axis=0)
        for direction in out:
            start = np.array([*middle[:2], height]) + 2.0 * direction
            _, hits = nearest_hits(vertices, model.faces, start, -direction[None])
            assert hits[0] < 0 or model.parts[hits[0]] != Part.LEGS


def test_bands_are_seen_where_a_van_has_any_and_on_any_colour_of_a_police_car():
    vans = [_walker(0.0, ids=(f"v{k}",), kinds=[Kind.VAN]) for k in range(60)]
    pairs = [place_users(each, np.zeros(3)).colours[0, [0, 4]] for each in vans]
    assert 0.3 < np.mean([(body != band).any() for body, band in pairs]) < 0.8
    red = _walker(0.0, kinds=[Kind.POLICE], colours=[(255, 0, 0)])
    body, band = place_users(red, np.zeros(3)).colours[0, [0, 4]]
    assert body == pytest.approx([1.0, 0.0, 0.0])
    assert band[2] > band[0]
