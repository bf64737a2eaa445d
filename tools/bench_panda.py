"""The same frames through Panda3D's software renderer, for comparison only."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dojo_env.camera import Camera
from dojo_env.rendering.fleet import usual_fleet
from dojo_env.rendering.lighting import SRGB
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.traffic import place_users
from dojo_env.snapshot import Snapshot
from dojo_maps.errors import ToolMissingError


class PandaWorld:
    """A scene and its road users in Panda3D, drawn off screen by p3tinydisplay."""

    def __init__(self, scene: Scene) -> None:
        """Load the static meshes.

        Raises:
            ToolMissingError: Panda3D is not installed.
        """
        try:
            from panda3d import core
        except ImportError as error:
            raise ToolMissingError("Panda3D is not installed: pip install 'traffic-dojo[bench]'") from error
        core.load_prc_file_data(
            "", "load-display p3tinydisplay\nwindow-type offscreen\nnotify-level-x11display fatal"
        )
        self._core, self._scene = core, scene
        self._engine = core.GraphicsEngine.get_global_ptr()
        self._pipe = core.GraphicsPipeSelection.get_global_ptr().make_module_pipe("p3tinydisplay")
        self._root = core.NodePath("scene")
        self._views: dict[Camera, tuple[Any, Any]] = {}
        self._users: dict[str, Any] = {}
        colours = SRGB[np.clip(scene.colours * 4095, 0, 4095).astype(int)]
        self._root.attach_new_node(
            self._node(scene.vertices[scene.faces].reshape(-1, 3), np.repeat(colours, 3, axis=0))
        )

    def close(self) -> None:
        """Free the buffers."""
        self._engine.remove_all_windows()

    def render(self, snapshot: Snapshot, cameras: Sequence[Camera]) -> list[np.ndarray]:
        """Draw one instant through each camera: (h, w, 3) each."""
        users = place_users(snapshot, self._scene.origin)
        for gone in self._users.keys() - set(snapshot.ids):
            self._users.pop(gone).remove_node()
        for k, name in enumerate(snapshot.ids):
            if name not in self._users:
                self._users[name] = self._root.attach_new_node(self._user_node(users, k))
            rows = np.eye(4)
            rows[:3, :3], rows[3, :3] = users.frames[k].T, users.places[k]
            self._users[name].set_mat(self._core.LMatrix4f(*rows.ravel().tolist()))
        for camera in cameras:
            if camera not in self._views:
                self._views[camera] = self._open(camera)
        self._engine.render_frame()
        return [self._read(self._views[camera][1], camera) for camera in cameras]

    def _user_node(self, users: Any, k: int) -> Any:
        models = usual_fleet().library
        first, _, face, end = models.spans[users.models[k], 0]
        corners = models.vertices[first + models.faces[face:end]].reshape(-1, 3)
        colour = SRGB[(users.colours[k, 0] * 4095).astype(int)]
        return self._node(corners, np.tile(colour, (len(corners), 1)))

    def _node(self, corners: np.ndarray, colours: np.ndarray) -> Any:
        core = self._core
        data = core.GeomVertexData("mesh", core.GeomVertexFormat.get_v3c4(), core.Geom.UH_static)
        vertex, colour = core.GeomVertexWriter(data, "vertex"), core.GeomVertexWriter(data, "color")
        for (x, y, z), (r, g, b) in zip(corners.tolist(), (colours / 255).tolist(), strict=True):
            vertex.add_data3(x, y, z)
            colour.add_data4(r, g, b, 1.0)
        triangles = core.GeomTriangles(core.Geom.UH_static)
        triangles.add_next_vertices(len(corners))
        geometry = core.Geom(data)
        geometry.add_primitive(triangles)
        node = core.GeomNode("mesh")
        node.add_geom(geometry)
        return node

    def _open(self, camera: Camera) -> tuple[Any, Any]:
        core = self._core
        flags = core.GraphicsPipe.BF_refuse_window
        size = core.WindowProperties.size(camera.width, camera.height)
        buffer = self._engine.make_output(
            self._pipe, camera.name, 0, core.FrameBufferProperties.get_default(), size, flags
        )
        texture = core.Texture()
        buffer.add_render_texture(texture, core.GraphicsOutput.RTM_copy_ram)
        lens = core.PerspectiveLens()
        upright = 2 * np.degrees(np.arctan(camera.height / 2 / camera.focal_length))
        lens.set_fov(camera.field_of_view_deg, float(upright))
        lens.set_near_far(camera.near, camera.far)
        eye = self._root.attach_new_node(core.Camera(camera.name, lens))
        place = np.array(camera.position) - self._scene.origin
        _, down, forward = camera.axes
        eye.set_pos(*place.tolist())
        eye.look_at(core.LPoint3f(*(place + forward).tolist()), core.LVector3f(*(-down).tolist()))
        buffer.make_display_region().set_camera(eye)
        return buffer, texture

    def _read(self, texture: Any, camera: Camera) -> np.ndarray:
        data = np.frombuffer(texture.get_ram_image_as("RGB"), dtype=np.uint8)
        return data.reshape(camera.height, camera.width, 3)[::-1]
