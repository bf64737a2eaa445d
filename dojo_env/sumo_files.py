"""The files that SUMO reads: where one names a file to write, SUMO gets a copy that writes nowhere else.

Detectors, mean data, signal logics and devices write files of their own, and additional files, routes and
networks alike may hold them. In a copy they write into the folder that the user names for it, or nowhere. A
file that names none goes to SUMO as it is.
"""

import os
import re
import sys
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, cast
from xml.sax import make_parser
from xml.sax.saxutils import XMLGenerator

from dojo_env.elements import MAX_BYTES, read_elements
from dojo_env.errors import ConfigError, ScenarioError
from dojo_env.scenario import LETS_THROUGH, Scenario
from dojo_env.sumo_options import OUTPUT_FILES
from dojo_maps.input_files import is_there, read_pieces

NOWHERE = "NUL"
"""SUMO's name of a file that keeps nothing."""
_NOTHING = ("", NOWHERE, NOWHERE.lower(), os.devnull)
_WRITTEN = ("file", "output", "dest")
"""Attributes that name a file to write, but where `_READ` says otherwise."""
_WRITING_PARAMETER = re.compile(r"(.*\.)?(file|output)|SWARMLOG", re.IGNORECASE)
"""What a `param` is called whose value does."""
_READ = {"include": "href", "rerouter": "file", "variableSpeedSign": "file", "calibrator": "file"}
"""Elements that name another file of SUMO's, and by which attribute."""
_LOOKED_UP = ("edgesFile", "imgFile", "osgFile")
"""Attributes that name other things to read."""
_DEEPEST, _MOST_INCLUDED = 16, 1000
"""How deep files may include each other, and how many one may, each counted as often as it is included."""
_MOST_NAMED = 10
_MISREAD = re.compile(r",|\$\{")
_UNUSABLE = re.compile(r"[:,]|\$\{|^~|^\.{0,2}$")
"""SUMO takes a colon for a socket's, a comma for the end of a name, and writes out others."""


class SumoFiles:
    """A scenario's files, made harmless. Copies lie in memory and go with this object or with its process.

    Attributes:
        options: of SUMO, by their names: the files, and what else the scenario's configuration asks for.
        notes: what is left out, in a line for each file.
    """

    def __init__(
        self,
        network: Path,
        scenario: Scenario,
        outputs: Path | None,
        options: Mapping[str, str] | None = None,
    ) -> None:
        """Check every file that SUMO will read.

        Args:
            network: to simulate on.
            scenario: all else.
            outputs: a folder for what the scenario writes, made if missing; None lets it write nothing.
            options: of SUMO, beside the scenario's files; None takes the scenario's own.

        Raises:
            ScenarioError: a file cannot be read, is unsafe, or would write over another.
            ConfigError: the folder cannot be made.
        """
        self.notes = scenario.describe_left_out(outputs=outputs is not None)
        self._outputs = outputs.absolute() if outputs is not None else None
        self._safe: dict[Path, Path] = {}
        self._included: dict[Path, int] = {}
        self._open: list[Path] = []
        self._targets: dict[str, Path] = {}
        self._kept: dict[str, tuple[IO[bytes], Path]] = {}
        wanted = scenario.options if options is None else options
        self.options: dict[str, str] = {**wanted, "net-file": str(self._make_safe(network))}
        weights = map(Path, filter(None, wanted.get("weight-files", "").split(",")))
        for name, paths in (
            ("route-files", scenario.routes),
            ("additional-files", scenario.additional),
            ("weight-files", tuple(weights)),
        ):
            if paths and (name not in wanted or name == "weight-files"):
                self.options[name] = ",".join(str(self._make_safe(path)) for path in paths)
        # Otherwise the devices of vehicles that name no file write one each into the current folder.
        self.options["device.ssm.file"] = self._place("device.ssm.xml", Path(), "device.ssm.file")
        if self._outputs is not None:
            self._add_outputs(self._outputs, scenario)

    def keep(self, name: str, text: str) -> Path:
        """Keep a text of ours in memory, in place of the last one of that name.

        Args:
            name: of the text.
            text: to keep.

        Returns:
            The path that SUMO reads it by.
        """
        if name not in self._kept:
            self._kept[name] = _open_private(name)
            weakref.finalize(self, self._kept[name][0].close)
        file, place = self._kept[name]
        file.seek(0)
        file.truncate()
        file.write(text.encode())
        file.flush()
        return place

    def name_originals(self, words: str) -> str:
        """Name the files themselves in what SUMO says of their copies.

        Args:
            words: SUMO's.

        Returns:
            The same with the files' own names.
        """
        for path, safe in self._safe.items():
            words = words.replace(str(safe), str(path))
        return words

    def _add_outputs(self, folder: Path, scenario: Scenario) -> None:
        for name, value in scenario.outputs.items():
            home = scenario.config or Path()
            is_file = name in OUTPUT_FILES
            self.options[name] = self._place(value, home.parent, f"{home}: {name}") if is_file else value
        inputs = {path.resolve() for path in self._safe}
        for target in map(Path, self._targets):
            if target.is_symlink() or target.resolve() in inputs:
                raise ScenarioError(target, "an output would be written over it; choose another folder")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(
                f"sumo_outputs: {folder} cannot be made ({error.strerror}); choose another"
            ) from error

    def _place(self, named: str, folder: Path, path: object) -> str:
        """Find where goes what a file at `path`, in `folder`, wants written."""
        name = re.split(r"[/\\]", named)[-1]
        if self._outputs is None or named in _NOTHING:
            return NOWHERE
        if _UNUSABLE.search(name):
            raise ScenarioError(path, f"an output is called {named[:80]!r}; give it a plain file name")
        target, origin = str(self._outputs / name), Path(os.path.normpath(folder.absolute() / named))
        if self._targets.setdefault(target, origin) != origin:
            raise ScenarioError(path, f"two outputs are called {name!r}; give each a name of its own")
        return target

    def _make_safe(self, path: Path) -> Path:
        """Check a file and all that it reads; returns it, or a copy of it."""
        path = _full(path)
        if path in self._safe:
            return self._safe[path]
        if path in self._open or len(self._open) > _DEEPEST:
            raise ScenarioError(path, f"includes itself, or {_DEEPEST} deep; leave that out")
        if _MISREAD.search(str(path)):
            raise ScenarioError(path, "SUMO cannot read a path with a comma or ${ in it; rename it")
        self._open.append(path)
        writers, read = _scan(path)
        moved = [self._make_safe(other) != other for other in read]
        self._open.pop()
        self._included[path] = 1 + sum(self._included[other] for other in read)
        if self._included[path] > _MOST_INCLUDED:
            raise ScenarioError(path, f"reads more than {_MOST_INCLUDED} other files; leave some out")
        if writers and self._outputs is None:
            names = [name[:40] for name in list(writers)[:_MOST_NAMED]]
            more = [f"{len(writers) - len(names)} more"] if len(writers) > len(names) else []
            self.notes.append(
                f"{path.name}: left out the outputs of {', '.join(names + more)}; {LETS_THROUGH}"
            )
        self._safe[path] = self._copy(path) if writers or any(moved) else path
        return self._safe[path]

    def _copy(self, path: Path) -> Path:
        file, place = _open_private(path.name)
        weakref.finalize(self, file.close)
        parser: Any = make_parser()  # noqa: S317 - `read_elements` has refused what is unsafe
        parser.setContentHandler(_Copier(self, path, file))
        for piece in read_pieces(path, most=MAX_BYTES, error=ScenarioError):
            parser.feed(piece)
        parser.close()
        file.flush()
        return place

    def redirect(self, name: str, attributes: dict[str, str], path: Path) -> None:
        """Change where an element of a file writes, and give what it reads its full path.

        Args:
            name: of the element.
            attributes: of it, which are changed.
            path: of its file.
        """
        for key in _find_written(name, attributes):
            attributes[key] = self._place(attributes[key], path.parent, path)
        for other in _find_read(name, attributes, path.parent):
            attributes[_READ[name]] = str(self._safe.get(other, other))
        for key in _LOOKED_UP:
            if attributes.get(key):
                attributes[key] = str(path.parent / attributes[key])


