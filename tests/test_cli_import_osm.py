"""`dojo-maps import-osm`: from a place to a bundle, and every way to call it wrong."""

import json
import time
from pathlib import Path

import osm_drawings
import pytest
from test_sources_overpass import GOOD, PAGE, REMARK, answer, overpass

from dojo_maps.cli import main
from dojo_maps.cli_area import join_signed
from dojo_maps.sources import overpass as overpass_source


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DOJO_CACHE", str(tmp_path / "cache"))
    for name in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def drawn(tmp_path: Path) -> bytes:
    return osm_drawings.left_hand().write(tmp_path / "drawn.osm").read_bytes()


def test_import_osm_from_a_point(own_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with overpass(answer(drawn(own_folder))) as server:
        arguments = ["import-osm", "--point", "-33.87,151.2", "--radius", "150", "--overpass-url", server.url]
        assert main(arguments) == 0
        assert main([*arguments, "-o", "again.dojo"]) == 0
    assert len(server.queries) == 1, "the second time it comes from the cache"
    folder = own_folder / "33.87000s-151.20000e.dojo"
    said = capsys.readouterr()
    assert "1 signal, " in said.out
    assert "vehicles and" in said.out
    assert time.strftime("%Y-", time.gmtime()) in said.err
    description = json.loads((folder / "map.json").read_text())
    assert description["left_hand"] is True


def test_import_osm_from_a_box_and_a_place(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def find_place(name: str) -> tuple[float, float]:
        asked.append(name)
        return -33.87, 151.2

    monkeypatch.setattr(overpass_source, "find_place", find_place)
    with overpass(answer(drawn(own_folder))) as server:
        box = ["--bbox", "151.198,-33.872,151.202,-33.868", "-o", "box.dojo", "--demand", "0"]
        assert main(["import-osm", *box, "--overpass-url", server.url]) == 0
        assert main(["import-osm", "--place", "Martin Place, Sydney", "--overpass-url", server.url]) == 0
    assert asked == ["Martin Place, Sydney"]
    assert (own_folder / "martin-place-sydney.dojo" / "demand.rou.xml").is_file()
    assert not (own_folder / "box.dojo" / "demand.rou.xml").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        ([], 2, "required"),
        (["a.osm", "--place", "b"], 2, "not allowed"),
        (["--point", "1,2", "--bbox", "1,2,3,4"], 2, "not allowed"),
        (["--point", "1"], 2, "expected LAT,LON in degrees"),
        (["--point", "north,south"], 2, "expected LAT,LON in degrees"),
        (["--bbox", "1,2,3"], 2, "expected W,S,E,N in degrees"),
        (["--bbox", "1,2,0,4"], 2, "not an area"),
        (["--bbox", "0,0,9,9"], 2, "at most 5 km"),
        (["--bbox", "nan,0,0.01,0.01"], 2, "numbers of degrees"),
        (["--point", "91,0"], 2, "not a place"),
        (["--point", "1,2", "--radius", "0"], 2, "expected 10 to 2500"),
        (["--point", "1,2", "--radius", "nan"], 2, "expected 10 to 2500"),
        (["--point", "1,2", "--demand", "-5"], 2, "0 or more"),
        (["--point", "1,2", "--demand", "nan"], 2, "0 or more"),
        (["--point", "1,2", "--overpass-url", "file:///etc/passwd"], 2, "web server"),
        (["--bbox", "0,0,0.01,0.01", "--radius", "100"], 2, "has its own size"),
        (["a.osm", "--radius", "100"], 2, "a file is given"),
        (["a.net.xml"], 2, "not named as OpenStreetMap"),
        (["missing.osm"], 3, "no such file"),
    ],
)
def test_import_osm_called_wrong(
    arguments: list[str], status: int, message: str, own_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        given = main(["import-osm", *arguments])
    except SystemExit as over:
        given = over.code  # type: ignore[assignment]
    assert given == status
    said = capsys.readouterr()
    assert message in said.err
    assert not said.out
    assert "Traceback" not in said.err
    assert not list(own_folder.glob("*.dojo"))


@pytest.mark.parametrize("body", [REMARK, GOOD[:300] + b"<", PAGE, b"<osm/>"])
def test_import_osm_of_a_bad_answer_writes_nothing(
    body: bytes, own_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.sleep", lambda _seconds: None)
    with overpass(answer(body)) as server:
        assert main(["import-osm", "--point", "60.17,24.94", "--overpass-url", server.url]) == 3
    assert server.url in capsys.readouterr().err
    assert not list(own_folder.glob("*.dojo"))
    assert [path for path in (own_folder / "cache").rglob("*") if path.is_file()] == []


def test_import_osm_without_a_network(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import-osm", "--point", "60.17,24.94", "--overpass-url", "http://127.0.0.1:9/"]) == 3
    assert "import-osm FILE" in capsys.readouterr().err


def test_join_signed_keeps_what_is_no_number() -> None:
    assert join_signed(["--bbox", "-1,2,3,4", "-o", "x"]) == ["--bbox=-1,2,3,4", "-o", "x"]
    assert join_signed(["--point", "-o", "x"]) == ["--point", "-o", "x"]
