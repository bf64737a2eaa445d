"""The scene as binary glTF: +Y up, one node and one material per mesh, the sources of its faces beside it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from dojo_maps.meshes.mesh import Mesh

COLOURS = {
    "terrain": (116, 142, 92),
    "terrain/water": (92, 130, 158),
    "terrain/green": (102, 134, 76),
    "building": (196, 184, 168),
    "tree": (70, 108, 56),
    "tree/trunk": (98, 78, 60),
    "road": (74, 77, 82),
    "junction": (78, 81, 86),
    "rail": (112, 101, 90),
    "rail/track": (150, 152, 156),
    "sidewalk": (178, 172, 162),
    "walking_area": (188, 182, 172),
    "island": (150, 156, 140),
    "marking": (236, 236, 232),
    "crossing": (242, 242, 240),
    "stop_line": (242, 242, 240),
    "arrow": (240, 240, 236),
    "signal": (48, 50, 54),
    "signal/red": (214, 44, 36),
    "signal/yellow": (240, 186, 40),
    "signal/green": (44, 178, 92),
}
"""Colours by node name, sRGB."""

_VERTICES, _INDICES = 34962, 34963
"""glTF's numbers for what a buffer view holds."""


def write_scene(meshes: Sequence[Mesh], path: Path) -> None:
    """Write scene.glb.

    Each mesh carries `extras.sources`: a list of [id, first face, number of faces], in the order of its
    faces, so that every face can be traced to the thing of the description it belongs to.
    """
    scene = trimesh.Scene()
    for mesh in meshes:
        x, y, z = mesh.vertices.T
        material = PBRMaterial(
            name=mesh.name,
            baseColorFactor=_linear(COLOURS[mesh.name]),
            metallicFactor=0.0,
            roughnessFactor=0.9,
            doubleSided=mesh.layer in ("road", "junction", "terrain"),
        )
        shape = trimesh.Trimesh(
            vertices=np.column_stack([x, z, -y]),
            faces=mesh.faces,
            process=False,
            visual=trimesh.visual.TextureVisuals(material=material),
            metadata={"sources": source_runs(mesh)},
        )
        scene.add_geometry(shape, node_name=mesh.name, geom_name=mesh.name)
    path.write_bytes(
        trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=_name_targets)
    )


def _name_targets(tree: dict[str, Any]) -> None:
    """Say of each buffer view whether it holds vertices or indices, as viewers on graphics cards ask for."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            uses = [(primitive["indices"], _INDICES)]
            uses += [(accessor, _VERTICES) for accessor in primitive["attributes"].values()]
            for accessor, target in uses:
                view = tree["accessors"][accessor]["bufferView"]
                tree["bufferViews"][view]["target"] = target


def _linear(colour: tuple[int, int, int]) -> list[float]:
    """Turn sRGB into the linear colour with alpha that glTF keeps. Source: IEC 61966-2-1."""
    return [
        *(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in np.array(colour) / 255),
        1.0,
    ]


def source_runs(mesh: Mesh) -> list[tuple[str, int, int]]:
    """List (id, first face, number of faces) of each source in a mesh, in the order of its faces."""
    starts = np.flatnonzero(np.diff(mesh.sources, prepend=-1))
    ends = np.append(starts[1:], len(mesh.sources))
    return [(mesh.ids[mesh.sources[a]], int(a), int(b - a)) for a, b in zip(starts, ends, strict=True)]
