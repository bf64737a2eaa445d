"""Files and folders that are there whole or not at all: on full disks, after kills, beside others."""

import fcntl
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import command_environment

from dojo_env.camera import Camera, write_cameras
from dojo_env.episode_files import EpisodeFiles
from dojo_env.recording import Recorder
from dojo_env.snapshot import Snapshot
from dojo_env.watching.video import open_video
from dojo_maps import whole_file
from dojo_maps.errors import UsageError, WriteError
from dojo_maps.whole_file import SUFFIX, added_files, replaced, replaced_folder, scratch_folder, write_text

ROOM = 2000
"""Bytes that a file may have on the full disk."""


@contextmanager
def full_disk() -> Iterator[None]:
    """Let the system refuse whatever is written beyond some bytes of any file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write_recording(path: Path) -> None:
    recorder, chance = Recorder(), np.random.default_rng(1)
    for second in range(60):
        count = 20
        recorder.add(
            Snapshot(
                time=float(second),
                ids=tuple(f"v{k}" for k in range(count)),
                numbers=np.arange(1, count + 1),
                kinds=np.zeros(count),
                positions=chance.uniform(0, 100, (count, 3)),
                headings=chance.uniform(0, 6, count),
                slopes=np.zeros(count),
                sizes=np.full((count, 3), 2.0),
                colours=np.zeros((count, 3)),
                lights=np.zeros(count),
                speeds=chance.uniform(0, 10, count),
                lanes=("",) * count,
            )
        )
    recorder.write(path)


def write_episode(path: Path) -> None:
    files = EpisodeFiles(str(path.with_name(path.name.partition("_conn")[0])))
    for step in range(500):
        files.add({"step": step, "reward": 0.5})
    files.finish({"seed": 1}, episode=1)


def write_video(path: Path) -> None:
    chance = np.random.default_rng(1)
    with open_video(path) as video:
        for _ in range(10):
            video.add(chance.integers(0, 255, (64, 96, 3), dtype=np.uint8))


def write_many_cameras(path: Path) -> None:
    write_cameras([Camera(name=str(k), position=(0.0, 0.0, 9.0)) for k in range(50)], path)


WRITERS: dict[str, Callable[[Path], None]] = {
    "a.txt": lambda path: write_text(path, "x" * 10_000),
    "a.csv": lambda path: whole_file.write_table(path, ["a"], [[k] for k in range(3000)]),
    "a.json": lambda path: whole_file.write_json(path, list(range(3000))),
    "cameras.json": write_many_cameras,
    "rec.npz": write_recording,
    "run_conn0_ep1.csv": write_episode,
    "film.mp4": write_video,
    "film.webm": write_video,
}
"""All that is written as one file, by its name."""


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_is_one_error_and_the_old_file_stays(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, old = tmp_path / name, not name.startswith("run_")
    if old:  # An episode takes no name that is there.
        path.write_text("old")
    with full_disk(), pytest.raises(WriteError, match=name):
        WRITERS[name](path)
    assert not old or path.read_text() == "old"
    assert names(tmp_path) == ([name] if old else [])
    WRITERS[name](path)
    assert path.stat().st_size > ROOM
    assert {part.split(".")[0] for part in names(tmp_path)} == {name.split(".", maxsplit=1)[0]}
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", WRITERS)
def test_a_folder_in_the_files_place_is_wrong_usage(name: str, tmp_path: Path) -> None:
    if name.startswith("run_"):
        pytest.skip("an episode takes the next name")
    (tmp_path / name / "mine").mkdir(parents=True)
    with pytest.raises((UsageError, ValueError), match=name) as caught:
        WRITERS[name](tmp_path / name)
    assert caught.value.exit_status == 2
    assert names(tmp_path) == [name]


@pytest.mark.parametrize("name", ["a.txt", "film.mp4"])
def test_a_folder_that_is_not_there_is_wrong_usage(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such folder"):
        WRITERS[name](tmp_path / "gone" / name)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder that nobody may write to")
@pytest.mark.parametrize("name", WRITERS)
def test_a_folder_that_nobody_may_write_to_is_one_error(name: str) -> None:
    with pytest.raises(WriteError, match="/proc/self"):
        WRITERS[name](Path("/proc/self") / name)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_device_is_one_error() -> None:
    with pytest.raises(WriteError, match=r"/dev/full: cannot be written \(No space left on device\)"):
        write_text(Path("/dev/full"), "new")


def test_what_was_there_stays_until_all_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(KeyError), replaced(path) as fresh:
        fresh.write_text("ne")
        raise KeyError
    assert path.read_text() == "old"
    with replaced(path) as fresh:
        fresh.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert names(tmp_path) == ["a.json"]


def test_what_must_not_be_overwritten_is_not(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with replaced(path, overwrite=False) as fresh:
        fresh.write_text("mine")
    with pytest.raises(FileExistsError), replaced(path, overwrite=False) as fresh:
        fresh.write_text("yours")
    assert path.read_text() == "mine"
    assert names(tmp_path) == ["a.csv"]


@pytest.mark.parametrize("name", ["x" * 255, "ü" * 127, ".hidden", "with space"])
def test_any_name_that_the_system_takes_is_written(name: str, tmp_path: Path) -> None:
    write_text(tmp_path / name, "new")
    assert names(tmp_path) == [name]


def test_a_file_has_the_rights_that_the_user_gives_new_ones(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    write_text(tmp_path / "whole", "")
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    real.write_text("old")
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_a_pipe_is_written_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(pipe, "new")
    assert os.read(reader, 10) == b"new"
    assert pipe.is_fifo()
    os.close(reader)


def test_a_pipe_that_nobody_reads_any_more_is_one_error(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with (
        pytest.raises(WriteError, match="pipe: cannot be written"),
        replaced(pipe) as fresh,
        fresh.open("w") as file,
    ):
        os.close(reader)
        file.write("x" * 10)


def fill(folder: Path) -> None:
    (folder / "one").write_text("new")
    (folder / "two").write_text("x" * 10_000)


def as_folder(folder: Path) -> None:
    with replaced_folder(folder, keeps=lambda entry: entry.name == "mine") as fresh:
        fill(fresh)


def as_files(folder: Path) -> None:
    with added_files(folder) as fresh:
        fill(fresh)


@pytest.mark.parametrize("write", [as_folder, as_files])
@pytest.mark.parametrize("there", [True, False])
def test_a_folder_is_filled_whole_or_not_at_all(
    write: Callable[[Path], None], there: bool, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    if there:
        folder.mkdir()
        (folder / "mine").write_text("mine")
        (folder / "one").write_text("old")
    with full_disk(), pytest.raises(WriteError, match="out: cannot be written"):
        write(folder)
    assert names(tmp_path) == (["out"] if there else [])
    assert not there or (names(folder), (folder / "one").read_text()) == (["mine", "one"], "old")
    write(folder)
    assert names(tmp_path) == ["out"]
    assert names(folder) == (["mine"] if there else []) + ["one", "two"]
    assert (folder / "one").read_text() == "new"


def test_folders_change_places_where_the_system_cannot_do_it_in_one_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(whole_file, "_EXCHANGE", 1 << 20)  # Linux refuses what it does not know.
    folder = tmp_path / "out"
    as_folder(folder)
    as_folder(folder)
    assert names(folder) == ["one", "two"]
    assert names(tmp_path) == ["out"]


KILLED = """
import sys
from pathlib import Path
from dojo_maps.whole_file import replaced, replaced_folder, scratch_folder
folder = Path(sys.argv[1])
with replaced(folder / "a.txt") as fresh, replaced_folder(folder / "out") as new, scratch_folder():
    fresh.write_text("half")
    print(flush=True)
    sys.stdin.read()
