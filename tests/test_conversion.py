"""The pipeline from Python, and the command's further ways: enriched networks, exports, quiet runs."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import dojo_maps
from dojo_maps import cli
from dojo_maps.errors import SourceError
from dojo_maps.exports import EXPORTERS
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network


def test_convert_returns_the_bundle_it_wrote(tmp_path: Path) -> None:
    bundle, report = dojo_maps.convert("cologne1", tmp_path / "cologne1.dojo")
    assert report["counts"]["error"] == 0
    read = dojo_maps.read_bundle(bundle.folder)
    assert [lane.id for lane in read.road_map.lanes] == [lane.id for lane in bundle.road_map.lanes]
    assert read.scene.read_bytes()[:4] == b"glTF"


def test_convert_writes_in_the_current_folder_by_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bundle, _ = dojo_maps.convert("two-way")
    assert bundle.folder == Path("two-way.dojo")
    assert (tmp_path / "two-way.dojo" / "map.json").is_file()


@pytest.mark.slow
def test_convert_is_the_same_for_any_number_of_threads(tmp_path: Path) -> None:
    folders = []
    for jobs in (1, 3):
        options = dojo_maps.ConvertOptions(jobs=jobs)
        folders.append(dojo_maps.convert("cologne3", tmp_path / f"{jobs}.dojo", options)[0].folder)
    for name in ("scene.glb", "map.json", "overview.png"):
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes()


def test_convert_tells_its_stages_in_order(tmp_path: Path) -> None:
    stages: list[str] = []
    dojo_maps.convert("two-way", tmp_path / "x.dojo", on_stage=stages.append)
    assert stages[0] == "Reading"
    assert stages[-1] == "Writing"


def test_convert_names_the_scenarios_when_there_is_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="cologne1"):
        dojo_maps.convert(str(tmp_path / "missing.net.xml"))


def test_enrich_net_gives_the_network_crossings_and_keeps_its_programs(tmp_path: Path) -> None:
    folder = tmp_path / "enriched.dojo"
    # In the rebuilt junction two opposite left turns cross that did not before; the program stays as it was.
    assert cli.main(["convert", "cologne1", "--enrich-net", "-o", str(folder)]) == 1
    report = json.loads((folder / "report.json").read_text())
    assert {i["check"] for i in report["issues"] if i["severity"] == "error"} == {"signals.green_conflict"}
    road_map = dojo_maps.read_bundle(folder).road_map
    assert road_map.crossings
    assert {crossing.origin for crossing in road_map.crossings} == {"network"}
    changes = json.loads((folder / "enrichment.json").read_text())
    assert changes["signals"][0]["id"] == road_map.signals[0].id
    plain, _ = dojo_maps.convert("cologne1", tmp_path / "plain.dojo")
    before, after = (m.signals[0].programs[0].phases for m in (plain.road_map, road_map))
    width = len(before[0].state)
    assert [(p.state) for p in before] == list(dict.fromkeys(p.state[:width] for p in after))
    assert sum(p.duration for p in before) == sum(p.duration for p in after)


def test_exports_are_part_of_the_bundle(tmp_path: Path) -> None:
    folder = tmp_path / "x.dojo"
    assert cli.main(["convert", "cologne1", "--export", *EXPORTERS, "-o", str(folder)]) == 0
    assert {path.name for path in (folder / "exports").iterdir()} == set(EXPORTERS)
    assert all(any(path.iterdir()) for path in (folder / "exports").iterdir())


def test_an_export_that_fails_costs_neither_the_bundle_nor_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    network, folder = tmp_path / "x.net.xml", tmp_path / "x.dojo"
    good = read_bytes(find_network("cologne1")[0])
    network.write_bytes(re.sub(rb'projParameter="[^"]*"', b'projParameter="+proj=nowhere"', good))
    names = ["geojson", "metadrive"]
    status = cli.main(["convert", str(network), "--quiet", "--export", *names, "-o", str(folder)])
    assert status == 4
    (line,) = capsys.readouterr().err.splitlines()
    assert "geojson failed" in line
    assert "nowhere" in line
    assert [path.name for path in (folder / "exports").iterdir()] == ["metadrive"]
    states = json.loads((folder / "report.json").read_text())["exports"]
    assert states["metadrive"] == "written"
    assert "nowhere" in states["geojson"]


def test_convert_says_what_is_written_and_where_also_with_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    network, folder = tmp_path / "x.net.xml", tmp_path / "x.dojo"
    good = read_bytes(find_network("cologne1")[0]).decode()
    network.write_text(good.replace('<lane id="', '<lane width="-1" id="'))
    assert cli.main(["convert", str(network), "--quiet", "-o", str(folder)]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    errors = json.loads((folder / "report.json").read_text())["counts"]["error"]
    assert line.startswith(f"written to {folder}; {errors} errors, ")
    assert f"see {folder}/report.html" in line


def test_commands_start_without_loading_what_they_do_not_run() -> None:
    heavy = "('numpy', 'shapely', 'trimesh', 'cv2')"
    code = f"import sys, dojo_maps.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_convert_writes_results_to_standard_output_only(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dojo_maps.cli", "convert", "cologne1", "-o", str(tmp_path / "x.dojo")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "10 roads, 19 lanes" in done.stdout
    assert done.stderr == ""


def test_checks_are_listed_with_severity_and_limit(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["checks"]) == 0
    listed = capsys.readouterr().out
    assert "topology.duplicate_id" in listed
    assert "geometry.mesh_health" in listed


def test_junction_without_a_shape_is_kept_without_one(tmp_path: Path) -> None:
    path, _ = find_network("cologne1")
    text, count = re.subn(r'(<junction [^>]*type="dead_end"[^>]*) shape="[^"]*"', r"\1", path.read_text())
    assert count
    (tmp_path / "bare.net.xml").write_text(text)
    bundle, report = dojo_maps.convert(str(tmp_path / "bare.net.xml"), tmp_path / "bare.dojo")
    shapeless = [j for j in dojo_maps.read_bundle(bundle.folder).road_map.junctions if not len(j.polygon)]
    assert len(shapeless) == count
    assert report["counts"]["error"] == 0


def test_the_scene_s_buffer_views_say_what_they_hold(tmp_path: Path) -> None:
    bundle, _ = dojo_maps.convert("cologne1", tmp_path / "x.dojo")
    data = bundle.scene.read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    held = [view["target"] for view in tree["bufferViews"]]
    assert set(held) == {34962, 34963}
