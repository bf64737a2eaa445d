"""Sensors of the kind `camera`: one output of one camera, such as `bev` or `approach_0:depth`."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.errors import ConfigError
from dojo_env.parked_cars import FIRST_NUMBER
from dojo_env.rendering.outputs import OUTPUTS
from dojo_env.sensors.base import CAMERA_KIND, SENSORS, Look, Sensor, Site
from dojo_maps.short_repr import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSensor:
    """One output of a camera. Its noise is that of the environment's `conditions`.

    Attributes:
        camera: a camera, or the name of one that is placed from the map, such as `bev` or `approach_0`.
        output: `rgb`, `depth`, `semantic` or `instance`: of the simulated road users alone, in `instance`.
        interval: seconds from look to look; 0 looks at each decision.
        delay: seconds from a look until the agent gets it.
    """

    camera: Camera | str = BEV
    output: str = "rgb"
    interval: float = 0.0
    delay: float = 0.0

    __repr__ = short_repr

    def mount(self, site: Site) -> Sensor:
        """Hang it.

        Raises:
            ConfigError: there is no such camera or output.
        """
        return _MountedCamera(self, site)


class _MountedCamera(Sensor):
    def __init__(self, settings: CameraSensor, site: Site) -> None:
        self._camera, self._output = site.find_camera(settings.camera), settings.output
        output = OUTPUTS.get(self._output)
        if output is None or output.dtype is None:
            known = ", ".join(name for name, each in OUTPUTS.items() if each.dtype is not None)
            raise ConfigError(f"sensor {site.name!r}: no output {self._output!r}; choose from {known}")
        self.space = spaces.Box(
            output.low, output.high(self._camera), output.shape(self._camera), output.dtype  # type: ignore[arg-type]
        )  # fmt: skip
        self.interval, self.delay = settings.interval, settings.delay
        self.views = {self._camera: (self._output,)}

    def observe(self, look: Look) -> NDArray[Any]:
        made: NDArray[Any] = look.pictures[self._camera].outputs[self._output]
        return np.where(made < FIRST_NUMBER, made, 0) if self._output == "instance" else made


def _mount(text: str, site: Site) -> Sensor:
    camera, _, output = text.partition(":")
    return CameraSensor(camera=camera, output=output or "rgb").mount(site)


SENSORS[CAMERA_KIND] = _mount