"""


def started(script: str, *arguments: object, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", script, *map(str, arguments)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=command_environment(**environment),
    )  # fmt: skip


def test_what_a_killed_process_left_is_removed_by_the_next_and_not_before(tmp_path: Path) -> None:
    folder, temporary = tmp_path / "here", tmp_path / "tmp"
    folder.mkdir()
    temporary.mkdir()
    write = "import sys; from dojo_maps.whole_file import *; write_text(Path(sys.argv[1]), 'new')"
    scratch = "from dojo_maps.whole_file import scratch_folder\nwith scratch_folder(): pass"
    with started(KILLED, folder, TMPDIR=str(temporary)) as living:
        assert living.stdout is not None
        living.stdout.readline()
        before = names(folder), names(temporary)
        assert [len(each) for each in before] == [2, 1]
        assert all(name.endswith(SUFFIX) for each in before for name in each)
        for script in (write, scratch):
            with started(script, folder / "b.txt", TMPDIR=str(temporary)) as other:
                other.communicate()
        assert (names(folder), names(temporary)) == (sorted([*before[0], "b.txt"]), before[1])
        living.kill()
    for script in (write, scratch):
        with started(script, folder / "b.txt", TMPDIR=str(temporary)) as other:
            other.communicate()
    assert (names(folder), names(temporary)) == (["b.txt"], [])


ENDLESS = """
import sys
from pathlib import Path
from dojo_maps.whole_file import replaced_folder
for number in range(10**9):
    with replaced_folder(Path(sys.argv[1])) as fresh:
        for name in "ab":
            (fresh / name).write_text(str(number))
    print(flush=True)
"""


def test_a_folder_is_whole_whenever_its_writer_is_killed(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    for number in range(8):
        with started(ENDLESS, folder) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(number * 0.003)
            writer.send_signal(signal.SIGKILL)
        assert names(folder) == ["a", "b"]
        assert (folder / "a").read_text() == (folder / "b").read_text()
    with started(ENDLESS.replace("10**9", "1"), folder) as writer:
        writer.communicate()
    assert names(tmp_path) == ["out"]


def test_a_stranger_s_folder_and_what_a_link_names_stay(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine").write_text("mine")
    (tmp_path / f".link.abc{SUFFIX}").symlink_to(tmp_path / "elsewhere")
    locked = tmp_path / f".busy.abc{SUFFIX}"
    locked.mkdir()
    handle = os.open(locked, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    write_text(tmp_path / "a.txt", "new")
    os.close(handle)
    assert (tmp_path / "elsewhere" / "mine").read_text() == "mine"
    assert locked.is_dir()


def test_scratch_is_gone_afterwards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with scratch_folder() as work:
        (work / "a").write_text("")
    with full_disk(), pytest.raises(WriteError, match=str(tmp_path)), scratch_folder() as work:
        (work / "a").write_text("x" * 10_000)
    assert names(tmp_path) == []
