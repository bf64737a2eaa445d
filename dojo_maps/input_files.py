"""The one way in: bytes of files that anybody may have made, within bounds, with one kind of error for each.

Only regular files are read, judged by what was opened and not by its name, so nothing waits for a pipe or a
device. gzip, bzip2, xz and zip are told by their first bytes and unpacked piece by piece.
"""

import bz2
import csv
import hashlib
import io
import lzma
import os
import stat
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from dojo_maps.errors import SourceError

MAX_BYTES = 1 << 30
"""The largest file read, in bytes once unpacked: a network of about twice the largest city in public use."""
MAX_EXPANSION = 200
"""How many times its own size a packed file may unpack to; networks reach about 15."""
_PIECE = 1 << 20
_FOLDER = "a folder, not a file; name a file in it"
_MOST_TOLD = 12
"""Columns that a message lists."""
_GZIP, _BZIP2, _XZ, _ZIP = b"\x1f\x8b", b"BZh", b"\xfd7zXZ\0", b"PK\x03\x04"
_XZ_MEMORY = 1 << 28
"""Bytes that unpacking xz may take."""

ErrorClass = type[SourceError]


@contextmanager
def opened(
    path: Path, *, most: int = MAX_BYTES, error: ErrorClass = SourceError
) -> Iterator[io.BufferedReader]:
    """Open a regular file for reading.

    Args:
        path: the file.
        most: bytes that it may have.
        error: raised for whatever is wrong with it, also with reading inside of the context.

    Yields:
        The file, open; it closes with the context.

    Raises:
        SourceError: of the class `error`: the file is missing, not a regular file, or too large; or the
            system refuses to read it.
    """
    try:
        # Opening must not wait either, as it does for a pipe that nobody writes to.
        with open(path, "rb", opener=_open_at_once) as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise error(path, _FOLDER if stat.S_ISDIR(found.st_mode) else "not a file")
            if found.st_size > most:
                raise error(path, f"{found.st_size} bytes; at most {most} are read")
            yield file
    except FileNotFoundError as problem:
        raise error(path, "no such file") from problem
    except IsADirectoryError as problem:
        raise error(path, _FOLDER) from problem
    except OSError as problem:
        raise error(path, f"cannot be read: {problem.strerror or problem}") from problem


def is_there(path: Path) -> bool:
    """Tell whether a path leads to something; what cannot be a path, as one far too long, does not.

    Args:
        path: any.

    Returns:
        Whether it does.
    """
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def check_file(path: Path, *, most: int = MAX_BYTES, error: ErrorClass = SourceError) -> None:
    """See that a library which opens files itself gets a regular one within bounds.

    Args:
        path: the file.
        most: bytes that it may have.
        error: raised for whatever is wrong with it.

    Raises:
        SourceError: as `opened`.
    """
    with opened(path, most=most, error=error):
        pass


def read_pieces(path: Path, *, most: int = MAX_BYTES, error: ErrorClass = SourceError) -> Iterator[bytes]:
    """Read a file piece by piece, unpacked if it is gzip, bzip2, xz or a zip of one file.

    Args:
        path: the file.
        most: bytes that it may have, unpacked.
        error: raised for whatever is wrong with it.

    Yields:
        Its bytes, unpacked, piece by piece.

    Raises:
        SourceError: of the class `error`: as `opened`; or empty, broken as what it is packed by, or
            unpacking to more than it may.
    """
    with opened(path, most=most, error=error) as file:
        total, blank, limit = 0, True, most
        if file.peek().startswith((_GZIP, _BZIP2, _XZ, _ZIP)):
            limit = min(most, max(MAX_EXPANSION * os.fstat(file.fileno()).st_size, _PIECE))
        elif path.name.endswith(".gz"):
            raise error(path, "not a gzip file, though its name says so; rename or repack it")
        for piece in _unpacked(file, path, error):
            total += len(piece)
            if total > limit:
                raise error(path, f"unpacks to more than {limit} bytes; refused as unsafe")
            blank = blank and not piece.strip()
            yield piece
        if blank:
            raise error(path, "the file is empty")


def read_bytes(path: Path, *, most: int = MAX_BYTES, error: ErrorClass = SourceError) -> bytes:
    """Read a file whole, unpacked if it is gzip, bzip2, xz or a zip of one file.

    Args:
        path: the file.
        most: bytes that it may have, unpacked.
        error: raised for whatever is wrong with it.

    Returns:
        Its bytes.

    Raises:
        SourceError: as `read_pieces`.
    """
    return b"".join(read_pieces(path, most=most, error=error))


