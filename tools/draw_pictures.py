"""Draw the pictures of roads that the documents of dojo_env show, through cameras of cologne1.

python tools/draw_pictures.py
"""

import sys
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import dojo_env
from dojo_env.camera import BEV
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.local_world import LocalWorld
from dojo_env.rendering.display import colour_outputs
from dojo_env.sensors.eyes import Eyes

FOLDER = Path(dojo_env.__file__).parent / "pictures"
HEIGHT, WIDTH, SECONDS, SEED = 384, 534, 600, 1
CONDITIONS = ("day", "dusk", "night", "rain")
OUTPUTS = ("rgb", "depth", "semantic", "instance")
APPROACH = 0
"""Number of the approach whose camera looks."""

Image = NDArray[np.uint8]


def save(name: str, pictures: list[Image]) -> None:
    """Write pictures two in a row."""
    rows = [np.hstack(pictures[k : k + 2]) for k in range(0, len(pictures), 2)]
    path = FOLDER / f"{name}.jpg"
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
    print(path)


def main() -> int:
    """Drive for a while, then look."""
    settings = {"scenario": "cologne1", "height": HEIGHT, "width": WIDTH, "smooth": True}
    with closing(LocalWorld(build_config(**settings, num_seconds=SECONDS, show_links=True))) as world:
        world.run(make_controller("fixed-time"), SEED)
        snapshot, bundle = world.instant.snapshot, world.map.bundle
        (signal,) = world.signals

        def look(outputs: tuple[str, ...], cameras: str = "usual", **more: object) -> list[list[Image]]:
            config = build_config(**settings, cameras=cameras, **more)
            with closing(Eyes(bundle, config.sensing)) as eyes:
                eyes.reset(SEED, begin=config.sumo.begin)
                seen = eyes.look(snapshot, eyes.cameras(signal), outputs)
            wanted = [each for each in seen if each.camera.name != BEV][APPROACH]
            above = [each for each in seen if each.camera.name == BEV]
            return [colour_outputs(each.outputs) for each in (wanted, *above)]

        save("conditions", [look(("rgb",), conditions=name)[0][0] for name in CONDITIONS])
        save("outputs", look(OUTPUTS)[0])
        save("approach_and_bev", [each[0] for each in look(("rgb",), show_links=True)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
