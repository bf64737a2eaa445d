"""The renderer: a snapshot through cameras. The static world comes from a cache; only what moves is drawn."""

from collections.abc import Iterable, Sequence
from typing import Any

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.rendering.background import SAMPLES
from dojo_env.rendering.eye import Eye, open_eye
from dojo_env.rendering.lighting import compute_light
from dojo_env.rendering.outputs import OUTPUTS, Drawing, Picture, check_outputs
from dojo_env.rendering.scene import NO_PATHS, Scene, SignalFaces
from dojo_env.rendering.traffic import Users, place_users
from dojo_env.snapshot import Snapshot

_Passes = Sequence[tuple[int, Sequence[str]]]
"""What is drawn of a camera, and how often: samples a pixel has across and down, and the outputs."""


class Renderer:
    """Draws snapshots of one scene under one state of light and weather."""

    def __init__(
        self,
        scene: Scene,
        *,
        conditions: Conditions | None = None,
        smooth: bool = False,
        show_links: bool = False,
    ) -> None:
        """Prepare to draw.

        Args:
            scene: the static world.
            conditions: light and weather; what they say of lenses belongs to `sensors.noise`.
            smooth: anti-alias what moves, too; costs a few times as much.
            show_links: draw each signal link's path as a green, yellow or red line, as the paper does.
        """
        self.scene = scene
        self.smooth = smooth
        self.show_links = show_links
        self._light = compute_light(conditions or Conditions())
        self._faces = SignalFaces(scene)
        self._eyes: dict[tuple[Camera, int], Eye] = {}

    def render(
        self, snapshot: Snapshot, cameras: Iterable[Camera], outputs: Sequence[str] = ("rgb",)
    ) -> tuple[Picture, ...]:
        """Draw one instant through each camera.

        Args:
            snapshot: the instant.
            cameras: one picture each, in this order.
            outputs: names of `OUTPUTS`.

        Raises:
            ConfigError: an output has no such name.
        """
        passes = self._plan(check_outputs(outputs))
        users = place_users(snapshot, self.scene.origin)
        return tuple(self._picture(snapshot, users, camera, passes) for camera in cameras)

    def forget(self, cameras: Iterable[Camera] | None = None) -> None:
        """Drop the backgrounds of cameras that are no longer used; of all if none are named."""
        gone = None if cameras is None else set(cameras)
        for key in [key for key in self._eyes if gone is None or key[0] in gone]:
            del self._eyes[key]

    def close(self) -> None:
        """Forget every background; the renderer may still be used."""
        self.forget()

    def _plan(self, wanted: frozenset[str]) -> _Passes:
        """Divide the outputs into those that are smoothed and the others; each kind is drawn once."""
        fine = [name for name in OUTPUTS if name in wanted and self.smooth and OUTPUTS[name].is_smoothed]
        plain = [name for name in OUTPUTS if name in wanted and name not in fine]
        return [(factor, names) for factor, names in ((SAMPLES, fine), (1, plain)) if names]

    def _picture(self, snapshot: Snapshot, users: Users, camera: Camera, passes: _Passes) -> Picture:
        made: dict[str, Any] = {}
        for factor, names in passes:
            drawing = self._draw(snapshot, users, camera, factor)
            for name in names:
                made[name] = OUTPUTS[name].make(drawing)
        return Picture(camera=camera, outputs=made)

    def _draw(self, snapshot: Snapshot, users: Users, camera: Camera, factor: int) -> Drawing:
        """Fill the visibility buffer."""
        key = (camera, factor)
        eye = self._eyes.get(key)
        if eye is None:
            eye = self._eyes[key] = open_eye(self.scene, camera, self._light, factor)
        states = tuple(snapshot.signals.items())
        paths = self._faces.paths(states) if self.show_links else NO_PATHS
        target = eye.bend(eye.canvas.draw(users, self._faces.lit(states), paths))
        return Drawing(camera, snapshot, users, eye, target, factor)