def read_table(
    path: Path, columns: Collection[str], *, error: ErrorClass = SourceError
) -> list[dict[str, str]]:
    """Read a CSV file with a head; each row by its columns' names.

    Args:
        path: the file.
        columns: that every row must have.
        error: raised for whatever is wrong with it.

    Returns:
        Texts by column, row by row.

    Raises:
        SourceError: of the class `error`: as `read_pieces`; no UTF-8, or a row lacks one of `columns`.
    """
    try:
        text = read_bytes(path, error=error).decode("utf-8-sig")
        rows = list(csv.DictReader(text.splitlines()))
    except (UnicodeDecodeError, csv.Error) as problem:
        raise error(path, f"not a table of comma-separated values ({problem})") from problem
    for number, row in enumerate(rows, 1):
        if missing := [name for name in columns if row.get(name) is None]:
            head = ", ".join(str(name) for name in list(row)[:_MOST_TOLD])
            wanted = ", ".join(columns)
            told = f"has no {missing[0]}; expected columns {wanted}, found {head}"
            raise error(path, told, f"row {number}")
    return rows


def sha256_of(path: Path, *, most: int = MAX_BYTES, error: ErrorClass = SourceError) -> str:
    """Hash a file as it lies on disk.

    Args:
        path: the file.
        most: bytes that it may have.
        error: raised for whatever is wrong with it.

    Returns:
        64 hexadecimal digits.

    Raises:
        SourceError: as `opened`.
    """
    digest = hashlib.sha256()  # hashlib's own loop never ends where a file has nothing to give for now.
    with opened(path, most=most, error=error) as file:
        for piece in _plain(file):
            digest.update(piece)
    return digest.hexdigest()


def _open_at_once(path: str, flags: int) -> int:
    at_once = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)  # Windows has no pipes by path.
    return os.open(path, flags | at_once)


def _unpacked(file: io.BufferedReader, path: Path, error: ErrorClass) -> Iterator[bytes]:
    start = file.peek()
    if start.startswith(_GZIP):
        return _gunzip(file, path, error)
    if start.startswith(_BZIP2):
        return _decompress(file, path, error, "bzip2", bz2.BZ2Decompressor)
    if start.startswith(_XZ):
        return _decompress(file, path, error, "xz", lambda: lzma.LZMADecompressor(memlimit=_XZ_MEMORY))
    return _unzip(file, path, error) if start.startswith(_ZIP) else _plain(file)


def _plain(file: io.BufferedReader) -> Iterator[bytes]:
    while piece := file.read(_PIECE):
        yield piece


def _gunzip(file: io.BufferedReader, path: Path, error: ErrorClass) -> Iterator[bytes]:
    member, begun = zlib.decompressobj(wbits=31), False
    try:
        for packed in _plain(file):
            left = packed
            # Zeros may fill up the space between and after members.
            while left := left if begun else left.lstrip(b"\0"):
                begun = True
                yield member.decompress(left, _PIECE)
                left = member.unconsumed_tail
                if member.eof:
                    left = member.unused_data
                    member, begun = zlib.decompressobj(wbits=31), False
    except zlib.error as problem:
        raise error(path, f"broken gzip data ({problem}); copy or download the file again") from problem
    if begun:
        raise error(path, "the gzip data ends early; copy or download the file again")


def _decompress(
    file: io.BufferedReader,
    path: Path,
    error: ErrorClass,
    kind: str,
    start: Callable[[], bz2.BZ2Decompressor | lzma.LZMADecompressor],
) -> Iterator[bytes]:
    """Unpack streams that follow each other."""
    stream, begun = start(), False
    try:
        for packed in _plain(file):
            left = packed
            while left or (begun and not stream.needs_input):
                begun = True
                yield stream.decompress(left, _PIECE)
                left = stream.unused_data if stream.eof else b""
                if stream.eof:
                    stream, begun = start(), False
    except (OSError, lzma.LZMAError) as problem:
        raise error(path, f"broken {kind} data ({problem}); copy or download the file again") from problem
    if begun:
        raise error(path, f"the {kind} data ends early; copy or download the file again")


def _unzip(file: io.BufferedReader, path: Path, error: ErrorClass) -> Iterator[bytes]:
    """Unpack the one file of a zip archive."""
    try:
        with zipfile.ZipFile(file) as archive:
            held = [entry for entry in archive.infolist() if not entry.is_dir()]
            if len(held) != 1:
                raise error(path, f"a zip archive of {len(held)} files, expected one; unpack it first")
            with archive.open(held[0]) as member:
                while piece := member.read(_PIECE):
                    yield piece
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as problem:
        raise error(path, f"broken or encrypted zip data ({problem}); unpack it first") from problem


def find_named(path: Path, folder: str, name: str) -> Path:
    """Find a file that a configuration names: from its own folder, or from one above it.

    Args:
        path: of the configuration.
        folder: that it names beside, where the program that it is for is started; "" for none.
        name: of the file.

    Returns:
        The path.

    Raises:
        SourceError: it is not there.
    """
    for above in path.absolute().parents:
        for found in (above / folder / name, above / name):
            if found.is_file():
                return found
    raise SourceError(path, f"names {folder}{name}, which is not there")
