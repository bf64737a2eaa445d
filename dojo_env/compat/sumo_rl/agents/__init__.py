"""SUMO-RL's agent that learns a table."""

from .ql_agent import QLAgent

__all__ = ["QLAgent"]
