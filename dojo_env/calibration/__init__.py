"""From a photograph to a camera: control points, the camera that they fit, its uncertainty, its overlay."""
