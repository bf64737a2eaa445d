"""SUMO's own word on a network: its program loads it beside other work, and what it says is kept.

The network is a stranger's. So SUMO gets a copy in a folder of its own, no port and little to write, and one
that holds more than a network, such as detectors that write files, is not given to it at all.
"""

import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from subprocess import Popen, TimeoutExpired

from dojo_maps.errors import DojoError
from dojo_maps.sumo_programs import find_program, kill_program, running_program, signal_name
from dojo_maps.whole_file import scratch_folder

PATIENCE = 60.0
"""Seconds that SUMO gets once all else is done."""
_MOST_WORDS = 1 << 22
_MOST_WRITTEN = 1 << 26
"""Bytes of SUMO's words that are read, and that it may write."""
_NETWORK, _WORDS = "x.net.xml", "words"
_OPTIONS = ("--end", "1", "--aggregate-warnings", "1000")
_LEVELS = ("Error: ", "Warning: ")
_ELEMENTS = frozenset(
    b"net location type restriction edge lane neigh stopOffset param junction request connection tlLogic"
    b" phase prohibition roundabout deadEnd".split()
)
_TAG = re.compile(rb"<([^\s/>!?]+)")
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_PARAMETER = re.compile(rb"<param\s[^<]*")
_KEY = re.compile(rb"""\skey\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_WRITES = re.compile(rb"file|output|swarmlog|&", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What SUMO said of a network; each error and warning once, in order, with how often it was said.

    Attributes:
        accepted: SUMO has loaded it; None if it was still at it when patience ended.
        errors: in SUMO's words; if it crashed without a word, that it did.
        warnings: in SUMO's words.
    """

    accepted: bool | None
    errors: dict[str, int]
    warnings: dict[str, int]


class Loading:
    """A network on its way into SUMO, and through what SUMO is to simulate on it."""

    def __init__(self, child: "Popen[bytes]", words: Path) -> None:
        """Take SUMO's process, and the file that it speaks into."""
        self._child, self._words = child, words

    @cached_property
    def verdict(self) -> Verdict:
        """What SUMO says; waits for it."""
        try:
            status = self._child.wait(PATIENCE)
        except TimeoutExpired:
            kill_program(self._child)
            return Verdict(accepted=None, errors={}, warnings={})
        with self._words.open("rb") as file:
            lines = file.read(_MOST_WORDS).decode("utf-8", "replace").splitlines()
        errors, warnings = (
            Counter(line.removeprefix(level) for line in lines if line.startswith(level)) for level in _LEVELS
        )
        if status != 0 and not errors:
            how = f"crashes ({signal_name(-status)})" if status < 0 else f"ends with status {status}"
            errors[f"SUMO {how} when it loads the network"] = 1
        return Verdict(accepted=status == 0, errors=dict(errors), warnings=dict(warnings))


@contextmanager
def loading(data: bytes) -> Iterator[Loading | None]:
    """Let SUMO load a network for as long as the context lasts, beside what is done there.

    Args:
        data: the network's bytes, unpacked.

    Yields:
        Its way into SUMO, or None where SUMO is not asked: its program is missing, no scratch file can be
        written, or the network holds what makes SUMO write or read other files.
    """
    with ExitStack() as stack:
        try:
            folder = stack.enter_context(scratch_folder())
            found = start_sumo(data, folder, _OPTIONS, stack)
        except (DojoError, OSError):
            found = None
        yield found


def start_sumo(data: bytes, folder: Path, options: Sequence[str], stack: ExitStack) -> Loading | None:
    """Let SUMO load a network in a folder and simulate; it ends with the stack at the latest.

    Args:
        data: the network's bytes, unpacked.
        folder: where SUMO runs, with nothing of another network in it.
        options: of SUMO, beside the network.
        stack: where what ends it is kept.

    Returns:
        The network on its way, or None where it holds what makes SUMO write or read other files.

    Raises:
        ToolMissingError: SUMO is not installed.
        OSError: the folder cannot be written.
    """
    if not _is_only_a_network(data):
        return None
    (folder / _NETWORK).write_bytes(data)
    words = stack.enter_context((folder / _WORDS).open("wb"))
    arguments = ("--net-file", _NETWORK, "--no-step-log", *options)
    child = stack.enter_context(running_program(find_program("sumo"), arguments, folder, words))
    if sys.platform == "linux":
        import resource  # noqa: PLC0415 - not everywhere

        with suppress(OSError):  # It has ended already.
            resource.prlimit(child.pid, resource.RLIMIT_FSIZE, (_MOST_WRITTEN, _MOST_WRITTEN))
    return Loading(child, folder / _WORDS)


def _is_only_a_network(data: bytes) -> bool:
    """Tell whether bytes hold a network's elements only, as far as that can be told without parsing them."""
    start = data[:4].removeprefix(b"\xef\xbb\xbf")
    if not start.startswith(b"<") or b"\0" in start:
        return False  # Tags are written otherwise than we look for them.
    bare = _COMMENT.sub(b"", data)
    if not _ELEMENTS.issuperset(_TAG.findall(bare)):
        return False
    keys = (key for found in _PARAMETER.findall(bare) for key in _KEY.findall(found))
    return not any(_WRITES.search(b"".join(key)) for key in keys)
