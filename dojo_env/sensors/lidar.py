"""Lidar: ranges to the static world once per mount, and per frame only to what moves.

Every triangle is tested against just the rays of its own span of azimuth and elevation, with an exact
intersection (Moeller and Trumbore 1997), so ranges do not depend on any picture's resolution.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, ceil, cos, floor, hypot, isfinite, pi, radians, sin
from zlib import crc32

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.errors import ConfigError
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.fleet import MOST_VERTICES
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.traffic import Users, place_users
from dojo_env.sensors.base import SENSORS, Look, Sensor, Site
from dojo_env.snapshot import Snapshot
from dojo_maps.short_repr import short_repr

Floats = NDArray[np.float64]

_MOST_RAYS = 4_000_000
_DETAIL = 1
"""Level of detail of the road users that rays meet: within centimetres of the finest, and half its faces."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lidar:
    """A spinning lidar.

    Attributes:
        name: unique among the sensors.
        position: metres, map frame.
        heading_deg: where the first column looks, counter-clockwise from east; columns go on clockwise.
        channels: number of rings.
        lowest_deg: elevation of the lowest ring.
        highest_deg: elevation of the highest ring.
        step_deg: azimuth between columns.
        reach: metres; nothing farther returns.
        noise: standard deviation of a range, metres.
        dropped: probability that a return is lost.
        interval: seconds from look to look of an agent's sensor; 0 looks at each decision.
        delay: seconds from a look until the agent gets it.
    """

    name: str
    position: tuple[float, float, float]
    heading_deg: float = 0.0
    channels: int = 32
    lowest_deg: float = -45.0
    highest_deg: float = 5.0
    step_deg: float = 0.4
    reach: float = 120.0
    noise: float = 0.0
    dropped: float = 0.0
    interval: float = 0.0
    delay: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what no lidar can be.

        Raises:
            ConfigError: a number is not finite or out of its range.
        """
        object.__setattr__(self, "position", tuple(float(x) for x in self.position))
        numbers = (*self.position, self.heading_deg, self.lowest_deg, self.highest_deg, self.step_deg,
                   self.reach, self.noise, self.dropped)  # fmt: skip
        rules = (
            (
                len(self.position) == 3 and all(map(isfinite, numbers)),
                "three finite positions, finite numbers",
            ),
            (self.channels >= 1 and self.step_deg > 0, "at least one channel and a step above 0"),
            (-90 <= self.lowest_deg <= self.highest_deg <= 90, "-90 <= lowest_deg <= highest_deg <= 90"),
            (0 < self.reach <= 1e5 and self.noise >= 0, "reach above 0, noise not below 0"),
            (0 <= self.dropped <= 1, "dropped from 0 to 1"),
        )
        for holds, wanted in rules:
            if not holds:
                raise ConfigError(f"lidar {self.name!r}: expected {wanted}; got {self}")
        if self.channels * self.columns > _MOST_RAYS:
            raise ConfigError(
                f"lidar {self.name!r}: more than {_MOST_RAYS} rays; use fewer channels or columns"
            )

    @property
    def columns(self) -> int:
        """Number of columns in a turn."""
        return max(1, round(360.0 / self.step_deg))

    @property
    def elevations(self) -> Floats:
        """(channels,) radians, lowest first."""
        return np.radians(np.linspace(self.lowest_deg, self.highest_deg, self.channels))

    @property
    def directions(self) -> Floats:
        """(channels, columns, 3) unit vectors, map frame."""
        azimuth = radians(self.heading_deg) - np.arange(self.columns) * 2 * pi / self.columns
        level = np.cos(self.elevations)[:, None]
        rise = np.broadcast_to(np.sin(self.elevations)[:, None], (self.channels, self.columns))
        return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), rise], axis=2)

    def mount(self, site: Site) -> Sensor:
        """Hang it for a signal; agents get its ranges."""
        return _MountedLidar(self, site)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """One turn of a lidar.

    Attributes:
        ranges: (channels, columns) float32 metres, highest ring first, inf where nothing returns.
        semantic: (channels, columns) `Semantic` of each return, SKY where nothing returns.
        instance: (channels, columns) the road user's number, 0 where there is none.
        points: (n, 3) float32 metres, map frame less the lidar's position, row by row.
        point_semantic: (n,) `Semantic` of each point.
        point_instance: (n,) the road user's number or 0.
    """

    ranges: NDArray[np.float32]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    points: NDArray[np.float32]
    point_semantic: NDArray[np.uint8]
    point_instance: NDArray[np.int32]


class LidarScanner:
    """Scans snapshots of one scene."""

    def __init__(self, scene: Scene, *, seed: int = 0) -> None:
        """Prepare to scan; `seed` decides noise and lost returns."""
        self._scene = scene
        self._seed = seed
        self._static: dict[Lidar, tuple[Floats, NDArray[np.uint8]]] = {}

    def scan(self, snapshot: Snapshot, lidars: Sequence[Lidar]) -> tuple[Scan, ...]:
        """Scan one instant with each lidar.

        Args:
            snapshot: the instant; the scene's parked cars are there, too.
            lidars: where they hang, and what they reach.

        Returns:
            A turn of each, in their order; noise follows from the seed, the lidar's name and the time.
        """
        scene = self._scene
        snapshot = snapshot.joined(scene.parked)
        users = place_users(snapshot, scene.origin, ways=scene.ways, fleet=scene.fleet)
        return tuple(self._scan(snapshot, users, lidar) for lidar in lidars)

    def _scan(self, snapshot: Snapshot, users: Users, lidar: Lidar) -> Scan:
        if lidar not in self._static:
            self._static[lidar] = self._scan_static(lidar)
        static_ranges, static_semantic = self._static[lidar]
        ranges, semantic = static_ranges.copy(), static_semantic.copy()
        owners = np.full(ranges.shape, -1, dtype=np.int32)
        models = self._scene.fleet.library
        _hit_users(
            users.frames, users.places, users.models, models.vertices, models.faces, models.spans,
            np.array(lidar.position) - self._scene.origin, lidar.elevations, radians(lidar.heading_deg),
            lidar.reach, ranges, owners,
        )  # fmt: skip
        moving = owners >= 0
        instance = np.zeros(ranges.shape, dtype=np.int32)
        instance[moving] = snapshot.numbers[owners[moving]]
        semantic[moving] = SEMANTIC_OF_KIND[snapshot.kinds[owners[moving]]]
        self._disturb(lidar, snapshot.time, ranges, semantic, instance)
        return _scan_of(lidar, ranges[::-1], semantic[::-1], instance[::-1])

    def _scan_static(self, lidar: Lidar) -> tuple[Floats, NDArray[np.uint8]]:
        scene = self._scene
        ranges = np.full((lidar.channels, lidar.columns), np.inf)
        faces = np.full(ranges.shape, -1, dtype=np.int32)
        _hit_mesh(
            scene.vertices, scene.faces, np.array(lidar.position) - scene.origin, lidar.elevations,
            radians(lidar.heading_deg), lidar.reach, ranges, faces,
        )  # fmt: skip
        return ranges, np.append(scene.semantics, np.uint8(Semantic.SKY))[faces]

    def _disturb(
        self,
        lidar: Lidar,
        time: float,
        ranges: Floats,
        semantic: NDArray[np.uint8],
        instance: NDArray[np.int32],
    ) -> None:
        """Add noise to ranges and lose some returns."""
        if lidar.noise == 0 and lidar.dropped == 0:
            return
        instant = int(np.float64(time).view(np.uint64))
        generator = np.random.default_rng([self._seed, crc32(lidar.name.encode()), instant])
        ranges += generator.normal(0.0, lidar.noise, ranges.shape)
        np.maximum(ranges, 0.0, out=ranges)
        lost = generator.random(ranges.shape) < lidar.dropped
        ranges[lost], semantic[lost], instance[lost] = np.inf, Semantic.SKY, 0


class _MountedLidar(Sensor):
    """Ranges, (channels, columns) float32 metres, highest ring first; `reach` where nothing returns."""

    def __init__(self, lidar: Lidar, site: Site) -> None:
        self._lidar, self._eyes = lidar, site.eyes
        self._scanner: LidarScanner | None = None
        self.space = spaces.Box(0.0, lidar.reach, (lidar.channels, lidar.columns), np.float32)
        self.interval, self.delay = lidar.interval, lidar.delay

    def reset(self, random: np.random.Generator) -> None:
        self._scanner = None

    def observe(self, look: Look) -> NDArray[np.float32]:
        if self._scanner is None:
            self._scanner = LidarScanner(self._eyes.scene, seed=self._eyes.conditions.seed)
        (scan,) = self._scanner.scan(look.snapshot, [self._lidar])
        return np.minimum(scan.ranges, np.float32(self._lidar.reach))


def _mount(text: str, site: Site) -> Sensor:
    """Hang one where a camera does: the one that is named, or the signal's first."""
    camera = site.find_camera(text) if text else site.eyes.cameras(site.signal)[0]
    return Lidar(name=site.name, position=camera.position).mount(site)


