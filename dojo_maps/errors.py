"""The errors users meet. A message says what is wrong, where, and what to do about it."""

_LONGEST = 400
"""Characters of each part of a message: where, of what, and what is wrong."""


class DojoError(Exception):
    """Root of every error raised on purpose; `exit_status` is what a command returns for it."""

    exit_status = 4


class UsageError(DojoError):
    """A command was called in a way that cannot work."""

    exit_status = 2


class SourceError(DojoError):
    """The input is missing, unreadable, not what it claims to be, or unsafe to read."""

    exit_status = 3

    def __init__(self, path: object, problem: str, element: str | None = None) -> None:
        """Name the input and, where one is at fault, the element in it.

        Args:
            path: of the input.
            problem: what is wrong with it, and what to do.
            element: what of it is at fault; None for the whole.
        """
        super().__init__(str(path), problem, element)  # All that pickle needs to make it again.
        self.path = str(path)
        self.element = element

    def __str__(self) -> str:
        """Say where, then what."""
        _, problem, element = self.args
        return ": ".join(_shortened(part) for part in (self.path, element, problem) if part)


def _shortened(text: str) -> str:
    """Leave out the middle of what is very long: names and values out of a file may have any length."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]}...{text[-_LONGEST // 2 :]}"


class DescriptionError(SourceError):
    """A map.json or bundle does not hold what its format promises."""


class GeometryError(DojoError):
    """A shape cannot be built from the description."""


class WriteError(DojoError):
    """The system lets nothing be written there: no room, no right, or nobody who reads a pipe."""


class ExportError(DojoError):
    """A map cannot be written in the wanted format."""


class ToolMissingError(DojoError):
    """A program or package that this step needs is not installed."""


_EXTRAS = {
    "torch": "learn",
    "stable_baselines3": "learn",
    "tensorboard": "learn",
    "matplotlib": "plot",
    "ray": "distributed",
    "onnx": "encoders",
    "onnxruntime": "detectors",
    "av": "h264",
    "argcomplete": "completion",
    "wandb": "wandb",
}
"""Packages that come with an extra of this project's, by the name that they are imported by."""


def explain_missing(error: ModuleNotFoundError) -> ToolMissingError | None:
    """Tell how to install what an import lacks; None where it is nothing optional of ours.

    Args:
        error: the import's.

    Returns:
        The error to raise in its place.
    """
    module = (error.name or "").partition(".")[0]
    if module not in _EXTRAS:
        return None
    return ToolMissingError(f"{module} is not installed: pip install 'traffic-dojo[{_EXTRAS[module]}]'")
