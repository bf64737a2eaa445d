"""Files are read by the readers on the ground floor only: a new module that opens one itself is told here."""

import ast
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
MODULES = sorted(
    path for room in ("dojo_maps", "dojo_env", "tools") for path in (REPOSITORY / room).rglob("*.py")
)
READING = {
    "open", "fdopen", "read_bytes", "read_text", "load", "loads", "loadtxt", "genfromtxt", "fromfile",
    "memmap", "ZipFile", "GzipFile", "BZ2File", "ParserCreate", "fromstring", "iterparse", "XML",
    "imread", "VideoCapture", "FileProcessor", "DictReader", "reader",
    "TiffFile",
}  # fmt: skip
"""Names of functions that read files, or turn bytes of anybody's into values."""
NOT_FILES = {"webbrowser"}
"""What else can be opened."""
OWN_READERS = {
    "dojo_maps/input_files.py": {"open", "read_bytes", "DictReader", "ZipFile"},
    "dojo_maps/safe_xml.py": {"ParserCreate"},
    "dojo_maps/safe_json.py": {"loads"},
    "dojo_maps/safe_toml.py": {"loads"},
    "dojo_env/plain_arrays.py": {"ZipFile", "open"},
    "dojo_env/learning/tensor_files.py": {"ZipFile", "load", "open"},
}
"""The readers themselves."""
EXPLAINED = {
    # Bytes that a reader has let through already.
    "dojo_env/calibration/points.py": {"reader"},
    "dojo_maps/repair/net_text.py": {"ParserCreate"},
    "dojo_maps/sources/line_numbers.py": {"ParserCreate"},
    "dojo_maps/sources/net_tree.py": {"fromstring"},
    "dojo_maps/sources/edits.py": {"fromstring", "read_bytes"},
    "dojo_maps/sources/geotiff.py": {"TiffFile"},
    "dojo_maps/sources/osm/read/osm_pbf.py": {"FileProcessor"},
    # What netconvert has just written into a scratch folder.
    "dojo_maps/repair/splicing.py": {"fromstring"},
    "dojo_maps/sources/netconvert.py": {"read_bytes"},
    "dojo_maps/sources/osm/network/netconvert_run.py": {"read_bytes", "read_text"},
    # What is written, not read; what a process of ours says; what a user types; a web server's answer.
    "dojo_env/commands/watch_video.py": {"open"},
    "dojo_env/sumo_files.py": {"fdopen"},
    "dojo_env/world_process.py": {"loads", "open"},
    "dojo_maps/command.py": {"open"},
    "dojo_maps/exports/geojson.py": {"loads"},
    "dojo_maps/sumo_loading.py": {"open"},
    "dojo_env/recording.py": {"open"},
    "dojo_maps/interruption.py": {"open"},
    "dojo_maps/sources/download.py": {"open"},
    "tools/bench_convert.py": {"loads"},
    "tools/bench_env.py": {"loads"},
    "tools/bench_render.py": {"loads"},
    "tools/bench_validate.py": {"loads"},
    "tools/bench_view.py": {"read_text"},
    "dojo_env/commands/train.py": {"loads"},
    "tools/fuzz.py": {"read_bytes", "read_text", "open"},
    "tools/random_damage.py": {"load", "loads"},
    "tools/survey_networks.py": {"loads", "read_text"},
    # Films: regular files of known kinds, or a stream that a user names.
    "dojo_env/films/source.py": {"VideoCapture"},
    # What this process has just written, and files of the packages themselves.
    "dojo_env/benchmark/cluster.py": {"read_bytes"},
    "dojo_maps/whole_file.py": {"open"},
    "dojo_maps/report/page.py": {"read_text"},
    "tools/make_training_maps.py": {"FileProcessor"},
    "dojo_maps/viewer/page.py": {"read_text"},
    "dojo_maps/sources/osm/read/boundaries.py": {"read_text"},
    "dojo_env/demand.py": {"read_bytes"},
    "dojo_env/cache.py": {"read_bytes", "open"},
    "dojo_env/datasets/cluster.py": {"read_bytes"},
    "dojo_env/datasets/writing.py": {"open"},
    "dojo_env/encoders/efficientnet.py": {"load"},
    "dojo_env/encoders/onnx_file.py": {"load"},
    "dojo_env/rendering/compiling.py": {"read_bytes", "load"},
    "dojo_env/watching/server.py": {"read_text", "loads"},
    "dojo_env/watching/video.py": {"VideoCapture", "open"},
    "dojo_maps/progress.py": {"open"},
    "tools/picture_findings.py": {"imread"},
}
"""Who else may, and what."""


def reading_calls(module: Path) -> set[str]:
    """Name the calls of a module that read files, but those that the readers on the ground floor define."""
    tree = ast.parse(module.read_text())
    ours = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.level or str(node.module).startswith("dojo_maps."))
        for alias in node.names
    }
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    plain = {call.id for call in calls if isinstance(call, ast.Name)} - ours
    methods = {
        call.attr
        for call in calls
        if isinstance(call, ast.Attribute) and getattr(call.value, "id", "") not in NOT_FILES
    }
    return (plain | methods) & READING


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_module_reads_files_by_the_readers_only(module: Path) -> None:
    name = str(module.relative_to(REPOSITORY))
    assert reading_calls(module) <= OWN_READERS.get(name, set()) | EXPLAINED.get(name, set())


@pytest.mark.parametrize("name", [*OWN_READERS, *EXPLAINED])
def test_what_is_explained_is_still_there(name: str) -> None:
    assert reading_calls(REPOSITORY / name) == OWN_READERS.get(name, EXPLAINED.get(name))
