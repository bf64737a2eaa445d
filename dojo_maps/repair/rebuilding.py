"""Let netconvert build a network anew where no smaller change will do, and put its signal programs back."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from dojo_maps.repair.edits import Rebuild
from dojo_maps.sources.netconvert import run_netconvert

_INPUT, _OUTPUT = "input.net.xml", "output.net.xml"
_OPTIONS = ("--offset.disable-normalization", "--no-turnarounds", "--no-internal-links", "false")
"""Connections come from the network, so turnarounds that exist stay."""


def rebuild(data: bytes, _rebuilds: Sequence[Rebuild], _path: Path) -> bytes:
    """Build a network anew.

    Raises:
        NetconvertError: netconvert refuses the network or crashes on it.
    """
    with tempfile.TemporaryDirectory(prefix="dojo-fix-") as name:
        folder = Path(name)
        (folder / _INPUT).write_bytes(data)
        run_netconvert(["-s", _INPUT, "-o", _OUTPUT, *_OPTIONS], folder=folder)
        return (folder / _OUTPUT).read_bytes()
