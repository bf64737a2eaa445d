"""Detectors of road users in pictures: any network in an ONNX file, and what it tells of lanes.

picture -> `DetectorModel` -> detections -> `grounding` (lane and place) -> `tracking` -> `measuring` (counts,
queues and speeds of lanes). `sensors.video_detector` hangs all of it at a signal.
"""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from dojo_env.detectors.base import NOTHING, Detections, DetectorModel
from dojo_env.detectors.onnx_detector import DetectorSettings, OnnxDetector
from dojo_env.detectors.scaling import Scaling
from dojo_env.detectors.styles import DETECTOR_STYLES
from dojo_env.errors import ConfigError, DetectorError
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_json import read_json

_FORMAT = ("dojo-detector", 1)
_MOST_CLASSES = 10_000


def load_detector(path: Path | str, **settings: Any) -> DetectorModel:
    """Load a detector.

    Args:
        path: an `.onnx` file; or a `.json` file that names one and says how to use it:
            `{"format": "dojo-detector", "version": 1, "model": "nanodet.onnx", "least_score": 0.4}`.
        settings: of `DetectorSettings`, before those of the file.

    Returns:
        The detector.

    Raises:
        ConfigError: a setting is unknown, or has a value that cannot work.
        DetectorError: a file is missing, no network, or one of another kind.
        ToolMissingError: onnxruntime is missing.
    """
    path = Path(path)
    told: dict[str, Any] = {}
    if path.suffix == ".json":
        told, path = _read_description(path)
    return OnnxDetector(path, read_bytes(path, error=DetectorError), _build_settings({**told, **settings}))


def _read_description(path: Path) -> tuple[dict[str, Any], Path]:
    """Read a description: settings, and where its network lies."""
    value = read_json(path, error=DetectorError)
    if not isinstance(value, dict) or (value.pop("format", None), value.pop("version", None)) != _FORMAT:
        raise DetectorError(path, "not a dojo-detector file of version 1")
    model = value.pop("model", None)
    if not isinstance(model, str) or not model:
        raise DetectorError(path, f"model is {model!r}; expected the name of an .onnx file")
    try:
        _build_settings(value)
    except ConfigError as error:
        raise DetectorError(path, str(error)) from error
    return value, path.parent / model


def _build_settings(told: Mapping[str, Any]) -> DetectorSettings:
    known = [each.name for each in fields(DetectorSettings)]
    if unknown := [name for name in told if name not in known]:
        raise ConfigError(f"detector: no setting {unknown[0]!r}; it has {', '.join(known)}")
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in told.items()
    }
    try:
        if isinstance(scaling := values.get("scaling"), dict):
            values["scaling"] = Scaling(**scaling)
        return DetectorSettings(**values)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"detector: {error}") from error


__all__ = [
    "DETECTOR_STYLES",
    "NOTHING",
    "Detections",
    "DetectorModel",
    "DetectorSettings",
    "OnnxDetector",
    "Scaling",
    "load_detector",
]
