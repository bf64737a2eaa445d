"""The same world in pybullet: a second pair of eyes, rays to compare lidar with, and who touches whom."""

from collections.abc import Iterable, Sequence
from types import ModuleType, TracebackType
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.errors import ConfigError
from dojo_env.rendering.classes import SEMANTIC_COLOURS, SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.fleet import Library
from dojo_env.rendering.outputs import OUTPUTS, BulletDrawing, Picture, check_outputs
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.traffic import Users, place_users
from dojo_env.snapshot import Lights, Snapshot
from dojo_maps.errors import ToolMissingError
from dojo_maps.progress import quiet_output

Floats = NDArray[np.float64]

_FACES_AT_ONCE = 20_000
"""pybullet takes meshes of at most some 130,000 vertices; a mesh is made of pieces of this many faces."""
_RAYS_AT_ONCE = 10_000
"""pybullet casts at most 16,383 rays in a batch."""

_SEEN, _FELT = 1, 2
"""Groups of bodies: meshes that rays meet, and hulls that only tell who touches whom."""


class Hits(NamedTuple):
    """What rays met.

    Attributes:
        distances: (n,) metres, inf where a ray met nothing.
        semantic: (n,) `Semantic`, SKY where a ray met nothing.
        instance: (n,) the road user's number, 0 where there is none.
    """

    distances: Floats
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]


class Contact(NamedTuple):
    """Two road users that touch or nearly do.

    Attributes:
        first: SUMO's id.
        second: SUMO's id.
        distance: metres between their convex hulls; negative where they overlap.
        place: (x, y, z) on the first, metres, map frame.
    """

    first: str
    second: str
    distance: float
    place: tuple[float, float, float]


