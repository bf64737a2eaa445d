"""Read SUMO's own XML files: routes, additional files, configurations, networks."""

from collections.abc import Callable
from pathlib import Path

from dojo_env.errors import ScenarioError
from dojo_maps.input_files import read_pieces
from dojo_maps.safe_xml import Attributes, parse_xml

MAX_BYTES = 1 << 32
"""The largest file, in bytes once unpacked: a day of a large city's traffic. It is read piece by piece."""


def read_elements(path: Path, visit: Callable[[str, Attributes], None] | None = None) -> None:
    """Call `visit`, if any, with name and attributes of each element, in their order; gzip is unpacked.

    Args:
        path: of the file.
        visit: takes an element's name and its attributes; None only sees that the file can be read.

    Raises:
        ScenarioError: the file cannot be read, is no XML, or has a document type.
    """
    parse_xml(
        read_pieces(path, most=MAX_BYTES, error=ScenarioError),
        path,
        root=None,
        kind="file of SUMO's",
        start=visit or (lambda _name, _attributes: None),
        error=ScenarioError,
    )
