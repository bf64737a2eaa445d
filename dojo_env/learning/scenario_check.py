"""Whether a run's environment can be made, seen before anything heavy is loaded."""

from contextlib import closing

from dojo_env.config import build_config
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import Training
from dojo_env.local_world import LocalWorld


def check_scenario(training: Training) -> None:
    """Begin an episode as the run's environments will.

    What the first use makes is then made once, not in each process: the converted map, compiled kernels.

    Args:
        training: the run's settings.

    Raises:
        ConfigError: there is no such scenario, a setting of the environment cannot work, or the scenario has
            several signals and the settings have one agent.
        SimulationError: SUMO refuses the input.
    """
    with closing(LocalWorld(build_config(**training.environment))) as world:
        count = len(world.signals)
        if training.agents == "single" and count > 1:
            raise ConfigError(
                f"agents='single': {training.scenario} has {count} signals; choose shared or independent, "
                "as in --agents shared"
            )
        world.reset(seed=0)
