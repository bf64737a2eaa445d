"""What the sensors of an environment share: one scene, one renderer, and the conditions of the episode.

Drawing needs a compiler in memory, so its modules are loaded when somebody looks for the first time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.camera_presets import PAPER
from dojo_env.conditions import Conditions, settle_conditions
from dojo_env.config import SensingConfig
from dojo_env.imaging import settle_imaging
from dojo_env.outages import find_outage
from dojo_env.snapshot import Snapshot
from dojo_env.vehicle_models import settle_models
from dojo_maps.bundle import Bundle
from dojo_maps.description import RoadMap

if TYPE_CHECKING:
    from dojo_env.rendering.bullet import BulletWorld
    from dojo_env.rendering.outputs import Picture
    from dojo_env.rendering.renderer import Renderer
    from dojo_env.rendering.scene import Scene
    from dojo_env.sensors.noise import Lens


class Eyes:
    """Draws for all signals of an environment."""

    def __init__(self, bundle: Bundle, config: SensingConfig) -> None:
        """Note what is to be seen, and how; nothing is loaded yet."""
        self._bundle, self.config = bundle, config
        self._placed: dict[str, tuple[Camera, ...]] = {}
        self._hung: dict[Camera, Camera] = {}
        self._renderer: Renderer | BulletWorld | None = None
        self._lenses: dict[str, Lens] = {}
        self._begin = 0.0
        self._good: dict[tuple[object, ...], NDArray[np.uint8]] = {}
        fixed = not isinstance(config.conditions, Mapping)
        self.conditions = settle_conditions(config.conditions, 0) if fixed else Conditions()
        self.imaging = settle_imaging(config.imaging, seed=0)

    @property
    def road_map(self) -> RoadMap:
        """The map as it is described."""
        return self._bundle.road_map

    @cached_property
    def scene(self) -> "Scene":
        """The static world."""
        from dojo_env.rendering.scene import build_scene

        return build_scene(self._bundle, settle_models(self.config.models), parked=self.config.parked)

    def reset(self, seed: int, *, begin: float = 0.0) -> None:
        """Begin an episode at a time: draw its conditions and its camera body, unless they are fixed.

        Args:
            seed: decides what is drawn, and all noise of the episode.
            begin: simulated seconds; the times of cameras' outages count from there.
        """
        self._begin = begin
        drawn = settle_conditions(self.config.conditions, seed)
        if drawn.outside != self.conditions.outside:
            # Another light needs other backgrounds; the same keeps them.
            self.close()
        self.conditions = replace(drawn, seed=seed)
        self.imaging = settle_imaging(self.config.imaging, seed)
        self._hung, self._lenses, self._good = {}, {}, {}

    def close(self) -> None:
        """Free what draws; it is made anew when somebody looks."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None

    def cameras(self, signal: str) -> tuple[Camera, ...]:
        """List a signal's cameras: those that were given for it, else placed from the map.

        Args:
            signal: its id.

        Returns:
            Those given, in their order; or one for each approach and, last, `bev`, the same at every call.

        Raises:
            ConfigError: cameras must be placed, and the map has no such signal or no lane leads to it.
            DescriptionError: cameras must be placed, and the bundle's scene is missing or broken.
        """
        from dojo_env.sensors.placement import place_cameras

        if signal not in self._placed:
            wanted = self.config.cameras
            given = () if isinstance(wanted, str) else tuple(wanted.get(signal, ()))
            preset = wanted if isinstance(wanted, str) else PAPER
            width, height = self.config.width, self.config.height
            self._placed[signal] = given or place_cameras(
                self.scene, signal, preset=preset, width=width, height=height
            )
        return self._placed[signal]

    def look(
        self,
        snapshot: Snapshot,
        cameras: Sequence[Camera],
        outputs: Sequence[str] = ("rgb",),
        *,
        viewer: str = "agent",
        parked: bool = True,
    ) -> "tuple[Picture, ...]":
        """Draw an instant through each camera, with all that the episode's conditions do to it.

        Lenses remember what they delivered, so who looks at other times than the agent needs lenses of its
        own: another `viewer`. Without what is `parked`, roads without road users are empty.

        Args:
            snapshot: the instant.
            cameras: one picture each, in this order; as they hang before mounts are shaken.
            outputs: names of `OUTPUTS`.
            viewer: whose lenses are looked through; any name.
            parked: whether the scene's parked cars are there, too.

        Returns:
            What each camera delivers; its own camera is the one that conditions have moved.

        Raises:
            ConfigError: the renderer has no such output, or pybullet is to draw through a lens that bends.
            DescriptionError: the bundle's scene is missing or broken.
            ToolMissingError: pybullet, or PyAV with x264 for H.264, is asked for and not installed.
        """
        hung = [self._mount(camera) for camera in cameras]
        pictures = self._draws.render(snapshot, hung, outputs, parked=parked)
        delivered = (self._delivered(picture, snapshot, viewer, parked=parked) for picture in pictures)
        if not self.config.outages:
            return tuple(delivered)
        return tuple(self._interrupt(picture, snapshot.time, viewer) for picture in delivered)

    @property
    def _draws(self) -> "Renderer | BulletWorld":
        from dojo_env.rendering.bullet import BulletWorld
        from dojo_env.rendering.renderer import Renderer

        if self._renderer is None and self.config.renderer == "bullet":
            self._renderer = BulletWorld(self.scene)
        elif self._renderer is None:
            self._renderer = Renderer(
                self.scene,
                conditions=self.conditions,
                smooth=self.config.smooth,
                show_links=self.config.show_links,
                look=self.config.look,
            )
        return self._renderer

    def _mount(self, camera: Camera) -> Camera:
        """Hang a camera where its shaken mount puts it in this episode."""
        if not (self.conditions.shake_m or self.conditions.shake_deg):
            return camera
        if camera not in self._hung:
            from dojo_env.sensors.mounts import shake_cameras

            (self._hung[camera],) = shake_cameras([camera], self.conditions)
        return self._hung[camera]

    def _delivered(self, picture: "Picture", snapshot: Snapshot, viewer: str, *, parked: bool) -> "Picture":
        """Make of a perfect picture what its camera delivers."""
        if picture.rgb is not None and self.imaging.takes_time:
            from dojo_env.sensors.shutter import expose

            draw = partial(self._draw_colours, parked=parked)
            picture = expose(draw, snapshot, picture, self.imaging)
        if self.conditions.sway_deg:
            from dojo_env.sensors.mounts import sway

            picture = sway(picture, self.conditions, snapshot.time)
        if picture.rgb is None or not (self.conditions.spoils_pictures or self.imaging.spoils_pictures):
            return picture
        if viewer not in self._lenses:
            from dojo_env.sensors.noise import Lens

            self._lenses[viewer] = Lens(self.conditions, self.imaging, self.scene)
        spoilt = self._lenses[viewer].spoil(picture.rgb, picture.camera, snapshot.time)
        return replace(picture, outputs={**picture.outputs, "rgb": spoilt})

    def _interrupt(self, picture: "Picture", time: float, viewer: str) -> "Picture":
        """Deliver what a camera does that fails; what it shows is gone, not what would be there to see."""
        if picture.rgb is None:
            return picture
        key = (viewer, picture.camera.name, picture.camera.position)
        outage = find_outage(self.config.outages, picture.camera.name, time - self._begin)
        if outage is None:
            self._good[key] = picture.rgb
            return picture
        last = self._good.get(key) if outage.kind == "frozen" else None
        rgb = np.zeros_like(picture.rgb) if last is None else last
        return replace(picture, outputs={**picture.outputs, "rgb": rgb})

    def _draw_colours(self, snapshot: Snapshot, camera: Camera, *, parked: bool) -> "NDArray[np.uint8]":
        (picture,) = self._draws.render(snapshot, [camera], parked=parked)
        colours: NDArray[np.uint8] = picture.rgb
        return colours
