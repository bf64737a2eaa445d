"""From shapes on the ground to triangles in space: surfaces, kerbs, paint, signals, and the scene file."""
