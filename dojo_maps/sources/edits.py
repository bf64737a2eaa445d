"""What a user changed in a network, as SUMO's own patches: taken from two networks, put on a third.

A patch is plain XML of nodes, edges, connections and signal programs, made by SUMO's netdiff, that netconvert
loads beside a network. Elements that speak of what the network no longer has are left out and reported.
"""

import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from dojo_maps.errors import SourceError, ToolMissingError
from dojo_maps.safe_xml import parse_xml
from dojo_maps.sources.net_tree import NetTree
from dojo_maps.sources.netconvert import NetconvertError, find_netconvert, run_netconvert
from dojo_maps.sumo_programs import sumo_environment
from dojo_maps.whole_file import scratch_folder
from dojo_maps.wording import counted

KINDS = {
    "nod": ("nodes", "-n"),
    "edg": ("edges", "-e"),
    "con": ("connections", "-x"),
    "tll": ("tlLogics", "-i"),
}
"""The files of a patch: root element and netconvert's option."""
_TIMEOUT = 240.0
_HEADER = re.compile(rb"<!--.*?-->\s*", re.DOTALL)

Patch = dict[str, bytes]
"""XML by kind; kinds without changes are missing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """A change that no longer fits: what it is about, as kind and id, and why."""

    kind: str
    id: str
    reason: str


def make_patch(base: bytes, edited: bytes, *, path: Path) -> Patch:
    """Find what turns one network into another.

    Args:
        base: the network as it was.
        edited: the network as the user saved it.
        path: of the edited one, for errors.

    Returns:
        XML by kind, as in `KINDS`; kinds without changes are missing.

    Raises:
        SourceError: one is not a SUMO network, or they cannot be compared.
        ToolMissingError: SUMO's netdiff is not installed.
    """
    for data in (base, edited):
        NetTree(data, path=path)
    program = find_netconvert()
    netdiff = program.parent.parent / "tools" / "net" / "netdiff.py"
    if not netdiff.is_file():
        raise ToolMissingError("netdiff is not installed; it is part of SUMO: pip install eclipse-sumo")
    with scratch_folder() as folder:
        (folder / "base.net.xml").write_bytes(base)
        (folder / "edited.net.xml").write_bytes(edited)
        command = [sys.executable, str(netdiff), "base.net.xml", "edited.net.xml", "patch"]
        try:
            done = subprocess.run(  # noqa: S603 (no shell; the program is SUMO's own)
                command,
                cwd=folder,
                env=sumo_environment(program),
                capture_output=True,
                timeout=_TIMEOUT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise SourceError(path, f"cannot be compared within {_TIMEOUT:g} s") from None
        files = {kind: folder / f"patch.{kind}.xml" for kind in KINDS}
        if done.returncode or not all(file.is_file() for file in files.values()):
            said = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
            raise SourceError(path, f"cannot be compared with the bundle's network ({' '.join(said)[:200]})")
        patch = {kind: _HEADER.sub(b"", file.read_bytes()) for kind, file in files.items()}
    return {kind: data for kind, data in patch.items() if len(read_patch(data, kind, path))}


def read_patch(data: bytes, kind: str, path: Path) -> Element:
    """Parse one file of a patch.

    Args:
        data: the file's bytes.
        kind: one of `KINDS`, which tells what the root element must be.
        path: where it lies, for errors.

    Returns:
        The root element; its children are the changes.

    Raises:
        SourceError: it is no such file, or unsafe.
    """
    parse_xml(data, path, root=KINDS[kind][0], kind="patch", start=lambda _name, _attributes: None)
    return ElementTree.fromstring(data)  # noqa: S314 (checked in the line before)


def apply_patch(network: bytes, patch: Mapping[str, bytes], *, path: Path) -> tuple[bytes, list[Misfit]]:
    """Put a patch on a network, as far as it fits.

    Args:
        network: a SUMO network.
        patch: of `make_patch`, maybe made for another version of the network.
        path: where the patch lies, for errors.

    Returns:
        The changed network, and what was left out.

    Raises:
        SourceError: the patch is broken or unsafe.
    """
    fitting, misfits = _sort_out(NetTree(network, path=path), patch, path)
    while fitting:
        try:
            roads = {kind: root for kind, root in fitting.items() if kind != "tll"}
            built = _build(network, roads) if roads else network
            if "tll" not in fitting:
                return built, misfits
            misfits += _drop_programs(fitting["tll"], NetTree(built, path=path))
            return _build(network, fitting), misfits
        except NetconvertError as error:
            # The signal programs depend on all the rest, so they are the first to be given up.
            kind = list(fitting)[-1]
            root = fitting.pop(kind)
            misfits += [Misfit(kind=element.tag, id=_id(element), reason=str(error)) for element in root]
    return network, misfits


def _build(network: bytes, patch: Mapping[str, Element]) -> bytes:
    with scratch_folder() as folder:
        (folder / "base.net.xml").write_bytes(network)
        options = ["-s", "base.net.xml", "-o", "built.net.xml", "--offset.disable-normalization"]
        options += ["--output.street-names", "--no-turnarounds.except-deadend"]
        for kind, root in patch.items():
            name = f"patch.{kind}.xml"
            (folder / name).write_bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True))
            options += [KINDS[kind][1], name]
        run_netconvert(options, folder=folder, timeout=_TIMEOUT)
        built = folder / "built.net.xml"
        if not built.is_file():
            raise NetconvertError("netconvert wrote no network")
        return _HEADER.sub(b"", built.read_bytes(), count=1)


def _sort_out(
    tree: NetTree, patch: Mapping[str, bytes], path: Path
) -> tuple[dict[str, Element], list[Misfit]]:
    """Keep the elements whose nodes, edges and signals the network has, or the patch itself brings."""
    nodes, edges = set(tree.junctions), set(tree.roads)
    signals = {logic.get("id", "") for logic in tree.logics()}
    checks: dict[str, Callable[[Element], str]] = {
        "nod": lambda e: _missing("node", _created(e, nodes, "x", "y"), nodes),
        "edg": lambda e: (
            _missing("edge", _created(e, edges, "from", "to"), edges)
            or _missing("node", {e.get("from"), e.get("to")} - {None}, nodes)
        ),
        "con": lambda e: (
            _missing("edge", {e.get("from"), e.get("to"), *e.get("edges", "").split()} - {None}, edges)
            or _missing("node", {e.get("node")} - {None}, nodes)
        ),
        "tll": lambda e: (
            _missing("edge", {e.get("from"), e.get("to")} - {None}, edges)
            or _missing("signal", {e.get("tl", e.get("id"))} - {None}, signals)
        ),
    }
    fitting: dict[str, Element] = {}
    misfits: list[Misfit] = []
    for kind in KINDS:
        root = read_patch(patch[kind], kind, path / f"{kind}.xml") if kind in patch else None
        for element in list(root) if root is not None else ():
            reason = checks[kind](element)
            if reason:
                misfits.append(Misfit(kind=element.tag, id=_id(element), reason=reason))
                root.remove(element)  # type: ignore[union-attr]
        if root is not None and len(root):
            fitting[kind] = root
    return fitting, misfits


def _drop_programs(root: Element, tree: NetTree) -> list[Misfit]:
    """Take out the programs that were made for a signal with another number of links."""
    lengths = {logic.get("id"): len(_state(logic)) for logic in tree.logics()}
    misfits = []
    for logic in root.findall("tlLogic"):
        links = lengths.get(logic.get("id"))
        if len(logic) and links != len(_state(logic)):
            reason = (
                f"its states are for {counted(len(_state(logic)), 'link')}, the signal has {links or 'none'}"
            )
            misfits.append(Misfit(kind=logic.tag, id=_id(logic), reason=reason))
            root.remove(logic)
    return misfits


def _state(logic: Element) -> str:
    phase = logic.find("phase")
    return phase.get("state", "") if phase is not None else ""


def _created(element: Element, known: set[str], *needed: str) -> set[str | None]:
    """Name what an element needs to be there; one that says all of itself is added to what is known."""
    own = element.get("id")
    if own is not None and element.tag != "delete" and all(key in element.attrib for key in needed):
        known.add(own)
    return {own} - {None}


def _missing(kind: str, wanted: set[str | None], known: set[str]) -> str:
    lost = sorted(str(name) for name in wanted if name not in known)
    return f"the network has no {kind} {', '.join(lost)}" if lost else ""


def _id(element: Element) -> str:
    ends = element.get("from"), element.get("to")
    return element.get("id", f"{ends[0]}->{ends[1]}" if all(ends) else element.get("node", "?"))
