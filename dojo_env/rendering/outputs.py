"""The outputs of a camera: for each name its type, its shape, its range, and how it is made from a drawing.

Both renderers, the spaces of observations and every check read this table; another output is another entry.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from dojo_env.camera import Camera
from dojo_env.errors import ConfigError
from dojo_env.rendering.boxes import Boxes, measure_boxes
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.eye import Eye
from dojo_env.rendering.target import Target, label, resolve_pixels, resolve_samples
from dojo_env.rendering.traffic import Users
from dojo_env.rendering.visibility import Visible
from dojo_env.snapshot import Snapshot


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What the rasteriser draws through one camera, once an output needs it.

    Attributes:
        camera: the camera.
        snapshot: the instant.
        users: its road users in place.
        eye: what the camera keeps from frame to frame.
        factor: samples a pixel has, across and down.
        draw: draws it.
    """

    camera: Camera
    snapshot: Snapshot
    users: Users
    eye: Eye
    factor: int
    draw: Callable[[], Target]

    @cached_property
    def target(self) -> Target:
        """The visibility buffer; valid until the camera draws again."""
        return self.draw()


class BulletDrawing(NamedTuple):
    """What pybullet has drawn through one camera.

    Attributes:
        camera: the camera.
        rgba: (h, w, 4) uint8.
        buffer: (h, w) float64, OpenGL's depth buffer, 0 at `near` and 1 at `far`.
        semantic: (h, w) uint8, `Semantic`.
        instance: (h, w) int32, the road user's number.
    """

    camera: Camera
    rgba: NDArray[np.uint8]
    buffer: NDArray[np.float64]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """One kind of output.

    Attributes:
        what: its meaning and unit, for people.
        make: makes it from what the rasteriser has drawn.
        make_bullet: makes it from what pybullet has drawn; None where pybullet has no such output.
        dtype: numpy's type; None for what is no array, and so cannot be observed.
        channels: the shape after height and width.
        low: its least value.
        high: its greatest value, through a camera.
        is_coloured: it shows colours, and so needs shading and shadows.
        is_smoothed: it is made from more samples a pixel where pictures are anti-aliased.
    """

    what: str
    make: Callable[[Drawing], Any]
    make_bullet: Callable[[BulletDrawing], Any] | None = None
    dtype: DTypeLike | None = None
    channels: tuple[int, ...] = ()
    low: float = 0.0
    high: Callable[[Camera], float] = lambda _: 0.0
    is_coloured: bool = False
    is_smoothed: bool = False

    def shape(self, camera: Camera) -> tuple[int, ...]:
        """Give the shape of the array that a camera delivers.

        Args:
            camera: its width and height count.

        Returns:
            Height and width, pixels, and what `channels` adds.
        """
        return (camera.height, camera.width, *self.channels)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """What a camera saw; every output is an attribute by its name, None where it was not asked for.

    Attributes:
        camera: the camera.
        outputs: what was asked for, by name; see `OUTPUTS`.
    """

    camera: Camera
    outputs: Mapping[str, Any] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        """Give an output of the table."""
        if name not in OUTPUTS:
            raise AttributeError(f"a picture has no {name!r}; it has camera, {', '.join(OUTPUTS)}")
        return self.outputs.get(name)

    def __repr__(self) -> str:
        """Tell through which camera, and what was asked for."""
        size = f"{self.camera.width} x {self.camera.height}"
        return f"Picture({self.camera.name!r}, {size}, {', '.join(self.outputs)})"

    def _repr_png_(self) -> bytes | None:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        from dojo_env.rendering.display import colour_outputs, encode_images  # noqa: PLC0415 - OpenCV is large; few need it

        images = colour_outputs(self.outputs)
        return encode_images(images) if images else None


