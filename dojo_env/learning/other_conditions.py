"""Conditions that a policy was not trained for: other light and cameras, or a detector for the truth."""

from collections.abc import Sequence
from typing import Any

from dojo_env.conditions import PRESETS, Conditions
from dojo_env.controllers import Controller
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import CONDITIONS, IMAGES, Training
from dojo_env.outages import CameraOutage
from dojo_env.sensors.detector import Detector

CAMERAS: dict[str, dict[str, Any]] = {
    **{name: {"conditions": PRESETS[name]} for name in ("day", "dusk", "night", "rain", "fog")},
    "moved-camera": {"conditions": Conditions(shake_m=0.3, shake_deg=2.0)},
    "swaying-camera": {"conditions": Conditions(sway_deg=0.3)},
    "noise": {"conditions": Conditions(noise=12.0)},
    "dirty-lens": {"conditions": Conditions(dirt=0.6)},
    "dead-camera": {"outages": (CameraOutage(camera="approach_0", begin=300.0, end=1200.0),)},
    "hung-camera": {"outages": (CameraOutage(camera="approach_0", begin=300.0, end=1200.0, kind="frozen"),)},
    "no-camera": {"outages": (CameraOutage(begin=0.0),)},
    "random": {"conditions": CONDITIONS["random"]},
}
"""What a policy that sees images may meet; `random` draws as `--conditions random` does in training."""
DETECTORS: dict[str, dict[str, Any]] = {
    "features": {"observation": "features"},
    "perfect-detector": {"observation": Detector(least_pixels=1, least_visible=0.0)},
    "detector": {"observation": Detector()},
    "noisy-detector": {"observation": Detector(missed=0.1, false_alarms=0.1)},
    "noisier-detector": {"observation": Detector(missed=0.3, false_alarms=0.3)},
    "late-detector": {"observation": Detector(missed=0.1, false_alarms=0.1, latency=2)},
}
"""What a policy that sees features may be fed with."""
AS_TRAINED, ALL = "as-trained", "all"


def list_conditions(training: Training) -> dict[str, dict[str, Any]]:
    """List what a policy may meet.

    Args:
        training: of the policy; those that observe images meet `CAMERAS`, the others `DETECTORS`.

    Returns:
        Settings of the environment, by the condition's name.
    """
    return CAMERAS if training.observation in IMAGES else DETECTORS


def choose_for_controller(controller: Controller, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Choose those of some conditions that a controller can meet; how it usually is where it can meet none.

    Args:
        controller: who is to meet them; one that leaves its signals to a program can meet none.
        names: of `CAMERAS` or `DETECTORS`, or `all`.

    Returns:
        Settings of the environment, by the condition's name.

    Raises:
        ConfigError: a name is unknown.
    """
    _refuse_unknown(names)
    if controller.settings.get("fixed_ts"):
        return {AS_TRAINED: {}}
    known = CAMERAS if "observation" in controller.settings else DETECTORS
    chosen = {name: changes for name, changes in known.items() if ALL in names or name in names}
    return chosen or {AS_TRAINED: {}}


def choose_conditions(training: Training, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Choose conditions by their names.

    Args:
        training: of the policy that meets them.
        names: of `CAMERAS` or `DETECTORS`, or `all`; none for how it was trained.

    Returns:
        Settings of the environment, by the condition's name; what such a policy cannot meet is left out.

    Raises:
        ConfigError: a name is unknown, or nothing of what is named can be met.
    """
    if not names:
        return {AS_TRAINED: {}}
    known = list_conditions(training)
    _refuse_unknown(names)
    chosen = {name: changes for name, changes in known.items() if ALL in names or name in names}
    if not chosen:
        raise ConfigError(
            f"{', '.join(names)}: not for a policy that observes {training.observation}; "
            f"expected {ALL}, or of {', '.join(known)}"
        )
    return chosen


def _refuse_unknown(names: Sequence[str]) -> None:
    if unknown := set(names) - {ALL, *CAMERAS, *DETECTORS}:
        raise ConfigError(
            f"{', '.join(sorted(unknown))}: expected {ALL}, or of {', '.join((*CAMERAS, *DETECTORS))}"
        )
