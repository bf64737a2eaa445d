"""The benchmark's rows: controllers that do not learn, and policies that do, each with its settings."""

from typing import Any

from .settings import Training

CONTROLLERS: dict[str, tuple[str, dict[str, Any]]] = {
    "FixedTime": ("fixed-time", {}),
    "Cycle": ("cycle", {}),
    "Webster": ("webster", {}),
    "Actuated": ("actuated", {}),
    "DelayBased": ("delay-based", {}),
    "SOTL": ("sotl", {"min_green": 8}),
    "MaxPressure": ("max-pressure", {}),
    "Random": ("random", {}),
}
"""Controller and settings of each row that does not learn.

`min_green` is green alone: 8 where the paper's figures come from changing 10 s after the last change, its 2 s
of yellow included.
"""
OWN_SETTINGS: dict[tuple[str, str], dict[str, Any]] = {("cologne1", "MaxPressure"): {"min_green": 8}}
MIN_GREEN = {"cologne1": 8}
"""What policies get by scenario, where not 10: what MaxPressure gets there."""
_ALGORITHMS = ("DQN", "PPO", "A2C")
_SEEN: dict[str, dict[str, Any]] = {
    "F": {"observation": "features"},
    "MV": {"observation": "multi_view"},
    "BEV": {"observation": "bev"},
    "BEV*": {"observation": "bev", "encoder": "efficientnet-lite0", "height": 256, "width": 356},
}
LEARNED: dict[str, dict[str, Any]] = {
    f"{algorithm}-{seen}": {"algorithm": algorithm.lower(), **settings}
    for algorithm in _ALGORITHMS
    for seen, settings in _SEEN.items()
}
"""What sets each row that learns apart from `Training`'s defaults."""
ROWS = (*CONTROLLERS, *LEARNED)


def find_training(row: str, scenario: str) -> Training:
    """Tell how a row's policy is trained on a scenario."""
    return Training(scenario=scenario, min_green=MIN_GREEN.get(scenario, 10), **LEARNED[row])
