"""SUMO-RL's interface: scripts written for it run with `dojo_env.compat.sumo_rl` in place of `sumo_rl`.

Its modules, names, keywords and attributes are those of SUMO-RL 1.4.5 (https://lucasalegre.github.io/sumo-rl),
and `ts_ids`, `enforce_max_green`, lists of rewards and `reward_weights`, which came after it. `README.md` in
the folder above lists what differs, and why. Importing it registers `sumo-rl-v0` with Gymnasium.
"""

import gymnasium

from .environment.env import SumoEnvironment, SumoEnvironmentPZ, env, parallel_env
from .environment.observations import DefaultObservationFunction, ObservationFunction
from .environment.resco_envs import (
    arterial4x4,
    cologne1,
    cologne3,
    cologne8,
    grid4x4,
    ingolstadt1,
    ingolstadt7,
    ingolstadt21,
)
from .environment.traffic_signal import TrafficSignal

__all__ = [
    "DefaultObservationFunction",
    "ObservationFunction",
    "SumoEnvironment",
    "SumoEnvironmentPZ",
    "TrafficSignal",
    "arterial4x4",
    "cologne1",
    "cologne3",
    "cologne8",
    "env",
    "grid4x4",
    "ingolstadt1",
    "ingolstadt7",
    "ingolstadt21",
    "parallel_env",
]

if "sumo-rl-v0" not in gymnasium.registry:
    gymnasium.register(
        "sumo-rl-v0", entry_point="dojo_env.compat.sumo_rl:SumoEnvironment", kwargs={"single_agent": True}
    )
