"""Frozen image encoders: pictures in, a few numbers each out, for policies that do not learn to see.

`load_encoder` finds one by name. `wrapper` puts it around a Gymnasium environment, `vectorised` around
Stable-Baselines3's environments, all of whose pictures it encodes in one batch.
"""

from collections.abc import Callable
from pathlib import Path

from dojo_env.encoders.base import Encoder, RememberingEncoder, import_needed
from dojo_env.encoders.efficientnet import open_efficientnet
from dojo_env.encoders.onnx_file import INSTALL, OnnxEncoder, open_dinov2
from dojo_env.errors import ConfigError, EncoderError
from dojo_maps.input_files import read_bytes

_MAKERS: dict[str, Callable[[], Encoder]] = {
    "efficientnet-lite0": open_efficientnet,
    "dinov2-focus": open_dinov2,
}
ENCODERS = tuple(_MAKERS)
"""Encoders that go by a name; beside them, `open_clip:MODEL:WEIGHTS` and paths of ONNX files."""
_LARGEST = (1 << 31) - 1
"""Bytes of a network, as its format has it."""


def load_encoder(name: str) -> Encoder:
    """Load an encoder that encodes the same picture only once.

    Args:
        name: one of `ENCODERS`, `open_clip:MODEL:WEIGHTS` where the weights are a tag or a local path, or the
            path of an `.onnx` file.

    Returns:
        The encoder.

    Raises:
        ConfigError: there is none of that name, or a package is missing.
        EncoderError: the file is missing, no network, or one of another kind.
    """
    return RememberingEncoder(_open_encoder(name))


def _open_encoder(name: str) -> Encoder:
    if name in _MAKERS:
        return _MAKERS[name]()
    if name.startswith("open_clip:"):
        import_needed(
            "open_clip", name, "see the README of dojo_env: it needs a torchvision made for your torch"
        )
        # torch and open_clip take seconds to load.
        from dojo_env.encoders.clip import ClipEncoder  # noqa: PLC0415

        return ClipEncoder(name)
    if name.endswith(".onnx"):
        import_needed("onnxruntime", name, INSTALL)
        return OnnxEncoder(name, read_bytes(Path(name), most=_LARGEST, error=EncoderError))
    known = ", ".join((*ENCODERS, "open_clip:MODEL:WEIGHTS", "the path of an .onnx file"))
    raise ConfigError(f"encoder {name!r}: expected one of {known}")


__all__ = ["ENCODERS", "Encoder", "load_encoder"]
