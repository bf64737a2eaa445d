"""SUMO-RL's environment, its signals, observations and scenarios."""
