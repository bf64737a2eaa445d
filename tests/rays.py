"""Rays against triangles by plain linear algebra: slow, and independent of what is tested."""

import numpy as np


def nearest_hits(vertices, faces, start, directions):
    """Distance to the first triangle along each ray (inf for none) and its index (-1 for none)."""
    a, b, c = (vertices[faces[:, k]] - start for k in range(3))
    normals = np.cross(b - a, c - a)
    distances, hits = np.full(len(directions), np.inf), np.full(len(directions), -1)
    for k, direction in enumerate(directions):
        with np.errstate(divide="ignore", invalid="ignore"):
            along = np.einsum("ij,ij->i", normals, a) / (normals @ direction)
            places = along[:, None] * direction
            inside = np.ones(len(faces), dtype=bool)
            for p, q in ((a, b), (b, c), (c, a)):
                inside &= np.einsum("ij,ij->i", np.cross(q - p, places - p), normals) >= 0
            along = np.where(inside & (along > 0), along, np.inf)
        face = int(np.argmin(along))
        if np.isfinite(along[face]):
            distances[k], hits[k] = along[face], face
    return distances, hits
