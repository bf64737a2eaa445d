"""Learning: settings of a training run, its environments and networks, checkpoints, evaluation.

Stable-Baselines3 on one machine, Ray RLlib on many: both train the same networks and write the same files.
"""
