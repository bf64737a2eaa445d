"""The environment: SUMO's traffic on a converted map, seen through cameras, measured and controlled.

Importing it registers `dojo_env/TrafficSignal-v0` with Gymnasium.
"""

from dojo_maps import interruption

interruption.begin_command("dojo-env", "dojo-env: interrupted")  # Before anything that takes longer to load.

from typing import TYPE_CHECKING  # noqa: E402

import gymnasium  # noqa: E402

from dojo_maps.lazy_names import attach  # noqa: E402

if TYPE_CHECKING:
    from dojo_env.background_subtraction import BackgroundSubtraction
    from dojo_env.camera import Camera, read_cameras, write_cameras
    from dojo_env.conditions import Conditions
    from dojo_env.config import (
        EnvConfig,
        EpisodeConfig,
        SensingConfig,
        SignalConfig,
        TrafficConfig,
        build_config,
    )
    from dojo_env.controllers import CONTROLLERS, Controller, make_controller
    from dojo_env.datasets.settings import DatasetSettings
    from dojo_env.datasets.writing import write_dataset
    from dojo_env.detectors import load_detector
    from dojo_env.encoders import load_encoder
    from dojo_env.env import TrafficSignalEnv
    from dojo_env.errors import ConfigError, EpisodeOverError, RecordingError, SimulationError
    from dojo_env.imaging import Imaging
    from dojo_env.instant import Instant, SignalView
    from dojo_env.keywords import DatasetKeywords, DrawingSettings, Settings
    from dojo_env.learning import train
    from dojo_env.learning.policy_controller import PolicyController
    from dojo_env.learning.settings import Training
    from dojo_env.parallel import TrafficSignalsEnv, parallel_env
    from dojo_env.plotting import film, plot
    from dojo_env.recording import Recording
    from dojo_env.replaying import Replayed, replay
    from dojo_env.rewards import REWARDS
    from dojo_env.runs import record, run_controller, summarize
    from dojo_env.scenario import PACKAGED, Scenario, find_scenario
    from dojo_env.sensors.base import Look, Sensor, SensorSettings, Site
    from dojo_env.sensors.detector import Detector
    from dojo_env.sensors.events import EventCamera
    from dojo_env.sensors.lidar import Lidar
    from dojo_env.sensors.picture import CameraSensor
    from dojo_env.sensors.video_detector import VideoDetector
    from dojo_env.snapshot import Snapshot

    __version__: str

__all__ = [
    "CONTROLLERS",
    "PACKAGED",
    "REWARDS",
    "BackgroundSubtraction",
    "Camera",
    "CameraSensor",
    "Conditions",
    "ConfigError",
    "Controller",
    "DatasetKeywords",
    "DatasetSettings",
    "Detector",
    "DrawingSettings",
    "EnvConfig",
    "EpisodeConfig",
    "EpisodeOverError",
    "EventCamera",
    "Imaging",
    "Instant",
    "Lidar",
    "Look",
    "PolicyController",
    "Recording",
    "RecordingError",
    "Replayed",
    "Scenario",
    "SensingConfig",
    "Sensor",
    "SensorSettings",
    "Settings",
    "SignalConfig",
    "SignalView",
    "SimulationError",
    "Site",
    "Snapshot",
    "TrafficConfig",
    "TrafficSignalEnv",
    "TrafficSignalsEnv",
    "Training",
    "VideoDetector",
    "build_config",
    "film",
    "find_scenario",
    "load_detector",
    "load_encoder",
    "make_controller",
    "parallel_env",
    "plot",
    "read_cameras",
    "record",
    "replay",
    "run_controller",
    "summarize",
    "train",
    "write_cameras",
    "write_dataset",
]

gymnasium.register("dojo_env/TrafficSignal-v0", entry_point="dojo_env.env:TrafficSignalEnv")

__getattr__, __dir__ = attach(
    __name__,
    {
        "background_subtraction": "BackgroundSubtraction",
        "camera": "Camera read_cameras write_cameras",
        "conditions": "Conditions",
        "config": "EnvConfig EpisodeConfig SensingConfig SignalConfig TrafficConfig build_config",
        "controllers": "CONTROLLERS Controller make_controller",
        "datasets.settings": "DatasetSettings",
        "datasets.writing": "write_dataset",
        "detectors": "load_detector",
        "encoders": "load_encoder",
        "env": "TrafficSignalEnv",
        "errors": "ConfigError EpisodeOverError RecordingError SimulationError",
        "imaging": "Imaging",
        "instant": "Instant SignalView",
        "keywords": "DatasetKeywords DrawingSettings Settings",
        "learning": "train",
        "learning.policy_controller": "PolicyController",
        "learning.settings": "Training",
        "parallel": "TrafficSignalsEnv parallel_env",
        "plotting": "film plot",
        "recording": "Recording",
        "replaying": "Replayed replay",
        "rewards": "REWARDS",
        "runs": "record run_controller summarize",
        "scenario": "PACKAGED Scenario find_scenario",
        "sensors.base": "Look Sensor SensorSettings Site",
        "sensors.detector": "Detector",
        "sensors.events": "EventCamera",
        "sensors.lidar": "Lidar",
        "sensors.picture": "CameraSensor",
        "sensors.video_detector": "VideoDetector",
        "snapshot": "Snapshot",
    },
)
