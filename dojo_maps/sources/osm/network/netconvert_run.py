"""Run netconvert on the plain XML.

It is never trusted: a crash or refusal drops the option most likely at fault and is reported.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.errors import SourceError
from dojo_maps.sources.netconvert import NetconvertError, run_netconvert
from dojo_maps.sources.osm.plain.plain_xml import CONNECTIONS, EDGES, NODES

_ALWAYS = (
    *("-n", NODES, "-e", EDGES, "-x", CONNECTIONS, "-o", "output.net.xml"),
    *("--no-internal-links", "false", "--offset.disable-normalization", "--no-turnarounds"),
    *("--output.street-names", "--junctions.join", "false", "--geometry.max-grade.fix", "false"),
)
_DROPPED_IN_TURN = ("--walkingareas",)
"""Given first, and left out one more at each attempt after a failure."""
_PLACELESS = re.compile(
    rb'<edge id=":[^"]*" function="crossing" crossingEdges="([^"]*)"[^>]*>\s*<lane [^>]*"[^"]*\bnan\b'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Converted:
    """What netconvert gave.

    Attributes:
        data: the network's bytes.
        warnings: its own.
        dropped: what was left out to let it finish, and why.
    """

    data: bytes
    warnings: tuple[str, ...]
    dropped: tuple[tuple[str, str], ...]


def convert_plain(folder: Path, path: Path, *, left_hand: bool, timeout: float) -> Converted:
    """Run netconvert on the plain XML in a folder, with one option less after each failure.

    Args:
        folder: where the files are, and where netconvert works.
        path: where the extract came from, for errors.
        left_hand: traffic keeps left.
        timeout: seconds that one run may take.

    Returns:
        The network without netconvert's header, its warnings, and what was left out.

    Raises:
        SourceError: netconvert builds nothing.
        NetconvertError: it fails whatever is left out.
        ToolMissingError: it is not installed.
    """
    always = [*_ALWAYS, "--lefthand"] if left_hand else list(_ALWAYS)
    options = list(_DROPPED_IN_TURN)
    dropped: list[tuple[str, str]] = []
    output = folder / "output.net.xml"
    while True:
        try:
            result = run_netconvert([*always, *options], folder=folder, timeout=timeout)
            placeless = _drop_placeless(folder, output) if output.is_file() else []
            if not placeless:
                break
            dropped += [
                (f"the crossing of {edges}", "netconvert finds no place for it") for edges in placeless
            ]
        except NetconvertError as error:
            what = options.pop() if options else _drop_crossings(folder)
            if what is None:
                raise
            dropped.append((what, str(error)))
    if not output.is_file():
        raise SourceError(path, "netconvert built no network from its roads; choose a larger area")
    data = _without_header(output.read_bytes())
    return Converted(data=data, warnings=result.warnings, dropped=tuple(dropped))


def _drop_placeless(folder: Path, output: Path) -> list[str]:
    """Take the crossings out of netconvert's input that it gave coordinates that are no numbers."""
    found = {frozenset(match[1].decode().split()) for match in _PLACELESS.finditer(output.read_bytes())}
    lines = (folder / CONNECTIONS).read_text(encoding="utf-8").splitlines(keepends=True)
    gone = [line for line in lines if _crossed_by(line) in found]
    kept = [line for line in lines if line not in gone]
    (folder / CONNECTIONS).write_text("".join(kept), encoding="utf-8")
    return [" ".join(sorted(_crossed_by(line))) for line in gone]


def _crossed_by(line: str) -> frozenset[str]:
    """Name the edges that a line of netconvert's input lets people cross; none if it is no crossing."""
    match = re.match(r'<crossing .*?edges="([^"]*)"', line)
    return frozenset(match[1].split()) if match else frozenset()


def _drop_crossings(folder: Path) -> str | None:
    """Take the crossings out of netconvert's input; None where there are none to take."""
    lines = (folder / CONNECTIONS).read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith("<crossing ")]
    if len(kept) == len(lines):
        return None
    (folder / CONNECTIONS).write_text("".join(kept), encoding="utf-8")
    return "crossings"


def _without_header(data: bytes) -> bytes:
    """Drop netconvert's comment, which names the time and the folder of the run."""
    return re.sub(rb"<!--.*?-->\s*", b"", data, count=1, flags=re.DOTALL)
