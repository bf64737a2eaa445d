"""Run SUMO's netconvert as a separate process: found, bounded in time, and never trusted to end well.

netconvert crashes on some real inputs, so its end is always read: an exit status, a signal or the time
limit each become one clear error.
"""

import itertools
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.errors import DojoError, ToolMissingError
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sumo_programs import find_program, running_program, signal_name
from dojo_maps.whole_file import scratch_folder

_WARNING, _ERROR = "Warning: ", "Error: "
_AGGREGATE = "--aggregate-warnings"
"""Without it netconvert keeps the repetitions of a warning to itself after a few."""

_INPUT, _OUTPUT = "input.net.xml", "output.net.xml"
_CONNECTIONS, _NODES = "added.con.xml", "changed.nod.xml"
_KEEP = ("--offset.disable-normalization", "--no-turnarounds", "--no-internal-links", "false")
"""Connections come from the network, so turnarounds that exist stay; crossings need internal lanes."""

_QUOTED = re.compile(r"'(:?-?[\w#.]+?)(_[cw]?\d+)?'")


class NetconvertError(DojoError):
    """netconvert refused its input, crashed, or took too long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetconvertResult:
    """What a successful run said; every warning once, in order, without its prefix."""

    warnings: tuple[str, ...]


def run_netconvert(
    arguments: Sequence[str], *, folder: Path | None = None, timeout: float = 600
) -> NetconvertResult:
    """Run netconvert to its end.

    Args:
        arguments: its options, as on a command line.
        folder: where it runs; relative paths in the options start here.
        timeout: seconds after which it and what it started are killed.

    Returns:
        What it warned of.

    Raises:
        ToolMissingError: netconvert is not installed.
        NetconvertError: it refused its input, died by a signal, or ran past the time limit.
    """
    if _AGGREGATE not in arguments:
        arguments = [*arguments, _AGGREGATE, "1000000"]
    status, diagnostics = _run(find_netconvert(), arguments, folder, timeout)
    lines = diagnostics.splitlines()
    if status < 0:
        raise NetconvertError(f"netconvert crashed ({signal_name(-status)}); {_last_words(lines)}")
    if status > 0:
        raise NetconvertError(f"netconvert failed with exit status {status}; {_last_words(lines)}")
    return NetconvertResult(
        warnings=tuple(line.removeprefix(_WARNING) for line in lines if line.startswith(_WARNING))
    )


def build_from_files(
    files: Mapping[str, str | bytes], options: Sequence[str], *, timeout: float = 600
) -> tuple[bytes, tuple[str, ...]]:
    """Let netconvert build a network.

    Args:
        files: what its files are to hold, by the options that take them.
        options: further ones.
        timeout: seconds.

    Returns:
        The network's bytes, without the time and the options that stand before it, and netconvert's warnings.

    Raises:
        ToolMissingError: netconvert is not installed.
        NetconvertError: as `run_netconvert`, or it writes nothing.
    """
    arguments = ["-o", _OUTPUT, *options]
    with scratch_folder() as folder:
        for number, (option, text) in enumerate(files.items()):
            data = text.encode() if isinstance(text, str) else text
            (folder / f"input_{number}.xml").write_bytes(data)
            arguments += [option, f"input_{number}.xml"]
        result = run_netconvert(arguments, folder=folder, timeout=timeout)
        if not (folder / _OUTPUT).is_file():
            raise NetconvertError("it has no roads")
        built = (folder / _OUTPUT).read_bytes()
    return b'<?xml version="1.0" encoding="UTF-8"?>\n\n' + built[built.find(b"<net ") :], result.warnings


def build_again(
    data: bytes, options: Sequence[str] = (), *, connections: str = "", nodes: str = ""
) -> tuple[bytes, tuple[str, ...]]:
    """Let netconvert build a network anew, where it lies and with the connections that it has.

    Args:
        data: the network's bytes, unpacked.
        options: further ones of netconvert.
        connections: what its plain file of connections is to hold, as XML elements.
        nodes: what its plain file of nodes is to hold.

    Returns:
        The new network's bytes, and netconvert's warnings.

    Raises:
        ToolMissingError: netconvert is not installed.
        NetconvertError: as `run_netconvert`.
    """
    arguments = ["-s", _INPUT, "-o", _OUTPUT, *options, *_KEEP]
    with scratch_folder() as folder:
        (folder / _INPUT).write_bytes(data)
        for option, name, root, elements in (
            ("-x", _CONNECTIONS, "connections", connections),
            ("-n", _NODES, "nodes", nodes),
        ):
            if elements:
                (folder / name).write_text(f"<{root}>\n{elements}</{root}>\n", encoding="utf-8")
                arguments += [option, name]
        result = run_netconvert(arguments, folder=folder)
        return (folder / _OUTPUT).read_bytes(), result.warnings


def warning_issue(warning: str, index: MapIndex, *, check: str, hint: str) -> Issue:
    """Make a note of a warning, at the elements that it names.

    Args:
        warning: in netconvert's words.
        index: of what it built.
        check: the note's own.
        hint: what to do about it.

    Returns:
        The note; at the map's origin, without elements, where the map has none of what it names.
    """
    elements: list[Element] = []
    x, y = index.map.origin
    for name, suffix in _QUOTED.findall(warning):
        key = name.removeprefix(":")
        if name + suffix in index.lanes:
            elements.append(Element(kind="lane", id=name + suffix))
            x, y, _ = map(float, index.lanes[name + suffix].shape[0])
        elif key in index.roads:
            elements.append(Element(kind="road", id=key))
            x, y, _ = map(float, index.lanes[index.roads[key].lanes[0]].shape[0])
        elif key in index.junctions:
            elements.append(Element(kind="junction", id=key))
            x, y, _ = index.junctions[key].position
    return Issue(
        check=check,
        severity=Severity.NOTE,
        elements=tuple(dict.fromkeys(elements)),
        position=(x, y, 0.0),
        message=f"netconvert: {warning}",
        hint=hint,
    )


def find_netconvert() -> Path:
    """Find netconvert, as `find_program` does.

    Raises:
        ToolMissingError: it is not installed.
    """
    return find_program("netconvert")


def _run(program: Path, arguments: Sequence[str], folder: Path | None, timeout: float) -> tuple[int, str]:
    try:
        with running_program(program, arguments, folder, subprocess.PIPE) as child:
            _, diagnostics = child.communicate(timeout=timeout)
    except ToolMissingError as error:
        raise NetconvertError(str(error)) from error
    except subprocess.TimeoutExpired:
        raise NetconvertError(
            f"netconvert was stopped after {timeout:g} s, its time limit; give it a smaller network"
        ) from None
    return child.returncode, diagnostics.decode("utf-8", "replace")


def _last_words(lines: list[str]) -> str:
    """Quote netconvert's own error with the indented lines that belong to it, or else its last line."""
    start = next((number for number, line in enumerate(lines) if line.startswith(_ERROR)), None)
    if start is None:
        said = [line for line in lines if line.strip() and not line.startswith("Quitting")][-1:]
    else:
        rest = itertools.takewhile(lambda line: line.startswith(" "), lines[start + 1 :])
        said = [lines[start].removeprefix(_ERROR), *rest]
    words = " ".join(" ".join(said).split())
    words = words if len(words) <= 300 else f"{words[:300]}..."
    return f"it said: {words}" if words else "it gave no reason"