def check_outputs(names: Iterable[str], *, bullet: bool = False) -> frozenset[str]:
    """Refuse names that are no outputs.

    Args:
        names: what is asked for.
        bullet: pybullet is to draw it.

    Returns:
        The names, each once.

    Raises:
        ConfigError: an output has no such name, or pybullet does not draw it.
    """
    wanted = frozenset(names)
    known = [name for name, output in OUTPUTS.items() if output.make_bullet or not bullet]
    if unknown := wanted.difference(known):
        drawer = " from bullet" if bullet else ""
        raise ConfigError(f"no output {sorted(unknown)}{drawer}; choose from {', '.join(known)}")
    return wanted


def _paint(drawing: Drawing) -> NDArray[np.uint8]:
    target, background = drawing.target, drawing.eye.background
    picture = background.lit.copy()
    resolve = resolve_pixels if drawing.factor == 1 else resolve_samples
    resolve(target.tags, target.spans, target.shades, background.shaded, background.headlit, picture)
    return picture


def _depth(drawing: Drawing) -> NDArray[np.float32]:
    return _measure_distances(drawing.target.depths, np.float32(drawing.camera.far))


def _semantic(drawing: Drawing) -> NDArray[np.uint8]:
    classes = np.append(SEMANTIC_OF_KIND[drawing.snapshot.kinds], np.uint8(Semantic.SIGNAL))
    target = drawing.target
    return label(target.tags, target.owners, classes, drawing.eye.background.semantics)


def _instance(drawing: Drawing) -> NDArray[np.int32]:
    target = drawing.target
    numbers = np.append(drawing.snapshot.numbers, np.int32(0))
    return label(target.tags, target.owners, numbers, drawing.eye.background.instances)


def _boxes(drawing: Drawing) -> Boxes:
    eye, users = drawing.eye, drawing.users
    alone = partial(eye.sights[1].canvas.count_pixels, users)
    seen = (drawing.target, eye.background.instances)
    return measure_boxes(seen, alone, users, drawing.snapshot, eye.parked, drawing.camera)


def _visible(drawing: Drawing) -> Visible:
    return drawing.eye.sights[1].measure_visible(drawing.users)


def _bullet_depth(drawing: BulletDrawing) -> NDArray[np.float32]:
    near, far = drawing.camera.near, drawing.camera.far
    return (far * near / (far - (far - near) * drawing.buffer)).astype(np.float32)


OUTPUTS: Mapping[str, Output] = MappingProxyType(
    {
        "rgb": Output(
            what="colour, sRGB",
            dtype=np.uint8,
            channels=(3,),
            high=lambda _: 255,
            make=_paint,
            make_bullet=lambda drawing: drawing.rgba[..., :3],
            is_coloured=True,
            is_smoothed=True,
        ),
        "depth": Output(
            what="metres along the camera's axis; its `far` where there is only sky",
            dtype=np.float32,
            high=lambda camera: camera.far,
            make=_depth,
            make_bullet=_bullet_depth,
        ),
        "semantic": Output(
            what="the class of what is there, `Semantic`",
            dtype=np.uint8,
            high=lambda _: int(max(Semantic)),
            make=_semantic,
            make_bullet=lambda drawing: drawing.semantic,
        ),
        "instance": Output(
            what="the road user's number in the snapshot; 0 where there is none",
            dtype=np.int32,
            high=lambda _: np.iinfo(np.int32).max,
            make=_instance,
            make_bullet=lambda drawing: drawing.instance,
        ),
        # Measured last: counting what stands in front draws anew.
        "boxes": Output(what="`Boxes` of the road users in view", make=_boxes),
        "visible": Output(
            what="`Visible` road users, as the boxes around them, without parked cars", make=_visible
        ),
    }
)
"""Outputs by name, in the order in which they are made."""


@kernel
def _measure_distances(depths, far):
    """Turn inverse depths into metres, at most `far`."""
    distances, least = np.empty_like(depths), np.float32(1) / far
    for row in range(depths.shape[0]):
        for column in range(depths.shape[1]):
            distances[row, column] = min(np.float32(1) / max(depths[row, column], least), far)
    return distances
