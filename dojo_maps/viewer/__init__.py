"""The map as one web page that opens offline, in any browser with WebGL 2.

`write_view` puts a map's meshes, what there is to know of it, the findings of its report and, where one is
given, a recorded episode into one file. The page asks for nothing else.
"""

from dojo_maps.viewer.page import write_view
from dojo_maps.viewer.playback import Model, Playback

__all__ = ["Model", "Playback", "write_view"]
