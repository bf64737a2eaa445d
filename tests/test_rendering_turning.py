"""Vehicles on their way round a corner: wheels steer as the road turns, and joints follow it."""

import numpy as np
import pytest
import traffic

from dojo_env.rendering.fleet import usual_fleet
from dojo_env.rendering.models import build_models
from dojo_env.rendering.shapes import Part
from dojo_env.rendering.traffic import place_users
from dojo_env.rendering.ways import Ways
from dojo_env.snapshot import Kind, Snapshot

RADIUS = 15.0


def _circle(kind: Kind, radius: float = RADIUS) -> tuple[Snapshot, Ways]:
    """A vehicle on a circle to the left around (0, 0), with nose and tail on it, as SUMO places it."""
    turns = np.linspace(-np.pi, np.pi, 721)
    ways = Ways(
        numbers={"round": 0},
        points=radius * np.column_stack([np.cos(turns), np.sin(turns)]),
        spans=np.array([(0, 721)], np.int32),
    )
    back = -traffic.SIZES[kind][0] / radius
    tail = radius * np.array([np.cos(back), np.sin(back)])
    heading = float(np.arctan2(-tail[1], radius - tail[0]))
    base = Snapshot(time=0.0)
    return traffic.users([(radius, 0.0, 0.0, heading)], [kind], base, lanes=("round",)), ways


def _corners(snapshot: Snapshot, ways: Ways, *parts: Part) -> np.ndarray:
    users, models = place_users(snapshot, np.zeros(3), ways=ways), usual_fleet().library
    first, _, start, end = models.spans[users.models[0], 0]
    chosen = models.faces[start:end][np.isin(models.parts[start:end], parts)] + first
    return models.vertices[chosen].reshape(-1, 3) @ users.frames[0].T + users.places[0]


@pytest.mark.parametrize("kind", [Kind.ARTICULATED_BUS, Kind.ROAD_TRAIN, Kind.TRAM])
def test_vehicles_with_joints_stay_on_the_curve(kind: Kind) -> None:
    """Bent, they sweep much less of the road than straight, as they would cut the corner."""
    snapshot, ways = _circle(kind, 25.0 if kind == Kind.TRAM else RADIUS)
    bent, straight = (
        np.linalg.norm(_corners(snapshot, each, Part.TYRE, Part.BODY, Part.ACCENT)[:, :2], axis=1)
        for each in (ways, Ways(numbers={}, points=ways.points, spans=ways.spans))
    )
    assert np.ptp(bent) < 0.8 * np.ptp(straight)


def test_front_wheels_steer_into_the_curve_and_rear_wheels_do_not() -> None:
    snapshot, ways = _circle(Kind.SALOON, 8.0)
    tyres = _corners(snapshot, ways, Part.TYRE)[:, :2]
    heading = snapshot.headings[0]
    ahead, left = (np.array([np.cos(a), np.sin(a)]) for a in (heading, heading + np.pi / 2))
    places = tyres - snapshot.positions[0, :2]
    angles = {}
    for name, own in (("front", places @ ahead > -1.6), ("rear", places @ ahead < -3.0)):
        wheel = places[own & (places @ left > 0)]
        spread = wheel - wheel.mean(axis=0)
        along = np.linalg.svd(spread)[2][0]
        angles[name] = (np.degrees(np.arctan2(along @ left, along @ ahead)) + 90.0) % 180.0 - 90.0
    assert 8.0 < angles["front"] < 25.0
    assert abs(angles["rear"]) < 1.0


def test_who_drives_straight_on_or_off_the_lanes_goes_straight() -> None:
    snapshot, _ = _circle(Kind.ARTICULATED_BUS)
    line = np.array([(-100.0, 0.0), (100.0, 0.0)])
    heading = snapshot.headings[0]
    straight = line @ np.array([(np.cos(heading), np.sin(heading)), (-np.sin(heading), np.cos(heading))])
    ways = Ways(numbers={"round": 0}, points=straight, spans=np.array([(0, 2)], np.int32))
    across = Ways(numbers={"round": 0}, points=straight[:, ::-1] * [1, -1], spans=ways.spans)
    usual = place_users(snapshot, np.zeros(3)).models[0]
    assert place_users(snapshot, np.zeros(3), ways=ways).models[0] == usual
    assert place_users(snapshot, np.zeros(3), ways=across).models[0] == usual


def test_sections_stand_where_the_model_does() -> None:
    """The ground under a bent vehicle is that of its sections: no corner of it stands far off."""
    for kind in (Kind.ARTICULATED_BUS, Kind.TRAILER, Kind.TRAM):
        (variant,) = build_models()[kind]
        assert variant.prints is not None
        for prints, (model, *_) in zip(variant.prints, variant.poses, strict=True):
            ends = prints * variant.size[:2]
            corners = model.vertices[:, :2] * variant.size[:2]
            ways = ends[:, 0] - ends[:, 1]
            share = np.einsum("nsi,si->ns", corners[:, None] - ends[:, 1], ways) / (ways**2).sum(axis=1)
            nearest = ends[:, 1] + np.clip(share, 0.0, 1.0)[..., None] * ways
            assert np.linalg.norm(corners[:, None] - nearest, axis=2).min(axis=1).max() < 2.1