SENSORS["lidar"] = _mount


def _scan_of(lidar: Lidar, ranges: Floats, semantic: NDArray[np.uint8], instance: NDArray[np.int32]) -> Scan:
    hit = np.isfinite(ranges)
    return Scan(
        ranges=ranges.astype(np.float32),
        semantic=np.ascontiguousarray(semantic),
        instance=np.ascontiguousarray(instance),
        points=(lidar.directions[::-1][hit] * ranges[hit][:, None]).astype(np.float32),
        point_semantic=semantic[hit],
        point_instance=instance[hit],
    )


@kernel
def _hit_users(
    frames, places, models, vertices, faces, spans, eye, elevations, heading, reach, ranges, owners
):
    corners, seen = np.empty((3, 3)), np.empty((MOST_VERTICES, 3))
    for k in range(len(places)):
        x, y = places[k, 0] - eye[0], places[k, 1] - eye[1]
        if hypot(x, y) > reach + 1000.0:
            continue
        span = spans[models[k], _DETAIL]
        for v in range(span[1] - span[0]):
            for axis in range(3):
                seen[v, axis] = places[k, axis] - eye[axis]
                for column in range(3):
                    seen[v, axis] += frames[k, axis, column] * vertices[span[0] + v, column]
        for face in range(span[2], span[3]):
            for c in range(3):
                corners[c] = seen[faces[face, c]]
            if _shows_front(corners):
                _hit_triangle(corners, elevations, heading, reach, k, ranges, owners)


