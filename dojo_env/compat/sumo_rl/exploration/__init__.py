"""How SUMO-RL's agent explores."""

from .epsilon_greedy import EpsilonGreedy

__all__ = ["EpsilonGreedy"]
