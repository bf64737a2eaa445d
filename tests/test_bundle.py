"""Bundles on disk: whole or not at all, a user's files kept, and hostile descriptions refused."""

import json
from pathlib import Path
from typing import Any

import pytest

from dojo_maps import read_bundle
from dojo_maps.bundle import replace_bundle
from dojo_maps.errors import DescriptionError, UsageError
from dojo_maps.serialization import from_json, to_json


def make_bundle(folder: Path) -> Path:
    folder.mkdir()
    (folder / "map.json").write_text("{}")
    (folder / "exports").mkdir()
    (folder / "cameras.json").write_text("mine")
    return folder


def test_replace_bundle_swaps_in_the_new_and_keeps_what_is_the_users(tmp_path: Path) -> None:
    folder = make_bundle(tmp_path / "x.dojo")
    with replace_bundle(folder) as fresh:
        (fresh / "map.json").write_text("new")
    assert (folder / "map.json").read_text() == "new"
    assert (folder / "cameras.json").read_text() == "mine"
    assert not (folder / "exports").exists()
    assert list(tmp_path.iterdir()) == [folder]


def test_replace_bundle_leaves_everything_when_writing_fails(tmp_path: Path) -> None:
    folder = make_bundle(tmp_path / "x.dojo")
    with pytest.raises(RuntimeError), replace_bundle(folder) as fresh:
        (fresh / "map.json").write_text("half")
        raise RuntimeError
    assert (folder / "map.json").read_text() == "{}"
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize(("step", "left"), [(1, "{}"), (2, "new")])
def test_replace_bundle_survives_an_interruption_right_after_each_step(
    step: int, left: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_bundle(tmp_path / "x.dojo")
    rename, done = Path.rename, []

    def interrupted(self: Path, target: Path) -> Path:
        moved = rename(self, target)
        done.append(target)
        if len(done) == step:
            raise KeyboardInterrupt
        return moved

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), replace_bundle(folder) as fresh:
        (fresh / "map.json").write_text("new")
    assert (folder / "map.json").read_text() == left
    assert list(tmp_path.iterdir()) == [folder]


def test_replace_bundle_refuses_a_folder_that_is_no_bundle(tmp_path: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / "me.jpg").write_text("precious")
    with pytest.raises(UsageError, match="not a bundle"), replace_bundle(folder):
        pass
    assert (folder / "me.jpg").read_text() == "precious"


@pytest.fixture(scope="module")
def description(converted: Any) -> dict[str, Any]:
    conversion = converted("cologne1")
    found: dict[str, Any] = json.loads((Path(conversion.bundle) / "map.json").read_text())
    return found


def test_description_survives_reading_and_writing(description: dict[str, Any]) -> None:
    assert to_json(from_json(description)) == description


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("version",), 2, "version 2"),
        (("format",), "other", "not a map description"),
        (("roads",), None, "roads"),
        (("lanes", 0, "width"), "wide", "width"),
        (("lanes", 0, "kind"), "footpath", "kind"),
        (("lanes", 0, "shape"), [[0, 0, "x"]], "shape"),
        (("lanes", 0, "shape"), [[0, 0, 1e999]], "shape"),
        (("lanes", 0, "shape"), [0, 0, 0], "shape"),
        (("lanes", 0, "shape"), [[0, 0, 0, 0]] * 3, "shape"),
        (("lanes", 0, "index"), True, "index"),
        (("bounds",), [[0, 0]], "bounds"),
    ],
)
def test_description_with_a_wrong_value_is_refused(
    description: dict[str, Any], keys: tuple[Any, ...], value: Any, message: str
) -> None:
    broken = json.loads(json.dumps(description))
    place = broken
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    with pytest.raises(DescriptionError, match=message):
        from_json(broken)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 100_000, '{"format": "dojo-map"}'])
def test_read_bundle_refuses_what_is_no_description(tmp_path: Path, text: str) -> None:
    (tmp_path / "map.json").write_text(text)
    with pytest.raises(DescriptionError):
        read_bundle(tmp_path)