class BulletWorld:
    """A scene and its road users in pybullet. Close it when done, or use it in a `with`."""

    def __init__(self, scene: Scene) -> None:
        """Load the static meshes.

        Raises:
            ToolMissingError: pybullet is not installed.
        """
        self._bullet = _import_pybullet()
        self._scene = scene
        self._client = self._bullet.connect(self._bullet.DIRECT)
        self._classes: dict[int, Semantic] = {}
        self._bodies: dict[str, tuple[int, int]] = {}
        self._looks: dict[str, tuple[Any, ...]] = {}
        self._colours: dict[str, bytes] = {}
        self._shapes: dict[tuple[Any, ...], tuple[int, int, int]] = {}
        self._given: tuple[Snapshot, bool] | None = None
        self._shown: Snapshot | None = None
        self._unseen = self._bullet.createVisualShape(
            self._bullet.GEOM_SPHERE, radius=1e-6, rgbaColor=[0.0] * 4, physicsClientId=self._client
        )
        for semantic in np.unique(scene.semantics):
            faces = np.flatnonzero(scene.semantics == semantic)
            for start in range(0, len(faces), _FACES_AT_ONCE):
                piece = scene.faces[faces[start : start + _FACES_AT_ONCE]]
                used, numbered = np.unique(piece, return_inverse=True)
                body = self._add(*self._mesh(scene.vertices[used], numbered.reshape(-1, 3)))
                self._paint(body, SEMANTIC_COLOURS[semantic])
                self._classes[body] = Semantic(semantic)

    def __enter__(self) -> "BulletWorld":
        """Use it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """Free the world; safe to call again."""
        if self._client >= 0:
            self._bullet.disconnect(self._client)
            self._client = -1

    def _require_open(self) -> None:
        if self._client < 0:
            raise ConfigError("this bullet world is closed; make another")

    def show(self, snapshot: Snapshot, *, parked: bool = True) -> None:
        """Put the road users of an instant in their places.

        Args:
            snapshot: the instant.
            parked: whether the scene's parked cars are there, too.

        Raises:
            ConfigError: the world is closed.
        """
        self._require_open()
        if (snapshot, parked) == self._given:
            return
        self._given = (snapshot, parked)
        if parked:
            snapshot = snapshot.joined(self._scene.parked)
        users = self._place(snapshot)
        sizes = map(tuple, np.linalg.norm(users.frames, axis=1).round(6).tolist())
        looks = dict(zip(snapshot.ids, zip(users.models.tolist(), sizes, strict=True), strict=True))
        for name in [name for name in self._bodies if looks.get(name) != self._looks[name]]:
            self._remove(name)
        self._looks = looks
        for k, name in enumerate(snapshot.ids):
            if name not in self._bodies:
                self._bodies[name] = self._add_user(users, k, looks[name])
            if self._colours.get(name) != users.colours[k, 0].tobytes():
                self._paint(self._bodies[name][0], np.round(255 * users.colours[k, 0] ** (1 / 2.2)))
                self._colours[name] = users.colours[k, 0].tobytes()
            for body in self._bodies[name]:
                self._bullet.resetBasePositionAndOrientation(
                    body, users.places[k], _quaternion(users.frames[k]), physicsClientId=self._client
                )
        self._shown = snapshot

    def render(
        self,
        snapshot: Snapshot,
        cameras: Iterable[Camera],
        outputs: Sequence[str] = ("rgb",),
        *,
        parked: bool = True,
    ) -> tuple[Picture, ...]:
        """Draw one instant through each camera with pybullet's own software renderer.

        Args:
            snapshot: the instant; it stays shown for rays and contacts.
            cameras: one picture each, in this order.
            outputs: names of `OUTPUTS`, of those that have a `make_bullet`.
            parked: whether the scene's parked cars are there, too.

        Returns:
            What each camera sees, with the outputs that were asked for.

        Raises:
            ConfigError: pybullet draws no such output, a camera's lens bends, or the world is closed.
        """
        wanted = check_outputs(outputs, bullet=True)
        self.show(snapshot, parked=parked)
        return tuple(self._picture(camera, wanted) for camera in cameras)

    def cast_rays(self, starts: Floats, ends: Floats) -> Hits:
        """Cast rays at the instant shown last.

        Args:
            starts: (n, 3) metres, map frame.
            ends: (n, 3) where each ray stops if it meets nothing, metres, map frame.

        Returns:
            What each ray met first, in the same order; before any instant is shown that is the static world.

        Raises:
            ConfigError: the world is closed.
        """
        self._require_open()
        starts, ends = np.asarray(starts) - self._scene.origin, np.asarray(ends) - self._scene.origin
        found: list[tuple[int, float]] = []
        for first in range(0, len(starts), _RAYS_AT_ONCE):
            batch = slice(first, first + _RAYS_AT_ONCE)
            hits = self._bullet.rayTestBatch(
                starts[batch].tolist(),
                ends[batch].tolist(),
                collisionFilterMask=_SEEN,
                physicsClientId=self._client,
            )
            found += [(hit[0], hit[2]) for hit in hits]
        bodies = np.array([body for body, _ in found], dtype=np.int64)
        share = np.array([part for _, part in found])
        length = np.linalg.norm(ends - starts, axis=1)
        semantic, instance = self._labels(bodies)
        return Hits(np.where(bodies >= 0, share * length, np.inf), semantic, instance)

    def contacts(self, distance: float = 0.0) -> tuple[Contact, ...]:
        """List the road users whose convex hulls come near each other at the instant shown last.

        Parked cars are asked for who comes near them, not for each other.

        Args:
            distance: metres up to which hulls may be apart to be listed; 0 lists those that touch or overlap.

        Returns:
            One for each pair, whose first comes first in the snapshot, too; empty before an instant is shown.

        Raises:
            ConfigError: the world is closed.
        """
        self._require_open()
        if self._shown is None:
            return ()
        found = []
        for i, k in _near_pairs(self._place(self._shown), distance):
            if (self._shown.lights[[i, k]] == Lights.OFF).all():
                continue
            first, second = self._shown.ids[i], self._shown.ids[k]
            points = self._bullet.getClosestPoints(
                self._bodies[first][1], self._bodies[second][1], distance, physicsClientId=self._client
            )
            if points:
                nearest = min(points, key=lambda point: point[8])
                x, y, z = np.array(nearest[5]) + self._scene.origin
                found.append(Contact(first, second, float(nearest[8]), (float(x), float(y), float(z))))
        return tuple(found)

    def _place(self, snapshot: Snapshot) -> Users:
        scene = self._scene
        return place_users(snapshot, scene.origin, ways=scene.ways, fleet=scene.fleet)

    def _mesh(self, vertices: Floats, faces: NDArray[Any]) -> tuple[int, int]:
        """Make shapes of a mesh as it is: one that rays meet, and one that pictures show."""
        bullet, client = self._bullet, self._client
        points, indices = vertices.tolist(), faces.reshape(-1).tolist()
        shape = bullet.createCollisionShape(
            bullet.GEOM_MESH, vertices=points, indices=indices, flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )  # fmt: skip
        look = bullet.createVisualShape(
            bullet.GEOM_MESH, vertices=points, indices=indices, normals=[[0.0, 0.0, 1.0]] * len(points),
            physicsClientId=client,
        )  # fmt: skip
        return shape, look

    def _add_user(self, users: Users, k: int, looks: tuple[Any, ...]) -> tuple[int, int]:
        """Add a road user: its mesh, and its convex hull, which neither pictures nor rays see."""
        # pybullet keeps shapes until the world ends, so all that look the same share theirs.
        if looks not in self._shapes:
            mesh = _mesh_of(users, k, self._scene.fleet.library)
            hull = self._bullet.createCollisionShape(
                self._bullet.GEOM_MESH, vertices=mesh[0].tolist(), physicsClientId=self._client
            )
            self._shapes[looks] = (*self._mesh(*mesh), hull)
        shape, look, hull = self._shapes[looks]
        return self._add(shape, look), self._add(hull, self._unseen, _FELT)

    def _add(self, shape: int, look: int, group: int = _SEEN) -> int:
        body: int = self._bullet.createMultiBody(0.0, shape, look, physicsClientId=self._client)
        self._bullet.setCollisionFilterGroupMask(body, -1, group, group, physicsClientId=self._client)
        return body

    def _paint(self, body: int, colour: NDArray[Any]) -> None:
        rgba = [*(np.asarray(colour) / 255).tolist(), 1.0]
        self._bullet.changeVisualShape(body, -1, rgbaColor=rgba, physicsClientId=self._client)

    def _remove(self, name: str) -> None:
        self._colours.pop(name, None)
        for body in self._bodies.pop(name):
            self._bullet.removeBody(body, physicsClientId=self._client)

    def _labels(self, bodies: NDArray[np.int64]) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Semantic class and road user's number of bodies; -1 is the sky."""
        size = max([0, *self._classes, *(body for pair in self._bodies.values() for body in pair)]) + 2
        semantic = np.full(size, Semantic.SKY, dtype=np.uint8)
        instance = np.zeros(size, dtype=np.int32)
        for body, value in self._classes.items():
            semantic[body] = value
        for k, name in enumerate(self._shown.ids if self._shown else ()):
            for body in self._bodies[name]:
                semantic[body] = SEMANTIC_OF_KIND[self._shown.kinds[k]]  # type: ignore[union-attr]
                instance[body] = self._shown.numbers[k]  # type: ignore[union-attr]
        return semantic[bodies], instance[bodies]

    def _picture(self, camera: Camera, wanted: frozenset[str]) -> Picture:
        if camera.distortion:
            raise ConfigError(
                f"camera {camera.name!r}: bullet has no lenses that bend; use the raster renderer"
            )
        bullet = self._bullet
        eye = np.array(camera.position) - self._scene.origin
        _, down, forward = camera.axes
        # TinyRenderer samples a pixel at its lower left corner; half a pixel brings that to the middle.
        across, up = camera.near / camera.focal_length * np.array([camera.width, camera.height]) / 2
        half = camera.near / camera.focal_length / 2
        window = [half - across, half + across, half - up, half + up]
        width, height, rgba, depth, bodies = bullet.getCameraImage(
            camera.width,
            camera.height,
            bullet.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), (-down).tolist()),
            bullet.computeProjectionMatrix(*window, camera.near, camera.far),
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        drawing = BulletDrawing(
            camera,
            np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4),
            np.asarray(depth, dtype=np.float64).reshape(height, width),
            *self._labels(np.asarray(bodies, dtype=np.int64).reshape(height, width)),
        )
        makers = {name: OUTPUTS[name].make_bullet for name in wanted}
        return Picture(camera=camera, outputs={name: make(drawing) for name, make in makers.items() if make})


