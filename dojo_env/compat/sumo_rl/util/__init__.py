"""SUMO-RL's helpers."""
