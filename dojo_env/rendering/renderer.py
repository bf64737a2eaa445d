"""The renderer: a snapshot through cameras. The static world comes from a cache; only what moves is drawn."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from typing import Any

from dojo_env.camera import Camera
from dojo_env.conditions import LOOKS, Conditions
from dojo_env.errors import ConfigError
from dojo_env.rendering.background import SAMPLES
from dojo_env.rendering.eye import Eye, open_eye
from dojo_env.rendering.lighting import compute_light
from dojo_env.rendering.outputs import OUTPUTS, Drawing, Picture, check_outputs
from dojo_env.rendering.scene import NO_PATHS, Scene, SignalFaces
from dojo_env.rendering.traffic import Users, place_users
from dojo_env.snapshot import Snapshot

_Maker = tuple[str, Callable[[Drawing], Any]]
_Passes = Sequence[tuple[int, bool, Sequence[_Maker]]]
"""How a camera is drawn: samples a pixel has across and down, whether in colours, and what is made of it."""


_NOBODY = Snapshot(time=0.0)


class Renderer:
    """Draws snapshots of one scene under one state of light and weather."""

    def __init__(
        self,
        scene: Scene,
        *,
        conditions: Conditions | None = None,
        smooth: bool = False,
        show_links: bool = False,
        look: str = "street",
    ) -> None:
        """Prepare to draw.

        Args:
            scene: the static world.
            conditions: light and weather; what they say of lenses belongs to `sensors.noise`.
            smooth: anti-alias what moves, too; costs a few times as much.
            show_links: draw each signal link's path as a green, yellow or red line, as the paper does.
            look: one of `LOOKS`.

        Raises:
            ConfigError: there is no such look.
        """
        if look not in LOOKS:
            raise ConfigError(f"look={look!r}: expected one of {', '.join(LOOKS)}")
        self.scene = scene
        self.smooth = smooth
        self.show_links = show_links
        self.look = look
        self._light = compute_light(conditions or Conditions())
        self._rain = conditions.rain if conditions else 0.0
        self._faces = SignalFaces(scene)
        self._eyes: dict[tuple[Camera, bool], Eye] = {}
        self._placed: tuple[Snapshot, Users] | None = None

    def render(
        self,
        snapshot: Snapshot,
        cameras: Iterable[Camera],
        outputs: Sequence[str] = ("rgb",),
        *,
        parked: bool = True,
    ) -> tuple[Picture, ...]:
        """Draw one instant through each camera.

        Args:
            snapshot: the instant.
            cameras: one picture each, in this order.
            outputs: names of `OUTPUTS`.
            parked: whether the scene's parked cars are there, too.

        Returns:
            What each camera sees, with the outputs that were asked for.

        Raises:
            ConfigError: an output has no such name.
        """
        passes = _plan(tuple(outputs), smooth=self.smooth)
        users = self._place(snapshot)
        return tuple(self._picture(snapshot, users, camera, passes, parked) for camera in cameras)

    def forget(self, cameras: Iterable[Camera] | None = None) -> None:
        """Drop the backgrounds of cameras that are no longer used; they are drawn anew if one looks again.

        Args:
            cameras: whose; None for those of all.
        """
        gone = None if cameras is None else set(cameras)
        for key in [key for key in self._eyes if gone is None or key[0] in gone]:
            del self._eyes[key]

    def close(self) -> None:
        """Forget every background; the renderer may still be used."""
        self.forget()

    def _place(self, snapshot: Snapshot) -> Users:
        """Place the road users once for all that look at the same instant, such as every signal's cameras."""
        if self._placed is None or self._placed[0] is not snapshot:
            scene = self.scene
            users = place_users(snapshot, scene.origin, rain=self._rain, ways=scene.ways, fleet=scene.fleet)
            self._placed = snapshot, users
        return self._placed[1]

    def _picture(
        self, snapshot: Snapshot, users: Users, camera: Camera, passes: _Passes, parked: bool
    ) -> Picture:
        eye = self._open(camera, parked)
        states = tuple(snapshot.signals.items())
        lamps, paths = self._faces.lit(states), self._faces.paths(states) if self.show_links else NO_PATHS
        made: dict[str, Any] = {}
        for factor, colours, makers in passes:
            draw = partial(eye.sights[factor].draw, users, lamps, paths, colours=colours)
            drawing = Drawing(
                camera=camera, snapshot=snapshot, users=users, eye=eye, factor=factor, draw=draw
            )
            for name, make in makers:
                made[name] = make(drawing)
        return Picture(camera=camera, outputs=made)

    def _open(self, camera: Camera, parked: bool) -> Eye:
        key = (camera, parked)
        if key not in self._eyes:
            self._eyes[key] = open_eye(
                self.scene,
                self.scene.parked if parked else _NOBODY,
                camera,
                self._light,
                smooth=self.smooth,
                plain=self.look == "plain",
            )
        return self._eyes[key]


@cache
def _plan(outputs: tuple[str, ...], *, smooth: bool) -> _Passes:
    """Divide the outputs into those that are smoothed and the others; each kind is drawn once.

    Raises:
        ConfigError: an output has no such name.
    """
    wanted = check_outputs(outputs)
    fine: list[_Maker] = []
    plain: list[_Maker] = []
    for name, output in OUTPUTS.items():
        if name in wanted:
            (fine if smooth and output.is_smoothed else plain).append((name, output.make))
    return [
        (factor, any(OUTPUTS[name].is_coloured for name, _ in makers), makers)
        for factor, makers in ((SAMPLES, fine), (1, plain))
        if makers
    ]
