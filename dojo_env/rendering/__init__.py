"""Drawing: the static world once per camera, and then only what moves."""
