"""The benchmark's rows: controllers that do not learn, and policies that do, each with its settings."""

from typing import Any

from .settings import REWARD, Training

CONTROLLERS: dict[str, tuple[str, dict[str, Any]]] = {
    "FixedTime": ("fixed-time", {}),
    "Pretimed": ("pretimed", {}),
    "Cycle": ("cycle", {}),
    "Webster": ("webster", {}),
    "Actuated": ("actuated", {}),
    "DelayBased": ("delay-based", {}),
    "SOTL": ("sotl-paper", {"min_green": 8}),
    "SOTL-movements": ("sotl", {}),
    "MaxPressure": ("max-pressure-paper", {}),
    "MaxPressure-movements": ("max-pressure", {}),
    "QueuePressure": ("queue-pressure", {}),
    "Random": ("random", {}),
}
"""Controller and settings of each row that does not learn.

`min_green` is green alone: 8 where the paper's figures come from changing 10 s after the last change, its 2 s
of yellow included.
"""
CONSTRAINTS: dict[str, dict[str, Any]] = {
    "paper": {"yellow_time": 2, "all_red": 0, "always_transition": True},
    "intergreen": {"yellow_time": "speed", "all_red": 2},
}
"""What holds for all rows of a table but the network's own program: the published figures' changes of 2 s, or
those of a street, with a yellow after each approach's speed limit and a red for all."""
GENTLE = {name: weight / 10 for name, weight in REWARD.items()}
"""A reward whose worst jams do not drown, in the errors of the value, what the policy is to learn."""
PATIENT = {**GENTLE, "diff-waiting-time": 0.01}
"""Another, that minds twice as much who waits."""
BOLD = {"learning_rate": 0.002, "ent_coef": 0.0005}
"""For A2C: rewards are a tenth, so the bonus for trying things must be, too."""
OWN_SETTINGS: dict[tuple[str, str], dict[str, Any]] = {
    ("cologne1", "MaxPressure"): {"min_green": 8},
    ("cologne1", "learned"): {"min_green": 8},
    ("cologne1", "PPO-BEV"): {"steps": 400_000, "patches": "apart"},
    ("cologne1", "PPO-BEV random"): {"steps": 300_000, "patches": "apart"},
    ("cologne1", "PPO-MV random"): {"steps": 200_000, "patches": "apart"},
    ("cologne1", "DQN"): {"hyperparameters": {"train_freq": 1}},
    ("cologne1", "DQN-MV"): {"steps": 50_000},
    ("cologne1", "DQN-BEV"): {"steps": 300_000, "patches": "apart", "hyperparameters": {"train_freq": 2}},
    ("cologne1", "PPO-BEV*"): {"steps": 100_000},
    ("cologne1", "DQN-BEV*"): {"steps": 120_000},
    ("cologne1", "A2C-F"): {"reward": PATIENT, "hyperparameters": BOLD},
    ("cologne1", "A2C-BEV*"): {"reward": PATIENT, "hyperparameters": BOLD},
    ("two-way", "PPO-BEV"): {"steps": 1_600_000, "reward": {**REWARD, "diff-waiting-time": 0.1}},
    ("two-way", "PPO-MV"): {"steps": 1_000_000, "reward": PATIENT},
    ("two-way", "PPO-BEV*"): {
        "steps": 500_000,
        "reward": PATIENT,
        "hyperparameters": {"learning_rate": 0.001},
    },
    ("two-way", "A2C-BEV"): {
        "steps": 1_200_000,
        "averaged_weights": True,
        "reward": {**GENTLE, "diff-waiting-time": 0.003},
        "hyperparameters": {**BOLD, "n_steps": 36, "ent_coef": 0.0015},
    },
    ("two-way", "A2C-MV"): {
        "steps": 800_000,
        "shared_views": True,
        "averaged_weights": True,
        "reward": {**GENTLE, "diff-waiting-time": 0.003},
        "hyperparameters": {"learning_rate": 0.001, "ent_coef": 0.0015},
    },
    ("two-way", "A2C-BEV*"): {
        "steps": 500_000,
        "averaged_weights": True,
        "reward": {**GENTLE, "diff-waiting-time": 0.004},
        "hyperparameters": {**BOLD, "ent_coef": 0.0015},
    },
    ("two-way", "DQN"): {"reward": GENTLE, "hyperparameters": {"n_steps": 6, "train_freq": 1}},
    ("two-way", "DQN-BEV"): {"steps": 300_000},
    ("two-way", "DQN-MV"): {
        "steps": 300_000,
        "shared_views": True,
        "hyperparameters": {"buffer_size": 40_000},
    },
    ("two-way", "DQN-BEV*"): {
        "steps": 430_000,
        "averaged_weights": True,
        "hyperparameters": {"batch_size": 128, "exploration_fraction": 0.15, "buffer_size": 100_000},
    },
    ("cologne3", "PPO-BEV shared"): {"steps": 80_000},
    ("cologne3", "PPO-BEV independent"): {"steps": 40_000},
    ("grid4x4", "PPO-F shared"): {"steps": 60_000},
    ("grid4x4", "PPO-F independent"): {"steps": 100_000, "hyperparameters": {"learning_rate": 0.001}},
    ("grid4x4", "PPO-BEV shared"): {"steps": 20_000},
}
"""What sets rows apart on one scenario: all that learn, an algorithm's, or one.

Pictures tell all they can after more steps than the others get.
"""
_ALGORITHMS = ("DQN", "PPO", "A2C")
_SEEN: dict[str, dict[str, Any]] = {
    "F": {"observation": "features"},
    "MV": {"observation": "multi_view", "patches": "overlapping", "steps": 100_000},
    "BEV": {"observation": "bev", "patches": "overlapping"},
    "BEV*": {
        "observation": "bev",
        "encoder": "efficientnet-lite0",
        "height": 256,
        "width": 356,
        "steps": 60_000,
    },
}
LEARNED: dict[str, dict[str, Any]] = {
    f"{algorithm}-{seen}": {"algorithm": algorithm.lower(), **settings}
    for algorithm in _ALGORITHMS
    for seen, settings in _SEEN.items()
}
"""What sets each row that learns apart from `Training`'s defaults."""
LEARNED["DQN-MV"]["hyperparameters"] = {"buffer_size": 20_000}  # Of four views each: some 3.4 GB.
SEVERAL: dict[str, dict[str, Any]] = {
    f"PPO-{seen} {agents}": {**LEARNED[f"PPO-{seen}"], "agents": agents}
    for seen in ("F", "BEV")
    for agents in ("shared", "independent")
}
"""Rows for scenarios with several signals."""
VARIED = {
    f"PPO-{seen} random": {
        **LEARNED[f"PPO-{seen}"],
        "conditions": "random",
        "background_subtraction": True,
    }
    for seen in ("BEV", "MV")
}
"""Rows that learn in light, weather and camera mounts drawn anew for each episode, from what moves."""
_ALL = {**LEARNED, **VARIED, **SEVERAL}
ROWS = (*CONTROLLERS, *_ALL)
GROUPS = {
    "all": (*CONTROLLERS, *LEARNED),
    "controllers": tuple(CONTROLLERS),
    "learned": tuple(LEARNED),
    "varied": tuple(VARIED),
    "several": tuple(SEVERAL),
}
_ONE = (*CONTROLLERS, *LEARNED, *VARIED)
SCENARIOS = {
    "two-way": _ONE,
    "cologne1": _ONE,
    "cologne3": (*CONTROLLERS, *SEVERAL),
    "grid4x4": (*CONTROLLERS, *SEVERAL),
}
"""The benchmark's scenarios and the rows that make sense on them."""


def find_settings(row: str, scenario: str) -> dict[str, Any]:
    """Tell a row's settings on a scenario; where they meet, those that fewer rows share win."""
    groups = ("learned", row.partition("-")[0], row) if learns(row) else (row,)
    settings = dict(_ALL[row] if learns(row) else CONTROLLERS[row][1])
    for group in groups:
        for name, value in OWN_SETTINGS.get((scenario, group), {}).items():
            settings[name] = {**settings.get(name, {}), **value} if name == "hyperparameters" else value
    return settings


def find_training(row: str, scenario: str) -> Training:
    """Tell how a row's policy is trained on a scenario."""
    return Training(scenario=scenario, **find_settings(row, scenario))


def learns(row: str) -> bool:
    """Tell whether a row has a policy."""
    return row in _ALL
