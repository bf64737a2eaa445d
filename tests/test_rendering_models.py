"""The models of road users: in their box, facing outward, and alike at every level of detail."""

import numpy as np
import pytest
from rays import nearest_hits

from dojo_env.rendering.models import build_models
from dojo_env.rendering.traffic import MOST_FACES, MOST_VERTICES, library
from dojo_env.snapshot import Kind

MODELS = [
    pytest.param(model, id=f"{kind.name}-{variant}-{level}")
    for kind, variants in zip(Kind, build_models(), strict=True)
    for variant, levels in enumerate(variants)
    for level, model in enumerate(levels)
]


@pytest.mark.parametrize("model", MODELS)
def test_model_fills_its_unit_box(model, request):
    """The finest level touches all six sides; others may leave out wheels. Only mirrors reach beyond."""
    low, high = model.vertices.min(axis=0) - (-1.0, -0.5, 0.0), (0.0, 0.5, 1.0) - model.vertices.max(axis=0)
    kind, *_, level = request.node.callspec.id.split("-")
    bare = {"TRAM", "TRAIN", "MOTORCYCLE", "BICYCLE", "SCOOTER", "PEDESTRIAN", "SHIP"}
    for gaps in (low, high):
        assert (gaps > np.array(-1e-5 if kind in bare else [-0.02, -0.12, -0.01])).all()
        assert (gaps < (1e-5 if level == "0" else 0.3)).all()


@pytest.mark.parametrize("model", MODELS)
def test_model_faces_outward(model):
    """Seen from outside, whatever a ray meets first shows its front."""
    a, b, c = (model.vertices[model.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    generator = np.random.default_rng(1)
    towards = generator.normal(size=(300, 3))
    towards[:, 2] = np.abs(towards[:, 2])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    aims = generator.uniform((-0.95, -0.45, 0.05), (-0.05, 0.45, 0.95), (300, 3))
    fronts = []
    for aim, direction in zip(aims, towards, strict=True):
        _, hits = nearest_hits(model.vertices, model.faces, aim + 5 * direction, -direction[None])
        if hits[0] >= 0:
            fronts.append(normals[hits[0]] @ direction > 0)
    assert len(fronts) > 50
    assert np.mean(fronts) > 0.97


def test_coarser_levels_have_fewer_faces():
    spans = library().spans
    counts = spans[:, :, 3] - spans[:, :, 2]
    assert (np.diff(counts, axis=1) <= 0).all()
    assert counts.max() < MOST_FACES
    assert (spans[:, :, 1] - spans[:, :, 0]).max() < MOST_VERTICES