def _mesh_of(users: Users, k: int, models: Library) -> tuple[Floats, NDArray[np.int32]]:
    """A road user's finest model at its size: vertices and faces."""
    first, last, face, end = models.spans[users.models[k], 0]
    size = np.linalg.norm(users.frames[k], axis=0)
    return models.vertices[first:last] * size, models.faces[face:end]


def _near_pairs(users: Users, distance: float) -> list[tuple[int, int]]:
    """Which road users' footprints come this near."""
    unit = np.array([(x, y, z) for x in (0.0, -1.0) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
    corners = np.einsum("nij,cj->nci", users.frames, unit)[..., :2] + users.places[:, None, :2]
    whose = np.repeat(np.arange(len(corners)), len(unit))
    prints = shapely.convex_hull(shapely.multipoints(corners.reshape(-1, 2), indices=whose))
    pairs = shapely.STRtree(prints).query(prints, predicate="dwithin", distance=max(distance, 1e-9))
    return sorted((i, k) for i, k in pairs.T.tolist() if i < k)


def _quaternion(frame: Floats) -> list[float]:
    """Turn of a frame whose axes are scaled, as (x, y, z, w)."""
    turn = frame / np.linalg.norm(frame, axis=0)
    yaw, pitch = np.arctan2(turn[1, 0], turn[0, 0]), -np.arcsin(np.clip(turn[2, 0], -1, 1))
    (cy, sy), (cp, sp) = (np.cos(yaw / 2), np.sin(yaw / 2)), (np.cos(pitch / 2), np.sin(pitch / 2))
    return [float(-sy * sp), float(cy * sp), float(sy * cp), float(cy * cp)]


def _import_pybullet() -> ModuleType:
    try:
        with quiet_output():
            import pybullet  # noqa: PLC0415 - only who asks for it needs it
    except ImportError as error:
        raise ToolMissingError(
            "pybullet is not installed: pip install 'traffic-dojo[bullet]' (it builds from source where it "
            "has no wheel, as after Python 3.11)"
        ) from error
    return pybullet
