"""The same runs on the nodes of a Ray cluster, by RLlib."""
