"""Options out of a TOML file count less than the command line, and are checked as that is."""

import subprocess
import sys
from pathlib import Path

import pytest

from dojo_env.cli import build_parser as build_env_parser
from dojo_maps import progress
from dojo_maps.cli import build_parser as build_maps_parser
from dojo_maps.errors import SourceError, UsageError


def write(folder: Path, text: str) -> str:
    path = folder / "options.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_file_sets_what_the_command_line_leaves(tmp_path: Path) -> None:
    lines = (
        *('scenario = "two-way"', 'controller = "cycle"', "seconds = 30", 'yellow = "speed"'),
        *('signals = ["a", "b"]', "all_red = 1", "quiet = true"),
    )
    file = write(tmp_path, "\n".join(lines))
    options = build_env_parser().parse_args(["run", "--seconds", "60", "--config", file])
    assert (options.scenario, options.controller, options.seconds) == ("two-way", "cycle", 60)
    assert (options.yellow, options.signals, options.all_red) == ("speed", ["a", "b"], 1)
    assert options.quiet is True


def test_file_can_name_the_only_one_of_several(tmp_path: Path) -> None:
    file = write(tmp_path, 'point = "60.1,24.9"\n')
    assert build_maps_parser().parse_args(["import-osm", f"--config={file}"]).point == (60.1, 24.9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("secnds = 3", "secnds: no option of dojo-env run; did you mean seconds"),
        ("config = 'x'", "no option"),
        ("seconds = 'long'", "seconds = 'long'"),
        ("seconds = [1, 2]", "expected one value"),
        ("quiet = 'yes'", "expected true or false"),
        ("seeds = true", "expected numbers or texts"),
        ("preset = 'sky'", "'sky' is not among paper"),
        ("signals = [[1]]", "expected numbers or texts"),
    ],
)
def test_what_cannot_be_is_told(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        build_env_parser().parse_args(["run", "--config", write(tmp_path, text)])


@pytest.mark.parametrize("text", ["a = ", "a = 1\na = 2", "\x00"])
def test_file_that_is_no_toml_is_told(tmp_path: Path, text: str) -> None:
    with pytest.raises(SourceError, match="not readable as TOML"):
        build_env_parser().parse_args(["run", "--config", write(tmp_path, text)])


@pytest.mark.slow
def test_log_is_written_where_asked_for(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dojo_maps", "convert", "cologne1", "-o", str(tmp_path / "x.dojo")]
    quiet = subprocess.run(command, capture_output=True, text=True, check=True)
    assert quiet.stderr == ""
    told = subprocess.run([*command, "--log-level", "info"], capture_output=True, text=True, check=True)
    assert "INFO dojo_maps.progress: " in told.stderr
    assert "Writing" in told.stderr
    assert told.stdout == quiet.stdout


def test_stage_tells_how_long_is_left(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    tell = progress.Progress()
    now[0] += 30.0
    with caplog.at_level("INFO", logger="dojo_maps.progress"):
        for stage in (
            "1,000 of 3,000 pictures",
            "20 of 3,000 pictures",
            "2,990 of 3,000 pictures",
            "Writing",
        ):
            tell(stage)
    told = [record.getMessage().partition(" s  ")[2] for record in caplog.records]
    assert told == [
        "1,000 of 3,000 pictures, about 60 s left",
        "20 of 3,000 pictures, about 74 min left",
        "2,990 of 3,000 pictures",
        "Writing",
    ]