class _Copier(XMLGenerator):
    """Writes what it is told of a file, but for where that writes and reads."""

    def __init__(self, files: SumoFiles, path: Path, target: IO[bytes]) -> None:
        super().__init__(cast("Any", target), encoding="utf-8")
        self._files, self._path = files, path

    def startElement(self, name: str, attrs: Any) -> None:  # noqa: N802 - as `xml.sax` calls it
        attributes = dict(attrs.items())
        self._files.redirect(name, attributes, self._path)
        super().startElement(name, cast("Any", attributes))


def _full(path: Path) -> Path:
    """Write a path in one way, so that what it names from its folder stays the same."""
    return path.parent.resolve() / path.name


def _scan(path: Path) -> tuple[dict[str, None], list[Path]]:
    """List what writes in a file, by the names of elements and parameters, and the files that it reads."""
    writers: dict[str, None] = {}
    read: list[Path] = []
    lists: list[Path] = []

    def visit(name: str, attributes: dict[str, str]) -> None:
        if _find_written(name, attributes):
            writers[attributes["key"] if name == "param" else name] = None
        if name in _READ:
            read.extend(_find_read(name, attributes, path.parent))
        if "edgesFile" in attributes:
            lists.append(path.parent / attributes["edgesFile"])

    read_elements(path, visit)
    for special in (other for other in lists if is_there(other) and not other.is_file()):
        raise ScenarioError(path, f"edgesFile={special.name[:80]!r} is no regular file; correct the path")
    return writers, read


def _find_written(name: str, attributes: Mapping[str, str]) -> list[str]:
    """List the attributes that name what an element writes."""
    if name == "param":
        is_writing = _WRITING_PARAMETER.fullmatch(attributes.get("key", ""))
        return ["value"] if is_writing and attributes.get("value", NOWHERE) not in _NOTHING else []
    return [
        key for key in _WRITTEN if _READ.get(name) != key and attributes.get(key, NOWHERE) not in _NOTHING
    ]


def _find_read(name: str, attributes: Mapping[str, str], folder: Path) -> list[Path]:
    """List the file that an element reads, if it is there: SUMO has words for one that is not."""
    named = attributes.get(_READ.get(name, ""), "")
    other = _full(folder / named)
    return [other] if named and is_there(other) else []


def _open_private(name: str) -> tuple[IO[bytes], Path]:
    """Open a file that goes with this process, and find the path by which other programs read it."""
    if sys.platform != "linux":
        file = tempfile.NamedTemporaryFile(suffix=name)  # noqa: SIM115 - it is closed with its `SumoFiles`
        return cast("IO[bytes]", file), Path(file.name)
    unnamed = os.fdopen(os.memfd_create(name[:100]), "w+b")
    return unnamed, Path(f"/proc/{os.getpid()}/fd/{unnamed.fileno()}")