@inner
def _shows_front(corners):
    """Tell whether a triangle, seen from 0, turns counter-clockwise."""
    a, b, c = corners[0], corners[1], corners[2]
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    ) < 0.0


@kernel
def _hit_mesh(vertices, faces, eye, elevations, heading, reach, ranges, tags):
    corners = np.empty((3, 3))
    for face in range(len(faces)):
        for c in range(3):
            for axis in range(3):
                corners[c, axis] = vertices[faces[face, c], axis] - eye[axis]
        _hit_triangle(corners, elevations, heading, reach, face, ranges, tags)


@inner
def _nearest_level(corners):
    """Least horizontal distance from the sensor to a triangle; 0 where it lies above or below the sensor."""
    nearest = np.inf
    left = right = 0
    for c in range(3):
        ax, ay = corners[c, 0], corners[c, 1]
        bx, by = corners[(c + 1) % 3, 0], corners[(c + 1) % 3, 1]
        side = ax * by - ay * bx
        left += side >= 0.0
        right += side <= 0.0
        square = (bx - ax) ** 2 + (by - ay) ** 2
        share = 0.0
        if square > 0.0:
            share = min(1.0, max(0.0, -(ax * (bx - ax) + ay * (by - ay)) / square))
        nearest = min(nearest, hypot(ax + share * (bx - ax), ay + share * (by - ay)))
    return 0.0 if left == 3 or right == 3 else nearest


@inner
def _hit_triangle(corners, elevations, heading, reach, tag, ranges, tags):
    """Shorten the ranges of the rays that meet a triangle, given around the sensor."""
    nearest = _nearest_level(corners)
    if nearest > reach:
        return
    farthest, low, high = 0.0, np.inf, -np.inf
    for c in range(3):
        farthest = max(farthest, hypot(corners[c, 0], corners[c, 1]))
        low, high = min(low, corners[c, 2]), max(high, corners[c, 2])
    lowest = atan2(low, nearest if low < 0.0 else farthest) - 1e-9
    highest = atan2(high, nearest if high > 0.0 else farthest) + 1e-9
    columns = ranges.shape[1]
    first, last = np.searchsorted(elevations, lowest), np.searchsorted(elevations, highest)
    if first >= last:
        return
    step = 2.0 * pi / columns
    start, count = 0, columns
    if nearest > 0.0:
        middle = atan2(
            corners[0, 1] + corners[1, 1] + corners[2, 1], corners[0, 0] + corners[1, 0] + corners[2, 0]
        )
        widest, narrowest = -np.inf, np.inf
        for c in range(3):
            turn = (atan2(corners[c, 1], corners[c, 0]) - middle + 3.0 * pi) % (2.0 * pi) - pi
            widest, narrowest = max(widest, turn), min(narrowest, turn)
        start = ceil((heading - middle - widest) / step - 1e-6)
        count = floor((heading - middle - narrowest) / step + 1e-6) - start + 1
    _hit_rays(corners, elevations, heading, reach, tag, ranges, tags, first, last, start, count)


@inner
def _hit_rays(corners, elevations, heading, reach, tag, ranges, tags, first, last, start, count):
    """Intersect one triangle with a block of rays. Source: Moeller and Trumbore 1997."""
    columns = ranges.shape[1]
    ax, ay, az = corners[0, 0], corners[0, 1], corners[0, 2]
    ux, uy, uz = corners[1, 0] - ax, corners[1, 1] - ay, corners[1, 2] - az
    vx, vy, vz = corners[2, 0] - ax, corners[2, 1] - ay, corners[2, 2] - az
    qx, qy, qz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
    for index in range(start, start + min(count, columns)):
        column = index % columns
        azimuth = heading - column * 2.0 * pi / columns
        cos_a, sin_a = cos(azimuth), sin(azimuth)
        for channel in range(first, last):
            level = cos(elevations[channel])
            dx, dy, dz = level * cos_a, level * sin_a, sin(elevations[channel])
            px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
            scale = ux * px + uy * py + uz * pz
            if scale == 0.0:
                continue
            u = -(ax * px + ay * py + az * pz) / scale
            if u < 0.0 or u > 1.0:
                continue
            v = (dx * qx + dy * qy + dz * qz) / scale
            if v < 0.0 or u + v > 1.0:
                continue
            distance = (vx * qx + vy * qy + vz * qz) / scale
            if 0.0 < distance < ranges[channel, column] and distance <= reach:
                ranges[channel, column] = distance
                tags[channel, column] = tag
