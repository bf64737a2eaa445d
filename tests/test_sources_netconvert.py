"""netconvert as a child process: found, quoted when it refuses, caught when it crashes, stopped in time."""

import importlib.util
import os
import signal
import time
from pathlib import Path

import pytest

from dojo_maps.errors import ToolMissingError
from dojo_maps.sources import netconvert
from dojo_maps.sources.files import find_network
from dojo_maps.sources.netconvert import NetconvertError, find_netconvert, run_netconvert


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Put a shell script in netconvert's place."""

    def place(script: str) -> Path:
        program = tmp_path / "home" / "bin" / "netconvert"
        program.parent.mkdir(parents=True)
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        monkeypatch.setattr(netconvert, "find_netconvert", lambda: program)
        return program

    return place


def test_run_netconvert_converts_a_packaged_network_without_a_word_on_projections(tmp_path):
    network, _ = find_network("cologne1")
    result = run_netconvert(["-s", str(network), "-o", "out.net.xml"], folder=tmp_path)
    assert (tmp_path / "out.net.xml").read_text().rstrip().endswith("</net>")
    assert not [warning for warning in result.warnings if "proj" in warning]


def test_run_netconvert_counts_every_warning(tmp_path):
    network, _ = find_network("ingolstadt21")
    arguments = ["-s", str(network), "-o", "out.net.xml"]
    every = run_netconvert(arguments, folder=tmp_path).warnings
    fewer = run_netconvert([*arguments, "--aggregate-warnings", "2"], folder=tmp_path).warnings
    assert len(every) > len(fewer) > 0
    assert not any(warning.startswith("Warning") for warning in every)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-s", "nowhere.net.xml", "-o", "x"], "File 'nowhere.net.xml' is not accessible"),
        (["--no-such-option"], "No option with the name 'no-such-option'"),
        (["-s", "broken.net.xml", "-o", "x"], r"exit status 1|crashed \(SIGSEGV\)"),
    ],
)
def test_run_netconvert_quotes_its_error_in_one_line(tmp_path, arguments, words):
    (tmp_path / "broken.net.xml").write_text("<net><edge")
    with pytest.raises(NetconvertError, match=words) as caught:
        run_netconvert(arguments, folder=tmp_path)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_status == 4


def test_run_netconvert_tells_a_crash_from_a_refusal(stand_in):
    stand_in("echo 'Warning: so far so good' >&2; kill -SEGV $$")
    with pytest.raises(NetconvertError, match=r"crashed \(SIGSEGV\).*so far so good"):
        run_netconvert([])


def test_run_netconvert_stops_it_and_its_children_when_the_time_is_up(stand_in, tmp_path):
    stand_in(f"sleep 60 & echo $! > {tmp_path}/pid; wait")
    begun = time.monotonic()
    with pytest.raises(NetconvertError, match=r"stopped after 0\.5 s"):
        run_netconvert([], timeout=0.5)
    assert time.monotonic() - begun < 10
    assert not _runs(int((tmp_path / "pid").read_text()))


def test_run_netconvert_names_the_data_of_the_sumo_it_runs(stand_in, tmp_path, monkeypatch):
    monkeypatch.setenv("SUMO_HOME", "/elsewhere")
    home = stand_in(f'printf "%s %s %s" "$SUMO_HOME" "$PROJ_LIB" "$PROJ_DATA" > {tmp_path}/seen').parents[1]
    (home / "data" / "proj").mkdir(parents=True)
    (home / "data" / "proj" / "proj.db").touch()
    run_netconvert([])
    assert (tmp_path / "seen").read_text() == f"{home} {home}/data/proj {home}/data/proj"
    assert os.environ["SUMO_HOME"] == "/elsewhere"


def test_find_netconvert_prefers_the_installed_package_then_sumo_home_then_path(tmp_path, monkeypatch):
    monkeypatch.setenv("SUMO_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("PATH", str(tmp_path / "path"))
    for folder in ("home/bin", "path"):
        program = tmp_path / folder / "netconvert"
        program.parent.mkdir(parents=True)
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
    assert find_netconvert().parents[1].name == "sumo"
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    assert find_netconvert() == tmp_path / "home" / "bin" / "netconvert"
    monkeypatch.delenv("SUMO_HOME")
    assert find_netconvert() == tmp_path / "path" / "netconvert"


def test_find_netconvert_says_what_to_install_when_it_is_nowhere(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    monkeypatch.delenv("SUMO_HOME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolMissingError, match="pip install eclipse-sumo"):
        find_netconvert()


def _runs(process: int) -> bool:
    """Tell whether a process is alive; a killed one may wait a moment to be reaped."""
    for _ in range(50):
        try:
            state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
        except FileNotFoundError:
            return False
        if state == "Z":
            return False
        time.sleep(0.05)
    os.kill(process, signal.SIGKILL)
    return True
