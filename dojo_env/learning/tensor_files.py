"""Weights and checkpoints in files: tensors and plain values, no pickled code, sealed with a checksum.

A file is a zip archive as torch writes it, and behind it the SHA-256 of all its bytes. What was written
before there were checksums ends with the archive, whose own CRC-32 of every member is checked instead.
"""

import hashlib
import io
import zipfile
from pathlib import Path
from typing import Any

import torch

from dojo_env.learning.settings import RunFileError
from dojo_maps.errors import WriteError
from dojo_maps.input_files import opened
from dojo_maps.whole_file import replaced

_SEAL = b"\nsha256 "
_LENGTH = len(_SEAL) + hashlib.sha256().digest_size
_END, _END_LENGTH = b"PK\x05\x06", 22
"""How an archive without a comment ends."""
_LARGEST = 1 << 40
_PIECE = 1 << 20


def save_tensors(state: Any, path: Path) -> None:
    """Write tensors and plain values, whole or not at all.

    Args:
        state: tensors, numbers and texts, in dicts and lists.
        path: of the file.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the disk is full, or the folder cannot be written.
    """
    with replaced(path) as fresh:
        try:
            torch.save(state, fresh)
        except RuntimeError as error:  # what torch makes of any refusal of the system
            raise WriteError(f"{path}: cannot be written; is the disk full?") from error
        with opened(fresh, most=_LARGEST) as file:
            digest = hashlib.file_digest(file, "sha256").digest()
        with fresh.open("ab") as file:
            file.write(_SEAL + digest)


def load_tensors(path: Path) -> Any:
    """Read tensors and plain values, and no code.

    Tensors stay in the file until they are used: a buffer that fits memory once need not fit it twice.

    Args:
        path: of the file that `save_tensors` wrote.

    Returns:
        What was saved, its tensors for the processor.

    Raises:
        RunFileError: there is no such file, it is not as it was written, or it holds something else.
    """
    with opened(path, most=_LARGEST, error=RunFileError) as file:
        if not _is_intact(file):
            raise RunFileError(path, "is damaged: it is not as it was written; copy it again, or train anew")
    try:
        return torch.load(path, map_location="cpu", weights_only=True, mmap=True)
    except Exception as error:  # torch raises whatever its readers do
        problem = " ".join(str(error).split())[:300]
        raise RunFileError(path, f"neither weights nor a checkpoint ({problem})") from error


def _is_intact(file: io.BufferedReader) -> bool:
    size = file.seek(0, io.SEEK_END)
    file.seek(max(0, size - _LENGTH))
    end = file.read()
    file.seek(0)
    if end.startswith(_SEAL):
        return _digest(file, size - _LENGTH) == end[len(_SEAL) :]
    if not end[-_END_LENGTH:].startswith(_END):
        return False
    try:
        with zipfile.ZipFile(file) as archive:
            return archive.testzip() is None
    except (ValueError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError):
        return False


def _digest(file: io.BufferedReader, count: int) -> bytes:
    """Hash the first bytes of a file."""
    found = hashlib.sha256()
    while count > 0 and (piece := file.read(min(count, _PIECE))):
        found.update(piece)
        count -= len(piece)
    return found.digest()
