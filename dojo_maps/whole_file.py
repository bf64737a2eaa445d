"""Files and folders that are there whole or not at all, and errors that name what could not be written.

What is written lies in a working folder beside its place until it is whole; then it takes its place in one
step. The folder's name ends in `.dojo-tmp`, and a lock tells that its process lives: what a killed one left
is removed by the next that writes there.
"""

import atexit
import csv
import ctypes
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from dojo_maps.errors import UsageError, WriteError
from dojo_maps.file_locks import lock as take_lock
from dojo_maps.interruption import held

SUFFIX = ".dojo-tmp"
"""Ends the names of working folders."""
_locks: dict[Path, int] = {}
"""The working folders of this process, and the descriptors that lock them."""
os.register_at_fork(after_in_child=_locks.clear)
_AT_FDCWD, _EXCHANGE = -100, 2
"""Of Linux's renameat2: paths as they are, and both names change places."""


@contextmanager
def replaced(path: Path, *, overwrite: bool = True, parents: bool = False) -> Iterator[Path]:
    """Give a new file to write, and put it in the place of `path` only once it is whole.

    What a link names is replaced, not the link; a pipe or a device, as /dev/stdout, is written as it is.

    Args:
        path: the file; the new one has the same name, so that its suffix tells libraries what to write.
        overwrite: False raises FileExistsError in the end where the file is there by then.
        parents: make its folder where there is none.

    Yields:
        The new file's path.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the system refuses: no room, no right, nobody who reads the pipe.
    """
    with _named(path):
        if path.parent == Path("/dev") or (path.exists() and not path.is_file() and not path.is_dir()):
            yield path
            return
        path = Path(os.path.realpath(path))
        if path.is_dir():
            raise UsageError(f"{path}: is a folder; give the file another name")
        _make_folder(path.parent) if parents else _check_folder(path.parent)
        with _working_folder(path.parent, path.name) as work:
            fresh = work / path.name
            yield fresh
            if overwrite:
                fresh.replace(path)
            else:
                _publish(fresh, path)


@contextmanager
def replaced_folder(
    folder: Path, *, keeps: Callable[[Path], bool] = lambda _entry: False, parents: bool = False
) -> Iterator[Path]:
    """Give a new folder to fill, and put it in the place of `folder` only once all went well.

    Args:
        folder: what to make, or to make anew.
        keeps: tells which of an older folder's entries move along.
        parents: make the folder around it where there is none.

    Yields:
        The new folder.

    Raises:
        UsageError: there is no folder to make it in.
        WriteError: the system refuses.
    """
    with _named(folder):
        _make_folder(folder.parent) if parents else _check_folder(folder.parent)
        with _working_folder(folder.parent, folder.name) as work:
            fresh = work / "new"
            fresh.mkdir()
            yield fresh
            if not folder.exists():
                fresh.rename(folder)
                return
            for entry in folder.iterdir():
                if keeps(entry) and not entry.name.endswith(SUFFIX):
                    copy = shutil.copytree if entry.is_dir() and not entry.is_symlink() else shutil.copy2
                    copy(entry, fresh / entry.name)
            _exchange(fresh, folder)


@contextmanager
def added_files(folder: Path) -> Iterator[Path]:
    """Give a folder to fill, whose files move into `folder`, which may hold others, once all are written.

    Args:
        folder: that they move into; it is made where there is none.

    Yields:
        The folder to fill.

    Raises:
        UsageError: a file is in the folder's way.
        WriteError: the system refuses.
    """
    with _named(folder):
        made = not folder.exists()
        _make_folder(folder)
        try:
            with _working_folder(folder, "files") as work:
                yield work
                for fresh in sorted(work.iterdir()):
                    fresh.replace(folder / fresh.name)
        except BaseException:
            if made:
                shutil.rmtree(folder, ignore_errors=True)
            raise


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Give a folder for what other programs read and write, for as long as the context lasts.

    Yields:
        The folder, which goes with the context.

    Raises:
        WriteError: it cannot be made, or has no room.
    """
    place = Path(tempfile.gettempdir())
    with _named(place), _working_folder(place, "work") as work:
        yield work


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8, whole or not at all.

    Args:
        path: of the file.
        text: to write.
    """
    with replaced(path) as fresh:
        fresh.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write a value as JSON that people can read, whole or not at all.

    Args:
        path: of the file.
        value: to write.
    """
    write_text(path, json.dumps(value, indent=1) + "\n")


def write_table(path: Path, head: Sequence[str], rows: Iterable[Sequence[Any]], **options: bool) -> None:
    """Write comma-separated values, whole or not at all; options as `replaced` has them.

    Args:
        path: of the file.
        head: names of the columns.
        rows: values, as many as there are columns.
        options: as `replaced` has them.
    """
    with replaced(path, **options) as fresh, fresh.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *rows])


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Name what was to be written in whatever error the system gives."""
    try:
        yield
    except FileExistsError:
        raise
    except OSError as error:
        raise WriteError(f"{path}: cannot be written ({error.strerror or error})") from error


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise UsageError(f"{folder}: a file is in this folder's way; choose another") from None


def _check_folder(folder: Path) -> None:
    if not folder.is_dir():
        raise UsageError(f"{folder}: no such folder; make it first, or choose another")


@contextmanager
def _working_folder(parent: Path, name: str) -> Iterator[Path]:
    _remove_left(parent)
    with held():  # An interruption in the middle of it would leave the folder there.
        work = _make_locked(parent, name)
    try:
        yield work
    finally:
        _remove(work)


def _make_locked(parent: Path, name: str) -> Path:
    while True:
        work = Path(tempfile.mkdtemp(prefix=f".{name[:40]}.", suffix=SUFFIX, dir=parent))
        with suppress(FileNotFoundError):  # Somebody took it for one that was left.
            lock = _open_folder(work)
            with suppress(OSError):  # Where nothing can be locked, nobody removes what was left.
                take_lock(lock)
            if work.exists():
                _locks[work] = lock
                return work
            os.close(lock)


def _remove(work: Path) -> None:
    with held():
        lock = _locks.pop(work, None)
        if lock is not None:
            shutil.rmtree(work, ignore_errors=True)
            os.close(lock)


@atexit.register
def _remove_all() -> None:
    """Remove what an interruption left that came on the way into `_remove`, or on the way to it."""
    for work in list(_locks):
        _remove(work)


@cache  # A process looks into a folder once: it may write thousands of files there.
def _remove_left(parent: Path) -> None:
    """Remove the working folders of processes that are no more."""
    for left in parent.glob(f".*{SUFFIX}"):
        with suppress(OSError):  # Another user's.
            handle = _open_folder(left)
            try:
                take_lock(handle, wait=False)
                shutil.rmtree(left, ignore_errors=True)
            finally:
                os.close(handle)


def _open_folder(path: Path) -> int:
    return os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)


def _publish(fresh: Path, path: Path) -> None:
    """Give a file its name, which must be free."""
    try:
        os.link(fresh, path)
    except PermissionError:  # A file system without links.
        path.touch(exist_ok=False)
        fresh.replace(path)


def _exchange(fresh: Path, folder: Path) -> None:
    """Let two folders change places in one step, where the file system can; else in two."""
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    if rename and rename(_AT_FDCWD, bytes(fresh), _AT_FDCWD, bytes(folder), _EXCHANGE) == 0:
        return
    old = fresh.with_name("old")
    try:
        folder.rename(old)
        fresh.rename(folder)
    except BaseException:
        # An interruption may come right after either step.
        if not folder.exists():
            old.rename(folder)
        raise
